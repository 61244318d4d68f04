// Unit tests of the commands of a live run, with a socket and a page that only take notes. Run by node's test runner:
//   node --test tests/view/page_live.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';

const texts = {};
const node = (id) => ({ set textContent(text) { texts[id] = text; } });
Object.assign(globalThis, { location: { search: '' }, document: { getElementById: node }, WebSocket: { OPEN: 1 } });
const { Live } = await import('../../view/page/live.js');

/** A live run without its controls. */
function live() {
  const sent = [];
  const one = Object.assign(Object.create(Live.prototype), {
    app: { sensor: 0 }, sequence: 0, queue: [], sentAt: -1, refusal: { text: '', until: 0 }, state: { obeyed: 0, time_s: 0, steps: 0, paused: true },
    socket: { readyState: 1, send: (text) => sent.push(JSON.parse(text).command) },
  });
  return { one, sent };
}

test('a command waits for a connection, and for the one before', () => {
  const { one, sent } = live();
  assert.ok(one.command({ do: 'run' }, { do: 'pause' }));
  one.socket.readyState = 3;
  one.ask();
  assert.equal(one.queue.length, 2); // nothing is lost
  one.socket.readyState = 1;
  one.ask();
  one.ask();
  one.state.obeyed++;
  one.ask();
  assert.deepEqual(sent, [{ do: 'run' }, undefined, { do: 'pause' }]);
  assert.equal(one.queue.length, 0);
});

test('what is not taken is said', () => {
  const { one } = live();
  assert.ok(!one.command({ do: 'set', set: 'ä'.repeat(5000) }));
  assert.match(texts['live-message'], /has 100\d\d bytes \(allowed: 8000\)/);
  assert.ok(one.command(...Array(60).fill({ do: 'save' })));
  assert.ok(!one.command(...Array(5).fill({ do: 'step' })));
  assert.match(texts['change-problem'], /65 commands would wait \(allowed: 64\)/);
  assert.equal(one.queue.length, 60);
});

test('before the first frame', () => {
  const { one } = live();
  assert.equal(one.waiting(), 'Paused at 0 s – Run (R)');
  one.state.paused = false;
  assert.equal(one.waiting(), 'No frame yet');
});

test('while a run goes on, pixels that the screen cannot show are binned; they are asked for again when it pauses', () => {
  const { one } = live(), asked = [];
  Object.assign(one, { newest: true, socket: { readyState: 1, send: (text) => asked.push(JSON.parse(text)) }, sequence: 7 });
  globalThis.devicePixelRatio = 1;
  one.app.frameView = { view: { scale: 0.499 }, image: { binning: 2 } };
  one.state = { obeyed: 0, paused: false, steps: 0 };
  one.ask();
  one.app.frameView.view.scale = 3;
  one.ask();
  one.app.frameView.view.scale = 0.25;
  one.state.paused = true;
  one.ask();
  one.app.frameView.image = { binning: 1 };
  one.ask();
  assert.deepEqual(asked.map(({ binning, after }) => [binning, after]), [[2, 7], [1, 0], [1, 0], [1, 7]]);
});

test('rewound: nothing of the discarded future is kept', () => {
  const { one } = live(), element = document.getElementById, done = [];
  document.getElementById = () => ({ classList: { toggle() {} } });
  const state = { time_s: 2, duration_s: 9, obeyed: 0, run: 0, steps: 0, paused: true, steered: true, states: [], message: '' };
  Object.assign(one, { state, states: '[]', shown: 1, trail: [1], app: { cache: { clear: () => done.push('cache') }, strip: { forget: () => done.push('strip') }, count: 3, current: 2 } });
  one.describe({ ...state, time_s: 1 }, '');
  assert.deepEqual([one.app.current, done], [2, []]);
  one.describe({ ...state, time_s: 5 }, '');
  assert.deepEqual([one.app.current, done, one.trail], [-1, ['cache', 'strip'], []]);
  document.getElementById = element;
});
