// Charts of report.html that answer: a canvas in the place of each SVG chart, drawn from the values that its elements hold
// (sim/io/chart_values.h). Without scripts, and in print, the SVG stays.
import { countUntil, decadesOf, drawCursor, drawLine, listenToChart, prepare, shortNumber, textsOf, ticksOf } from './chart.js';

/** Significant digits of values that are read. */
const DIGITS = 5;
const FONT = '12px system-ui, sans-serif';
const ALPHA = { bands: 0.16, area: 0.22, bar: 0.75 };

// ---------------------------------------------------------------- what an SVG holds

const numberOf = (word) => (word === '-' ? NaN : Number(word));

/** Numbers of an attribute; "-" is NaN. @param {string | undefined} text */
export const numbersOf = (text) => (text ? text.split(' ').map(numberOf) : []);

/** Points of a series: a word of y is a value, or the extremes "low:high" of a column. @param {number[]} x @param {string | undefined} y */
export function pointsOf(x, y) {
  return (y ? y.split(' ') : []).map((word, k) => {
    const [low, high = low] = word.split(':').map(numberOf);
    return { time: x[k], low, high };
  });
}

/** An axis: "low high", then "log", "bare". @param {string} text @param {string} [label] "name, unit" */
export function axisOf(text, label = '') {
  const [low, high, ...flags] = text.split(' '), comma = label.lastIndexOf(', ');
  return { low: Number(low), high: Number(high), log: flags.includes('log'), bare: flags.includes('bare'), label,
    name: comma < 0 ? label : label.slice(0, comma), unit: comma < 0 ? '' : label.slice(comma + 2) };
}

/** Share of a range at a value, 0 to 1. @param {{low: number, high: number}} range */
export const shareOf = (range, value, log) => (log
  ? (value > 0 ? Math.log(value / range.low) / Math.log(range.high / range.low) : -Infinity) : (value - range.low) / (range.high - range.low));

/** Value at a share of a range. */
export const valueOf = (range, share, log) => (log ? range.low * (range.high / range.low) ** share : range.low + share * (range.high - range.low));

/** Values with a margin, as the range of an axis; null: there are none. @param {number[]} values */
export function rangeOf(values, log) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (!Number.isFinite(value) || (log && value <= 0)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (!(high >= low)) return null;
  if (log) return { low: low / 1.2, high: high * 1.2 };
  const pad = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1;
  return { low: low === 0 ? 0 : low - pad, high: high + pad };
}

const withUnit = (text, unit) => (unit ? `${text} ${unit}` : text);
const spanText = ({ low, high }) => (low === high ? shortNumber(low, DIGITS) : `${shortNumber(low, DIGITS)} to ${shortNumber(high, DIGITS)}`);

/** The point that is nearest in time; null: there is none. @param {{time: number, low: number, high: number}[]} points by rising time */
export function nearestPoint(points, time) {
  const count = countUntil(points, time), before = points[count - 1], after = points[count];
  if (!before || !after) return before || after || null;
  return after.time - time < time - before.time ? after : before;
}

/** A shape of a chart, as its element holds it. @param {SVGElement} one @param {(text: string | undefined) => number[]} xOf */
function itemOf(one, xOf) {
  const { kind = '', x, y, low, high, from, to, bar, rule, mark, word } = one.dataset, title = one.querySelector('title');
  const item = { element: one, kind, colour: '', number: (one.getAttribute('class') || '').match(/\bc\d+\b/)?.[0] || '', dashed: one.classList.contains('s'), entry: null,
    title: title ? title.textContent : '', points: [], numbers: [], ends: [], text: '', anchor: '' };
  if (kind === 'line' || kind === 'dots') item.points = pointsOf(xOf(x), y);
  if (kind === 'area' || kind === 'whiskers') {
    const lows = numbersOf(low), highs = numbersOf(high);
    item.points = xOf(x).map((time, k) => ({ time, low: lows[k], high: highs[k] }));
  }
  if (kind === 'bands') item.ends = numbersOf(to);
  if (kind === 'bands') item.numbers = numbersOf(from);
  for (const [name, text] of Object.entries({ bar, rule, mark, word })) if (text) Object.assign(item, { kind: name, numbers: numbersOf(text) });
  if (word) Object.assign(item, { text: one.textContent, anchor: one.getAttribute('text-anchor') || 'start' });
  return item;
}

