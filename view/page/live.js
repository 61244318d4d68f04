// A run that is steered from the page: its WebSocket, its newest frame, its controls.
import { getJson } from './api.js';
import { changeFields, changesOf } from './changes.js';
import { shortNumber } from './chart.js';
import { binningAt, covers, partFor, WHOLE_PX } from './frame_parts.js';
import { imageOf, readAnswer, Trail } from './live_answer.js';
import { LivePicture } from './live_picture.js';
import { setProperty, setText } from './text.js';

/** Rates that are offered, times real time; 0: flat out. */
const RATES = [0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 0];
/** Commands that wait at most, and the longest one, bytes: the program takes 8192 bytes a message. */
const QUEUE_MOST = 64, COMMAND_BYTES = 8000;
/** Time that a command which was not taken is named, ms. */
const REFUSAL_MS = 6000;
/** Time between two questions for names, ms. */
const NAMES_MS = 1000;
/** Least time between two changes of the texts of a run that goes on, ms: they change more of the page than the picture does. */
const TEXT_MS = 500;
/** Time before another attempt to connect, ms. */
const RETRY_MS = 1000;

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

export class Live {
  /** @param {any} app */
  constructor(app) {
    this.app = app;
    this.state = null;
    this.controller = false;
    this.sequence = 0;
    this.newest = true; // the page shows the newest frame
    this.trail = new Trail();
    this.picture = new LivePicture(this, app.frameView);
    this.missed = -1; // exposure that was shown from the record
    this.askedNames = 0; // when names of objects were asked for
    this.queue = []; // commands that wait until the one before is obeyed
    this.sentAt = -1; // commands that the run had obeyed when the last one was sent; -1: none is awaited
    this.refusal = { text: '', until: 0 }; // of the last command that was not taken
    this.shown = 0; // frames
    this.textsSet = 0; // when the texts were set
    this.setTexts = null; // sets the texts of the frame that is shown
    this.over = false; // the run has ended, and the page knows its end
    this.ready = null;
    this.first = new Promise((done) => { this.ready = done; });
    this.makeControls();
  }

  /** Connects, and waits until the run has a folder. */
  async start() {
    this.connect();
    await this.first;
    element('live').hidden = false;
  }

  // ---------------------------------------------------------------- WebSocket

  connect() {
    const address = new URL('live', location.href);
    address.protocol = 'ws:';
    this.socket = this.picture.connect(address);
    this.socket.binaryType = 'arraybuffer';
    this.socket.addEventListener('open', () => { this.sentAt = -1; this.ask(); });
    this.socket.addEventListener('message', (/** @type {any} */ event) => this.take(event.data));
    this.socket.addEventListener('close', () => {
      if (this.state && !this.state.ended) this.say('The run cannot be reached. Is "boresight view" still running?');
      setTimeout(() => this.connect(), RETRY_MS);
    });
  }

  /** Binning of a frame whose size is not known yet: that of the sensor. */
  least() {
    const { sensorWidth, sensorHeight } = this.app.frameView || {}, side = Math.max(sensorWidth || 0, sensorHeight || 0);
    return Math.max(1, Math.ceil(side / WHOLE_PX));
  }

  /** Pixels of a frame along one pixel of the screen while it runs; 1: each can be seen, or looked at. Where the processor draws, the
   * picture has up to a third fewer pixels along a side than the screen, rather than more: it is the run's processor. */
  binning() {
    const { frameView } = this.app;
    if (!frameView || !this.state || this.state.paused || this.state.steps > 0) return this.least();
    const pixels = 1 / (frameView.view.scale * (devicePixelRatio || 1));
    return Math.max(1, frameView.made && frameView.made.plain ? Math.round(pixels) : Math.floor(1.02 * pixels));
  }

  /** The part of a frame that is too large to be sent whole; null: it is not too large. */
  part() {
    const { frameView } = this.app, { image } = frameView || {};
    if (!image || !(Math.max(image.frameWidth, image.frameHeight) > WHOLE_PX)) return null;
    return partFor(frameView.box(), frameView.frameSize(), binningAt(frameView.view.scale * (devicePixelRatio || 1)));
  }

  /** True if the image lacks something of what is to be seen. */
  lacks(binning, part) {
    const { frameView } = this.app, { image } = frameView || {};
    if (!this.newest || !image) return false;
    return part ? !covers(image, frameView.box(), frameView.frameSize(), part.binning) : image.binning > binning;
  }

  /** What is asked for now. */
  wanted() {
    const part = this.part(), binning = part ? part.binning : this.binning();
    // pixels that were binned, or left out, are asked for again when they can be seen
    const asked = { sensor: this.app.sensor, after: this.lacks(binning, part) ? 0 : this.sequence, take: true, binning };
    if (part) asked.part = { x: part.x, y: part.y, width: part.width, height: part.height };
    return asked;
  }

  /** One request, which gets one answer. */
  ask() {
    const asked = this.wanted();
    const next = this.state && this.state.obeyed === this.sentAt ? undefined : this.queue[0];
    if (next) asked.command = next;
    if (this.socket.readyState !== WebSocket.OPEN) return; // the next connection asks
    this.socket.send(JSON.stringify(asked));
    if (!next) return;
    this.queue.shift();
    this.sentAt = this.state ? this.state.obeyed : -1;
  }

