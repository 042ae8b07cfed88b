import { mkdir } from 'node:fs/promises';
import type { Page } from 'playwright-core';
import { open_browser } from './browser.ts';

// Pictures of the page in its states, wide and narrow, light and dark: node .build/dev/shots.js ADDRESS FOLDER [STATE…]

const [address = 'http://127.0.0.1:5174/?token=token', folder = 'out/shots', ...chosen] = process.argv.slice(2);

const press = (page: Page, id: string) => page.getByTestId(id).click();
const still = (page: Page) =>
  page.waitForFunction(() => window.traceflow.lastFrame?.final, undefined, { timeout: 15000 });

async function open_tab(page: Page, name: string): Promise<void> {
  const tab = page.getByTestId(`tab-${name}`);
  if ((await tab.getAttribute('aria-selected')) !== 'true' || (await page.locator('.panel-closed').count()) > 0)
    await tab.click();
}

const states: Record<string, (page: Page) => Promise<unknown>> = {
  start: async () => undefined,
  normal: async (page) => {
    await open_tab(page, 'view');
    await press(page, 'layer-normal');
  },
  rays: async (page) => {
    await open_tab(page, 'view');
    await press(page, 'rays');
    const box = await page.getByTestId('stage').boundingBox();
    if (!box) return;
    const at = (x: number, y: number): [number, number] => [box.x + box.width * x, box.y + box.height * y];
    await page.mouse.click(...at(0.47, 0.52));
    await page.mouse.click(...at(0.6, 0.48));
    await page.waitForTimeout(300);
    await page.mouse.move(...at(0.3, 0.7));
    await page.mouse.down();
    await page.mouse.move(...at(0.42, 0.64), { steps: 4 });
    await page.mouse.up();
    await still(page);
    await page.mouse.move(...at(0.5, 0.55));
    await page.waitForTimeout(400);
  },
  split: async (page) => {
    await open_tab(page, 'cameras');
    await press(page, 'camera-6');
    await page.waitForTimeout(1800);
  },
  training: async (page) => open_tab(page, 'training'),
  path: async (page) => {
    await open_tab(page, 'path');
    await press(page, 'keyframe-add');
    for (let i = 0; i < 2; i++) {
      await page.getByTestId('stage').focus();
      for (let k = 0; k < 4; k++) await page.keyboard.press('ArrowRight');
      await page.keyboard.press('-');
      await press(page, 'keyframe-add');
    }
    await page.keyboard.press('-');
    await page.keyboard.press('-');
    for (let k = 0; k < 5; k++) await page.keyboard.press('-');
  },
  density: async (page) => {
    await open_tab(page, 'training');
    await page.getByTestId('curve-density').scrollIntoViewIfNeeded();
    await page.getByTestId('curve-rate').scrollIntoViewIfNeeded();
    await page.getByTestId('curve-surfels').hover();
  },
  stop: async (page) => {
    await open_tab(page, 'training');
    await press(page, 'stop');
  },
  fly: async (page) => {
    await page.keyboard.press('d');
    await page.keyboard.press('6');
  },
  help: async (page) => page.keyboard.press('?'),
};

const browser = await open_browser();
await mkdir(folder, { recursive: true });
for (const [form, width, height] of [
  ['wide', 1280, 800],
  ['narrow', 390, 844],
] as const) {
  for (const colours of ['dark', 'light'] as const) {
    for (const [name, reach] of Object.entries(states)) {
      if (chosen.length > 0 && !chosen.includes(name) && !chosen.includes(`${name}-${form}-${colours}`)) continue;
      const context = await browser.newContext({
        viewport: { width, height },
        colorScheme: colours,
        hasTouch: form === 'narrow',
      });
      const page = await context.newPage();
      page.on('console', (message) => message.type() === 'error' && console.log(name, message.text()));
      page.on('pageerror', (error) => console.log(name, error.message));
      await page.goto(address);
      await still(page);
      await reach(page);
      await page.waitForTimeout(700);
      await still(page);
      await page.screenshot({ path: `${folder}/${name}-${form}-${colours}.png` });
      await context.close();
    }
  }
}
await browser.close();