/** Charts that move together: all over time of the same length, or one alone. Values are in units of the axes times `unit`. */
class Group {
  constructor(low, high, log) {
    this.all = { low, high };
    this.range = { low, high };
    this.log = log;
    this.cursor = NaN;
    /** @type {Chart[]} */
    this.charts = [];
  }

  zoomed() { return this.range.low !== this.all.low || this.range.high !== this.all.high; }

  setRange(low, high) {
    const from = Math.max(this.all.low, low), to = Math.min(this.all.high, high);
    if (shareOf(this.all, to, this.log) - shareOf(this.all, from, this.log) > 1e-6) this.range = { low: from, high: to };
    this.redraw();
  }

  zoom(factor, value) {
    const { range, log } = this, share = Number.isFinite(value) && value >= range.low && value <= range.high ? shareOf(range, value, log) : 0.5;
    this.setRange(valueOf(range, share - share * factor, log), valueOf(range, share + (1 - share) * factor, log));
  }

  reset() {
    this.range = this.all;
    for (const chart of this.charts) chart.yRange = null;
    this.redraw();
  }

  setCursor(value) {
    this.cursor = value;
    const { low, high } = this.range, half = (high - low) / 2;
    if ((value < low || value > high) && !this.log) this.setRange(value - half, value + half);
    else this.redraw();
  }

  redraw() { for (const chart of this.charts) chart.touch(); }
}

class Chart {
  /** @param {SVGElement} svg @param {(text: string | undefined) => number[]} xOf */
  constructor(svg, xOf) {
    this.svg = svg;
    this.figure = svg.parentElement;
    this.name = svg.getAttribute('aria-label') || '';
    this.x = axisOf(svg.dataset.x, svg.dataset.xLabel);
    this.y = axisOf(svg.dataset.y, svg.dataset.yLabel);
    this.unit = Number(svg.dataset.unitS) || 1;
    this.margins = numbersOf(svg.dataset.margins);
    /** @type {any[]} */
    this.items = [...svg.querySelectorAll('[data-kind], [data-bar], [data-rule], [data-mark], [data-word]')].map((one) => itemOf(/** @type {SVGElement} */ (one), xOf))
      .filter(({ kind, points }) => (kind !== 'line' && kind !== 'dots') || points.some((point) => Number.isFinite(point.low)));
    const kinds = new Set(this.items.map((item) => item.kind));
    /** Dots in no order: the cursor goes to the nearest one. */
    this.scatter = kinds.has('dots') && !['line', 'area', 'bar'].some((kind) => kinds.has(kind));
    this.dots = this.scatter ? this.items.filter((item) => item.kind === 'dots').flatMap((item) => item.points.map((point) => ({ ...point, item }))) : [];
    this.dot = -1;
    this.yRange = null; // chosen by dragging
    this.part = null;
    this.visible = this.dirty = false;
    this.ink = ''; // of the style in which the colours are
    /** @type {Group} */
    this.group = null;
    this.readLegend();
    this.build();
  }

  // ---------------------------------------------------------------- elements

  /** Entries of the legend become buttons that show and hide what has their colour. */
  readLegend() {
    const list = [...this.figure.children].find((one) => one.matches('ul.legend'));
    this.entries = (list ? [...list.children] : []).map((row) => {
      const key = row.querySelector('.key'), words = [...key.classList];
      const entry = { row, name: row.textContent, kind: words.find((word) => ['line', 'dash', 'dot', 'ground'].includes(word)), number: words.find((word) => /^c\d+$/.test(word)),
        hidden: false, value: document.createElement('b'), items: [] };
      const button = document.createElement('button');
      button.type = 'button';
      button.setAttribute('aria-pressed', 'true');
      button.append(...row.childNodes);
      row.replaceChildren(button);
      button.addEventListener('click', () => {
        entry.hidden = !entry.hidden;
        button.setAttribute('aria-pressed', String(!entry.hidden));
        this.touch();
      });
      entry.button = button;
      return entry;
    });
    const kindOf = (item) => ({ line: item.dashed ? 'dash' : 'line', dots: 'dot', bands: 'ground', bar: 'ground', area: 'ground' })[item.kind];
    for (const item of this.items) {
      if (item.kind === 'word' || item.kind === 'rule' || item.kind === 'mark') continue;
      const own = this.entries.filter((entry) => entry.number === item.number);
      item.entry = own.find((entry) => entry.kind === kindOf(item)) || (item.dashed && this.entries.find((entry) => entry.kind === 'dash')) || own[0] || null;
      if (item.entry) item.entry.items.push(item);
    }
    for (const entry of this.entries) if (!this.scatter && entry.items.some((item) => item.points.length)) entry.button.append(entry.value);
  }

