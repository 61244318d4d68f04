// Two runs beside each other or one over the other: frames at the same time, plots, and the difference of their figures.
import { addStyle, getJson, getNumbers, getPixels, post } from './api.js';
import { drawLine, LINE_COLOURS, prepare, shortNumber, ticksOf } from './chart.js';
import { make } from './editor_form.js';
import { makePainter, originOf } from './frame_gl.js';
import { WHOLE_PX } from './frame_parts.js';
import { drawMarks, KINDS, sortMarks } from './marks.js';
import { readLines } from './plots.js';
import { describePixels, limitsOf } from './statistics.js';

const NUMBERS = 5;
const LEFT = 62, RIGHT = 10, TOP = 8, BOTTOM = 18;

/** Figures that are the machine's, not the run's: they differ between any two runs. */
const OF_MACHINE = new Set(['wall_time_s', 'real_time_factor']);

/** Numbers and texts of a summary with their paths, as the table has them. @param {any} node @returns {Map<string, number | string>} */
export function figuresOf(node, path = '', found = new Map()) {
  for (const [key, value] of Object.entries(node || {})) {
    const name = path ? `${path} / ${key}` : key;
    if (typeof value === 'number' || typeof value === 'string') found.set(name, value);
    else if (typeof value === 'boolean') found.set(name, Number(value));
    else if (value && typeof value === 'object') figuresOf(value, name, found);
  }
  return found;
}

/** Rows of both runs' figures: {name, a, b}; NaN: a run has none. */
export function differences(one, other) {
  const a = figuresOf(one), b = figuresOf(other);
  return [...new Set([...a.keys(), ...b.keys()])].map((name) => ({ name, a: a.get(name) ?? NaN, b: b.get(name) ?? NaN }));
}

/** Cells of a row of the table: a, b, their difference; and whether it is emphasised. */
export function rowOf({ name, a, b }) {
  const isText = typeof a === 'string' || typeof b === 'string', equal = Object.is(a, b);
  const text = (value) => (typeof value === 'string' ? value : shortNumber(value));
  return { cells: [text(a), text(b), isText ? (equal ? '' : 'differs') : shortNumber(b - a)], differs: !equal && !OF_MACHINE.has(name.split(' / ').pop()) };
}

const nameOfSensor = ({ observer, name }) => `${observer || ''}/${name || ''}`;

/** The sensor of a run that is compared with another run's: that with the same name, or else that with the same number, or the last.
 * @param {any} sensor @param {any[]} sensors of the other run @param {number} number @returns {{number: number, same: boolean}} number -1: there are none */
export function matchSensor(sensor, sensors, number) {
  const found = sensors.findIndex((one) => nameOfSensor(one) === nameOfSensor(sensor));
  return found >= 0 ? { number: found, same: true } : { number: Math.min(number, sensors.length - 1), same: false };
}

/** Index of the frame whose middle is nearest to a time; -1: there are none. @param {Float64Array} frames */
export function nearestFrame(frames, time) {
  const count = frames.length / NUMBERS;
  let low = 0, high = count - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (frames[NUMBERS * middle + 1] < time) low = middle + 1; else high = middle;
  }
  if (low > 0 && time - frames[NUMBERS * (low - 1) + 1] < frames[NUMBERS * low + 1] - time) low--;
  return count ? low : -1;
}

/** Names that differ: base names of folders, or the whole paths where these are equal. */
function shortName(path) { return path.replace(/\/+$/, '').split('/').pop() || path; }

/** A frame of one of the runs. */
class Side {
  constructor(letter) {
    this.canvas = make('canvas');
    this.overlay = make('canvas');
    this.caption = make('figcaption', { dir: 'auto' });
    this.stage = make('div', { className: 'compare-stage' }, this.canvas, this.overlay);
    this.box = make('figure', { className: 'compare-side' }, this.caption, this.stage);
    this.overlay.setAttribute('role', 'img');
    this.overlay.setAttribute('aria-label', `Frame of run ${letter}`);
    this.canvas.setAttribute('aria-hidden', 'true');
    this.letter = letter;
    this.painter = makePainter(this.canvas, true);
    this.image = this.details = this.limits = null;
    this.run = this.sensor = -1;
    this.soft = 0;
  }

