import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { FrameHeader, ViewRequest } from '../../src/messages.ts';
import { ViewRequester, type WantedView } from '../../src/stage/view_requester.ts';

// A clock that the test turns, and a server that answers when it is told to.
function bench() {
  let now = 0;
  let frame = 0;
  const timers: { at: number; f: () => void }[] = [];
  const sent: ViewRequest[] = [];
  let connected = true;
  const requester = new ViewRequester((view) => connected && sent.push(view) > 0, {
    now: () => now,
    after: (wait, f) => void timers.push({ at: now + wait, f }),
  });
  return {
    requester,
    sent,
    set connected(value: boolean) {
      connected = value;
    },
    pass(milliseconds: number) {
      const end = now + milliseconds;
      for (;;) {
        timers.sort((a, b) => a.at - b.at);
        const next = timers[0];
        if (!next || next.at > end) break;
        timers.shift();
        now = Math.max(now, next.at);
        next.f();
      }
      now = end;
    },
    answer(view: number, milliseconds = 10) {
      const header: FrameHeader = {
        type: 'frame',
        frame: ++frame,
        view,
        width: 1,
        height: 1,
        final: false,
        milliseconds,
        iteration: 0,
        format: 'jpeg',
      };
      return requester.answer(header);
    },
  };
}

const view = (time: number): WantedView => ({ time, width: 8, height: 8, layer: 'rgb', exposure: 0, map: '' });

test('the first view is requested at once and at rest', () => {
  const b = bench();
  b.requester.want(view(0));
  assert.equal(b.sent.length, 1);
  assert.equal(b.sent[0]?.moving, false);
});

test('while one is unanswered only the newest waits', () => {
  const b = bench();
  b.requester.want(view(0));
  b.requester.want(view(0.1));
  b.requester.want(view(0.2));
  assert.equal(b.sent.length, 1);
  b.pass(10);
  b.answer(1);
  assert.deepEqual(
    b.sent.map((v) => v.time),
    [0, 0.2],
  );
  assert.deepEqual(
    b.sent.map((v) => v.id),
    [1, 2],
  );
});

test('motion ends with a request at rest', () => {
  const b = bench();
  b.requester.motion();
  b.requester.want(view(0.5));
  assert.equal(b.sent[0]?.moving, true);
  b.pass(20);
  b.answer(1);
  b.pass(100);
  assert.equal(b.sent.length, 1);
  b.pass(60);
  assert.equal(b.sent.length, 2);
  assert.deepEqual([b.sent[1]?.moving, b.sent[1]?.time], [false, 0.5]);
  b.pass(1000);
  assert.equal(b.sent.length, 2);
});

test('the rest is not forgotten when the last of the motion is still unanswered', () => {
  const b = bench();
  b.requester.motion();
  b.requester.want(view(0.5));
  b.pass(400);
  assert.equal(b.sent.length, 1);
  b.answer(1);
  assert.deepEqual([b.sent.length, b.sent[1]?.moving], [2, false]);
});

test('latency counts from the earliest input in the request', () => {
  const b = bench();
  b.requester.want(view(0));
  b.pass(5);
  b.requester.want(view(0.1));
  b.pass(20);
  b.requester.want(view(0.2));
  b.answer(1);
  b.pass(10);
  assert.equal(b.answer(2)?.input, 5);
});

test('finer frames of an answered request answer nothing', () => {
  const b = bench();
  b.requester.want(view(0));
  assert.equal(b.answer(1)?.view.id, 1);
  assert.equal(b.answer(1), undefined);
});

test('a slow line carries two requests at once, a fast one does not', () => {
  const b = bench();
  for (let i = 1; i <= 12; i++) {
    b.requester.want(view(i / 100));
    b.pass(200);
    b.answer(b.sent.length, 5);
  }
  const before = b.sent.length;
  b.requester.want(view(0.5));
  b.requester.want(view(0.6));
  b.requester.want(view(0.7));
  assert.equal(b.sent.length, before + 2);
});

test('an answer that never comes does not hold up the page', () => {
  const b = bench();
  b.requester.want(view(0));
  b.requester.want(view(0.1));
  b.pass(2100);
  assert.equal(b.sent.length, 2);
  assert.ok(b.requester.waiting() >= 2000);
});

test('asleep, nothing is sent: neither the rest of a motion nor what an answer or patience held back', () => {
  const b = bench();
  b.requester.motion();
  b.requester.want(view(0.1));
  b.requester.want(view(0.2));
  b.requester.sleep(true);
  b.requester.motion();
  b.pass(200);
  b.answer(1);
  b.pass(5000);
  assert.equal(b.sent.length, 1);
  b.requester.sleep(false);
  b.requester.want(view(0.3));
  assert.deepEqual([b.sent.length, b.sent[1]?.time, b.sent[1]?.moving], [2, 0.3, false]);
});

test('a request that sleep cut off holds nothing up', () => {
  const b = bench();
  b.requester.want(view(0.1));
  b.requester.sleep(true);
  assert.equal(b.requester.waiting(), 0);
  b.pass(10);
  b.requester.sleep(false);
  b.requester.want(view(0.2));
  assert.equal(b.sent.length, 2);
  assert.equal(b.answer(2)?.input, 10);
});

test('a refused request is answered: it is not waited for, and the next is sent', () => {
  const b = bench();
  b.requester.want(view(0));
  b.requester.want(view(0.1));
  b.pass(10);
  b.requester.refused(1);
  assert.deepEqual(
    b.sent.map((v) => v.time),
    [0, 0.1],
  );
  b.requester.refused(2);
  b.pass(5000);
  assert.equal(b.requester.waiting(), 0);
  assert.equal(b.sent.length, 2);
});

test('after a reconnection the view is requested again', () => {
  const b = bench();
  b.requester.want(view(0));
  b.connected = false;
  b.requester.want(view(0.3));
  b.connected = true;
  b.requester.restart();
  b.requester.want(view(0.3));
  assert.deepEqual(
    b.sent.map((v) => v.time),
    [0, 0.3],
  );
  assert.equal(b.requester.waiting(), 0);
});