  build() {
    const [, , width, height] = this.svg.getAttribute('viewBox').split(' ').map(Number);
    this.canvas = document.createElement('canvas');
    this.canvas.className = 'plot';
    this.canvas.style.aspectRatio = `${width} / ${height}`;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'slider');
    this.canvas.setAttribute('aria-label', this.name);
    this.canvas.setAttribute('aria-valuemin', String(this.x.low));
    this.canvas.setAttribute('aria-valuemax', String(this.x.high));
    this.canvas.setAttribute('aria-valuenow', String(this.x.low));
    const line = document.createElement('p');
    line.className = 'readout';
    this.words = document.createElement('span');
    this.all = document.createElement('button');
    this.all.type = 'button';
    this.all.textContent = 'Show all';
    this.all.hidden = true;
    this.all.addEventListener('click', () => { this.group.reset(); this.canvas.focus(); });
    line.append(this.words, this.all);
    this.svg.after(this.canvas, line);
    this.figure.classList.add('answers');
    listenToChart(this.canvas, {
      hover: (x, y) => this.point(x, y),
      click: (x, y) => this.point(x, y),
      drag: (part) => { this.part = part && { ...part }; this.touch(); },
      dragged: (part) => this.choose(part),
      reset: () => this.group.reset(),
      zoom: (factor, x) => this.group.zoom(factor, this.toValue(x) * this.unit),
    });
    this.canvas.addEventListener('keydown', (event) => this.press(event));
  }

  // ---------------------------------------------------------------- places

  range() { return { low: this.group.range.low / this.unit, high: this.group.range.high / this.unit }; }

  /** Plotting area in pixels of the canvas. */
  area() {
    const [left, top, right, bottom] = this.margins;
    return { left, top, right: this.canvas.clientWidth - right, bottom: this.canvas.clientHeight - bottom };
  }

  /** Function from values of the horizontal axis to pixels, for what is in view now. */
  across() {
    const { left, right } = this.area(), range = this.range();
    return (value) => left + shareOf(range, value, this.x.log) * (right - left);
  }

  toX(value) { return this.across()(value); }

  toValue(x) {
    const { left, right } = this.area();
    return valueOf(this.range(), Math.min(1, Math.max(0, (x - left) / (right - left))), this.x.log);
  }

  shown(item) { return !item.entry || !item.entry.hidden; }

  /** Range of the vertical axis: as in the SVG, or after zooming that of the values in view. */
  heights() {
    if (this.yRange) return this.yRange;
    if (this.y.bare || !this.group.zoomed()) return this.y;
    const { low, high } = this.range(), values = [];
    for (const item of this.items.filter((one) => this.shown(one))) {
      for (const p of item.points) if (p.time >= low && p.time <= high) values.push(p.low, p.high);
      if (item.kind === 'bar' && item.numbers[1] > low && item.numbers[0] < high) values.push(item.numbers[2], item.numbers[3]);
    }
    return rangeOf(values, this.y.log) || this.y;
  }

  // ---------------------------------------------------------------- pointer and keys

  point(x, y) {
    if (!this.scatter) {
      this.group.setCursor(this.toValue(x) * this.unit);
      return;
    }
    let nearest = Infinity;
    const toX = this.across(), toY = this.toHeight();
    this.dots.forEach((dot, k) => {
      const distance = Math.hypot(toX(dot.time) - x, toY(dot.low) - y);
      if (this.shown(dot.item) && distance < nearest) { nearest = distance; this.dot = k; }
    });
    this.touch();
  }

  /** Shows the part that was dragged over: of dots in no order the box, else its width. */
  choose({ x0, y0, x1, y1 }) {
    const from = this.toValue(Math.min(x0, x1)) * this.unit, to = this.toValue(Math.max(x0, x1)) * this.unit;
    this.part = null;
    if (this.scatter && !this.y.bare && Math.abs(y1 - y0) > 4) {
      const { top, bottom } = this.area(), heights = this.heights();
      const value = (y) => valueOf(heights, Math.min(1, Math.max(0, (bottom - y) / (bottom - top))), this.y.log);
      this.yRange = { low: value(Math.max(y0, y1)), high: value(Math.min(y0, y1)) };
    }
    this.group.setRange(from, to);
  }

  /** Places at which the arrow keys stop: centres of bars, or samples of the longest line. */
  stops() {
    const bars = this.y.bare ? [] : this.items.filter((item) => item.kind === 'bar').map((item) => (item.numbers[0] + item.numbers[1]) / 2);
    if (bars.length) return bars.sort((a, b) => a - b).map((time) => ({ time, low: 0, high: 0 }));
    let longest = [];
    for (const item of this.items) if (this.shown(item) && item.points.length > longest.length) longest = item.points;
    return longest;
  }

  /** Cursor `count` stops on, or without stops hundredths of what is in view. */
  step(count) {
    const stops = this.stops(), { low, high } = this.range(), cursor = this.group.cursor / this.unit;
    if (this.scatter) {
      const order = this.dots.map((_, k) => k).filter((k) => this.shown(this.dots[k].item)), at = order.indexOf(this.dot);
      if (order.length) this.dot = order[at < 0 ? 0 : Math.min(order.length - 1, Math.max(0, at + count))];
      this.touch();
    } else if (!Number.isFinite(cursor) || cursor < low || cursor > high) {
      const first = stops.find((stop) => stop.time >= low);
      this.group.setCursor((first ? first.time : low) * this.unit);
    } else if (stops.length) {
      const at = countUntil(stops, cursor) - 1;
      this.group.setCursor(stops[Math.min(stops.length - 1, Math.max(0, at + count))].time * this.unit);
    } else {
      this.group.setCursor(Math.min(this.x.high, Math.max(this.x.low, cursor + count * (high - low) / 100)) * this.unit);
    }
  }

  /** @param {KeyboardEvent} event */
  press(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const by = event.shiftKey ? 10 : 1, { low, high } = this.group.range, keys = {
      ArrowRight: () => this.step(by), ArrowUp: () => this.step(by), ArrowLeft: () => this.step(-by), ArrowDown: () => this.step(-by),
      PageUp: () => this.step(10), PageDown: () => this.step(-10), Home: () => this.group.setCursor(low), End: () => this.group.setCursor(high),
      '+': () => this.group.zoom(0.5, this.group.cursor), '=': () => this.group.zoom(0.5, this.group.cursor), '-': () => this.group.zoom(2, this.group.cursor),
      0: () => this.group.reset(), Escape: () => this.group.reset(),
    };
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  }

  // ---------------------------------------------------------------- values at the cursor

  /** Texts of what is at the cursor; values of entries of the legend go there, too. */
  read() {
    const at = this.group.cursor / this.unit, words = [], spoken = [];
    if (this.scatter ? this.dot < 0 : !Number.isFinite(at)) return { words, spoken };
    if (this.scatter) {
      const dot = this.dots[this.dot], own = this.items.find((item) => item.kind === 'whiskers' && item.number === dot.item.number);
      const span = own && own.points.find((p) => p.time === dot.time && p.low <= dot.low && p.high >= dot.low);
      words.push(`${this.x.name} ${this.nameAt(dot.time) || withUnit(shortNumber(dot.time, DIGITS), this.x.unit)}`,
        withUnit(`${this.y.name} ${spanText(dot)}`, this.y.unit) + (span ? ` (${spanText(span)})` : ''));
      if (dot.item.entry) words.push(dot.item.entry.name);
      return { words, spoken: words };
    }
    const hasBars = this.items.some((item) => item.kind === 'bar'), time = shortNumber(at, DIGITS + 1), bars = this.items.filter((item) => item.kind === 'bar' && item.numbers[0] <= at && item.numbers[1] >= at && this.shown(item));
    for (const { numbers: [from, to, , top] } of hasBars && !this.y.bare ? bars : []) {
      words.push(`${shortNumber(from, DIGITS - 1)} to ${withUnit(shortNumber(to, DIGITS - 1), this.x.unit)}: ${withUnit(`${shortNumber(top, DIGITS)} ${this.y.name}`, this.y.unit)}`);
    }
    if (words.length === 0) words.push(this.svg.dataset.unitS ? withUnit(time, this.x.unit) : this.x.label ? withUnit(`${this.x.name} ${time}`, this.x.unit) : time);
    for (const item of this.items) {
      const band = item.kind === 'bands' ? item.numbers.findIndex((from, k) => from <= at && at < item.ends[k]) : -1;
      if (band >= 0 && item.title) words.push(item.title);
      if ((item.kind !== 'line' && item.kind !== 'dots') || !this.shown(item)) continue;
      const point = nearestPoint(item.points, at), value = point && Number.isFinite(point.low) ? spanText(point) : '–';
      if (!item.entry) words.push(withUnit(`${hasBars ? 'curve' : this.y.name} ${value}`, this.y.unit));
      else if (item.entry.value.textContent === '') {
        item.entry.value.textContent = value;
        spoken.push(withUnit(`${item.entry.name} ${value}`, this.y.unit));
      }
    }
    if (this.y.bare) words.push(...bars.filter(({ title, entry }) => title || entry).map(({ title, entry }) => title || entry.name));
    return { words, spoken: [...words, ...spoken] };
  }

  /** Word below a place of an axis that has words for numbers. */
  nameAt(value) {
    const word = this.x.bare && this.items.find((item) => item.kind === 'word' && item.numbers[0] === value);
    return word ? word.text : '';
  }

  describe() {
    for (const entry of this.entries) entry.value.textContent = '';
    const { words, spoken } = this.read(), at = this.scatter ? (this.dots[this.dot] || {}).time : this.group.cursor / this.unit;
    this.words.textContent = words.join(' · ');
    this.words.dir = 'auto';
    this.all.hidden = !this.group.zoomed() && !this.yRange;
    this.canvas.setAttribute('aria-valuenow', String(Number.isFinite(at) ? at : this.x.low));
    this.canvas.setAttribute('aria-valuetext', spoken.join(', ') || 'no value chosen');
  }

  // ---------------------------------------------------------------- drawing

  /** Draws with the next picture of the screen, if the chart is in view. */
  touch() {
    if (this.dirty) return;
    this.dirty = true;
    if (this.visible) requestAnimationFrame(() => this.draw());
  }

  toHeight() {
    const { top, bottom } = this.area(), heights = this.heights(); // once: `heights` looks at all values
    return (value) => bottom - Math.min(3, Math.max(-2, shareOf(heights, value, this.y.log))) * (bottom - top);
  }

  draw() {
    if (!this.dirty || !this.visible) return;
    this.dirty = false;
    this.describe();
    const { context } = prepare(this.canvas), { left, top, right, bottom } = this.area(), toX = this.across(), toY = this.toHeight();
    const style = getComputedStyle(this.svg), ink = style.getPropertyValue('--ink').trim(), area = { left, top, right, bottom };
    this.colour(ink);
    context.font = FONT;
    this.drawAxes(context, area, toX, toY, ink, style.getPropertyValue('--grid').trim());
    context.save();
    context.beginPath(); context.rect(left, top, right - left, bottom - top); context.clip();
    for (const item of this.items) if (item.kind !== 'word' && this.shown(item)) this.drawItem(context, item, area, toX, toY);
    this.drawRing(context, toX, toY, ink);
    const { x0, x1 } = this.part || { x0: NaN, x1: NaN };
    drawCursor(context, top, bottom, { x: this.scatter ? NaN : toX(this.group.cursor / this.unit), from: x0, to: x1, colour: ink });
    context.restore();
    for (const item of this.items) if (item.kind === 'word') this.drawWord(context, item, area, toX, toY, ink);
    context.strokeStyle = style.getPropertyValue('--line').trim();
    context.lineWidth = 1;
    context.strokeRect(Math.round(left) + 0.5, Math.round(top) + 0.5, Math.round(right - left), Math.round(bottom - top));
  }

  /** Colours of the shapes, as the style sheet has them; again where light became dark. @param {string} ink */
  colour(ink) {
    if (this.ink === ink) return;
    this.ink = ink;
    for (const item of this.items) item.colour = getComputedStyle(item.element).getPropertyValue('--c').trim() || ink;
  }

  /** Points of a series in view, and one beyond each end. @param {any[]} points */
  inView(points) {
    if (this.scatter || !this.group.zoomed()) return points;
    const { low, high } = this.range();
    return points.slice(Math.max(0, countUntil(points, low) - 1), countUntil(points, high) + 1);
  }

  drawAxes(context, { left, top, right, bottom }, toX, toY, ink, grid) {
    const x = this.range(), y = this.heights(), marks = (axis, range, count) => (axis.bare ? [] : axis.log ? decadesOf(Math.log10(range.low) - 1e-9, Math.log10(range.high) + 1e-9)
      : ticksOf(range.low, range.high, count));
    context.fillStyle = ink;
    context.strokeStyle = grid;
    context.lineWidth = 1;
    context.textAlign = 'center';
    context.textBaseline = 'alphabetic';
    const across = marks(this.x, x, Math.max(Math.min(7, (right - left) / 60), (right - left) / 85)), up = marks(this.y, y, (bottom - top) / 32);
    const acrossTexts = textsOf(across), upTexts = textsOf(up);
    across.forEach((tick, k) => {
      const at = Math.round(toX(tick)) + 0.5;
      context.beginPath(); context.moveTo(at, top); context.lineTo(at, bottom); context.stroke();
      context.fillText(acrossTexts[k], at, bottom + 16);
    });
    if (this.x.label) context.fillText(this.x.label, (left + right) / 2, bottom + 33);
    context.textAlign = 'right';
    up.forEach((tick, k) => {
      const at = Math.round(toY(tick)) + 0.5;
      context.beginPath(); context.moveTo(left, at); context.lineTo(right, at); context.stroke();
      context.fillText(upTexts[k], left - 6, at + 4);
    });
    if (!this.y.label) return;
    context.save();
    context.translate(14, (top + bottom) / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = 'center';
    context.fillText(this.y.label, 0, 0);
    context.restore();
  }

  drawItem(context, item, { left, top, right, bottom }, toX, toY) {
    const { kind, numbers } = item, points = this.inView(item.points);
    context.fillStyle = context.strokeStyle = item.colour;
    context.globalAlpha = ALPHA[kind] || 1;
    context.lineWidth = 1.4;
    if (kind === 'line') {
      drawLine(context, points, toX, toY, { colour: item.colour, log: this.y.log, dash: item.dashed ? [5, 4] : [], dots: false });
    } else if (kind === 'dots') {
      context.beginPath();
      for (const { time, low, high } of points) {
        if (!Number.isFinite(low)) continue;
        for (const value of low === high ? [low] : [low, high]) { context.moveTo(toX(time) + 1.8, toY(value)); context.arc(toX(time), toY(value), 1.8, 0, 2 * Math.PI); }
      }
      context.fill();
    } else if (kind === 'area') {
      const known = points.filter((p) => Number.isFinite(p.low) && Number.isFinite(p.high));
      context.beginPath();
      for (const p of known) context.lineTo(toX(p.time), toY(p.high));
      for (const p of known.reverse()) context.lineTo(toX(p.time), toY(p.low));
      context.fill();
    } else if (kind === 'whiskers') {
      context.beginPath();
      for (const p of points) {
        const x = toX(p.time), a = toY(p.low), b = toY(p.high);
        if (!Number.isFinite(p.low) || !Number.isFinite(p.high)) continue;
        context.moveTo(x, a); context.lineTo(x, b);
        for (const y of [a, b]) { context.moveTo(x - 3, y); context.lineTo(x + 3, y); }
      }
      context.stroke();
    } else if (kind === 'bands') {
      numbers.forEach((from, k) => { if (toX(item.ends[k]) > left && toX(from) < right) context.fillRect(toX(from), top, toX(item.ends[k]) - toX(from), bottom - top); });
    } else if (kind === 'bar') {
      const [x0, x1, y0, y1] = [toX(numbers[0]), toX(numbers[1]), toY(numbers[2]), toY(numbers[3])];
      context.fillRect(Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0));
    } else {
      context.setLineDash([2, 3]);
      context.beginPath();
      if (kind === 'rule') { context.moveTo(left, toY(numbers[0])); context.lineTo(right, toY(numbers[0])); } else { context.moveTo(toX(numbers[0]), top); context.lineTo(toX(numbers[0]), bottom); }
      context.stroke();
      context.setLineDash([]);
    }
    context.globalAlpha = 1;
  }

  /** Around the dot of the cursor, or the values of lines there. */
  drawRing(context, toX, toY, ink) {
    const ring = (time, value) => {
      context.strokeStyle = ink;
      context.lineWidth = 1.5;
      context.beginPath(); context.arc(toX(time), toY(value), 4.5, 0, 2 * Math.PI); context.stroke();
    };
    if (this.scatter) {
      if (this.dot >= 0) ring(this.dots[this.dot].time, this.dots[this.dot].low);
      return;
    }
    const at = this.group.cursor / this.unit;
    if (!Number.isFinite(at)) return;
    for (const { points } of this.items.filter((item) => item.kind === 'line' && this.shown(item))) {
      const point = nearestPoint(points, at);
      if (point && point.low === point.high && Number.isFinite(point.low)) ring(point.time, point.low);
    }
  }

  /** Words at the ends of an axis stay there; others move with their place. */
  drawWord(context, { numbers: [x, y, dx, dy], text, anchor }, { left, right, bottom }, toX, toY, ink) {
    const atX = x <= this.x.low ? left : toX(x), atY = y <= this.y.low ? bottom : toY(y);
    if (atX < left - 1 || atX > right + 1) return;
    context.fillStyle = ink;
    context.textAlign = anchor === 'middle' ? 'center' : anchor;
    context.fillText(text, atX + dx, atY + dy);
  }
}