  /** Shows nothing. @param {string} text */
  clear(text) {
    this.image = this.details = this.limits = null;
    this.caption.textContent = `${this.letter}  ${text}`;
    this.overlay.setAttribute('aria-label', `Frame of run ${this.letter}, ${text}`);
  }

  /** @param {{run: number, name: string, sensor: number, sensorName: string, target: number, frames: Float64Array, names: any}} source @param {number} frame -1: none */
  async load({ run, name, sensor, sensorName, target, frames, names }, frame) {
    if (this.run !== run || this.sensor !== sensor) this.limits = null;
    [this.run, this.sensor] = [run, sensor];
    this.image = this.details = null;
    if (frame >= 0) {
      const kept = frames[NUMBERS * frame + 3] >= 0;
      [this.image, this.details] = await Promise.all([kept ? getPixels(sensor, frame, undefined, run, { longest: WHOLE_PX }) : null, getJson('frame', { sensor, frame, run })]);
      Object.assign(this.details, { names, target });
    }
    if (this.image && !this.limits) {
      const statistics = describePixels(this.image.data);
      this.limits = limitsOf('asinh', this.image.data, statistics);
      this.soft = 3 * statistics.sigma;
    }
    const text = frame >= 0 ? `${name}, ${sensorName}: frame ${frame + 1}, ${frames[NUMBERS * frame + 1].toFixed(2)} s` : `${name}, ${sensorName}: no frames`;
    this.caption.textContent = `${this.letter}  ${text}`;
    this.overlay.setAttribute('aria-label', `Frame of run ${this.letter}, ${text}`);
  }

  /** @param {{black: number, white: number} | null} limits of both runs */
  draw(limits, soft) {
    const ratio = devicePixelRatio || 1, whole = (side) => Math.max(1, Math.round(side * ratio)) / ratio; // pixels of the screen
    const width = whole(this.stage.clientWidth), height = whole(this.stage.clientHeight);
    for (const canvas of [this.canvas, this.overlay]) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
      Object.assign(canvas.style, { width: `${width}px`, height: `${height}px` });
    }
    const { image, details } = this, context = this.overlay.getContext('2d');
    const n = (image && image.binning) || 1, frame = image ? { width: image.frameWidth || image.width, height: image.frameHeight || image.height } : { width: 1024, height: 1024 }, scale = Math.min(width / frame.width, height / frame.height);
    const originX = originOf(this.canvas.width, frame.width / 2 / n - 0.5, scale * ratio * n), originY = originOf(this.canvas.height, frame.height / 2 / n - 0.5, scale * ratio * n);
    this.painter.draw(image, { originX, originY, scale: scale * ratio * n, black: limits ? limits.black : 0,
      white: limits ? limits.white : 65535, soft, invert: false });
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (!details) return;
    const toScreen = (x, y) => ({ x: originX / ratio + (x + 0.5) * scale, y: originY / ratio + (y + 0.5) * scale });
    drawMarks(context, sortMarks(details), details.wcs, { toScreen, scale, width, height, shown: Object.fromEntries(KINDS.map((kind) => [kind.name, kind.shown])) });
  }
}

