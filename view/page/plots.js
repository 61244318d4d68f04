// Plots over time: modes as bands, one panel for each quantity, a common axis and cursor.
import { getNumbers } from './api.js';

const LEFT = 58, RIGHT = 10, TOP = 8, BOTTOM = 16;
const COLUMNS_MOST = 4096;
/** Colours of modes (Paul Tol's muted scheme); each band has its name, too. */
const MODE_COLOURS = {
  idle: '#7d8893', lost: '#cc6677', slew: '#ddcc77', search: '#aa4499', acquire: '#ee8866', track: '#44aa99', hold: '#88ccee', stare: '#88ccee',
};
const OTHER_MODE = '#999933';

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

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

/** Short text of a number. @param {number} value */
export function shortNumber(value) {
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size >= 1e6 || (size > 0 && size < 1e-3)) return value.toExponential(1).replace('e+', 'e').replace('-', '−');
  return String(Number(value.toPrecision(size >= 100 ? 5 : 3))).replace('-', '−');
}

/** Splits an answer into lines: {time, low, high} each. @param {Float64Array} numbers @param {number} lines */
export function readLines(numbers, lines) {
  const found = [];
  for (let k = 0, at = 0; k < lines && at < numbers.length; k++) {
    const count = numbers[at++], points = [];
    for (let i = 0; i < count; i++, at += 3) points.push({ time: numbers[at], low: numbers[at + 1], high: numbers[at + 2] });
    found.push(points);
  }
  return found;
}

/** Value of a line at a time: the last point at or before it. */
export function valueAt(points, time) {
  let low = 0, high = points.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (points[middle].time <= time + 1e-9) low = middle + 1; else high = middle;
  }
  return low > 0 ? (points[low - 1].low + points[low - 1].high) / 2 : NaN;
}

class Panel {
  constructor(plots, info) {
    this.plots = plots;
    this.info = info;
    this.lines = [];
    this.log = info.name === 'pointing_error'; // from a degree in search to parts of a pixel
    this.box = document.createElement('div');
    this.box.className = 'panel';
    const head = document.createElement('div'), title = document.createElement('h3'), gap = document.createElement('span');
    head.className = 'panel-head';
    title.textContent = info.title + (info.unit ? ` [${info.unit.replace('e-', 'e−').replace('arcsec', '″').replace('deg', '°')}]` : '');
    gap.className = 'gap';
    this.values = info.lines.map((name, k) => {
      const value = document.createElement('span'), swatch = document.createElement('i'), number = document.createElement('b');
      value.className = 'value';
      swatch.className = `swatch swatch-${k % 3}`;
      value.append(swatch, `${name} `, number);
      return { value, number };
    });
    this.scaleButton = document.createElement('button');
    this.scaleButton.type = 'button';
    this.scaleButton.textContent = 'log';
    this.scaleButton.setAttribute('aria-pressed', String(this.log));
    this.scaleButton.setAttribute('aria-label', `log: logarithmic axis of ${info.title}`);
    this.scaleButton.addEventListener('click', () => {
      this.log = !this.log;
      this.scaleButton.setAttribute('aria-pressed', String(this.log));
      this.draw();
    });
    head.append(title, ...this.values.map((v) => v.value), ...this.stopTexts(), gap, this.scaleButton);
    this.canvas = document.createElement('canvas');
    this.canvas.setAttribute('role', 'img');
    this.box.append(head, this.canvas);
    plots.listen(this.canvas);
  }

  /** Stops of axes in words: they are mostly outside of what the plot shows. */
  stopTexts() {
    const stops = (this.info.stops || []).map(({ line, low, high }) => `${this.info.lines[line]} ${low === -high ? `±${shortNumber(high)}` : `${shortNumber(low)} to ${shortNumber(high)}`}`);
    if (stops.length === 0) return [];
    const text = document.createElement('span');
    text.className = 'value';
    text.textContent = `stops: ${stops.join(', ')}`;
    return [text];
  }

