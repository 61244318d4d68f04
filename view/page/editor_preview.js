// Pictures of what a scenario's numbers mean: the field with its stars, and the target's SNR over a day.
import { make } from './editor_form.js';
import { shortNumber, ticksOf } from './chart.js';

const SVG = 'http://www.w3.org/2000/svg';
/** SNR of the limiting magnitude (sim/analysis/check/check_figures.h). */
const LIMIT_SNR = 5;
/** Radius of the brightest and the faintest star, px. */
const BRIGHT_PX = 5, FAINT_PX = 0.8;

function svg(width, height, label) {
  const root = document.createElementNS(SVG, 'svg');
  for (const [key, value] of Object.entries({ width, height, viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': label })) root.setAttribute(key, String(value));
  const add = (kind, attributes, text = '') => {
    const one = document.createElementNS(SVG, kind);
    for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, String(value));
    one.textContent = text;
    root.append(one);
    return one;
  };
  return { root, add };
}

/** Scale of the field: px of the picture for a degree, and the sides of the field in it. @param {number[]} field deg @param {number} side px */
export function fieldScale(field, side) {
  const scale = side / Math.hypot(field[0], field[1]);
  return { scale, width: field[0] * scale, height: field[1] * scale };
}

/** Radius of a star, px. @param {number} v its magnitude @param {number} brightest @param {number} faintest */
export const starRadius = (v, brightest, faintest) => FAINT_PX + (BRIGHT_PX - FAINT_PX) * (faintest - v) / Math.max(1, faintest - brightest);

/** The field at the epoch, north up, with the target in its middle. @param {any} sensor of the figures */
function skyPicture(sensor) {
  const { sky } = sensor, side = 230, { scale, width, height } = fieldScale(sensor.field_deg, side - 14);
  const text = `${sky.stars.length < sky.total ? `The brightest ${sky.stars.length} of ${sky.total} catalogue stars` : `${sky.total} catalogue stars`} down to V ${sky.v_limit.toFixed(1)}`;
  const { root, add } = svg(side, side, `Field at the epoch: ${text}`), middle = side / 2;
  add('rect', { x: 0, y: 0, width: side, height: side, class: 'preview-sky' });
  const magnitudes = sky.stars.map((star) => star[2]), brightest = Math.min(...magnitudes), faintest = Math.max(...magnitudes);
  for (const [east, north, v] of sky.stars) {
    const x = middle - east * scale, y = middle - north * scale;
    if (x > 0 && y > 0 && x < side && y < side) add('circle', { cx: x.toFixed(1), cy: y.toFixed(1), r: starRadius(v, brightest, faintest).toFixed(1), class: 'preview-star' });
  }
  add('rect', { x: middle - width / 2, y: middle - height / 2, width, height, class: 'preview-field' });
  add('path', { d: `M${middle - 9} ${middle}h6m6 0h6M${middle} ${middle - 9}v6m0 6v6`, class: 'preview-target' });
  add('text', { x: middle, y: 12, 'text-anchor': 'middle', class: 'preview-text' }, 'N');
  add('text', { x: 4, y: middle + 4, class: 'preview-text' }, 'E');
  return make('figure', {}, root, make('figcaption', { textContent: `${text}, around RA ${sky.ra_deg.toFixed(3)}°, Dec ${sky.dec_deg.toFixed(3)}°. The roll of the camera is left out.` }));
}

/**
 * What the target is at each step of the day: its SNR, and whether the Earth or its shadow is in the way.
 * @param {any} day @param {number} limit V magnitude with SNR 5 @returns {{ snr: number, state: 'visible' | 'faint' | 'dark' | 'occulted' }[]}
 */
export function statesOfDay(day, limit) {
  return day.v_mag.map((v, k) => {
    const snr = v === null ? 0 : LIMIT_SNR * 10 ** (0.4 * (limit - v));
    return { snr, state: day.occulted[k] ? 'occulted' : v === null || day.sunlit_fraction[k] === 0 ? 'dark' : snr < LIMIT_SNR ? 'faint' : 'visible' };
  });
}

/** Steps in a row with the same state. @param {{ state: string }[]} states @returns {{ state: string, first: number, last: number }[]} */
export function spansOf(states) {
  const spans = [];
  states.forEach(({ state }, k) => {
    const last = spans[spans.length - 1];
    if (last && last.state === state) last.last = k; else spans.push({ state, first: k, last: k });
  });
  return spans;
}

const WORDS = { visible: 'visible', faint: `SNR below ${LIMIT_SNR}`, dark: 'in shadow', occulted: 'behind the Earth' };
/** Colours of the bands in words (editor.css). */
const BANDS = { occulted: 'orange', faint: 'green', dark: 'grey' };

/** SNR over the day from the epoch on. @param {any} sensor of the figures @param {number} duration of the run, s */
function dayPicture(sensor, duration) {
  const states = statesOfDay(sensor.day, sensor.v_mag_at_snr_5), step = sensor.day.step_s / 3600, width = 300, height = 150, left = 40, right = 8, top = 8, bottom = 22;
  if (states.length < 2) return make('p', { className: 'doc', textContent: 'The orbits end with the run: there is no day to show.' });
  const span = (states.length - 1) * step, most = Math.max(LIMIT_SNR * 2, ...states.map((one) => one.snr)) * 1.05;
  const share = Math.round(100 * states.filter((one) => one.state === 'visible').length / states.length), text = `The target is visible with SNR ${LIMIT_SNR} or more in ${share} % of ${shortNumber(span)} h.`;
  const { root, add } = svg(width, height, `SNR of the target over the day. ${text}`);
  const toX = (hours) => left + hours / span * (width - left - right), toY = (snr) => height - bottom - snr / most * (height - top - bottom);
  for (const { state, first, last } of spansOf(states)) {
    if (state === 'visible') continue;
    const x = toX(Math.max(0, (first - 0.5) * step)), end = toX(Math.min(span, (last + 0.5) * step));
    const band = add('rect', { x, y: top, width: Math.max(1, end - x), height: height - top - bottom, class: `preview-band preview-${state}` });
    const title = document.createElementNS(SVG, 'title');
    title.textContent = WORDS[state];
    band.append(title);
    if (end - x > 84) add('text', { x: (x + end) / 2, y: top + 14, 'text-anchor': 'middle', class: 'preview-axis' }, WORDS[state]);
  }
  for (const tick of ticksOf(0, most, 3)) {
    add('line', { x1: left, x2: width - right, y1: toY(tick), y2: toY(tick), class: 'preview-grid' });
    add('text', { x: left - 5, y: toY(tick) + 4, 'text-anchor': 'end', class: 'preview-axis' }, shortNumber(tick));
  }
  for (let hours = 0; hours <= span + 1e-9; hours += 6) add('text', { x: toX(hours), y: height - 6, 'text-anchor': hours === 0 ? 'start' : hours > span - 1 ? 'end' : 'middle', class: 'preview-axis' }, hours === 0 ? 'epoch' : `${hours} h`);
  add('polyline', { points: states.map((one, k) => `${toX(k * step).toFixed(1)},${toY(one.snr).toFixed(1)}`).join(' '), class: 'preview-line' });
  add('line', { x1: left, x2: width - right, y1: toY(LIMIT_SNR), y2: toY(LIMIT_SNR), class: 'preview-limit' });
  add('line', { x1: toX(0), x2: Math.max(toX(0) + 2, toX(Math.min(span, duration / 3600))), y1: height - bottom, y2: height - bottom, class: 'preview-run' });
  const bands = Object.keys(BANDS).filter((state) => states.some((one) => one.state === state)).map((state) => `${BANDS[state]} ${WORDS[state]}`);
  return make('figure', {}, root, make('figcaption', { textContent: `${text} The thick line below is the run.${bands.length ? ` Bands: ${bands.join(', ')}.` : ''}` }));
}

/** Pictures of a sensor. @param {any} sensor of the figures @param {number} duration of the run, s @returns {Node[]} */
export function previewOf(sensor, duration) {
  const parts = [];
  if (sensor.sky) parts.push(skyPicture(sensor));
  if (sensor.day) parts.push(dayPicture(sensor, duration));
  return parts.length ? [make('div', { className: 'preview' }, ...parts)] : [];
}