  /**
   * Takes commands, all or none; false: none, and the page says why.
   * @param {...object} commands see view/live_run.h
   */
  command(...commands) {
    const bytes = Math.max(0, ...commands.map((one) => new TextEncoder().encode(JSON.stringify(one)).length));
    let why = '';
    if (bytes > COMMAND_BYTES) why = `Not done: the command has ${bytes} bytes (allowed: ${COMMAND_BYTES}).`;
    else if (this.queue.length + commands.length > QUEUE_MOST) why = `Not done: ${this.queue.length + commands.length} commands would wait (allowed: ${QUEUE_MOST}).`;
    if (why) {
      this.refusal = { text: why, until: performance.now() + REFUSAL_MS };
      this.say(why);
      element('change-problem').textContent = why;
    } else {
      this.refusal.until = 0;
      this.queue.push(...commands);
      if (this.picture) this.picture.stop();
    }
    return !why;
  }

  /** @param {ArrayBuffer} data */
  take(data) {
    const answer = readAnswer(data), before = this.state;
    let drawn = false; // elsewhere
    this.state = answer.state;
    this.controller = answer.controller;
    const now = performance.now(), due = !this.running() || !before || before.paused || now - this.textsSet >= TEXT_MS;
    if (due) this.textsSet = now;
    if (this.picture.shown && !this.running()) this.drawHere();
    else if (answer.sequence) {
      this.sequence = answer.sequence;
      drawn = this.takeFrame(answer.frame, imageOf(data, answer), data, due);
    }
    if (answer.problem) this.sentAt = -1; // refused: it does not count
    if (due && this.setTexts) this.setTexts();
    this.describe(before, answer.problem, due);
    if (this.state.run >= 0) this.ready();
    // the answer is drawn before the next one is asked for
    if (drawn) return;
    if (document.hidden) setTimeout(() => this.ask(), 200);
    else requestAnimationFrame(() => this.ask());
  }

  /** The page draws again, the newest frame first. */
  drawHere() {
    this.sequence = 0;
    this.picture.hide();
  }

  /**
   * Shows a frame. While the run goes on, a worker draws it, and the page takes it some times a second for what is written about it.
   * @param {any} details @param {import('./frame_parts.js').Image | null} pixels @param {ArrayBuffer | null} [data] the answer with both
   * @param {boolean} [due] something is written @returns {boolean} the worker draws it, and the next one is asked for then
   */
  takeFrame(details, pixels, data = null, due = true) {
    const { app } = this, sensor = app.run && app.run.sensors[app.sensor], before = [...this.trail.exposures], { earlier, again } = this.trail.add(details);
    this.missed = -1;
    if (!sensor || !this.newest) return false;
    const elsewhere = Boolean(data && app.panels.frameShown && this.running() && !this.part() && !document.hidden && this.picture.suits(pixels));
    if (!elsewhere) this.picture.hide();
    if (due || !elsewhere) this.keepFrame(details, elsewhere ? { ...pixels, data: pixels.data.slice() } : pixels, earlier);
    if (elsewhere) this.picture.show(data, { asked: this.wanted(), trail: before, time: TEXT_MS });
    if (elsewhere && this.queue.length > 0) this.picture.stop();
    app.plots.follow(details.time_s);
    if (!again) this.shown++;
    document.dispatchEvent(new CustomEvent('liveframe', { detail: details.exposure_id }));
    return elsewhere;
  }

  /** The page has a frame: for its drawing, for values under the pointer, and for its texts. */
  keepFrame(details, pixels, earlier) {
    const { app } = this, sensor = app.run.sensors[app.sensor];
    app.frameView.getPart = null; // it comes with the next answer
    this.needNames(details);
    const target = Object.entries(app.names).find(([, name]) => name === sensor.target);
    const all = { ...details, names: app.names, target: target ? Number(target[0]) : -1, tracks: details.tracks.concat(earlier) };
    app.frameView.show(pixels, all, details.dropped ? 'This frame was dropped.' : 'This run has no pixels.', !this.state.paused);
    this.setTexts = () => {
      this.setTexts = null;
      app.frameView.sayCounts();
      setText(element('position'), `exposure ${details.exposure_id} · ${details.time_s.toFixed(2)} s · ${details.utc.replace('T', ' ').replace('Z', '')} UTC`);
      element('slider').value = element('slider').max;
    };
  }

  /** Number of the newest exposure that the page has shown; -1: none. */
  shownExposure() { return Math.max(this.missed, this.trail.newest); }

  /** Asks for the names of objects if one has none yet: a run has recorded them some time after its first frames. @param {any} details */
  needNames(details) {
    const { app } = this, unknown = details.truth.some((mark) => mark.kind.startsWith('object') && !(mark.id in app.names));
    if (!unknown || performance.now() - this.askedNames < NAMES_MS) return;
    this.askedNames = performance.now();
    getJson('names').then(({ names }) => { app.names = names; }).catch(() => {});
  }

  // ---------------------------------------------------------------- controls

