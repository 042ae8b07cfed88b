import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { after, before, describe, test } from 'node:test';
import type { Browser } from 'playwright-core';
import { open_browser } from '../../dev/browser.ts';
import { parse_path } from '../../src/math/keyframes.ts';
import { at_rest, difference, faults, glimpse, newest_view, open, patience, press, slide, then_rest } from './page.ts';
import { available, real, serve, type Served } from './served.ts';

// What the page does with a finished run.
describe('looking at a run', { skip: !available('view') }, () => {
  let served: Served;
  let browser: Browser;
  before(async () => {
    served = await serve('view');
    browser = await open_browser();
  });
  after(async () => {
    await browser.close();
    await served.stop();
    assert.deepEqual(faults, []);
  });

  test('the first picture comes without being asked for', async () => {
    const page = await browser.newPage({ viewport: { width: 900, height: 560 } });
    await page.addInitScript(() => {
      const check = (): void => {
        if ((window.traceflow?.frames ?? 0) === 0) requestAnimationFrame(check);
        else performance.mark('first picture');
      };
      requestAnimationFrame(check);
    });
    await page.goto(served.address);
    await page.waitForFunction(() => performance.getEntriesByName('first picture').length > 0, undefined, {
      timeout: patience,
    });
    const [painted, picture] = await page.evaluate(() => [
      performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? Infinity,
      performance.getEntriesByName('first picture')[0]?.startTime ?? Infinity,
    ]);
    console.log(
      `# first paint after ${Math.round(painted ?? 0)} ms, first picture after ${Math.round(picture ?? 0)} ms`,
    );
    assert.ok(Number.isFinite(painted) && Number.isFinite(picture));
    await page.close();
  });

  test('the token leaves the address and nothing breaks the policy', async () => {
    const { page, errors } = await open(browser, served.address);
    assert.ok(!page.url().includes('token'));
    await page.reload();
    await at_rest(page);
    assert.deepEqual(errors, []);
    await page.context().close();
  });

  test('a picture at rest has the size of the stage', async () => {
    const { page } = await open(browser, served.address);
    const box = await page.getByTestId('stage').boundingBox();
    const frame = await page.evaluate(() => window.traceflow.lastFrame);
    assert.deepEqual([frame?.width, frame?.height], [box?.width, box?.height]);
    await page.context().close();
  });

  test('each layer differs from the others', async () => {
    const { page } = await open(browser, served.address);
    const names = await page
      .locator('[data-testid^=layer-]')
      .evaluateAll((all) => all.map((e) => e.getAttribute('data-testid') ?? ''));
    assert.ok(names.length >= 9);
    const seen: [string, number[]][] = [];
    for (const name of names) {
      if (seen.length > 0) await then_rest(page, () => press(page, name));
      const now = await glimpse(page);
      for (const [other, then] of seen) assert.ok(difference(now, then) > 0.05, `${name} looks like ${other}`);
      seen.push([name, now]);
    }
    await page.context().close();
  });

  test('M lays the paths of what moves over the picture and takes them away', async () => {
    const { page } = await open(browser, served.address);
    const before = await glimpse(page);
    await then_rest(page, () => page.keyboard.press('m'));
    assert.ok(await page.getByTestId('layer-tracks').getByRole('radio').isChecked());
    assert.ok(difference(await glimpse(page), before) > 0.05);
    await then_rest(page, () => page.keyboard.press('m'));
    assert.ok(await page.getByTestId('layer-rgb').getByRole('radio').isChecked());
    assert.ok(difference(await glimpse(page), before) < 0.05);
    await page.context().close();
  });

  test('a drag turns the view, reset takes it back, and latency is measured', async () => {
    const { page } = await open(browser, served.address);
    const start = await glimpse(page);
    const box = await page.getByTestId('stage').boundingBox();
    assert.ok(box);
    const known = await page.evaluate(() => window.traceflow.latencies.length);
    await then_rest(page, async () => {
      await page.mouse.move(box.x + 200, box.y + 300);
      await page.mouse.down();
      await page.mouse.move(box.x + 320, box.y + 260, { steps: 12 });
      await page.mouse.up();
    });
    assert.ok(difference(start, await glimpse(page)) > 2);
    assert.ok((await page.evaluate(() => window.traceflow.latencies.length)) > known);
    await press(page, 'reset');
    await page.waitForTimeout(1200);
    await at_rest(page, (await newest_view(page)) - 1);
    assert.ok(difference(start, await glimpse(page)) < 1);
    await page.context().close();
  });

  test('exposure and zoom change the picture', async () => {
    const { page } = await open(browser, served.address);
    const start = await glimpse(page);
    await then_rest(page, () => slide(page, 'exposure', -2));
    const dark = await glimpse(page);
    assert.ok(difference(start, dark) > 5);
    await then_rest(page, async () => {
      await page.getByTestId('stage').hover();
      await page.mouse.wheel(0, 400);
    });
    assert.ok(difference(dark, await glimpse(page)) > 1);
    await page.context().close();
  });

  test('scrubbing and playing change the picture', async () => {
    const { page } = await open(browser, served.address);
    const start = await glimpse(page);
    await then_rest(page, () => slide(page, 'time', 0.5));
    assert.ok(difference(start, await glimpse(page)) > 0.3);
    const frames = await page.evaluate(() => window.traceflow.frames);
    await press(page, 'play');
    await page.waitForFunction((known) => window.traceflow.frames > known + 3, frames, { timeout: patience });
    await press(page, 'play');
    assert.ok(Number(await page.getByTestId('time').inputValue()) !== 0.5);
    await page.context().close();
  });

  test('the split slider moves between photograph and render, by hand and by key', async () => {
    const { page } = await open(browser, served.address);
    await press(page, 'tab-cameras');
    await press(page, 'camera-0');
    const handle = page.getByTestId('split');
    await handle.waitFor({ timeout: patience });
    await at_rest(page, (await newest_view(page)) - 1);
    await page.waitForTimeout(1500);
    const area = await handle.locator('..').boundingBox();
    assert.ok(area);
    await handle.press('Home');
    const render = await glimpse(page);
    await handle.press('End');
    const photograph = await glimpse(page);
    assert.ok(difference(render, photograph) > 0.3);
    const middle = { x: area.x + area.width - 1, y: area.y + area.height / 2 };
    await page.mouse.move(middle.x, middle.y);
    await page.mouse.down();
    await page.mouse.move(area.x + area.width * 0.25, middle.y, { steps: 5 });
    await page.mouse.up();
    const value = Number(await handle.getAttribute('aria-valuenow'));
    assert.ok(Math.abs(value - 25) <= 2, `${value}`);
    await handle.press('ArrowRight');
    assert.ok(Number(await handle.getAttribute('aria-valuenow')) > value);
    await then_rest(page, () => press(page, 'compare-difference'));
    assert.ok(difference(render, await glimpse(page)) > 3);
    await then_rest(page, async () => {
      await page.getByTestId('stage').focus();
      await page.keyboard.press('ArrowLeft');
    });
    assert.equal(await page.getByTestId('split').count(), 0);
    await page.context().close();
  });

  test('a ray is probed, pinned and stays in the scene', async () => {
    const { page } = await open(browser, served.address);
    const box = await page.getByTestId('stage').boundingBox();
    assert.ok(box);
    await press(page, 'rays');
    await page.mouse.move(box.x + box.width * 0.5, box.y + box.height * 0.55);
    await page.getByTestId('ray-readout').waitFor({ timeout: patience });
    await page.mouse.down();
    await page.mouse.up();
    await page.getByTestId('pins').waitFor({ timeout: patience });
    const where = (): Promise<string> =>
      page.locator('.ray:not(.live) .ray-surface').evaluate((e) => `${e.getAttribute('cx')} ${e.getAttribute('cy')}`);
    const start = await where();
    await then_rest(page, async () => {
      await page.keyboard.press('t');
      for (let i = 0; i < 5; i++) await page.keyboard.press('ArrowRight');
      await page.keyboard.press('Shift+ArrowUp');
    });
    assert.notEqual(await where(), start);
    await page.keyboard.press('x');
    assert.equal(await page.locator('.ray').count(), 0);
    await page.context().close();
  });

  test('a camera path is made, previewed, kept and saved as a file', async () => {
    const { page } = await open(browser, served.address);
    await press(page, 'tab-path');
    await page.keyboard.press('k');
    await then_rest(page, async () => {
      await page.getByTestId('stage').focus();
      for (let i = 0; i < 6; i++) await page.keyboard.press('ArrowRight');
    });
    await page.keyboard.press('k');
    assert.equal(await page.getByTestId('keyframes').locator('li').count(), 2);
    await page.waitForFunction(
      () => !document.querySelector<HTMLButtonElement>('[data-testid=path-preview]')?.disabled,
    );
    assert.ok((await page.locator('.path-way').count()) > 5);
    const start = await glimpse(page);
    await press(page, 'path-preview');
    await page.waitForTimeout(400);
    assert.ok(difference(start, await glimpse(page)) > 0.5);
    await page.keyboard.press('Escape');
    const [download] = await Promise.all([page.waitForEvent('download'), press(page, 'path-export')]);
    const path = parse_path(await readFile(await download.path(), 'utf8'));
    assert.equal(path.keyframes.length, 2);
    await page.reload();
    await at_rest(page);
    await press(page, 'tab-path');
    assert.equal(await page.getByTestId('keyframes').locator('li').count(), 2);
    await page.context().close();
  });

  test('a screenshot is a PNG of the size that was asked for', async () => {
    const { page } = await open(browser, served.address);
    await page.getByTestId('still-size-capture').click();
    const [download] = await Promise.all([page.waitForEvent('download', { timeout: patience }), press(page, 'still')]);
    const bytes = await readFile(await download.path());
    assert.deepEqual([...bytes.subarray(1, 4)], [0x50, 0x4e, 0x47]);
    const size = `${bytes.readUInt32BE(16)}x${bytes.readUInt32BE(20)}`;
    assert.ok(download.suggestedFilename().endsWith(`_${size}.png`), download.suggestedFilename());
    await page.context().close();
  });

  test('a hidden page asks for nothing', async () => {
    const { page } = await open(browser, served.address);
    const hide = (hidden: boolean): Promise<void> =>
      page.evaluate((value) => {
        Object.defineProperty(document, 'hidden', { value, configurable: true });
        document.dispatchEvent(new Event('visibilitychange'));
      }, hidden);
    await hide(true);
    await page.waitForTimeout(500); // for what was under way
    const hidden = await newest_view(page);
    await press(page, 'layer-normal');
    await page.waitForTimeout(700);
    assert.equal(await newest_view(page), hidden);
    await then_rest(page, () => hide(false));

    const playing = await newest_view(page);
    await press(page, 'play');
    await page.waitForFunction((known) => (window.traceflow.lastFrame?.view ?? 0) > known + 1, playing, {
      timeout: patience,
    });
    await hide(true);
    await page.waitForTimeout(500); // for what was under way
    const last = await newest_view(page);
    await page.waitForTimeout(1000);
    assert.equal(await newest_view(page), last);
    await press(page, 'play');
    await then_rest(page, () => hide(false));
    await page.context().close();
  });

  test('a lost connection is said, and the view survives it', async () => {
    const { page } = await open(browser, served.address);
    await then_rest(page, async () => {
      await page.getByTestId('stage').focus();
      for (let i = 0; i < 5; i++) await page.keyboard.press('ArrowLeft');
    });
    await then_rest(page, () => press(page, 'layer-normal'));
    const before_cut = await glimpse(page);
    served.cut();
    await page.getByTestId('banner-lost').waitFor({ timeout: 5000 });
    assert.match((await page.getByTestId('banner-lost').textContent()) ?? '', /connection .* lost/);
    const frames = await page.evaluate(() => window.traceflow.frames);
    await page.waitForTimeout(1500);
    served.restore();
    await page.waitForFunction((known) => window.traceflow.connected && window.traceflow.frames > known, frames, {
      timeout: patience,
    });
    await at_rest(page);
    assert.equal(await page.getByTestId('banner-lost').count(), 0);
    assert.ok(difference(before_cut, await glimpse(page)) < 1);
    await page.context().close();
  });

  test('a warning of the server is shown until it ends', { skip: real }, async () => {
    const { page } = await open(browser, served.address);
    served.warn('The disk is full.');
    await page.getByTestId('banner-warning').getByText('The disk is full.').waitFor({ timeout: 5000 });
    served.warn('');
    await page.getByTestId('banner-warning').waitFor({ state: 'detached', timeout: 5000 });
    await page.context().close();
  });

  test('on a narrow screen the panel is a sheet and nothing sticks out', async () => {
    const { page } = await open(browser, served.address, 390, 844);
    for (const tab of ['view', 'cameras', 'path']) {
      await press(page, `tab-${tab}`);
      await page.waitForTimeout(100);
      const wide = await page.evaluate(
        () =>
          [...document.querySelectorAll('.panel *, .stage > *')].filter((e) => e.getBoundingClientRect().right > 391)
            .length,
      );
      assert.equal(wide, 0, tab);
    }
    await press(page, 'tab-path');
    assert.equal(await page.locator('.panel-closed').count(), 1);
    await page.context().close();
  });

  test('another server at the same address does not know the page, and the page says so', async () => {
    const { page } = await open(browser, served.address);
    await served.restart();
    await page.getByTestId('banner-locked').waitFor({ timeout: 15000 });
    assert.match((await page.getByTestId('banner-locked').textContent()) ?? '', /Open the address/);
    await page.context().close();
  });

  test(`these were tests of ${real ? 'the program' : 'the stand-in'}`, () => undefined);
});