  async load(signal) {
    const { from, to } = this.plots.range;
    const columns = Math.min(COLUMNS_MOST, Math.max(50, Math.round((this.canvas.clientWidth || 400) * (devicePixelRatio || 1))));
    const numbers = await getNumbers('plot', { sensor: this.plots.sensor, panel: this.info.name, from, to, columns }, signal);
    this.lines = readLines(numbers, this.info.lines.length);
    this.draw();
  }

  extent() {
    let low = Infinity, high = -Infinity;
    for (const points of this.lines) {
      for (const p of points) {
        if (p.time < this.plots.range.from || p.time > this.plots.range.to) continue;
        if (p.low < low && (!this.log || p.low > 0)) low = p.low;
        if (p.high > high) high = p.high;
      }
    }
    if (!(high >= low)) return null;
    if (this.log) return high > 0 ? { low: Math.log10(low) - 0.05, high: Math.log10(high) + 0.05 } : null;
    if (low >= 0 && low < 0.5 * high) low = 0;
    const pad = (high - low || Math.abs(high) || 1) * 0.06;
    return { low: low === 0 ? 0 : low - pad, high: high + pad };
  }

  draw() {
    const { context, width, height } = prepare(this.canvas), style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(name).trim();
    const extent = this.extent(), bottom = height - BOTTOM, plots = this.plots;
    this.describe();
    plots.drawBands(context, TOP, bottom, 0.13);
    context.font = '11px system-ui, sans-serif';
    context.fillStyle = colour('--faint');
    context.lineWidth = 1;
    context.textBaseline = 'middle';
    if (!extent) {
      context.fillText('no values in this range', LEFT + 8, (TOP + bottom) / 2);
      return;
    }
    const toY = (value) => bottom - ((this.log ? Math.log10(Math.max(value, 1e-300)) : value) - extent.low) / (extent.high - extent.low) * (bottom - TOP);
    context.textAlign = 'right';
    for (const tick of this.axisTicks(extent)) {
      const y = Math.round(toY(tick)) + 0.5;
      context.strokeStyle = colour('--grid');
      context.beginPath(); context.moveTo(LEFT, y); context.lineTo(width - RIGHT, y); context.stroke();
      context.fillText(shortNumber(tick), LEFT - 6, y);
    }
    plots.drawTimes(context, bottom, colour('--faint'));
    context.save();
    context.beginPath(); context.rect(LEFT, 0, width - LEFT - RIGHT, height); context.clip();
    this.drawStops(context, extent, toY, colour);
    this.lines.forEach((points, k) => this.drawLine(context, points, toY, colour(`--line-${k % 3}`)));
    context.restore();
    plots.drawCursor(context, 0, bottom, colour('--cursor'));
  }

  /** Stops of the axes that are in view: broken lines. */
  drawStops(context, extent, toY, colour) {
    context.setLineDash([6, 4]);
    for (const { line, low, high } of this.info.stops || []) {
      context.strokeStyle = colour(`--line-${line % 3}`);
      for (const value of [low, high]) {
        if (this.log || value < extent.low || value > extent.high) continue;
        context.beginPath(); context.moveTo(0, toY(value)); context.lineTo(this.canvas.clientWidth, toY(value)); context.stroke();
      }
    }
    context.setLineDash([]);
  }

  axisTicks(extent) {
    if (!this.log) return ticksOf(extent.low, extent.high, 3.5);
    const ticks = [];
    for (let k = Math.ceil(extent.low); k <= extent.high; k++) ticks.push(10 ** k);
    return ticks.length > 1 ? ticks.slice(0, 8) : ticksOf(10 ** extent.low, 10 ** extent.high, 2).filter((t) => t > 0);
  }

