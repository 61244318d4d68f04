// What the numbers of a scenario mean: limiting magnitude, SNR of the target, field and day, disk space, speed, margins of the loops.
import { make } from './editor_form.js';
import { previewOf } from './editor_preview.js';

const number = (value, digits = 3) => (typeof value === 'number' && Number.isFinite(value) ? Number(value.toPrecision(digits)).toString() : '–');

/** Bytes with a unit. */
function size(bytes) {
  if (!(bytes > 0)) return 'no frames are kept';
  const k = Math.min(4, Math.floor(Math.log10(bytes) / 3));
  return `${number(bytes / 1000 ** k)} ${['B', 'kB', 'MB', 'GB', 'TB'][k]}`;
}

function table(rows) {
  return make('table', {}, ...rows.map(([name, ...values]) => make('tr', {}, make('th', { scope: 'row', textContent: name }), ...values.map((value) => make('td', { textContent: value })))));
}

/** Begin, middle and end of a run, as columns. */
function targetRows({ states }) {
  const each = (name, of) => [name, ...states.map(of)];
  return [
    each('Time (s)', (one) => number(one.time_s, 6)), each('V magnitude', (one) => (one.v_mag === null ? 'dark' : number(one.v_mag, 4))),
    each('SNR', (one) => (one.occulted ? 'behind the Earth' : number(one.snr))), each('Range (km)', (one) => number(one.range_m / 1000, 5)),
    each('Rate (arcsec/s)', (one) => number(one.rate_arcsec_per_s)), each('Sunlit', (one) => number(one.sunlit_fraction, 2)),
  ];
}

/** @param {any[]} axes of a sensor in `boresight loop` */
function loopRows(axes) {
  const each = (name, of) => [name, ...axes.map(of)];
  return [
    each('Axis', (one) => String(one.axis)), each('Stable', (one) => (one.stable === undefined ? '–' : one.stable ? 'yes' : 'no')),
    each('Gain margin (dB)', (one) => number(one.gain_margin_db)), each('Phase margin (°)', (one) => number(one.phase_margin_deg)),
    each('Delay margin (s)', (one) => number(one.delay_margin_s)), each('Pointing error (px RMS)', (one) => number(one.predicted_rms_px)),
  ];
}

/** Frames of a trial run, and its longest simulated time, s (view/editor_speed.h). */
const TRIAL_FRAMES = 4, TRIAL_MOST_S = 600;

/** Simulated time of a trial run: some frames of the slowest sensor. @param {any} figures */
export function trialTime({ duration_s: duration, sensors }) {
  const periods = sensors.map((one) => (one.frames > 0 ? duration / one.frames : 0));
  return Math.min(duration, TRIAL_MOST_S, Math.max(2, TRIAL_FRAMES * Math.max(0, ...periods)));
}

/** A measured speed in words. @param {any} found {real_time_factor, wall_time_s, duration_s} or {problem} @param {number} duration of the run, s */
export function speedText({ real_time_factor: factor, duration_s: trial, problem }, duration) {
  if (problem) return problem;
  const whole = duration / factor, time = whole < 120 ? `${number(whole, 2)} s` : whole < 7200 ? `${number(whole / 60, 2)} min` : `${number(whole / 3600, 2)} h`;
  return `about ${number(factor, 2)} × real time, the whole run ${time} (from its first ${number(trial)} s, without frames on disk)`;
}

/** The line with the speed, measured when it is asked for. @param {any} figures @param {(duration: number) => Promise<any>} measure */
function speedLine(figures, measure) {
  const text = make('output', { textContent: '' }), button = make('button', { type: 'button', textContent: 'Measure speed' });
  text.setAttribute('role', 'status');
  button.addEventListener('click', async () => {
    button.disabled = true;
    text.textContent = 'a trial run …';
    try {
      text.textContent = speedText(await measure(trialTime(figures)), figures.duration_s);
    } catch (error) {
      text.textContent = error.message;
    }
    button.disabled = false;
  });
  return make('p', { className: 'preview-speed' }, button, ' ', text);
}

/** @param {HTMLElement} box @param {any} figures of `boresight check --figures`; null: the text is wrong @param {any} loops of `boresight loop`
 * @param {(duration: number) => Promise<any>} measure the speed of the scenario */
export function showFigures(box, figures, loops, measure) {
  if (!figures) {
    box.replaceChildren(make('p', { className: 'doc', textContent: 'A scenario without errors has figures here.' }));
    return;
  }
  const parts = [table([['Frames on disk', size(figures.frame_bytes)], ['Objects', String(figures.objects)]]), speedLine(figures, measure)];
  for (const sensor of figures.sensors) {
    parts.push(make('h3', { textContent: `${sensor.observer}/${sensor.sensor}`, dir: 'auto' }), table([
      ['Limiting magnitude (V at SNR 5)', number(sensor.v_mag_at_snr_5, 4)], ['Field (°)', sensor.field_deg.map((side) => number(side)).join(' × ')],
      ['Pixel (arcsec)', number(sensor.pixel_scale_arcsec)], ['Frames', number(sensor.frames, 7)], ['Noise of a pixel (e⁻)', number(sensor.noise_e)],
      ['Sky and dark in a pixel (e⁻)', `${number(sensor.sky_e)} + ${number(sensor.dark_e)}`],
    ]));
    if (sensor.target) parts.push(make('h4', { textContent: `Target ${sensor.target.object}`, dir: 'auto' }), table(targetRows(sensor.target)));
    parts.push(...previewOf(sensor, figures.duration_s));
    const loop = loops && loops.sensors.find((one) => one.observer === sensor.observer && one.sensor === sensor.sensor);
    if (loop && loop.axes.length > 0) parts.push(make('h4', { textContent: 'Control loop' }), table(loopRows(loop.axes)));
  }
  box.replaceChildren(...parts);
}