export class Comparison {
  constructor(box, app) {
    this.app = app;
    this.turn = 0; // number of the newest choice: answers to earlier ones are dropped
    this.asked = -1; // sensor of the page at that choice
    this.b = null; // what is compared: {run, own, described, names, sensor, frames}; own: sensor of the page
    this.shown = false;
    this.sides = [new Side('A'), new Side('B')];
    this.choice = make('select');
    this.how = make('select', {}, ...[['beside', 'side by side'], ['over', 'one over the other']].map(([value, text]) => make('option', { value, textContent: text })));
    this.blend = make('input', { type: 'range', min: '0', max: '1', step: '0.05', value: '0.5' });
    this.blendLabel = make('label', { className: 'inline', hidden: true }, 'A ', this.blend, ' B');
    this.message = make('output', { className: 'hint' });
    this.message.setAttribute('role', 'status');
    this.stages = make('div', { className: 'compare-frames' }, ...this.sides.map((side) => side.box));
    this.table = make('table', { className: 'study-table' });
    this.plots = make('div', { className: 'compare-plots' });
    const region = (title, ...children) => {
      const one = make('section', { className: 'compare-part', tabIndex: 0 }, ...children);
      one.setAttribute('aria-label', title);
      return one;
    };
    box.append(make('div', { className: 'bar' }, make('label', { className: 'inline' }, 'Compare with ', this.choice), make('label', { className: 'inline' }, 'Frames ', this.how), this.blendLabel, this.message),
      this.stages, make('div', { className: 'compare-lower' }, region('Plots of both runs', this.plots), region('Figures of both runs', this.table)));
    this.choice.addEventListener('change', () => this.choose());
    this.how.addEventListener('change', () => this.arrange());
    this.blend.addEventListener('input', () => this.arrange());
    document.addEventListener('frameshown', () => this.follow());
    document.addEventListener('themechanged', () => this.drawPlots());
    new ResizeObserver(() => this.draw()).observe(this.stages);
  }

  async list() {
    const { open, runs } = await getJson('runs'), own = Number(new URLSearchParams(location.search).get('run') || 0);
    const listed = new Set(open.map((run) => run.name.replace(/\/+$/, '')));
    const values = [...open.filter((run) => run.number !== own).map((run) => [String(run.number), run.name]),
      ...runs.filter((name) => !listed.has(`runs/${name}`)).map((name) => [`runs/${name}`, `runs/${name}`])];
    values.push(...(await this.ofStudy(new Set(open.map((run) => run.number !== own && shortName(run.name))))));
    this.choice.replaceChildren(...values.map(([value, textContent]) => make('option', { value, textContent })));
    if (values.length) await this.choose();
    else this.message.textContent = 'There is no other run: give two folders, or keep runs in runs/.';
  }

  /** Runs of the study that are not open yet. @param {Set<string>} open their names */
  async ofStudy(open) {
    if (!this.app.ofStudy) return [];
    const { runs } = await getJson('study'), own = shortName(this.app.run.name);
    const nameOf = (run) => String(run.run).padStart(6, '0');
    return runs.filter((run) => run.folder && nameOf(run) !== own && !open.has(nameOf(run))).map((run) => [`study/${run.run}`, `run ${run.run} of the study`]);
  }

  /** Number of the run that the list names; opens it if it is not open. @param {string} value */
  async openRun(value) {
    if (value.startsWith('study/')) return (await post('study/open', JSON.stringify({ number: Number(value.slice(6)) }))).run;
    if (value.startsWith('runs/')) return (await post('open', JSON.stringify({ run: value.slice(5) }))).run;
    return Number(value);
  }

  /** Compares with the run of the list. Of choices in quick succession only the last one is shown. */
  async choose() {
    const turn = ++this.turn, { app } = this, own = this.asked = app.sensor;
    try {
      if (!app.run.sensors[own]) throw new Error('the run of this page has no sensors');
      const run = await this.openRun(this.choice.value), [described, { names }] = await Promise.all([getJson('run', { run }), getJson('names', { run })]);
      const { number: sensor, same } = matchSensor(app.run.sensors[own], described.sensors, own);
      if (sensor < 0) throw new Error('it has no sensors');
      const frames = await getNumbers('frames', { sensor, run });
      if (turn !== this.turn) return;
      this.b = { run, own, described, names, sensor, frames };
      this.message.textContent = same ? '' : `B has no sensor ${nameOfSensor(app.run.sensors[own])}: its sensor ${nameOfSensor(described.sensors[sensor])} is shown.`;
      this.fillTable();
      await Promise.all([this.follow(), this.loadPlots(turn)]);
    } catch (error) {
      if (turn !== this.turn) return;
      this.b = null;
      this.panels = [];
      this.table.replaceChildren();
      this.plots.replaceChildren();
      this.sides[1].clear('no run');
      this.draw();
      this.message.textContent = `This run cannot be compared: ${error.message}`;
    }
  }

