// Plots over time: modes as bands, one panel for each quantity, a common axis and cursor.
import { getNumbers } from './api.js';
import { decadesOf, drawCursor, drawLine, LINE_COLOURS, listenToChart, prepare, shortNumber, textsOf, ticksOf, valueAt } from './chart.js';
import { setText } from './text.js';

const LEFT = 58, RIGHT = 10, TOP = 8, BOTTOM = 16;
const COLUMNS_MOST = 4096;
/** Colours of modes (Paul Tol's muted scheme); each band has its name, too. */
const MODE_COLOURS = {
  idle: '#7d8893', lost: '#cc6677', slew: '#ddcc77', search: '#aa4499', acquire: '#ee8866', track: '#44aa99', hold: '#88ccee', stare: '#88ccee',
};
const OTHER_MODE = '#999933';

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

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
      swatch.className = `swatch swatch-${k % LINE_COLOURS}${k < LINE_COLOURS ? '' : ' dashed'}`;
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
    this.inView = true;
    this.late = false; // what is drawn is not of now
    this.box.append(head, this.canvas);
    plots.listen(this.canvas);
  }

  /** Stops of axes in words: they are mostly outside of what the plot shows. */
  stopTexts() {
    const range = ({ low, high }) => (low === -high ? `±${shortNumber(high)}` : `${shortNumber(low)} to ${shortNumber(high)}`);
    const all = this.info.stops || [], same = all.length === this.info.lines.length && all.length > 2 && all.every((stop) => range(stop) === range(all[0]));
    const stops = same ? [range(all[0])] : all.map((stop) => `${this.info.lines[stop.line]} ${range(stop)}`);
    if (stops.length === 0) return [];
    const text = document.createElement('span');
    text.className = 'value';
    text.textContent = `${this.info.limit_word || 'stops'}: ${stops.join(', ')}`;
    return [text];
  }

  async load(signal) {
    const { from, to } = this.plots.range;
    const columns = Math.min(COLUMNS_MOST, Math.max(50, Math.round((this.canvas.clientWidth || 400) * (devicePixelRatio || 1))));
    const numbers = await getNumbers('plot', { sensor: this.plots.sensor, panel: this.info.name, from, to, columns }, signal);
    this.lines = readLines(numbers, this.info.lines.length);
    this.draw();
    this.describe();
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
    this.late = false;
    const { context, width, height } = prepare(this.canvas), style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(name).trim();
    const extent = this.extent(), bottom = height - BOTTOM, plots = this.plots;
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
    const ticks = this.log ? decadesOf(extent.low, extent.high) : ticksOf(extent.low, extent.high, 3.5), texts = textsOf(ticks);
    ticks.forEach((tick, k) => {
      const y = Math.round(toY(tick)) + 0.5;
      context.strokeStyle = colour('--grid');
      context.beginPath(); context.moveTo(LEFT, y); context.lineTo(width - RIGHT, y); context.stroke();
      context.fillText(texts[k], LEFT - 6, y);
    });
    plots.drawTimes(context, bottom, colour('--faint'));
    context.save();
    context.beginPath(); context.rect(LEFT, 0, width - LEFT - RIGHT, height); context.clip();
    this.drawStops(context, extent, toY, colour);
    this.lines.forEach((points, k) => drawLine(context, points, (time) => plots.toX(time), toY, {
      colour: colour(`--line-${k % LINE_COLOURS}`), log: this.log, dash: k < LINE_COLOURS ? [] : [5, 3],
    }));
    context.restore();
    plots.drawCursor(context, 0, bottom, colour('--cursor'));
  }

  /** Stops of the axes that are in view: broken lines. */
  drawStops(context, extent, toY, colour) {
    context.setLineDash([6, 4]);
    for (const { line, low, high } of this.info.stops || []) {
      context.strokeStyle = colour(`--line-${line % LINE_COLOURS}`);
      for (const value of [low, high]) {
        if (this.log || value < extent.low || value > extent.high) continue;
        context.beginPath(); context.moveTo(0, toY(value)); context.lineTo(this.canvas.clientWidth, toY(value)); context.stroke();
      }
    }
    context.setLineDash([]);
  }

  /** Values at the pointer or else the cursor, beside the title and for screen readers. */
  describe() {
    const time = this.plots.pointed ?? this.plots.cursor;
    const texts = this.info.lines.map((name, k) => {
      const value = this.lines[k] ? valueAt(this.lines[k], time) : NaN;
      setText(this.values[k].number, shortNumber(value));
      return `${name} ${shortNumber(value)}`;
    });
    this.canvas.setAttribute('aria-label', `${this.info.title}, at ${time.toFixed(2)} s: ${texts.join(', ')} ${this.info.unit}`);
  }
}

