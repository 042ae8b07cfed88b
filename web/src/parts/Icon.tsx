const paths = {
  play: 'M7 4.5v15l12-7.5z',
  pause: 'M7 5h3.5v14H7zM13.5 5H17v14h-3.5z',
  loop: 'M17 3l3 3-3 3M4 11V9a3 3 0 013-3h13M7 21l-3-3 3-3M20 13v2a3 3 0 01-3 3H4',
  orbit: 'M12 9.5a2.5 2.5 0 100 5 2.5 2.5 0 000-5zM3 12c0-2.5 4-4.5 9-4.5s9 2 9 4.5-4 4.5-9 4.5M9 13.8l3 2.7-3 2.7',
  fly: 'M21 3L10.5 13.5M21 3l-6.5 18-4-7.5L3 9.5z',
  ray: 'M3 4l9 13 9-13M5 20h14M17 4.2h4v4',
  reset: 'M4 11l8-7 8 7M6 9.5V20h12V9.5M10 20v-6h4v6',
  camera: 'M4 8h3l2-3h6l2 3h3v11H4zM12 10a3.5 3.5 0 100 7 3.5 3.5 0 000-7z',
  panel: 'M4 5h16v14H4zM15 5v14',
  help: 'M9.2 9a2.8 2.8 0 115 1.6c-1 .9-2.2 1.4-2.2 3M12 17.2v.3',
  sun: 'M12 8a4 4 0 100 8 4 4 0 000-8zM12 3v1.5M12 19.5V21M3 12h1.5M19.5 12H21M5.6 5.6l1.1 1.1M17.3 17.3l1.1 1.1M18.4 5.6l-1.1 1.1M6.7 17.3l-1.1 1.1',
  moon: 'M19.5 14.2A8 8 0 119.8 4.5a6.4 6.4 0 009.7 9.7z',
  auto: 'M12 4a8 8 0 100 16zM12 4a8 8 0 010 16',
  close: 'M6 6l12 12M18 6L6 18',
  up: 'M6 14.5l6-6 6 6',
  down: 'M6 9.5l6 6 6-6',
  left: 'M14.5 6l-6 6 6 6',
  right: 'M9.5 6l6 6-6 6',
  plus: 'M12 5v14M5 12h14',
  bin: 'M5 7h14M10 7V4.5h4V7M7 7l1 13h8l1-13',
  target: 'M12 7a5 5 0 100 10 5 5 0 000-10zM12 2.5V7M12 17v4.5M2.5 12H7M17 12h4.5',
  layers: 'M12 4l9 5-9 5-9-5zM3.5 13.5L12 18l8.5-4.5',
  frames: 'M4 6h11v9H4zM8 18.5h12V9',
  path: 'M5 19c0-6 4-4 7-7s1-7 7-7M5 19m-1.8 0a1.8 1.8 0 103.6 0 1.8 1.8 0 10-3.6 0M19 5m-1.8 0a1.8 1.8 0 103.6 0 1.8 1.8 0 10-3.6 0',
  chart: 'M4 4v16h16M7.5 15l3.5-4.5 3 2.5 5-7',
  save: 'M12 4v11M7.5 11l4.5 4.5 4.5-4.5M5 20h14',
  load: 'M12 15.5V4.5M7.5 9L12 4.5 16.5 9M5 20h14',
  stop: 'M6.5 6.5h11v11h-11z',
};

export type IconName = keyof typeof paths;

const solid = new Set<IconName>(['play', 'pause', 'stop']);

export function Icon({ name }: { name: IconName }) {
  return (
    <svg class={solid.has(name) ? 'icon solid' : 'icon'} viewBox="0 0 24 24" aria-hidden="true">
      <path d={paths[name]} />
    </svg>
  );
}