  // ---------------------------------------------------------------- frames

  /** What a side shows. @param {number} run @param {any} described @param {number} sensor @param {Float64Array} frames @param {any} names */
  static source(run, described, sensor, frames, names) {
    const target = Number((Object.entries(names).find(([, name]) => name === described.sensors[sensor].target) || [-1])[0]);
    return { run, name: described.name, sensor, sensorName: nameOfSensor(described.sensors[sensor]), target, frames, names };
  }

  /** Shows the frames at the time of the page's frame. */
  async follow() {
    const { app } = this;
    if (!this.shown || app.current < 0) return;
    if (this.turn > 0 && this.asked !== app.sensor) { // the page shows another sensor now
      await this.choose();
      return;
    }
    if (!this.b || this.busy) return;
    this.busy = true;
    const own = Number(new URLSearchParams(location.search).get('run') || 0);
    try {
      for (let at = -1, b = null; this.b && app.current >= 0 && (at !== app.current || b !== this.b);) { // page or choice may have gone on meanwhile
        at = app.current;
        b = this.b;
        if (b.own !== app.sensor) break; // the choice for the new sensor is on its way, and calls again
        await Promise.all([
          this.sides[0].load(Comparison.source(own, app.run, app.sensor, app.frames, app.names), at),
          this.sides[1].load(Comparison.source(b.run, b.described, b.sensor, b.frames, b.names), nearestFrame(b.frames, app.timeOf(at))),
        ]);
        if (!this.b) this.sides[1].clear('no run'); // a choice failed meanwhile
        this.draw();
        this.drawPlots();
      }
    } catch (error) {
      this.message.textContent = error.message;
    } finally {
      this.busy = false;
    }
  }

  arrange() {
    const over = this.how.value === 'over';
    this.stages.classList.toggle('over', over);
    this.blendLabel.hidden = !over;
    this.sides[1].stage.style.opacity = over ? this.blend.value : '1';
    this.draw();
  }

  /** Both have the stretch of the first, so that they can be compared. */
  draw() {
    const first = this.sides.find((side) => side.limits);
    for (const side of this.sides) side.draw(first ? first.limits : null, first ? first.soft : 0);
  }

  // ---------------------------------------------------------------- figures

  fillTable() {
    const summaries = [this.app.run, this.b.described].map(({ manifest }) => ({ ...manifest.summary, warnings: manifest.warnings, wall_time_s: manifest.wall_time_s }));
    const rows = differences(...summaries).map((figure) => {
      const { cells, differs } = rowOf(figure);
      const row = make('tr', { className: differs ? 'differs' : '' }, make('th', { scope: 'row', dir: 'auto', textContent: figure.name.replace(/_/g, ' ') }));
      for (const textContent of cells) row.append(make('td', { dir: 'auto', textContent }));
      return row;
    });
    const caption = make('caption', { className: 'hint', textContent: 'Figures of the runs\' summaries: of the whole runs, whatever sensor is shown.' });
    const head = make('tr', {}, ...['Figure', `A ${shortName(this.app.run.name)}`, `B ${shortName(this.b.described.name)}`, 'B − A'].map((textContent) => make('th', { scope: 'col', dir: 'auto', textContent })));
    this.table.replaceChildren(caption, make('thead', {}, head), make('tbody', {}, ...rows));
  }

  // ---------------------------------------------------------------- plots

