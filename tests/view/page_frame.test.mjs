// Unit test of where the picture of a frame is: its pixels on a canvas, and marks on them. Run by node's test runner:
//   node --test tests/view/page_frame.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';

Object.assign(globalThis, { location: { search: '' }, document: { getElementById: () => ({ value: 'linear', checked: false }) } });
const { makePainter } = await import('../../view/page/frame_gl.js');
const { FrameView } = await import('../../view/page/frame_view.js');

/** A canvas that keeps what is put on it. */
function makeCanvas(width, height) {
  const context = { createImageData: (w, h) => ({ width: w, height: h, data: new Uint8ClampedArray(4 * w * h) }), putImageData: () => {}, clearRect: () => {} };
  return { width, height, getContext: () => context };
}

/** First and last of the canvas' pixels along an axis that show a pixel of the image. @param {(k: number) => number} greyAt */
function shownAt(count, greyAt, value) {
  const all = Array.from({ length: count }, (_, k) => k).filter((k) => greyAt(k) === value);
  return [all[0], all.at(-1) + 1, all.length];
}

test('pixels of the frame cover whole pixels of the screen, and marks are on them', () => {
  for (const ratio of [1, 2]) for (const scale of [1, 2, 8]) for (const canvasSide of [120, 121]) for (const side of [8, 9]) for (const binning of [1, 2]) {
    globalThis.devicePixelRatio = ratio;
    const canvas = makeCanvas(canvasSide, canvasSide + 3), words = `${ratio} ${scale} ${canvasSide} ${side} ${binning}`;
    const view = Object.assign(Object.create(FrameView.prototype), {
      canvas, stage: { clientWidth: canvas.width / ratio, clientHeight: canvas.height / ratio }, limits: { black: 0, white: 255 }, statistics: null,
      image: { width: side, height: side, binning, frameWidth: side * binning, frameHeight: side * binning, data: Uint16Array.from({ length: side * side }, (_, k) => 10 + k) },
      view: { x: (side * binning - 1) / 2, y: (side * binning - 1) / 2, scale: scale / ratio / binning, fitted: false },
    });
    const painter = makePainter(canvas, true);
    painter.draw(view.image, view.drawing());
    const grey = (x, y) => painter.words[y * canvas.width + x] & 255;
    for (const i of [0, 1, side - 1]) {
      const from = view.toScreen(i * binning - 0.5, i * binning - 0.5), to = view.toScreen((i + 1) * binning - 0.5, (i + 1) * binning - 0.5);
      const across = shownAt(canvas.width, (k) => grey(k, Math.floor((from.y + to.y) / 2 * ratio)), view.image.data[i * side + i]);
      const down = shownAt(canvas.height, (k) => grey(Math.floor((from.x + to.x) / 2 * ratio), k), view.image.data[i * side + i]);
      assert.deepEqual([across, down], [[from.x * ratio, to.x * ratio, scale], [from.y * ratio, to.y * ratio, scale]], words);
      const back = view.toFrame(from.x, to.y);
      assert.deepEqual([back.x, back.y], [i * binning - 0.5, (i + 1) * binning - 0.5], words);
    }
    // within half a pixel of the screen of the middle
    const middle = view.toScreen(view.view.x, view.view.y);
    assert.ok(Math.abs(middle.x * ratio - canvas.width / 2) <= 0.5 && Math.abs(middle.y * ratio - canvas.height / 2) <= 0.5, words);
  }
});

test('pictures of a frame that is larger than the screen are where they are', () => {
  globalThis.devicePixelRatio = 1;
  const canvas = makeCanvas(101, 101), view = Object.assign(Object.create(FrameView.prototype), { canvas, image: null, view: { x: 511.5, y: 511.5, scale: 0.1 } });
  const at = view.toScreen(511.5, 611.5);
  assert.ok(Math.abs(at.x - 50.5) < 1e-9 && Math.abs(at.y - 60.5) < 1e-9);
});
