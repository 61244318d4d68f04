// The runs of a study: a table of parameters and figures, and a plot of a figure over a parameter. A click opens a run.
import { addStyle, getJson, post } from './api.js';
import { shortNumber, ticksOf } from './chart.js';
import { make } from './editor_form.js';

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);
const LEFT = 64, RIGHT = 16, TOP = 12, BOTTOM = 40;
/** Figures that the table begins with. */
const FIGURES_SHOWN = 6;

/** Name of a column for people: its unit stands beside it. */
const titleOf = ({ name, unit }) => (unit && name.endsWith(`_${unit}`) ? name.slice(0, -unit.length - 1) : name).replace(/_/g, ' ');
const textOf = (cell) => (cell === null || cell === undefined ? '–' : typeof cell === 'number' ? shortNumber(cell) : String(cell));

/** Numbers or, of texts, their places in the alphabet. @param {any[]} values */
export function placesOf(values) {
  if (values.every((value) => value === null || typeof value === 'number')) return { places: values, names: null };
  const names = [...new Set(values.filter((value) => value !== null).map(String))].sort();
  return { places: values.map((value) => (value === null ? null : names.indexOf(String(value)))), names };
}

/** Means of y at each x, in the order of x. @param {(number | null)[]} x @param {(number | null)[]} y */
export function meansOf(x, y) {
  const sums = new Map();
  x.forEach((at, k) => {
    if (at === null || y[k] === null) return;
    const sum = sums.get(at) || { x: at, sum: 0, count: 0 };
    sum.sum += y[k];
    sum.count++;
    sums.set(at, sum);
  });
  return [...sums.values()].sort((a, b) => a.x - b.x).map((one) => ({ x: one.x, y: one.sum / one.count, count: one.count }));
}

/** Rows in the order of a column: numbers before texts, empty ones last. @param {any[]} runs */
export function sorted(runs, column, down) {
  const rank = (value) => (value === null ? 2 : typeof value === 'number' ? 0 : 1);
  return runs.slice().sort((one, other) => {
    const a = one.cells[column], b = other.cells[column];
    if (rank(a) !== rank(b)) return rank(a) - rank(b);
    const order = a === null ? 0 : typeof a === 'number' ? a - b : a.localeCompare(b);
    return (down ? -order : order) || one.run - other.run;
  });
}

class Study {
  /** @param {HTMLElement} box @param {any} study */
  constructor(box, study) {
    this.study = study;
    this.column = 0;
    this.down = false;
    const of = (role) => study.columns.map((column, index) => ({ ...column, index })).filter((column) => column.role === role);
    this.parameters = of('parameter');
    // figures that differ between runs first
    const differs = (index) => new Set(study.runs.map((run) => run.cells[index])).size > 1;
    const figures = of('figure').filter(({ index }) => study.runs.some((run) => run.cells[index] !== null));
    this.figures = [...figures.filter(({ index }) => differs(index)), ...figures.filter(({ index }) => !differs(index))];
    this.all = false;
    this.build(box);
    this.draw();
    this.fill();
  }

  build(box) {
    const { study } = this, select = (label, columns) => {
      const choice = make('select', {}, ...columns.map((column) => make('option', { value: String(column.index), textContent: titleOf(column) })));
      choice.addEventListener('change', () => this.draw());
      return [make('label', { className: 'inline' }, `${label} `, choice), choice];
    };
    const run = { name: 'run', index: 0, role: '', unit: '', doc: '' };
    const [figureLabel, figure] = select('Figure', this.figures), [overLabel, over] = select('over', [...this.parameters, run]);
    const pointing = this.figures.find((column) => column.name === 'pointing_rms_px');
    if (pointing) figure.value = String(pointing.index);
    this.figure = figure;
    this.over = over;
    this.plot = make('div', { className: 'study-plot' });
    const all = make('button', { type: 'button', textContent: 'All figures' });
    all.setAttribute('aria-pressed', 'false');
    all.addEventListener('click', () => {
      this.all = !this.all;
      all.setAttribute('aria-pressed', String(this.all));
      this.fill();
    });
    this.table = make('table', { className: 'study-table' });
    const frame = make('div', { className: 'study-frame', tabIndex: 0 }, this.table);
    frame.setAttribute('role', 'region');
    frame.setAttribute('aria-label', 'Table of the runs');
    this.doc = make('p', { className: 'hint', dir: 'auto' });
    const total = study.total > study.runs.length ? `the first ${study.runs.length} of ${study.total} runs` : `${study.total} runs`;
    box.replaceChildren(make('h2', { dir: 'auto', textContent: `Study ${study.name || ''}: ${total}` }),
      make('div', { className: 'bar' }, figureLabel, overLabel), this.doc, this.plot, make('div', { className: 'bar' }, make('h2', { textContent: 'Runs' }), all), frame);
    box.classList.add('study');
    new ResizeObserver(() => this.draw()).observe(this.plot);
  }

  async open(run) {
    try {
      const { run: number } = await post('study/open', JSON.stringify({ number: run.run }));
      location.search = `?run=${number}`;
    } catch (error) {
      element('problems').hidden = false;
      element('problems').textContent = `Run ${run.run}: ${error.message}`;
    }
  }

  // ---------------------------------------------------------------- table

