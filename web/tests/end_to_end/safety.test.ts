import assert from 'node:assert/strict';
import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { after, before, describe, test } from 'node:test';
import type { Browser } from 'playwright-core';
import { open_browser } from '../../dev/browser.ts';
import { open } from './page.ts';
import { available, real, serve, type Served } from './served.ts';

// Whom the program lets in, as a browser sees it (docs/view.md, Safety).
describe('the door of the program', { skip: !real || !available('view') }, () => {
  let served: Served;
  let browser: Browser;
  let elsewhere: Server; // a website of somebody else
  let door: string; // the program's address without the token
  before(async () => {
    served = await serve('view');
    browser = await open_browser('--host-resolver-rules=MAP evil.example 127.0.0.1');
    door = new URL(served.address).origin;
    elsewhere = createServer((_, answer) => answer.setHeader('Content-Type', 'text/html').end('<p>come in</p>'));
    await new Promise<void>((ready) => elsewhere.listen(0, '127.0.0.1', ready));
  });
  after(async () => {
    elsewhere.close();
    await browser.close();
    await served.stop();
  });

  const foreign = (): string => `http://127.0.0.1:${(elsewhere.address() as AddressInfo).port}`;

  test('the token is needed, and the right one', async () => {
    const page = await (await browser.newContext()).newPage();
    for (const path of ['/', '/?token=', '/?token=0123456789abcdef0123456789abcdef', '/viewer.js', '/ws']) {
      const answer = await page.goto(door + path);
      assert.equal(answer?.status(), 403, path);
      assert.match((await page.textContent('body')) ?? '', /Open the whole address/);
    }
    await page.context().close();
  });

  test('a cookie takes its place, which no script can read', async () => {
    const { page } = await open(browser, served.address);
    assert.equal(await page.evaluate(() => document.cookie), '');
    const [cookie] = await page.context().cookies();
    assert.equal(cookie?.httpOnly, true);
    assert.equal(cookie?.sameSite, 'Strict');
    assert.equal((await page.goto(`${door}/`))?.status(), 200);
    await page.context().close();
  });

  test('a name that somebody points at this machine opens nothing', async () => {
    const page = await (await browser.newContext()).newPage();
    const { port, search } = new URL(served.address);
    const answer = await page.goto(`http://evil.example:${port}/${search}`);
    assert.equal(answer?.status(), 421);
    assert.match((await page.textContent('body')) ?? '', /--allow-host/);
    await page.context().close();
  });

  test('the page of another site gets neither an answer nor a connection, whatever cookies there are', async () => {
    const { page } = await open(browser, served.address);
    const other = await page.context().newPage();
    await other.goto(foreign());
    const got = await other.evaluate(async (target) => {
      const read = await fetch(`${target}/viewer.js`, { credentials: 'include' }).then(() => 'read', () => 'refused');
      const live = await new Promise((end) => {
        const socket = new WebSocket(`${target.replace('http', 'ws')}/ws`);
        socket.onopen = () => end('open');
        socket.onerror = () => end('refused');
      });
      const script = await new Promise((end) => {
        const element = document.createElement('script');
        element.src = `${target}/viewer.js`;
        element.onload = () => end('loaded');
        element.onerror = () => end('refused');
        document.head.append(element);
      });
      const frame = document.createElement('iframe');
      frame.src = `${target}/`;
      await new Promise((end) => {
        frame.onload = end;
        document.body.append(frame);
      });
      return { read, live, script };
    }, door);
    assert.deepEqual(got, { read: 'refused', live: 'refused', script: 'refused' });
    const inside = other.frames()[1];
    assert.equal(await inside?.evaluate(() => document.querySelector('canvas') === null).catch(() => true), true);
    await page.context().close();
  });
});
