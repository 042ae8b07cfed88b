import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { FrameHeader, Look } from '../../src/messages.ts';
import { Looker, type Wish } from '../../src/stage/looker.ts';

// A clock that the test turns, and a server that answers when it is told to.
function bench() {
  let now = 0;
  let frame = 0;
  const timers: { at: number; f: () => void }[] = [];
  const sent: Look[] = [];
  let connected = true;
  const looker = new Looker((look) => connected && sent.push(look) > 0, {
    now: () => now,
    after: (wait, f) => void timers.push({ at: now + wait, f }),
  });
  return {
    looker,
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
    answer(look: number, milliseconds = 10) {
      const header: FrameHeader = {
        type: 'frame',
        frame: ++frame,
        look,
        width: 1,
        height: 1,
        final: false,
        milliseconds,
        iteration: 0,
        format: 'jpeg',
      };
      return looker.answer(header);
    },
  };
}

const wish = (time: number): Wish => ({ time, width: 8, height: 8, layer: 'rgb', exposure: 0, map: '' });

test('the first wish is sent at once and at rest', () => {
  const b = bench();
  b.looker.want(wish(0));
  assert.equal(b.sent.length, 1);
  assert.equal(b.sent[0]?.moving, false);
});

test('while one is unanswered only the newest waits', () => {
  const b = bench();
  b.looker.want(wish(0));
  b.looker.want(wish(0.1));
  b.looker.want(wish(0.2));
  assert.equal(b.sent.length, 1);
  b.pass(10);
  b.answer(1);
  assert.deepEqual(
    b.sent.map((l) => l.time),
    [0, 0.2],
  );
  assert.deepEqual(
    b.sent.map((l) => l.id),
    [1, 2],
  );
});

test('motion ends with a look at rest', () => {
  const b = bench();
  b.looker.motion();
  b.looker.want(wish(0.5));
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
  b.looker.motion();
  b.looker.want(wish(0.5));
  b.pass(400);
  assert.equal(b.sent.length, 1);
  b.answer(1);
  assert.deepEqual([b.sent.length, b.sent[1]?.moving], [2, false]);
});

test('latency counts from the earliest input in the look', () => {
  const b = bench();
  b.looker.want(wish(0));
  b.pass(5);
  b.looker.want(wish(0.1));
  b.pass(20);
  b.looker.want(wish(0.2));
  b.answer(1);
  b.pass(10);
  assert.equal(b.answer(2)?.input, 5);
});

test('finer frames of an answered look answer nothing', () => {
  const b = bench();
  b.looker.want(wish(0));
  assert.equal(b.answer(1)?.look.id, 1);
  assert.equal(b.answer(1), undefined);
});

test('a slow line carries two looks at once, a fast one does not', () => {
  const b = bench();
  for (let i = 1; i <= 12; i++) {
    b.looker.want(wish(i / 100));
    b.pass(200);
    b.answer(b.sent.length, 5);
  }
  const before = b.sent.length;
  b.looker.want(wish(0.5));
  b.looker.want(wish(0.6));
  b.looker.want(wish(0.7));
  assert.equal(b.sent.length, before + 2);
});

test('an answer that never comes does not hold up the page', () => {
  const b = bench();
  b.looker.want(wish(0));
  b.looker.want(wish(0.1));
  b.pass(2100);
  assert.equal(b.sent.length, 2);
  assert.ok(b.looker.waiting() >= 2000);
});

test('after a reconnection the wish is sent again', () => {
  const b = bench();
  b.looker.want(wish(0));
  b.connected = false;
  b.looker.want(wish(0.3));
  b.connected = true;
  b.looker.restart();
  b.looker.want(wish(0.3));
  assert.deepEqual(
    b.sent.map((l) => l.time),
    [0, 0.3],
  );
  assert.equal(b.looker.waiting(), 0);
});