  shownColumns() {
    const named = this.study.columns.map((column, index) => ({ ...column, index }));
    const own = named.filter((column) => ['run', 'status'].includes(column.name));
    return [...own, ...this.parameters, ...(this.all ? this.figures : this.figures.slice(0, FIGURES_SHOWN))];
  }

  fill() {
    const columns = this.shownColumns(), head = make('tr');
    for (const column of columns) {
      const order = make('button', { type: 'button', title: column.doc, textContent: titleOf(column) + (column.unit ? ` [${column.unit}]` : '') });
      const cell = make('th', { scope: 'col' }, order);
      cell.setAttribute('aria-sort', column.index !== this.column ? 'none' : this.down ? 'descending' : 'ascending');
      order.addEventListener('click', () => {
        this.down = column.index === this.column && !this.down;
        this.column = column.index;
        this.fill();
      });
      head.append(cell);
    }
    const rows = sorted(this.study.runs, this.column, this.down).map((run) => make('tr', {}, ...columns.map((column, k) => {
      const text = textOf(run.cells[column.index]);
      if (k > 0) return make('td', { dir: 'auto', textContent: text });
      const link = make('button', { type: 'button', textContent: text, disabled: !run.folder, title: run.folder ? '' : 'Its folder was not kept.' });
      link.setAttribute('aria-label', `Open run ${text}`);
      link.addEventListener('click', () => this.open(run));
      return make('td', {}, link);
    })));
    this.table.replaceChildren(make('thead', {}, head), make('tbody', {}, ...rows));
  }

  // ---------------------------------------------------------------- plot

  draw() {
    const { study } = this, x = Number(this.over.value), y = Number(this.figure.value), column = study.columns[y];
    if (!column || this.figures.length === 0) {
      this.plot.textContent = 'This study has no figures yet.';
      return;
    }
    this.doc.textContent = `${column.doc} Points are runs, the line joins their means.`;
    const width = Math.max(300, this.plot.clientWidth), height = 250, name = 'http://www.w3.org/2000/svg';
    const svg = document.createElementNS(name, 'svg'), add = (kind, attributes, text = '') => {
      const one = document.createElementNS(name, kind);
      for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, String(value));
      one.textContent = text;
      svg.append(one);
      return one;
    };
    const { places, names } = placesOf(study.runs.map((run) => run.cells[x])), values = study.runs.map((run) => (typeof run.cells[y] === 'number' ? run.cells[y] : null));
    const spread = (list) => {
      const known = list.filter((value) => value !== null), low = Math.min(...known), high = Math.max(...known), pad = 0.06 * (high - low) || Math.abs(high) * 0.1 || 1;
      return { low: low - pad, high: high + pad };
    };
    if (!values.some((value) => value !== null)) {
      this.plot.textContent = 'No run has this figure.';
      return;
    }
    const ofX = spread(places), ofY = spread(values);
    const toX = (value) => LEFT + (value - ofX.low) / (ofX.high - ofX.low) * (width - LEFT - RIGHT);
    const toY = (value) => height - BOTTOM - (value - ofY.low) / (ofY.high - ofY.low) * (height - TOP - BOTTOM);
    for (const tick of ticksOf(ofY.low, ofY.high, 5)) {
      add('line', { x1: LEFT, x2: width - RIGHT, y1: toY(tick), y2: toY(tick), class: 'grid' });
      add('text', { x: LEFT - 6, y: toY(tick) + 4, 'text-anchor': 'end' }, shortNumber(tick));
    }
    const ticks = names ? names.map((_, k) => k) : ticksOf(ofX.low, ofX.high, width / 110);
    for (const tick of ticks) add('text', { x: toX(tick), y: height - BOTTOM + 16, 'text-anchor': 'middle' }, names ? names[tick].slice(0, 24) : shortNumber(tick));
    add('text', { x: (LEFT + width) / 2, y: height - 6, 'text-anchor': 'middle' }, titleOf(study.columns[x]));
    if (!names) {
      const means = meansOf(places, values);
      add('polyline', { points: means.map((one) => `${toX(one.x)},${toY(one.y)}`).join(' '), class: 'means' });
    }
    study.runs.forEach((run, k) => {
      if (places[k] === null || values[k] === null) return;
      const point = add('circle', { cx: toX(places[k]), cy: toY(values[k]), r: 4.5, class: run.folder ? 'point open' : 'point' });
      const title = document.createElementNS(name, 'title');
      title.textContent = `run ${run.run}: ${titleOf(column)} ${shortNumber(values[k])}`;
      point.append(title);
      if (run.folder) point.addEventListener('click', () => this.open(run));
    });
    svg.setAttribute('role', 'img');
    svg.setAttribute('width', String(width));
    svg.setAttribute('height', String(height));
    svg.setAttribute('aria-label', `${titleOf(column)} over ${titleOf(study.columns[x])} of ${study.runs.length} runs; the table below has the numbers`);
    this.plot.replaceChildren(svg);
  }
}

/** Shows the study in the place of the start page. */
export async function showStudy() {
  await addStyle('compare.css');
  const study = await getJson('study'), box = element('start');
  for (const part of [element('main'), document.querySelector('footer'), document.querySelector('.run')]) part.hidden = true;
  document.title = `${study.name || 'Study'} – Boresight`;
  box.hidden = false;
  document.boresight.panels.withoutRun(box, 'Study');
  document.study = new Study(box, study); // for tests of the page
  document.dispatchEvent(new CustomEvent('studyshown'));
}
