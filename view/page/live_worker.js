// Draws the pictures of a live run beside the page's thread: their pixels and marks go straight to the screen, and the browser
// neither lays out nor composes the page for each of them (view/README.md).
import { CanvasPainter, placeOf } from './frame_gl.js';
import { drawCompass, drawMarks, sortMarks } from './marks.js';
import { imageOf, readAnswer, Trail } from './live_answer.js';

/** @type {{canvas: any, context: any, painter: CanvasPainter} | null} */
let screen = null;
/** Of FrameView.picture(). @type {any} */
let view = null;
let trail = new Trail();
/** The newest picture. @type {{image: any, details: any} | null} */
let picture = null;
let waiting = false; // a drawing

function draw() {
  const { canvas, context, painter } = screen, { image, details } = picture, { ratio } = view, n = image.binning || 1, width = canvas.width / ratio, height = canvas.height / ratio;
  const { x, y, scale } = placeOf(view, canvas, n, ratio);
  painter.background = view.background;
  context.setTransform(1, 0, 0, 1, 0, 0);
  painter.draw(image, { ...view.stretch, originX: x + (image.x || 0) * scale, originY: y + (image.y || 0) * scale, scale: scale * n });
  const sorted = sortMarks({ ...details, names: view.names, target: view.target });
  const toScreen = (px, py) => ({ x: x / ratio + (px + 0.5) * view.scale, y: y / ratio + (py + 0.5) * view.scale });
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  drawMarks(context, sorted, details.wcs, { toScreen, scale: view.scale, width, height, shown: view.shown });
  if (details.wcs) drawCompass(context, details.wcs, { scale: view.scale, width, height });
}

/** Draws before the next picture of the screen, and says so. */
function redraw() {
  if (waiting || !picture || !view || !screen) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    draw();
    postMessage('drawn');
  });
}

onmessage = ({ data }) => {
  if (data.canvas) {
    const context = data.canvas.getContext('2d', { willReadFrequently: true, alpha: false });
    screen = { canvas: data.canvas, context, painter: new CanvasPainter(data.canvas, context) };
  }
  if (data.view) {
    view = data.view;
    if (screen.canvas.width !== view.width || screen.canvas.height !== view.height) Object.assign(screen.canvas, { width: view.width, height: view.height });
  }
  if (data.trail) trail = new Trail(data.trail);
  if (data.answer) {
    const answer = readAnswer(data.answer), { earlier } = trail.add(answer.frame);
    picture = { image: imageOf(data.answer, answer), details: { ...answer.frame, tracks: answer.frame.tracks.concat(earlier) } };
  }
  redraw();
};