  drawLine(context, points, toY, colour) {
    let down = false;
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = 1.5;
    context.lineJoin = 'round';
    context.beginPath();
    for (const p of points) {
      if (!Number.isFinite(p.low) || (this.log && p.high <= 0)) { down = false; continue; }
      const x = this.plots.toX(p.time);
      if (down) context.lineTo(x, toY(p.low)); else context.moveTo(x, toY(p.low));
      if (p.high !== p.low) context.lineTo(x, toY(p.high));
      down = true;
    }
    context.stroke();
    if (points.length > 120) return;
    for (const p of points) { // few samples: each one shows
      if (!Number.isFinite(p.low)) continue;
      context.beginPath(); context.arc(this.plots.toX(p.time), toY(p.low), 2, 0, 2 * Math.PI); context.fill();
    }
  }

  /** Values at the pointer or else the cursor, beside the title and for screen readers. */
  describe() {
    const time = this.plots.pointed ?? this.plots.cursor;
    const texts = this.info.lines.map((name, k) => {
      const value = this.lines[k] ? valueAt(this.lines[k], time) : NaN;
      this.values[k].number.textContent = shortNumber(value);
      return `${name} ${shortNumber(value)}`;
    });
    this.canvas.setAttribute('aria-label', `${this.info.title}, at ${time.toFixed(2)} s: ${texts.join(', ')} ${this.info.unit}`);
  }
}