  async loadPlots(turn) {
    const { app, b } = this, own = app.run.sensors[b.own].panels, others = b.described.sensors[b.sensor].panels;
    const end = (frames) => (frames.length ? frames[frames.length - NUMBERS + 1] : 1);
    const range = { from: 0, to: Math.max(end(app.frames), end(b.frames)), columns: 600 }, panels = [];
    for (const info of own.filter((panel) => others.some((other) => other.name === panel.name))) {
      const ask = async (sensor, run) => readLines(await getNumbers('plot', { sensor, panel: info.name, ...range, ...(run >= 0 ? { run } : {}) }), info.lines.length);
      const [a, c] = await Promise.all([ask(b.own, -1), ask(b.sensor, b.run)]), canvas = make('canvas');
      if (turn !== this.turn) return;
      canvas.setAttribute('role', 'img');
      canvas.setAttribute('aria-label', `${info.title}: run A as full lines, run B as broken ones`);
      panels.push({ info, lines: [a, c], canvas });
    }
    this.range = range;
    this.panels = panels;
    const swatch = (k, more) => make('i', { className: `swatch swatch-${k % LINE_COLOURS} ${more}` });
    this.plots.replaceChildren(...panels.map(({ info, canvas }) => {
      const title = make('h2', { textContent: info.title + (info.unit ? ` [${info.unit}]` : '') });
      const key = make('span', { className: 'hint compare-key' }, ...info.lines.map((name, k) => make('span', {}, `${name}: A `, swatch(k, ''), ' B ', swatch(k, 'broken'))));
      title.append(key);
      return make('div', { className: 'compare-plot' }, title, canvas);
    }));
    this.drawPlots();
  }

  drawPlots() {
    for (const panel of this.panels || []) this.drawPlot(panel);
  }

  drawPlot({ info, lines, canvas }) {
    const { context, width, height } = prepare(canvas), style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(name).trim();
    const log = info.name === 'pointing_error', scaled = (value) => (log ? Math.log10(Math.max(value, 1e-6)) : value);
    const all = lines.flat(2).filter((point) => Number.isFinite(point.low) && (!log || point.low > 0));
    if (all.length === 0) return;
    let low = Infinity, high = -Infinity;
    for (const point of all) {
      low = Math.min(low, scaled(point.low));
      high = Math.max(high, scaled(point.high));
    }
    const pad = 0.06 * (high - low) || 1, { from, to } = this.range;
    const toX = (time) => LEFT + (time - from) / (to - from) * (width - LEFT - RIGHT);
    const toY = (value) => height - BOTTOM - (scaled(value) - low + pad) / (high - low + 2 * pad) * (height - TOP - BOTTOM);
    context.font = '11px system-ui, sans-serif';
    context.fillStyle = colour('--faint');
    context.strokeStyle = colour('--grid');
    context.textAlign = 'right';
    for (const tick of ticksOf(low - pad, high + pad, 3)) {
      const value = log ? 10 ** tick : tick, y = Math.round(toY(value)) + 0.5;
      context.beginPath(); context.moveTo(LEFT, y); context.lineTo(width - RIGHT, y); context.stroke();
      context.fillText(shortNumber(value), LEFT - 6, y + 4);
    }
    context.textAlign = 'center';
    for (const tick of ticksOf(from, to, Math.max(2, width / 110))) context.fillText(shortNumber(tick), toX(tick), height - 4);
    lines.forEach((own, side) => own.forEach((points, k) => drawLine(context, points, toX, toY, { colour: colour(`--line-${k % LINE_COLOURS}`), log, dash: side ? [5, 4] : [], dots: false })));
    const x = Math.round(toX(this.app.timeOf(Math.max(0, this.app.current)))) + 0.5;
    context.strokeStyle = colour('--cursor');
    context.lineWidth = 1;
    context.beginPath(); context.moveTo(x, 0); context.lineTo(x, height - BOTTOM); context.stroke();
  }
}

/** Opens the panel. @param {HTMLElement} box @param {any} app */
export async function open(box, app) {
  await addStyle('compare.css');
  box.classList.add('compare');
  const comparison = new Comparison(box, app);
  document.comparison = comparison; // for tests of the page
  return {
    async shown() {
      comparison.shown = true;
      if (comparison.turn === 0) await comparison.list();
      else await comparison.follow();
    },
    hidden() { comparison.shown = false; },
  };
}
