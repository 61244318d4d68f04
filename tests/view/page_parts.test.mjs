// Unit tests of the parts of large frames that the page asks for. Run by node's test runner:
//   node --test tests/view/page_parts.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';

Object.assign(globalThis, { location: { search: '' }, document: { getElementById: () => ({ value: 'linear', checked: false }) }, devicePixelRatio: 1 });
const { binningAt, covers, longestSide, partFor, valueAt } = await import('../../view/page/frame_parts.js');
const { FrameView } = await import('../../view/page/frame_view.js');

test('frames up to 2048 pixels are sent whole, larger ones as large as the stage', () => {
  assert.deepEqual([[1024, 500], [2048, 4000], [2049, 500], [8192, 700], [8192, 9000], [0, 1300]].map((pair) => longestSide(...pair)), [2048, 2048, 512, 768, 2048, 1536]);
});

test('binning is what the screen can show', () => {
  assert.deepEqual([8, 1, 0.6, 0.51, 0.5, 0.26, 0.25, 0.06].map(binningAt), [1, 1, 1, 2, 2, 2, 4, 16]);
});

test('a part has what is shown, lies on the grid, and is within the frame', () => {
  const frame = { width: 8192, height: 6100 };
  for (const binning of [1, 2, 8]) for (let k = 0; k < 200; k++) {
    const x = (k * 7919) % 9000 - 500, y = (k * 104729) % 7000 - 500, side = 40 + (k * 31) % 900, box = { left: x + 0.3, top: y + 0.7, right: x + binning * side, bottom: y + binning * side };
    const part = partFor(box, frame, binning), seen = box.right > 0 && box.bottom > 0 && box.left < frame.width && box.top < frame.height;
    if (!part) { assert.ok(!seen); continue; }
    assert.deepEqual([part.x % (64 * binning), part.y % (64 * binning)], [0, 0]);
    assert.ok(part.x + part.width <= frame.width && part.y + part.height <= frame.height);
    assert.ok(part.width * part.height / binning ** 2 < (1.5 * side + 130) ** 2);
    const image = { ...part, width: Math.ceil(part.width / binning), height: Math.ceil(part.height / binning), data: new Uint16Array(0) };
    if (seen) assert.ok(covers(image, box, frame, binning), `${x} ${y} ${side} ${binning}`);
    assert.ok(!seen || binning === 1 || !covers(image, box, frame, binning / 2));
  }
  const wide = partFor({ left: 0, top: 0, right: 5120, bottom: 2880 }, frame, 1);
  assert.ok(wide.width * wide.height <= 2 ** 24); // what the server sends at most (BST_VIEW_PIXELS_MOST)
});

test('the value of a pixel is that of the part', () => {
  const part = { x: 64, y: 128, width: 2, height: 2, binning: 4, data: Uint16Array.of(1, 2, 3, 4) };
  assert.deepEqual([[64, 128], [67, 131], [68, 128], [71, 135], [72, 128], [63, 128], [64, 136]].map(([x, y]) => valueAt(part, x, y)), [1, 1, 2, 4, undefined, undefined, undefined]);
  assert.equal(valueAt(null, 0, 0), undefined);
});

test('while the frame without noise is shown, the part is its own', async () => {
  const asked = [], image = { width: 512, height: 512, binning: 16, frameWidth: 8192, frameHeight: 8192, data: new Uint16Array(0) }, clean = { ...image };
  const get = (name) => async (part) => { asked.push(name); return { ...part, name, data: new Uint16Array(0) }; };
  const view = Object.assign(Object.create(FrameView.prototype), {
    canvas: { width: 600, height: 600 }, stage: { clientWidth: 600, clientHeight: 600 }, image, part: null, clean: null, cleanPart: null, cleanShown: false, loadingPart: false, redraw() {},
    view: { x: 4000, y: 4000, scale: 4, fitted: false }, getPart: get('frame'), getCleanPart: get('clean'),
  });
  await view.loadPart();
  assert.equal(view.setClean({ ...clean, binning: 8 }), false); // not of these bins
  assert.deepEqual([view.drawn, view.drawnPart.name], [image, 'frame']);
  assert.equal(view.setClean(clean), true);
  assert.deepEqual([view.drawn, view.drawnPart], [clean, null]);
  await view.loadPart();
  assert.deepEqual([view.drawnPart.name, view.part.name], ['clean', 'frame']);
  view.setClean(clean, false); // in turn
  assert.deepEqual([view.drawn, view.drawnPart.name], [image, 'frame']);
  view.setClean(clean, true);
  await view.loadPart();
  assert.deepEqual([view.drawnPart.name, asked], ['clean', ['frame', 'clean']]); // each once
  view.setClean(null);
  assert.deepEqual([view.drawn, view.cleanPart], [image, null]);
});

test('a view that moves asks for one part at a time, and drops one of another frame', async () => {
  const asked = [], answers = [], image = { width: 512, height: 512, binning: 16, frameWidth: 8192, frameHeight: 8192, data: new Uint16Array(0) };
  const view = Object.assign(Object.create(FrameView.prototype), {
    canvas: { width: 600, height: 600 }, stage: { clientWidth: 600, clientHeight: 600 }, image, part: null, loadingPart: false, redraw() {},
    view: { x: 4000, y: 4000, scale: 4, fitted: false }, getPart: (part) => { asked.push(part); return new Promise((done) => answers.push(done)); },
  });
  const waiting = view.loadPart();
  view.view.x = 6000;
  await view.loadPart(); // one is on its way
  assert.equal(asked.length, 1);
  answers[0]({ ...asked[0], data: new Uint16Array(0) });
  await waiting;
  const next = view.loadPart();
  assert.equal(asked.length, 2);
  view.image = { ...image };
  answers[1]({ ...asked[1], data: new Uint16Array(0) });
  await next;
  assert.equal(view.part.x, asked[0].x); // not that of the other frame
  view.view.scale = 0.0625;
  assert.equal(view.wantedPart(), null); // the binned picture has it
});