/** Fits the pixels of a canvas to its size and clears it. */
function prepare(canvas) {
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

/** Least time between two drawings of the plots of a live run, ms: they take longer than its frames. */
const FOLLOW_MS = 1000;

export class Plots {
  /** @param {(time: number) => void} seek goes to the frame of a time */
  constructor(seek) {
    this.seek = seek;
    this.panels = [];
    this.modes = [];
    this.events = [];
    this.all = this.range = { from: 0, to: 1 };
    this.cursor = 0;
    /** @type {number | null} */
    this.pointed = null; // time under the pointer
    this.followed = 0; // when `follow` has drawn
    this.sensor = 0;
    this.drag = null;
    this.request = null;
    this.pointing = false; // a drawing of it waits
    this.reloading = Promise.resolve(); // the lines of the range that is shown
    this.listen(element('modes'));
    new ResizeObserver(() => { this.draw(); this.reload(); }).observe(element('panels'));
    element('time-in').addEventListener('click', () => this.zoom(0.5));
    element('time-out').addEventListener('click', () => this.zoom(2));
    element('time-all').addEventListener('click', () => this.setRange(this.all.from, this.all.to));
  }

  /** @param {number} sensor @param {any[]} panels @param {{time_s: number, mode: string}[]} modes @param {any[]} events */
  show(sensor, panels, modes, events, from, to) {
    this.sensor = sensor;
    this.modes = modes;
    this.events = events;
    this.all = { from, to: to > from ? to : from + 1 };
    this.panels = panels.map((info) => new Panel(this, info));
    element('panels').replaceChildren(...this.panels.map((panel) => panel.box));
    this.setRange(this.all.from, this.all.to);
  }

  /** More of the same run: what is in view stays in view, unless all of it was. */
  extend(panels, modes, events, to) {
    if (panels.length !== this.panels.length) {
      this.show(this.sensor, panels, modes, events, this.all.from, to);
      return;
    }
    const all = this.range.from === this.all.from && this.range.to === this.all.to;
    this.modes = modes;
    this.events = events;
    this.all = { from: this.all.from, to: Math.max(to, this.all.to) };
    if (all) this.setRange(this.all.from, this.all.to);
    else this.draw();
  }

  setRange(from, to) {
    const least = (this.all.to - this.all.from) * 1e-7;
    if (!(to - from > least)) return;
    this.range = { from: Math.max(this.all.from, from), to: Math.min(this.all.to, to) };
    element('range').textContent = `${shortNumber(this.range.from)} to ${shortNumber(this.range.to)} s`;
    this.draw();
    this.reloading = this.reload();
    document.dispatchEvent(new CustomEvent('rangechanged'));
  }

  zoom(factor, centre = this.cursor) {
    const { from, to } = this.range, inside = centre >= from && centre <= to ? centre : (from + to) / 2;
    this.setRange(inside - (inside - from) * factor, inside + (to - inside) * factor);
  }

  /** One request for each panel, the older ones given up. */
  async reload() {
    if (this.request) this.request.abort();
    const request = this.request = new AbortController();
    for (const panel of this.panels) {
      try {
        await panel.load(request.signal);
      } catch (error) {
        if (request.signal.aborted) return;
        panel.values.forEach((v) => { v.number.textContent = '–'; });
        panel.canvas.setAttribute('aria-label', `${panel.info.title}: ${error.message}`);
      }
    }
  }

  setCursor(time) {
    this.cursor = time;
    const { from, to } = this.range;
    if (time < from || time > to) this.setRange(time - (to - from) / 2, time + (to - from) / 2);
    else this.draw();
  }

  /** The newest time of a live run: the cursor, drawn some times a second. */
  follow(time) {
    const all = this.range.to === this.all.to;
    this.cursor = time;
    if (time > this.all.to) this.all = { from: this.all.from, to: time };
    if (all) this.range = { from: this.range.from, to: this.all.to };
    if (performance.now() - this.followed < FOLLOW_MS) return;
    this.followed = performance.now();
    element('range').textContent = `${shortNumber(this.range.from)} to ${shortNumber(this.range.to)} s`;
    this.draw();
  }

  draw() {
    this.drawModes();
    for (const panel of this.panels) panel.draw();
  }

  // ---------------------------------------------------------------- what all panels have

  width() { return element('modes').clientWidth; }

  toX(time) {
    return LEFT + (time - this.range.from) / (this.range.to - this.range.from) * (this.width() - LEFT - RIGHT);
  }

  toTime(x) {
    const share = (x - LEFT) / Math.max(1, this.width() - LEFT - RIGHT);
    return this.range.from + Math.min(1, Math.max(0, share)) * (this.range.to - this.range.from);
  }

  /** Calls `draw` with mode and edges of each band in view. */
  eachBand(draw) {
    this.modes.forEach((change, k) => {
      const end = k + 1 < this.modes.length ? this.modes[k + 1].time_s : this.all.to;
      if (end < this.range.from || change.time_s > this.range.to) return;
      const a = Math.max(LEFT, this.toX(change.time_s)), b = Math.min(this.width() - RIGHT, this.toX(end));
      if (b > a) draw(change.mode, a, b, MODE_COLOURS[change.mode] || OTHER_MODE);
    });
  }

  drawBands(context, top, bottom, alpha) {
    context.globalAlpha = alpha;
    this.eachBand((mode, a, b, colour) => {
      context.fillStyle = colour;
      context.fillRect(a, top, b - a, bottom - top);
    });
    context.globalAlpha = 1;
  }

  drawTimes(context, bottom, colour) {
    context.fillStyle = colour;
    context.textAlign = 'center';
    context.textBaseline = 'top';
    const ticks = ticksOf(this.range.from, this.range.to, Math.max(2, this.width() / 110));
    for (const tick of ticks) {
      const x = this.toX(tick);
      if (x < LEFT + 8 || x > this.width() - RIGHT - 16) continue;
      context.fillRect(Math.round(x), bottom, 1, 3);
      context.fillText(shortNumber(tick) + (tick === ticks[ticks.length - 1] ? ' s' : ''), x, bottom + 4);
    }
    context.textAlign = 'start';
  }

  drawCursor(context, top, bottom, colour) {
    if (this.drag && this.drag.moved) {
      const a = this.toX(this.drag.from), b = this.toX(this.drag.to);
      context.globalAlpha = 0.25;
      context.fillStyle = colour;
      context.fillRect(Math.min(a, b), top, Math.abs(b - a), bottom - top);
      context.globalAlpha = 1;
    }
    context.strokeStyle = colour;
    context.lineWidth = 1;
    for (const [time, dash] of [[this.cursor, []], [this.pointed, [3, 3]]]) {
      const x = time === null ? -1 : Math.round(this.toX(time)) + 0.5;
      if (x < LEFT || x > this.width() - RIGHT + 1) continue;
      context.setLineDash(dash);
      context.beginPath(); context.moveTo(x, top); context.lineTo(x, bottom); context.stroke();
    }
    context.setLineDash([]);
  }

  /** The time under the pointer: the same line in all plots, and the values there. @param {number | null} time */
  point(time) {
    this.pointed = time;
    if (this.pointing) return;
    this.pointing = true;
    requestAnimationFrame(() => {
      this.pointing = false;
      const at = this.pointed === null ? '' : `at ${shortNumber(this.pointed)} s, of `;
      element('range').textContent = `${at}${shortNumber(this.range.from)} to ${shortNumber(this.range.to)} s`;
      this.draw();
    });
  }

  drawModes() {
    const canvas = element('modes'), { context, height } = prepare(canvas), style = getComputedStyle(document.documentElement);
    context.font = '11px system-ui, sans-serif';
    context.textBaseline = 'middle';
    context.fillStyle = style.getPropertyValue('--faint');
    context.textAlign = 'right';
    context.fillText('mode', LEFT - 6, height / 2);
    context.textAlign = 'start';
    let here = '';
    for (const change of this.modes) if (change.time_s <= this.cursor + 1e-9) here = change.mode;
    this.eachBand((mode, a, b, colour) => {
      context.fillStyle = colour;
      context.fillRect(a, 5, Math.max(1, b - a - 1), height - 9);
      if (context.measureText(mode).width < b - a - 6) {
        context.fillStyle = '#0b1016';
        context.fillText(mode, a + 4, height / 2 + 0.5);
      }
    });
    context.fillStyle = style.getPropertyValue('--warn');
    for (const event of this.events) {
      const x = this.toX(event.time_s);
      if (event.kind !== 'mode' && x >= LEFT && x <= this.width() - RIGHT) context.fillRect(Math.round(x), 0, 2, 4);
    }
    this.drawCursor(context, 0, height, style.getPropertyValue('--cursor'));
    canvas.setAttribute('aria-label', `Modes of the controller; at the cursor: ${here || 'none'}`);
  }

  /** A click goes to its time, a drag shows its range. */
  listen(canvas) {
    canvas.addEventListener('pointerdown', (event) => {
      const time = this.toTime(event.offsetX);
      this.drag = { from: time, to: time, x: event.offsetX, moved: false };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener('pointerleave', () => this.point(null));
    canvas.addEventListener('pointermove', (event) => {
      if (!this.drag) {
        this.point(this.toTime(event.offsetX));
        return;
      }
      this.drag.to = this.toTime(event.offsetX);
      this.drag.moved = this.drag.moved || Math.abs(event.offsetX - this.drag.x) > 4;
      this.draw();
    });
    canvas.addEventListener('pointerup', () => {
      const drag = this.drag;
      this.drag = null;
      if (drag && drag.moved) this.setRange(Math.min(drag.from, drag.to), Math.max(drag.from, drag.to));
      else if (drag) this.seek(drag.from);
    });
    canvas.addEventListener('pointercancel', () => { this.drag = null; this.draw(); });
    canvas.addEventListener('dblclick', () => this.setRange(this.all.from, this.all.to));
    canvas.addEventListener('wheel', (event) => {
      if (!event.ctrlKey && !event.shiftKey) return; // scrolls the panels
      event.preventDefault();
      this.zoom(2 ** ((event.deltaY || event.deltaX) / 300), this.toTime(event.offsetX));
    }, { passive: false });
  }
}
