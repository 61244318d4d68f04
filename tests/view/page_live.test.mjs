// Unit tests of the commands of a live run, with a socket and a page that only take notes. Run by node's test runner:
//   node --test tests/view/page_live.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';

const texts = {};
const node = (id) => ({ set textContent(text) { texts[id] = text; } });
Object.assign(globalThis, { location: { search: '' }, document: { getElementById: node }, WebSocket: { OPEN: 1 } });
const { Live } = await import('../../view/page/live.js');
const { LivePicture } = await import('../../view/page/live_picture.js');
const { imageOf, readAnswer, Trail } = await import('../../view/page/live_answer.js');

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
  one.state.paused = false;
  const binnings = [true, false].map((plain) => [0.7, 0.6, 0.45, 0.38, 0.3].map((scale) => {
    one.app.frameView = { view: { scale }, image: { binning: 1 }, made: { plain } };
    return one.binning();
  }));
  assert.deepEqual(binnings, [[1, 2, 2, 3, 3], [1, 1, 2, 2, 3]]); // by the processor, by a graphics processor
});

test('rewound: nothing of the discarded future is kept', () => {
  const { one } = live(), element = document.getElementById, done = [];
  document.getElementById = () => ({ classList: { toggle() {} } });
  const state = { time_s: 2, duration_s: 9, obeyed: 0, run: 0, steps: 0, paused: true, steered: true, states: [], message: '' };
  Object.assign(one, { state, states: '[]', shown: 1, trail: new Trail([{ id: 1, tracks: [] }]), app: { cache: { clear: () => done.push('cache') }, strip: { forget: () => done.push('strip') }, count: 3, current: 2 } });
  one.describe({ ...state, time_s: 1 }, '');
  assert.deepEqual([one.app.current, done], [2, []]);
  one.describe({ ...state, time_s: 5 }, '');
  assert.deepEqual([one.app.current, done, one.trail.newest], [-1, ['cache', 'strip'], -1]);
  document.getElementById = element;
});

test('an answer: its words, and its pixels behind them', () => {
  const words = '{"width":2,"height":1,"binning":3,"frame_width":6,"frame_height":3,"x":0,"y":0}', length = words.length + words.length % 2;
  const data = new ArrayBuffer(4 + length + 4);
  new DataView(data).setUint32(0, length, true);
  new Uint8Array(data, 4, length).set(new TextEncoder().encode(words.padEnd(length)));
  new Uint16Array(data, 4 + length).set([7, 65535]);
  const answer = readAnswer(data), image = imageOf(data, answer);
  assert.deepEqual([image.width, image.height, image.binning, image.frameWidth, [...image.data]], [2, 1, 3, 6, [7, 65535]]);
  assert.equal(imageOf(data, { ...answer, width: 0 }), null);
});

test('a trail: tracks of the exposures before, without a future that was discarded', () => {
  const trail = new Trail(), at = (id) => trail.add({ exposure_id: id, tracks: [{ id: 1, x: id, now: true }] });
  assert.deepEqual(at(3), { earlier: [], again: false });
  assert.deepEqual(at(4), { earlier: [{ id: 1, x: 3, now: false }], again: false });
  assert.deepEqual(at(4), { earlier: [{ id: 1, x: 3, now: false }], again: true }); // with other pixels
  for (let id = 5; id < 60; id++) at(id);
  assert.equal(at(60).earlier.length, 40);
  assert.deepEqual(at(20), { earlier: [], again: false });
  assert.equal(trail.newest, 20);
});

test('another sensor: a frame of the one before, which was asked for, is not shown', () => {
  const { one } = live(), shown = [], state = { obeyed: 0, run: -1, steps: 0, paused: true };
  const answer = (sequence) => {
    const words = JSON.stringify({ state, controller: true, sequence, width: 0, frame: { exposure_id: sequence } }), data = new ArrayBuffer(4 + words.length);
    new DataView(data).setUint32(0, words.length, true);
    new Uint8Array(data, 4).set(new TextEncoder().encode(words));
    return data;
  };
  globalThis.requestAnimationFrame = () => {};
  Object.assign(one, { trail: new Trail([{ id: 8, tracks: [] }]), picture: { hide() {} }, describe() {}, takeFrame: ({ exposure_id: id }) => { shown.push(id); } });
  Object.assign(one.app, { frameView: null });
  one.ask();
  one.app.sensor = 1;
  one.changeSensor();
  one.take(answer(9));
  LivePicture.prototype.take.call({ live: one, socket: { tell() {} } }, { message: answer(9), trail: [{ id: 8, tracks: [] }] }); // of the worker
  assert.deepEqual([shown, one.sequence, one.trail.newest], [[], 0, -1]);
  one.ask();
  one.take(answer(3));
  assert.deepEqual([shown, one.sequence], [[3], 3]);
});
