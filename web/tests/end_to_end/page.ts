import type { Browser, Page } from 'playwright-core';
import '../../src/for_tests.ts';

export const patience = Number(process.env['PATIENCE'] ?? 20000); // ms that a server may take over a picture at rest

export interface Opened {
  page: Page;
  errors: string[]; // of the console
}

// Whatever any page threw, and every breach of the content security policy.
export const faults: string[] = [];

// Opens the viewer and waits for a picture at rest.
export async function open(browser: Browser, address: string, width = 900, height = 560): Promise<Opened> {
  const context = await browser.newContext({ viewport: { width, height }, acceptDownloads: true });
  const page = await context.newPage();
  const errors: string[] = [];
  page.on('pageerror', (error) => void faults.push(error.message));
  page.on('console', (message) => {
    if (message.type() === 'error') errors.push(message.text());
    if (/Content.Security.Policy/i.test(message.text())) faults.push(message.text());
  });
  await page.goto(address);
  await at_rest(page);
  return { page, errors };
}

export const at_rest = async (page: Page, after = 0): Promise<void> => {
  await page.waitForFunction(
    (id) => (window.traceflow?.lastFrame?.final ?? false) && (window.traceflow.lastFrame?.view ?? 0) > id,
    after,
    { timeout: patience },
  );
};

export const newest_view = (page: Page): Promise<number> => page.evaluate(() => window.traceflow.lastFrame?.view ?? 0);

// Does something that changes what is looked at, and waits for its picture at rest.
export async function then_rest(page: Page, act: () => Promise<unknown>): Promise<void> {
  const before = await newest_view(page);
  await act();
  await at_rest(page, before);
}

// The canvas in 24 × 18 means of colours.
export function glimpse(page: Page): Promise<number[]> {
  return page.evaluate(() => {
    const canvas = document.querySelector<HTMLCanvasElement>('[data-testid=stage]');
    const small = new OffscreenCanvas(24, 18).getContext('2d');
    if (!canvas || !small) return [];
    small.imageSmoothingQuality = 'high';
    small.drawImage(canvas, 0, 0, 24, 18);
    return [...small.getImageData(0, 0, 24, 18).data];
  });
}

// Mean difference of two glimpses, 0 to 255.
export function difference(a: readonly number[], b: readonly number[]): number {
  return a.reduce((sum, value, i) => sum + Math.abs(value - (b[i] ?? 0)), 0) / Math.max(a.length, 1);
}

export const press = (page: Page, id: string): Promise<void> => page.getByTestId(id).click();

// Sets a slider, as dragging it does.
export const slide = (page: Page, id: string, value: number): Promise<void> =>
  page.getByTestId(id).evaluate((element: HTMLInputElement, wanted) => {
    element.value = String(wanted);
    element.dispatchEvent(new Event('input', { bubbles: true }));
  }, value);

export const iteration = async (page: Page): Promise<number> =>
  Number((await page.getByTestId('iteration').textContent())?.replaceAll(',', ''));
