// The connection of a live run, and its pictures, beside the page's thread: while the run goes on, pixels and marks go straight to the
// screen, and the browser neither lays out nor composes the page for each of them (view/README.md).
import { CanvasPainter, placeOf } from './frame_gl.js';
import { imageOf, readAnswer, Trail } from './live_answer.js';
import { drawCompass, drawMarks, sortMarks } from './marks.js';

/** Time after which a drawing is not waited for, ms: what is not on the screen is not drawn. */
const WAIT_MS = 300;

/** @type {WebSocket | null} */
let socket = null;
/** @type {{canvas: any, context: any, painter: CanvasPainter} | null} */
let screen = null;
/** Of FrameView.picture(). @type {any} */
let view = null;
let trail = new Trail();
/** The newest picture. @type {{image: any, details: any} | null} */
let picture = null;
let drawing = false; // waits for the next picture of the screen
/** What is asked for without the page, and until when; null: the page has the turn. @type {{asked: any, obeyed: number, run: number, until: number} | null} */
let alone = null;
let asking = false; // an answer is awaited
let shown = 0; // frames since the page had the turn
let timer = 0;

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

/** Asks for the next frame, if it is not asked for. */
function ask() {
  clearTimeout(timer);
  if (!alone || asking || !socket || socket.readyState !== WebSocket.OPEN) return;
  asking = true;
  socket.send(JSON.stringify(alone.asked));
}

/** Draws with the next picture of the screen. */
function redraw() {
  if (drawing || !picture || !view || !screen) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    draw();
    ask();
  });
}

/** @param {ArrayBuffer} data an answer with a frame @param {any} answer */
function show(data, answer) {
  const { earlier, again } = trail.add(answer.frame);
  if (!again) shown++;
  picture = { image: imageOf(data, answer), details: { ...answer.frame, tracks: answer.frame.tracks.concat(earlier) } };
  clearTimeout(timer);
  timer = self.setTimeout(ask, WAIT_MS); // before it is drawn only if nothing is
  redraw();
}

/** Gives the page the turn, with what was shown. @param {ArrayBuffer | null} data an answer for it */
function giveTurn(data) {
  const told = { message: data, shown, trail: alone ? trail.exposures : null };
  alone = null;
  shown = 0;
  postMessage(told, { transfer: data ? [data] : [] });
}

/** @param {ArrayBuffer} data */
function take(data) {
  asking = false;
  if (!alone) {
    giveTurn(data);
    return;
  }
  const answer = readAnswer(data), { state } = answer, goesOn = !state.paused && !state.ended && state.steps === 0 && state.obeyed === alone.obeyed && state.run === alone.run;
  if (!goesOn || answer.problem || performance.now() >= alone.until || (answer.sequence && !(answer.width > 0))) giveTurn(data);
  else if (answer.sequence) {
    alone.asked.after = answer.sequence;
    show(data, answer);
  } else ask();
}

/** @param {string} address */
function connect(address) {
  socket = new WebSocket(address);
  socket.binaryType = 'arraybuffer';
  socket.onopen = () => { asking = false; postMessage({ open: true }); };
  socket.onmessage = ({ data }) => take(data);
  socket.onclose = () => {
    if (alone) giveTurn(null);
    postMessage({ closed: true });
  };
}

onmessage = ({ data }) => {
  if (data.connect) connect(data.connect);
  if (data.send) {
    asking = true;
    socket.send(data.send);
  }
  if (data.canvas) {
    const context = data.canvas.getContext('2d', { willReadFrequently: true, alpha: false });
    screen = { canvas: data.canvas, context, painter: new CanvasPainter(data.canvas, context) };
  }
  if (data.view) {
    view = data.view;
    if (screen.canvas.width !== view.width || screen.canvas.height !== view.height) Object.assign(screen.canvas, { width: view.width, height: view.height });
    redraw();
  }
  if (data.trail) trail = new Trail(data.trail);
  if (data.answer) {
    const answer = readAnswer(data.answer);
    alone = { asked: data.asked, obeyed: answer.state.obeyed, run: answer.state.run, until: performance.now() + data.time };
    show(data.answer, answer);
    shown = 0; // the page has counted it
  }
  if (data.stop && alone) {
    if (asking) alone.until = 0; // with the answer
    else giveTurn(null);
  }
  if (data.count) postMessage({ count: shown });
};
