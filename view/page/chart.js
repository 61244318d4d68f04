// What charts on a canvas have in common: plots over time, the comparison of runs, and the charts of a report.

/** A sample, or the extremes of the samples of a column; NaN: a gap. @typedef {{time: number, low: number, high: number}} Extent */

/** Colours of the lines of a plot, `--line-0` to `--line-5` of style.css. */
export const LINE_COLOURS = 6;

/** Marks of an axis: round numbers, about `count` of them. */
export function ticksOf(from, to, count) {
  const rough = (to - from) / Math.max(1, count);
  if (!(rough > 0) || !Number.isFinite(rough)) return [];
  const power = 10 ** Math.floor(Math.log10(rough)), part = rough / power;
  const step = power * (part <= 1 ? 1 : part <= 2 ? 2 : part <= 5 ? 5 : 10);
  const ticks = [];
  for (let k = Math.ceil(from / step - 1e-9); k * step <= to + step * 1e-9 && ticks.length < 100; k++) ticks.push(k * step);
  return ticks;
}

/** Marks of a logarithmic axis: decades, or round numbers where there are less than two. @param {number} low logarithm of the lower end */
export function decadesOf(low, high) {
  const ticks = [];
  for (let k = Math.ceil(low); k <= high; k++) ticks.push(10 ** k);
  return ticks.length > 1 ? ticks.slice(0, 8) : ticksOf(10 ** low, 10 ** high, 4).filter((tick) => tick > 0);
}

/** Short text of a number. @param {number} value @param {number} [digits] significant ones; default: 3, or 5 from 100 on */
export function shortNumber(value, digits) {
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size >= 1e6 || (size > 0 && size < 1e-3)) return value.toExponential(digits ? digits - 1 : 1).replace('e+', 'e').replace('-', '−');
  return String(Number(value.toPrecision(digits || (size >= 100 ? 5 : 3)))).replace('-', '−');
}

/** Texts of the marks of an axis: as many digits as tell neighbours apart. @param {number[]} ticks */
export function textsOf(ticks) {
  const step = Math.abs(ticks[1] - ticks[0]);
  return ticks.map((tick) => {
    const digits = step > 0 ? Math.floor(Math.log10(Math.abs(tick) / step) + 1e-9) + 2 : 0;
    return shortNumber(Math.abs(tick) < step * 1e-9 ? 0 : tick, digits > 3 ? Math.min(15, digits) : undefined);
  });
}

/** Number of the points at or before a time. @param {Extent[]} points by rising time */
export function countUntil(points, time) {
  let low = 0, high = points.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (points[middle].time <= time + 1e-9) low = middle + 1; else high = middle;
  }
  return low;
}

/** Value of a line at a time: the last point at or before it. @param {Extent[]} points */
export function valueAt(points, time) {
  const count = countUntil(points, time);
  return count > 0 ? (points[count - 1].low + points[count - 1].high) / 2 : NaN;
}

/** Fits the pixels of a canvas to its size and clears it. @param {HTMLCanvasElement} canvas */
export function prepare(canvas) {
  const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/** Few samples: each one shows. */
const DOTS_MOST = 120;

/** Draws a line of extents; NaN, and zero or less on a logarithmic axis, is a gap.
 * @param {CanvasRenderingContext2D} context @param {Extent[]} points @param {(time: number) => number} toX @param {(value: number) => number} toY
 * @param {{colour: string, log?: boolean, dash?: number[], dots?: boolean}} how */
export function drawLine(context, points, toX, toY, { colour, log = false, dash = [], dots = true }) {
  let down = false;
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 1.5;
  context.lineJoin = 'round';
  context.setLineDash(dash);
  context.beginPath();
  for (const p of points) {
    if (!Number.isFinite(p.low) || (log && p.high <= 0)) { down = false; continue; }
    const x = toX(p.time);
    if (down) context.lineTo(x, toY(p.low)); else context.moveTo(x, toY(p.low));
    if (p.high !== p.low) context.lineTo(x, toY(p.high));
    down = true;
  }
  context.stroke();
  context.setLineDash([]);
  if (!dots || points.length > DOTS_MOST) return;
  for (const p of points) {
    if (!Number.isFinite(p.low)) continue;
    context.beginPath(); context.arc(toX(p.time), toY(p.low), 2, 0, 2 * Math.PI); context.fill();
  }
}

/** The part that is being chosen by dragging, and the line of the cursor: places in pixels; NaN: not there.
 * @param {CanvasRenderingContext2D} context @param {number} top @param {number} bottom @param {{x: number, from: number, to: number, colour: string}} what */
export function drawCursor(context, top, bottom, what) {
  const { x, from, to, colour } = what;
  if (to !== from && Number.isFinite(to - from)) {
    context.globalAlpha = 0.25;
    context.fillStyle = colour;
    context.fillRect(Math.min(from, to), top, Math.abs(to - from), bottom - top);
    context.globalAlpha = 1;
  }
  if (!Number.isFinite(x)) return;
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.beginPath(); context.moveTo(Math.round(x) + 0.5, top); context.lineTo(Math.round(x) + 0.5, bottom); context.stroke();
}

/** Gestures on a chart: a click, dragging over a part, a double click, and the wheel with Ctrl or Shift. Places are pixels of the element.
 * @param {HTMLElement} canvas
 * @param {{hover?: (x: number, y: number) => void, click: (x: number, y: number) => void, drag: (part: {x0: number, y0: number, x1: number, y1: number} | null) => void,
 *   dragged: (part: {x0: number, y0: number, x1: number, y1: number}) => void, reset: () => void, zoom: (factor: number, x: number) => void}} on
 *   drag: the part so far, null: given up */
export function listenToChart(canvas, on) {
  let part = null, moved = false;
  canvas.addEventListener('pointerdown', (event) => {
    if (event.button !== 0) return; // a menu takes the end of the gesture
    part = { x0: event.offsetX, y0: event.offsetY, x1: event.offsetX, y1: event.offsetY };
    moved = false;
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!part) {
      if (on.hover) on.hover(event.offsetX, event.offsetY);
      return;
    }
    part.x1 = event.offsetX;
    part.y1 = event.offsetY;
    moved = moved || Math.abs(part.x1 - part.x0) > 4;
    if (moved) on.drag(part);
  });
  canvas.addEventListener('pointerup', () => {
    const done = part;
    part = null;
    if (done && moved) on.dragged(done);
    else if (done) on.click(done.x0, done.y0);
  });
  canvas.addEventListener('pointercancel', () => { part = null; on.drag(null); });
  canvas.addEventListener('dblclick', () => on.reset());
  canvas.addEventListener('wheel', (event) => {
    if (!event.ctrlKey && !event.shiftKey) return; // scrolls the page
    event.preventDefault();
    on.zoom(2 ** ((event.deltaY || event.deltaX) / 300), event.offsetX);
  }, { passive: false });
}