/** Requests for plots at a time: three may wait for the truth, which is read once for them. */
const REQUESTS = 4;
/** Least time between two drawings of the plots of a live run, ms: they take longer than its frames. */
const FOLLOW_MS = 2000;

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
    this.columnsWidth = 0; // of the box of the panels, for which the lines were asked
    /** @type {any} */
    this.strip = null; // the bands of `bandsOf`, in the range and width of `bandsKey`
    this.bandsKey = '';
    /** @type {any[] | null} */
    this.bandsOf = null;
    this.reloading = Promise.resolve(); // the lines of the range that is shown
    // while a run goes on, plots out of view are drawn when they come into view
    this.seen = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        const panel = this.panels.find(({ box }) => box === target);
        if (!panel) continue;
        panel.inView = isIntersecting;
        if (isIntersecting && panel.late) { panel.draw(); panel.describe(); }
      }
    });
    this.listen(element('modes'));
    new ResizeObserver(() => this.resize()).observe(element('panels'));
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
    this.seen.disconnect();
    for (const panel of this.panels) this.seen.observe(panel.box);
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

  /** Other columns are asked for if the width has changed; more panels alone make the box higher. */
  resize() {
    const width = element('panels').clientWidth;
    if (width === this.columnsWidth) return;
    this.columnsWidth = width;
    this.draw();
    this.reloading = this.reload();
  }

  /** One request for each panel, some at a time: one that waits for a long table does not keep the others. The older ones are given up. */
  async reload() {
    if (this.request) this.request.abort();
    const request = this.request = new AbortController(), waiting = [...this.panels];
    const work = async () => {
      for (let panel = waiting.shift(); panel && !request.signal.aborted; panel = waiting.shift()) {
        try {
          await panel.load(request.signal);
        } catch (error) {
          if (request.signal.aborted) return;
          panel.values.forEach((v) => { v.number.textContent = '–'; });
          panel.canvas.setAttribute('aria-label', `${panel.info.title}: ${error.message}`);
        }
      }
    };
    await Promise.all(Array.from({ length: REQUESTS }, work));
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
    setText(element('range'), `${shortNumber(this.range.from)} to ${shortNumber(this.range.to)} s`);
    this.draw(this.panels.filter((panel) => panel.inView));
    for (const panel of this.panels) panel.late = !panel.inView;
  }

  draw(panels = this.panels) {
    this.measured = element('modes').clientWidth;
    this.drawModes();
    for (const panel of panels) panel.draw();
    for (const panel of panels) panel.describe(); // text last: a look at a canvas after it lays out the page
  }

  // ---------------------------------------------------------------- what all panels have

  width() { return this.measured || element('modes').clientWidth; }

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

  /** The bands, one pixel high, drawn once for all panels: a day has thousands. */
  bands() {
    const ratio = devicePixelRatio || 1, width = Math.max(1, Math.round(this.width() * ratio));
    const key = [this.range.from, this.range.to, this.all.to, width, this.modes.length].join();
    if (this.bandsKey !== key || this.bandsOf !== this.modes) {
      this.bandsKey = key;
      this.bandsOf = this.modes;
      this.strip = document.createElement('canvas');
      this.strip.width = width;
      this.strip.height = 1;
      const context = this.strip.getContext('2d');
      context.scale(ratio, 1);
      this.eachBand((mode, a, b, colour) => {
        context.fillStyle = colour;
        context.fillRect(a, 0, b - a, 1);
      });
    }
    return this.strip;
  }

  drawBands(context, top, bottom, alpha) {
    if (this.modes.length === 0) return;
    const strip = this.bands();
    context.globalAlpha = alpha;
    context.imageSmoothingEnabled = false;
    context.drawImage(strip, 0, 0, strip.width, 1, 0, top, strip.width / (devicePixelRatio || 1), bottom - top);
    context.globalAlpha = 1;
  }

  drawTimes(context, bottom, colour) {
    context.fillStyle = colour;
    context.textAlign = 'center';
    context.textBaseline = 'top';
    const ticks = ticksOf(this.range.from, this.range.to, Math.max(2, this.width() / 110));
    const texts = textsOf(ticks);
    ticks.forEach((tick, k) => {
      const x = this.toX(tick);
      if (x < LEFT + 8 || x > this.width() - RIGHT - 16) return;
      context.fillRect(Math.round(x), bottom, 1, 3);
      context.fillText(texts[k] + (k === ticks.length - 1 ? ' s' : ''), x, bottom + 4);
    });
    context.textAlign = 'start';
  }

  drawCursor(context, top, bottom, colour) {
    const at = (time) => {
      const x = time === null ? NaN : Math.round(this.toX(time));
      return x + 0.5 >= LEFT && x + 0.5 <= this.width() - RIGHT + 1 ? x : NaN;
    };
    const { from, to } = this.drag || { from: NaN, to: NaN }, pointed = at(this.pointed);
    drawCursor(context, top, bottom, { x: at(this.cursor), from: this.toX(from), to: this.toX(to), colour });
    if (!Number.isFinite(pointed)) return;
    context.strokeStyle = colour;
    context.lineWidth = 1;
    context.setLineDash([3, 3]);
    context.beginPath(); context.moveTo(pointed + 0.5, top); context.lineTo(pointed + 0.5, bottom); context.stroke();
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
      setText(element('range'), `${at}${shortNumber(this.range.from)} to ${shortNumber(this.range.to)} s`);
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
    listenToChart(canvas, {
      click: (x) => this.seek(this.toTime(x)),
      drag: (part) => {
        this.drag = part && { from: this.toTime(part.x0), to: this.toTime(part.x1) };
        this.draw();
      },
      dragged: ({ x0, x1 }) => {
        const from = this.toTime(Math.min(x0, x1)), to = this.toTime(Math.max(x0, x1));
        this.drag = null;
        this.setRange(from, to);
      },
      reset: () => this.setRange(this.all.from, this.all.to),
      zoom: (factor, x) => this.zoom(factor, this.toTime(x)),
    });
    canvas.addEventListener('pointerleave', () => this.point(null));
    canvas.addEventListener('pointermove', (event) => { if (!this.drag) this.point(this.toTime(event.offsetX)); });
  }
}
