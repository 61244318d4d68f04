// The panel that says why the target was detected in a frame, or not, and which detections made a track.
import { addStyle, getJson } from './api.js';
import { make } from './editor_form.js';
import { TITLES } from './reason.js';

/** States of a track that are listed: the newest ones. */
const STATES_MOST = 500;
const fixed = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : '–');

/**
 * Rows of the table of a track: each exposure with the detection that updated it, newest first; exposures in a row without
 * one are one row. @param {any[]} states
 * @returns {{first: number, last: number, time: number, status: string, detection: any}[]} detection: null where there is none
 */
export function rowsOfTrack(states) {
  const rows = [];
  for (const one of states) {
    const last = rows[rows.length - 1];
    if (!one.detection && last && !last.detection && last.status === one.status) last.last = one.frame;
    else rows.push({ first: one.frame, last: one.frame, time: one.time_s, status: one.status, detection: one.detection || null });
  }
  return rows.reverse();
}

/** What a detection is, besides its figures. @param {any} detection */
export function kindOfDetection({ label, streak, blend }) {
  return [label, streak ? 'streak' : '', blend ? 'blended' : ''].filter(Boolean).join(', ');
}

/** The list of a track's detections. */
class TrackList {
  /** @param {any} app */
  constructor(app) {
    this.app = app;
    this.choice = make('select', { id: 'why-track' });
    this.summary = make('p', { className: 'why-summary' });
    this.table = make('table', { className: 'why-table' });
    this.box = make('section', { className: 'why-track' }, make('h2', { textContent: 'Detections that made a track' }),
      make('label', { className: 'inline' }, 'Track ', this.choice), this.summary, this.table);
    this.box.setAttribute('aria-label', 'Detections that made a track');
    this.choice.addEventListener('change', () => {
      app.chosenTrack = Number(this.choice.value);
      this.show();
    });
  }

  /** Lists the tracks of the frame, and what made the chosen one. */
  async show() {
    const { app } = this, { current: frame, sensor } = app, details = app.frameView.details;
    const tracks = details ? details.tracks.filter((one) => one.now) : [], ids = tracks.map((one) => one.id);
    const target = tracks.find((one) => one.target) || tracks[0], id = app.chosenTrack || (target ? target.id : 0);
    if (id && !ids.includes(id)) tracks.push({ id, status: 'not in this frame' });
    this.box.hidden = Boolean(app.exported) || tracks.length === 0;
    if (this.box.hidden) return;
    this.choice.replaceChildren(...tracks.map((one) => make('option', { value: String(one.id), textContent: `${one.id}, ${one.status}${one.target ? ', target' : ''}` })));
    this.choice.value = String(id);
    const { first_s: first, earlier, states } = await getJson('track', { sensor, frame, object: id });
    if (frame !== app.current || sensor !== app.sensor) return;
    const made = states.filter((one) => one.detection).length;
    this.summary.textContent = states.length === 0 ? `Track ${id} has no states up to this frame.`
      : `${made} detections in ${states.length} exposures${earlier ? ' that are looked at' : ''}; first detection at ${fixed(first, 2)} s.`;
    const head = make('tr', {}, ...['Frame', 'Time (s)', 'Track', 'Detection', 'x, y (px)', 'SNR', 'V'].map((textContent) => make('th', { scope: 'col', textContent })));
    this.table.replaceChildren(make('thead', {}, head), make('tbody', {}, ...rowsOfTrack(states).slice(0, STATES_MOST).map((row) => this.row(row, frame))));
  }

  row({ first, last, time, status, detection: found }, frame) {
    const text = first === last ? String(first + 1) : `${first + 1} – ${last + 1}`, link = make('button', { type: 'button', textContent: text });
    link.setAttribute('aria-label', `Go to frame ${first + 1}`);
    link.addEventListener('click', () => this.app.goTo(first));
    const cells = found ? [kindOfDetection(found), `${fixed(found.x, 2)}, ${fixed(found.y, 2)}`, fixed(found.snr, 1), fixed(found.v_mag, 2)] : ['none', '', '', ''];
    return make('tr', { className: frame >= first && frame <= last ? 'now' : '' }, make('td', {}, link), ...[fixed(time, 2), status, ...cells].map((textContent) => make('td', { textContent })));
  }
}

/** Opens the panel. @param {HTMLElement} box @param {any} app */
export async function open(box, app) {
  await addStyle('why.css');
  box.classList.add('why');
  const head = make('h2', { dir: 'auto' }), text = make('p', { className: 'why-text', dir: 'auto' }), list = make('ol', { className: 'why-list' });
  const tracks = new TrackList(app);
  text.setAttribute('role', 'status');
  list.setAttribute('aria-label', 'Frames around this one; each line goes to its first frame');
  box.append(head, text, list, tracks.box);
  let shown = false;

  const showReason = async (frame) => {
    const { sensor } = app, found = await getJson('why', { sensor, frame });
    if (frame !== app.current || sensor !== app.sensor) return;
    list.hidden = text.hidden = !found.target;
    if (!found.target) {
      head.textContent = 'This sensor has no target';
      return;
    }
    head.textContent = `${found.target} in frame ${frame + 1}: ${(TITLES[found.frame.kind] || found.frame.kind).slice(2)}`;
    text.textContent = `${found.frame.text[0].toUpperCase()}${found.frame.text.slice(1)}.`;
    list.replaceChildren(...found.spans.map((span) => {
      const button = make('button', { type: 'button' }, make('span', { className: 'when', textContent: span.first === span.last ? String(span.first + 1) : `${span.first + 1} – ${span.last + 1}` }),
        make('span', { className: 'kind', textContent: TITLES[span.kind] || span.kind }), make('span', { textContent: span.text, dir: 'auto' }));
      button.addEventListener('click', () => app.goTo(span.first));
      return make('li', { className: frame >= span.first && frame <= span.last ? 'now' : '' }, button);
    }));
  };

  const show = async () => {
    const frame = app.current;
    if (!shown || frame < 0) return;
    try {
      await Promise.all([showReason(frame), tracks.show()]);
    } catch (error) {
      text.hidden = false;
      text.textContent = error.message;
    }
  };
  document.addEventListener('frameshown', show);
  document.addEventListener('trackchosen', show);
  return {
    async shown() {
      shown = true;
      await show();
    },
    hidden() { shown = false; },
  };
}