/** Makes the charts of the page answer. */
function start() {
  /** @type {Map<string, number[]>} */
  const lists = new Map(), xOf = (text) => {
    if (!text || !text.startsWith('#')) return numbersOf(text);
    if (!lists.has(text)) lists.set(text, numbersOf(document.getElementById(text.slice(1)).dataset.x));
    return lists.get(text);
  };
  /** @type {Map<string, Group>} */
  const groups = new Map();
  const charts = /** @type {SVGElement[]} */ ([...document.querySelectorAll('svg.chart[data-x]')]).map((svg) => new Chart(svg, xOf));
  charts.forEach((chart, k) => {
    const low = chart.x.low * chart.unit, high = chart.x.high * chart.unit, name = chart.svg.dataset.unitS ? `${low} ${high}` : `chart ${k}`;
    if (!groups.has(name)) groups.set(name, new Group(low, high, chart.x.log));
    chart.group = groups.get(name);
    chart.group.charts.push(chart);
  });
  if (charts.length === 0) return;
  const note = document.createElement('p');
  note.className = 'note';
  note.textContent = 'Charts show values under the pointer, or with the arrow keys. Dragging over a part enlarges it, in all charts over time together; a double click or Escape shows all.';
  document.querySelector('h1').after(note);
  const known = new Map(charts.map((chart) => [chart.canvas, chart]));
  const watch = new IntersectionObserver((seen) => seen.forEach(({ target, isIntersecting }) => {
    const chart = known.get(/** @type {HTMLCanvasElement} */ (target));
    chart.visible = isIntersecting;
    chart.draw();
  }), { rootMargin: '200px' });
  const sizes = new ResizeObserver((changed) => changed.forEach(({ target }) => {
    const chart = known.get(/** @type {HTMLCanvasElement} */ (target));
    chart.touch();
    chart.draw();
  }));
  for (const chart of charts) {
    chart.dirty = true;
    watch.observe(chart.canvas);
    sizes.observe(chart.canvas);
  }
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => charts.forEach((chart) => chart.touch()));
  document.report = { charts }; // for tests of the page
}

if (typeof document !== 'undefined') start();
