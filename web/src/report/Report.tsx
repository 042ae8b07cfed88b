import { useState } from 'preact/hooks';
import { Curves } from '../curves/Curves.tsx';
import { ThemeButton } from '../parts/ThemeButton.tsx';
import type { ReportData } from './data.ts';
import { Facts } from './Facts.tsx';
import { present, written } from './figures.ts';
import { FigureTable } from './FigureTable.tsx';
import { Large, type Opened } from './Large.tsx';
import { charts_over_time } from './over_time.ts';
import { OverTime } from './OverTime.tsx';
import { Settings } from './Settings.tsx';
import { Times } from './Times.tsx';
import { Compare } from './Compare.tsx';
import { Views } from './Views.tsx';

export function Report({ data }: { data: ReportData }) {
  const [opened, open] = useState<Opened | null>(null);
  const parts: { id: string; title: string; body: preact.ComponentChild; there: boolean }[] = [
    { id: 'views', title: 'Views', body: <Views data={data} open={open} />, there: data.pictures.length > 0 },
    {
      id: 'figures',
      title: 'Figures of each view',
      body: <FigureTable data={data} open={open} />,
      there: data.views.length > 0,
    },
    {
      id: 'over-time',
      title: 'Over time',
      body: <OverTime data={data} />,
      there: data.motion !== null || charts_over_time(data).length > 0,
    },
    {
      id: 'curves',
      title: 'Training',
      body: <Curves events={data.events} height={170} />,
      there: data.events.length > 0,
    },
    { id: 'times', title: 'Time', body: <Times phases={data.phases} />, there: data.phases.length > 0 },
    { id: 'settings', title: 'Settings', body: <Settings settings={data.settings} />, there: data.settings.length > 0 },
    { id: 'run', title: 'Run', body: <Facts data={data} />, there: true },
  ];
  const there = parts.filter((part) => part.there);
  return (
    <>
      <Header data={data} />
      <nav class="contents" aria-label="Contents">
        {there.map(({ id, title }) => (
          <a key={id} href={`#${id}`}>
            {title}
          </a>
        ))}
      </nav>
      <Hero data={data} open={open} />
      {there.map(({ id, title, body }) => (
        <section key={id} id={id} class="part">
          <h2>{title}</h2>
          {body}
        </section>
      ))}
      {opened && <Large data={data} opened={opened} open={open} />}
    </>
  );
}

function Header({ data }: { data: ReportData }) {
  const figures = present(data).filter(({ key, in_table_alone }) => data.mean[key] !== null && !in_table_alone);
  const share = data.motion?.mean.share ?? null;
  return (
    <header class="head">
      <div class="head-line">
        <Mark />
        <div>
          <h1>{data.run}</h1>
          <p>
            {data.capture} · {data.views.length} {data.split} views · {data.iterations.toLocaleString('en-GB')}{' '}
            iterations
          </p>
        </div>
        <ThemeButton />
      </div>
      <dl class="means" data-testid="means">
        {figures.map((kind) => (
          <div key={kind.key}>
            <dt>{kind.label}</dt>
            <dd>
              {written(data.mean[kind.key], kind)}
              {kind.unit && <small>{kind.unit}</small>}
            </dd>
          </div>
        ))}
        {share !== null && (
          <div>
            <dt>Motion error</dt>
            <dd>{share.toFixed(3)}</dd>
          </div>
        )}
      </dl>
    </header>
  );
}

// The view of middling quality, large: what to expect.
function Hero({ data, open }: { data: ReportData; open: (opened: Opened) => void }) {
  const value = (id: string): number => data.views.find((view) => view.id === id)?.psnr ?? 0;
  const ordered = data.pictures
    .map((_, i) => i)
    .sort((a, b) => value(data.pictures[a]?.id ?? '') - value(data.pictures[b]?.id ?? ''));
  const index = ordered[ordered.length >> 1];
  const picture = index === undefined ? undefined : data.pictures[index];
  if (index === undefined || !picture) return null;
  return (
    <figure class="hero">
      <Compare
        left={picture.photograph}
        right={picture.rgb}
        leftName="Photograph"
        rightName="Render"
        aspect={picture.width / picture.height}
        id="hero"
      />
      <figcaption>
        <span>{picture.id}, the view of median PSNR</span>
        <button type="button" class="link" data-testid="hero-open" onClick={() => open({ index, layer: 'rgb' })}>
          Open large
        </button>
      </figcaption>
    </figure>
  );
}

const Mark = () => (
  <svg class="mark" viewBox="0 0 32 32" aria-hidden="true">
    <ellipse cx="16" cy="22" rx="11" ry="3.6" />
    <path d="M5 7 16 22" />
    <path class="mirrored" d="M16 22 27 7" />
    <circle cx="16" cy="22" r="2.2" />
  </svg>
);