  makeControls() {
    element('live-rate').replaceChildren(...RATES.map((rate) => {
      const option = document.createElement('option');
      option.value = String(rate);
      option.textContent = rate > 0 ? `${rate} ×` : 'flat out';
      return option;
    }));
    element('live-rate').value = '10';
    const on = (id, act) => element(id).addEventListener('click', act);
    on('live-run', () => this.toggle());
    on('live-step', () => this.step());
    on('live-newest', () => this.follow(!this.newest));
    on('live-save', () => this.command({ do: 'save' }));
    on('live-rewind', () => this.command({ do: 'rewind', state: Number(element('live-states').value) }));
    on('live-branch', () => this.command({ do: 'branch', state: Number(element('live-states').value) }));
    on('live-end', () => this.command({ do: 'end' }));
    on('live-change', () => this.openChanges());
    on('change-apply', () => this.applyChanges());
    element('live-rate').addEventListener('change', () => { if (this.running()) this.run(); });
  }

  run() {
    this.follow(true);
    this.command({ do: 'run', rate: Number(element('live-rate').value) });
  }

  running() { return Boolean(this.state && !this.state.paused && this.state.steps === 0); }

  toggle() {
    if (this.running()) this.command({ do: 'pause' });
    else this.run();
  }

  step() {
    this.follow(true);
    this.command({ do: 'step', frames: 1 });
  }

  /** @param {boolean} newest show the newest frame, not one that was recorded before */
  follow(newest) {
    if (newest && !this.newest) this.sequence = 0; // show it again
    this.newest = newest;
    if (!newest) {
      this.setTexts = null;
      this.picture.hide();
    }
    element('live-newest').setAttribute('aria-pressed', String(newest));
  }

  say(text) { setText(element('live-message'), text); }

  /** @param {any} before state before this one @param {string} problem @param {boolean} [due] the time is said */
  describe(before, problem, due = true) {
    const { state } = this;
    const steers = this.controller && !state.ended;
    element('live').classList.toggle('watched', !state.steered);
    if (due) {
      setText(element('live-time'), `${state.time_s.toFixed(2)} / ${state.duration_s} s · ${
        state.ended ? 'complete' : state.paused ? 'paused' : !state.steered ? 'running' : `${state.speed.toFixed(1)} × real time`}`);
    }
    setText(element('live-run'), this.running() ? 'Pause' : 'Run');
    for (const id of ['live-run', 'live-step', 'live-rate', 'live-save', 'live-rewind', 'live-change', 'live-end']) setProperty(element(id), 'disabled', !steers);
    setProperty(element('live-branch'), 'disabled', !this.controller);
    const refusal = performance.now() < this.refusal.until ? this.refusal.text : '';
    this.say(refusal || problem || state.message || (this.controller || !state.steered ? '' : 'Another page controls this run.'));
    setText(element('change-problem'), refusal || problem || state.message);
    if (before && state.obeyed > before.obeyed && this.queue.length === 0 && element('changes').open) this.fillChanges();
    if (this.shown === 0 && this.app.count === 0) element('no-pixels').textContent = this.waiting();
    const states = JSON.stringify(state.states);
    if (states !== this.states) {
      this.states = states;
      const chosen = element('live-states').value;
      element('live-states').replaceChildren(...state.states.slice().reverse().map((one) => {
        const option = document.createElement('option');
        option.value = String(one.id);
        option.textContent = `${one.time_s.toFixed(2)} s, ${one.why}`;
        return option;
      }));
      if (state.states.some((one) => String(one.id) === chosen)) element('live-states').value = chosen;
    }
    if (before && before.run !== state.run && before.run >= 0 && state.run >= 0) { // a branch
      const query = new URLSearchParams(location.search);
      query.set('run', String(state.run));
      location.search = query.toString();
    }
    if (state.ended && this.app.run && this.app.run.state !== 'still running') this.over = true;
    if (before && state.time_s < before.time_s - 1e-9) { // rewound: what came later is recorded anew
      this.trail = new Trail();
      this.app.cache.clear();
      this.app.strip.forget();
      this.app.current = -1;
    }
  }

  // ---------------------------------------------------------------- changes

  /** What stands in the place of the first frame. */
  waiting() {
    const { state } = this;
    if (state.ended) return 'The run has ended without a frame.';
    return state.paused && state.steps === 0 ? `Paused at ${shortNumber(state.time_s)} s – Run (R)` : 'No frame yet';
  }

  async fillChanges() {
    this.scenario = await getJson('scenario');
    changeFields(element('change-fields'), this.scenario, this.app.sensor, this.state.time_s);
  }

  async openChanges() {
    await this.fillChanges();
    element('change-problem').textContent = '';
    element('changes').showModal();
  }

  async applyChanges() {
    const commands = changesOf(element('change-fields'), this.scenario, this.state.time_s);
    const free = element('change-set').value.trim();
    if (free) commands.push({ do: 'set', set: free });
    if (commands.length === 0) element('change-problem').textContent = 'Nothing differs.';
    else if (this.command(...commands)) element('change-set').value = ''; // the fields are filled once they are obeyed
  }
}
