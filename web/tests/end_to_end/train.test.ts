import assert from 'node:assert/strict';
import { after, before, describe, test } from 'node:test';
import type { Browser, Page } from 'playwright-core';
import { open_browser } from '../../dev/browser.ts';
import { faults, iteration, open, patience, press } from './page.ts';
import { available, serve, type Served } from './served.ts';

const iteration_after = (page: Page, before: number): Promise<unknown> =>
  page.waitForFunction(
    (known) => Number(document.querySelector('[data-testid=iteration]')?.textContent?.replaceAll(',', '')) > known,
    before,
    { timeout: patience },
  );

// What the page does with a training that goes on.
describe('watching a training', { skip: !available('train') }, () => {
  let served: Served;
  let browser: Browser;
  let page: Page;
  before(async () => {
    served = await serve('train');
    browser = await open_browser();
    ({ page } = await open(browser, served.address));
    await press(page, 'tab-training');
  });
  after(async () => {
    await browser.close();
    await served.stop();
    assert.deepEqual(faults, []);
  });

  test('curves grow', async () => {
    const first = await iteration(page);
    await page.getByTestId('curve-loss').waitFor({ timeout: patience });
    const points = Number(await page.getByTestId('curve-loss').getAttribute('data-points'));
    await page.waitForFunction(
      (known) => Number(document.querySelector('[data-testid=curve-loss]')?.getAttribute('data-points')) > known,
      points,
      { timeout: patience },
    );
    await iteration_after(page, first);
  });

  test('a pause holds the count while pictures go on', async () => {
    await press(page, 'pause');
    await page.getByTestId('resume').waitFor({ timeout: patience });
    const held = await iteration(page);
    const frames = await page.evaluate(() => window.traceflow.frames);
    await page.getByTestId('stage').focus();
    await page.keyboard.press('ArrowLeft');
    await page.waitForFunction((known) => window.traceflow.frames > known, frames, { timeout: patience });
    await page.waitForTimeout(1500);
    assert.equal(await iteration(page), held);
    await press(page, 'resume');
    await iteration_after(page, held);
  });

  test('a second page sees the same', async () => {
    const other = await open(browser, served.address);
    await page.waitForFunction(() =>
      document.querySelector('[data-testid=status]')?.textContent?.includes('2 viewers'),
    );
    await press(other.page, 'tab-training');
    await press(other.page, 'pause');
    await page.getByTestId('resume').waitFor({ timeout: patience });
    await press(page, 'resume');
    await other.page.context().close();
  });

  test('stopping asks first', async () => {
    await press(page, 'stop');
    await press(page, 'stop-cancel');
    await page.getByTestId('stop').waitFor();
    await press(page, 'stop');
    await press(page, 'stop-confirm');
    await page.getByTestId('stop').waitFor({ state: 'detached', timeout: patience });
    assert.equal(await page.getByTestId('pause').count(), 0);
  });
});
