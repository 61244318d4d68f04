// Unit tests of the film-strip's choice of frames and of its grey levels. Run by node's test runner:
//   node --test tests/view/page_strip.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';

Object.assign(globalThis, { location: { search: '' } });
const { chooseFrames, greyOf, Strip } = await import('../../view/page/strip.js');

test('frames are spread evenly from the first to the last one', () => {
  assert.deepEqual(chooseFrames(0, 3, 11, false), [0, 1, 2, 3]);
  assert.deepEqual(chooseFrames(10, 20, 3, false), [10, 15, 20]);
  assert.deepEqual(chooseFrames(0, 86399, 5, false), [0, 21600, 43200, 64799, 86399]);
  assert.deepEqual(chooseFrames(7, 90, 1, false), [7]);
  assert.deepEqual(chooseFrames(7, 90, 0, true), [64]);
  assert.deepEqual(chooseFrames(5, 4, 10, false), []);
});

test('frames of a growing run stay as it grows', () => {
  let before = [];
  for (let count = 1; count < 400; count++) {
    const now = chooseFrames(0, count - 1, 10, true);
    assert.ok(now.length <= 10 && now.length >= Math.min(count, 5), `${count}: ${now}`);
    // all of them, or every second one, are still there
    assert.ok(before.filter((frame) => now.includes(frame)).length >= Math.floor(before.length / 2), `${count}: ${now}`);
    before = now;
  }
});

test('noise is dark and a point of light is bright', () => {
  const data = Uint16Array.from({ length: 1000 }, (_, k) => 500 + (k * 7919) % 30);
  data[123] = 900;
  const grey = greyOf(data);
  assert.deepEqual([grey[4 * 123], grey[4 * 123 + 3]], [255, 255]);
  const rest = Array.from({ length: 1000 }, (_, k) => grey[4 * k]).filter((_, k) => k !== 123);
  assert.ok(rest.reduce((sum, one) => sum + one, 0) / rest.length < 90);
  assert.deepEqual([...greyOf(new Uint16Array(9)).slice(0, 4)], [0, 0, 0, 255]); // a frame without light
});

test('after a rewind no picture of the discarded future is left, nor comes', async () => {
  globalThis.fetch = () => new Promise((done) => { setTimeout(() => done({ ok: true, headers: new Map([['X-Frame-Width', '1'], ['X-Frame-Height', '1']]), arrayBuffer: async () => new ArrayBuffer(2) }), 5); });
  globalThis.ImageData = class {};
  globalThis.document = { createElement: () => ({ getContext: () => ({ putImageData() {} }) }) };
  const strip = Object.assign(Object.create(Strip.prototype), { kept: new Map(), draw() {}, app: { sensor: 0, frames: [0, 1.5, 0.1, 0, 0, 1, 2.5, 0.1, 0, 0], timeOf: (k) => k + 1.5 } });
  await strip.load([0], new AbortController().signal);
  assert.equal(strip.kept.size, 1);
  strip.request = new AbortController();
  const loading = strip.load([1], strip.request.signal);
  strip.forget();
  await loading;
  assert.equal(strip.kept.size, 0);
});

test('the list of frames is looked through once', () => {
  let looks = 0;
  const frames = { some: (test) => { looks++; return [0, 1, 1, -1, 0, 1, 2, 1, 0, 0].some(test); } }, strip = Object.assign(Object.create(Strip.prototype), { app: { frames }, looked: {} });
  assert.deepEqual([strip.anyPixels(), strip.anyPixels(), looks], [true, true, 1]);
  strip.app.frames = [0, 1, 1, -1, 0];
  assert.equal(strip.anyPixels(), false);
});
