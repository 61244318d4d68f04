// The page: loads a run, and moves frame, plots and events together.
import { getJson, getNumbers, getPixels } from './api.js';
import { Blink } from './blink.js';
import { shortNumber } from './chart.js';
import { FrameView } from './frame_view.js';
import { Panels } from './panels.js';
import { Plots } from './plots.js';
import { Reason } from './reason.js';
import { Strip } from './strip.js';

/** Numbers of a frame in the list (view/recorded_run.h). */
const NUMBERS = 5;
/** Frames that are kept, bytes of pixels. */
const CACHE_BYTES = 192e6;
/** Time that a frame is shown while playing, ms. */
const PLAY_MS = 90;

/** State of a run in progress (bst_run_state_name), and time between two looks at its folder, ms. */
const RUNNING = 'still running';
const REFRESH_MS = 2000;
/** Time between two looks at whether it is time, ms. */
const LOOK_MS = 200;
/** Share of the time that the looks may take at most: the run's tables grow. A live run's are read by the program that writes them. */
const REFRESH_SHARE = 0.05, LIVE_SHARE = 0.02;

/** Events that are listed at once, more than are in view; the others follow after the plots. */
const EVENTS_FIRST = 100;

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

/** Changes of the mode. @param {number} sensor */
async function getModes(sensor) {
  return (await getJson('modes', { sensor })).modes.filter((change) => Number.isFinite(change.time_s));
}

/** Those of the events that have a time: a damaged table may have others. @param {{events: any[]}} answer */
const listedEvents = ({ events }) => events.filter((event) => Number.isFinite(event.time_s));

class App {
  constructor() {
    this.frameView = new FrameView();
    this.plots = new Plots((time) => this.seek(time));
    this.run = null;
    this.sensor = 0;
    /** @type {Float64Array} */
    this.frames = new Float64Array(0);
    this.count = 0;
    this.current = -1;
    this.wanted = -1;
    this.busy = false;
    this.cache = new Map();
    this.playing = false;
    this.live = null; // of a run that is steered here
    this.events = [];
    this.names = {};
    this.strip = new Strip(this);
    this.blink = new Blink(this);
    this.reason = new Reason(this);
    this.chosenTrack = 0; // whose detections the panel Why lists; 0: that of the target
    this.panels = new Panels(element('tabs'), element('main'), this);
    this.listen();
  }

  async start() {
    const query = new URLSearchParams(location.hash.slice(1));
    const session = await getJson('session');
    const address = new URLSearchParams(location.search);
    this.ofStudy = Boolean(session.study);
    if (session.study && (address.has('start') || !address.has('run'))) {
      const { showStudy } = await import('./study.js');
      await showStudy();
      return;
    }
    if (address.has('start') || (!session.live && session.runs === 0)) {
      const { showStart } = await import('./start.js');
      await showStart();
      return;
    }
    if (session.exported) this.describeExport(session.exported);
    if (session.live) {
      const { Live } = await import('./live.js');
      this.live = new Live(this);
      await this.live.start();
    }
    if (session.run && !this.live) [this.run, this.names] = [session.run, session.names];
    else [this.run, { names: this.names }] = await Promise.all([getJson('run'), getJson('names')]);
    this.describeRun();
    await this.openSensor(Number(query.get('sensor')) || 0, Number(query.get('frame')) || 0);
    const [x, y, scale] = (query.get('at') || '').split(',').map(Number);
    if (scale > 0) { // #at=X,Y,SCALE: a place of the frame
      Object.assign(this.frameView.view, { x, y, scale, fitted: false });
      this.frameView.redraw();
    }
    if (this.live) this.live.follow(true);
    if (!session.exported && this.inProgress()) this.follow();
  }

  /** A page that is one file, without a program: what of the run it has. */
  describeExport({ space, sensors }) {
    this.exported = true;
    const parts = sensors.map(({ rows, total, binning }) => `${rows.length} of ${total} frames${binning > 1 ? `, ${binning} × ${binning} pixels binned` : ''}`);
    element('exported').hidden = false;
    element('exported').textContent = parts.length > 1 ? 'copy' : parts[0];
    element('exported').title = `This page is a copy of a part of the run, made by "boresight export --page". Sensors: ${parts.join('; ')}. ` +
      'Plots show all exposures. "boresight view" shows the whole run.';
    document.querySelector('h1 a').removeAttribute('href'); // there is no start page
    this.panels.keep(['frame', 'why', ...(space ? ['space'] : [])]);
  }

  inProgress() { return this.run.state === RUNNING || Boolean(this.live && !this.live.over); }

  /** Time until the next question, ms: a live run that goes on is slowed by few of them; one that pauses shows at once what it has. @param {number} took ms, the last one */
  refreshWait(took) {
    const goesOn = this.live && !(this.live.state && this.live.state.paused);
    return Math.max(REFRESH_MS, took / (goesOn ? LIVE_SHARE : REFRESH_SHARE));
  }

  /** Asks for what was recorded since, while the run is in progress; stays at the end if it is there. */
  async follow() {
    for (let took = 0; this.inProgress();) {
      for (const end = performance.now(); performance.now() - end < this.refreshWait(took);) await new Promise((done) => { setTimeout(done, LOOK_MS); });
      const begin = performance.now();
      try {
        const { sensor } = this, run = await getJson('refresh'), frames = await getNumbers('frames', { sensor });
        const [modes, events, { names }] = await Promise.all([getModes(sensor), getJson('events'), getJson('names')]);
        if (sensor !== this.sensor) continue;
        this.names = names;
        const atEnd = this.current === this.count - 1;
        this.run = run;
        this.describeRun();
        element('sensor').value = String(sensor);
        for (const frame of this.cache.keys()) { // may have been without pixels yet
          if (frame >= this.count - 2 && frame !== this.current) this.cache.delete(frame);
        }
        this.setFrames(frames);
        this.showEvents(events);
        this.plots.extend(run.sensors[sensor].panels, modes, this.events, this.lastTime(modes));
        if (this.live && this.live.newest) await this.showMissed();
        else if (atEnd && this.count) await this.goTo(this.count - 1);
        await this.plots.reloading;
      } catch (error) {
        this.showProblems([`The run cannot be followed: ${error.message}`]);
      }
      took = performance.now() - begin;
    }
  }

  /** A live run that pauses may have gone on while the page could not ask: the last frame with tracks, from the record. */
  async showMissed() {
    const frame = this.count - 2, { live } = this; // the last one may still be processed
    if (frame < 0 || !live.state.paused || live.shownExposure() >= this.frames[frame * NUMBERS]) return;
    const { image, details, why } = await this.load(frame);
    if (!live.newest || !live.state.paused) return;
    this.current = this.wanted = frame;
    this.frameView.getPart = image ? (wanted) => getPixels(this.sensor, frame, undefined, undefined, wanted) : null;
    this.frameView.show(image, details, why);
    this.describePosition(details);
    this.plots.setCursor(this.timeOf(frame));
    live.missed = details.exposure_id;
  }

  /** @param {Float64Array} frames numbers of all frames */
  setFrames(frames) {
    this.frames = frames;
    this.count = frames.length / NUMBERS;
    element('slider').max = String(Math.max(0, this.count - 1));
  }

  lastTime(modes) {
    return Math.max(this.count ? this.timeOf(this.count - 1) : 1, ...modes.slice(-1).map((mode) => mode.time_s));
  }

  describeRun() {
    const { run } = this, summary = run.manifest.summary || {};
    const steered = Boolean(this.live && this.live.state.steered && !this.live.over);
    const name = steered ? run.name.replace(/\.partial$/, '') : run.name; // it gets this name at its end
    const state = steered && run.state === RUNNING ? 'live' : this.exported && run.state === RUNNING ? `${RUNNING} when exported` : run.state;
    document.title = `${name} – Boresight`;
    element('run-name').textContent = name;
    element('run-name').title = run.manifest.scenario || '';
    element('run-state').textContent = state;
    element('run-state').classList.toggle('bad', state !== 'complete' && state !== 'live');
    const figures = [
      ['Final mode', summary.final_mode], ['Pointing RMS', summary.pointing_rms_px, ' px'],
      ['Custody', summary.custody === undefined || summary.custody === null ? undefined : 100 * summary.custody, ' %'],
      ['Speed', summary.real_time_factor, '× real time'], ['Warnings', run.manifest.warnings],
    ];
    element('figures').replaceChildren(...figures.filter(([, value]) => value !== undefined && value !== null).map(([name, value, unit]) => {
      const box = document.createElement('div'), key = document.createElement('dt'), text = document.createElement('dd');
      key.textContent = name;
      text.textContent = typeof value === 'number' ? shortNumber(value) + (unit || '') : String(value);
      box.append(key, text);
      return box;
    }));
    this.showProblems(run.problems.concat(run.manifest.error ? [run.manifest.error] : []));
    element('sensor').replaceChildren(...run.sensors.map((sensor, k) => {
      const option = document.createElement('option');
      option.value = String(k);
      option.textContent = sensor.observer ? `${sensor.observer}/${sensor.name}` : `sensor ${k}`;
      return option;
    }));
    element('sensor-label').hidden = run.sensors.length < 2;
  }

  showProblems(problems) {
    element('problems').hidden = problems.length === 0;
    element('problems').textContent = problems.join('\n');
  }

  async openSensor(sensor, frame) {
    const info = this.run.sensors[sensor];
    if (!info) return;
    this.sensor = sensor;
    if (this.live) this.live.changeSensor();
    element('sensor').value = String(sensor);
    this.blink.offer(info);
    this.chosenTrack = 0;
    this.frameView.sensorWidth = info.width_px;
    this.frameView.sensorHeight = info.height_px;
    this.frameView.reset();
    this.cache.clear();
    const others = Promise.all([getModes(sensor), getJson('events')]);
    others.catch(() => {}); // said where they are awaited
    this.setFrames(await getNumbers('frames', { sensor }));
    this.current = -1;
    if (this.count === 0) {
      this.frameView.show(null, null, this.live ? this.live.waiting() : 'This sensor has no frames.');
      element('position').textContent = 'no frames';
    } else {
      await this.goTo(Math.min(frame, this.count - 1)); // the picture first
    }
    const [modes, events] = await others;
    this.events = listedEvents(events);
    const first = this.count ? this.frames[1] - (this.frames[2] || 0) / 2 : 0;
    this.plots.show(sensor, info.panels, modes, this.events, Math.min(0, first), this.lastTime(modes));
    if (this.count) this.plots.setCursor(this.timeOf(Math.max(0, this.current)));
    this.showEvents(events);
  }

  timeOf(frame) { return this.frames[frame * NUMBERS + 1]; }

  // ---------------------------------------------------------------- frames

  /** Shows a frame. Only one is loaded at a time; of those that are asked for meanwhile, the last. */
  async goTo(frame) {
    this.wanted = Math.min(this.count - 1, Math.max(0, frame));
    if (this.live) this.live.follow(false);
    if (this.busy) return;
    this.busy = true;
    try {
      while (this.wanted !== this.current) {
        const next = this.wanted;
        const loaded = await this.load(next), part = await this.loadPart(next, loaded.image);
        this.current = next;
        this.frameView.getPart = this.exported || !loaded.image ? null : (wanted) => getPixels(this.sensor, next, undefined, undefined, wanted);
        this.frameView.show(loaded.image, loaded.details, loaded.why, false, part);
        this.firstShown = this.firstShown || performance.now(); // ms since the page was asked for
        this.describePosition(loaded.details);
        this.plots.setCursor(this.timeOf(next));
        this.markEvent();
        document.dispatchEvent(new CustomEvent('frameshown', { detail: next }));
      }
    } catch (error) {
      this.wanted = this.current;
      this.stop();
      this.showProblems([`Frame ${frame}: ${error.message}. Is "boresight view" still running?`]);
    } finally {
      this.busy = false;
    }
    if (this.current + 1 < this.count) this.load(this.current + 1).catch(() => {});
  }

  /** The shown part of a frame that is too large to be loaded whole, while the view is not of the whole frame. */
  async loadPart(frame, image) {
    const view = this.frameView, same = image && image.binning > 1 && !view.view.fitted && !this.exported;
    const wanted = same && view.image && view.image.frameWidth === image.frameWidth ? view.wantedPart(image) : null;
    return wanted ? getPixels(this.sensor, frame, undefined, undefined, wanted).catch(() => null) : null;
  }

  load(frame) {
    const held = this.cache.get(frame);
    if (held) {
      this.cache.delete(frame);
      this.cache.set(frame, held); // the latest last
      return held.promise;
    }
    const entry = { bytes: 0, promise: null };
    entry.promise = this.fetchFrame(frame, entry);
    entry.promise.catch(() => this.cache.delete(frame));
    this.cache.set(frame, entry);
    this.forget();
    return entry.promise;
  }

  async fetchFrame(frame, entry) {
    const sensor = this.sensor, kept = this.frames[frame * NUMBERS + 3] >= 0;
    const dropped = this.frames[frame * NUMBERS + 4] === 1;
    const [image, details] = await Promise.all([
      kept ? getPixels(sensor, frame, undefined, undefined, { longest: this.frameView.longest() }) : null, getJson('frame', { sensor, frame }),
    ]);
    details.names = this.names;
    entry.bytes = image ? image.data.byteLength : 1000;
    return { image, details, why: dropped ? 'This frame was dropped.' : 'The pixels of this frame were not kept.' };
  }

  /** Drops the frames that were not shown for the longest time. */
  forget() {
    let bytes = 0;
    for (const entry of this.cache.values()) bytes += entry.bytes;
    for (const [frame, entry] of this.cache) {
      if (bytes <= CACHE_BYTES || this.cache.size <= 2) return;
      bytes -= entry.bytes;
      this.cache.delete(frame);
    }
  }

  describePosition(details) {
    const time = this.timeOf(this.current), utc = details.utc ? `${details.utc.replace('T', ' ').replace('Z', '')} UTC` : '';
    element('slider').value = String(this.current);
    element('slider').setAttribute('aria-valuetext', `frame ${this.current + 1} of ${this.count}, ${time.toFixed(2)} s`);
    element('position').textContent = `${this.current + 1} / ${this.count} · exposure ${details.exposure_id} · ${time.toFixed(2)} s${utc ? ` · ${utc}` : ''}`;
  }

  /** Goes to the frame whose middle is nearest to a time. */
  seek(time) {
    let low = 0, high = this.count - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.timeOf(middle) < time) low = middle + 1; else high = middle;
    }
    if (low > 0 && time - this.timeOf(low - 1) < this.timeOf(low) - time) low--;
    if (this.count) this.goTo(low);
  }

  async play() {
    if (this.current >= this.count - 1) await this.goTo(0);
    this.playing = true;
    this.showPlaying();
    while (this.playing && this.current < this.count - 1) {
      const begin = performance.now();
      await this.goTo(this.current + 1);
      await new Promise((done) => { setTimeout(done, Math.max(0, PLAY_MS - (performance.now() - begin))); });
    }
    this.stop();
  }

  stop() {
    this.playing = false;
    this.showPlaying();
  }

  showPlaying() {
    element('play').querySelector('path').setAttribute('d', this.playing ? 'M3 2h4v12H3zM9 2h4v12H9z' : 'M4 2v12l10-6z');
    element('play').setAttribute('aria-label', this.playing ? 'Stop' : 'Play');
    element('play').setAttribute('aria-pressed', String(this.playing));
  }

  // ---------------------------------------------------------------- events

  showEvents({ total, events: listed }) {
    const events = this.events = listedEvents({ events: listed }), shown = events.slice(0, EVENTS_FIRST);
    element('event-count').textContent = total > events.length ? `first ${events.length} of ${total}` : String(total);
    element('events').replaceChildren(...shown.map((event) => this.eventItem(event)));
    this.markEvent();
    if (events.length > shown.length) this.plots.reloading.then(() => setTimeout(() => this.showFurther(events)));
  }

  /** The events that are out of view, some at a time, after the plots. @param {any[]} events */
  showFurther(events) {
    const list = element('events'), from = list.children.length;
    if (events !== this.events || from >= events.length) return;
    list.append(...events.slice(from, from + EVENTS_FIRST).map((event) => this.eventItem(event)));
    this.markEvent();
    setTimeout(() => this.showFurther(events));
  }

  eventItem(event) {
    const item = document.createElement('li'), button = document.createElement('button');
    for (const [name, text] of [['when', `${event.time_s.toFixed(2)} s`], ['kind', event.kind], ['what', event.text]]) {
      const span = document.createElement('span');
      span.className = name;
      span.textContent = text;
      span.dir = name === 'when' ? 'ltr' : 'auto';
      button.append(span);
    }
    if (this.run.sensors.length > 1) { // which of them
      const source = document.createElement('span');
      source.className = 'source';
      source.textContent = `${event.source}: `;
      button.lastElementChild.prepend(source);
    }
    button.type = 'button';
    button.title = event.source;
    button.addEventListener('click', () => this.seek(event.time_s));
    item.append(button);
    return item;
  }

  /** Marks the last event at or before the frame. */
  markEvent() {
    if (this.current < 0) return;
    const time = this.timeOf(this.current);
    let at = -1;
    this.events.forEach((event, k) => { if (event.time_s <= time + 1e-9) at = k; });
    [...element('events').children].forEach((item, k) => item.classList.toggle('now', k === at));
  }

  // ---------------------------------------------------------------- controls

  listen() {
    const on = (id, act) => element(id).addEventListener('click', act);
    on('first', () => this.goTo(0));
    on('back', () => this.goTo(this.wanted - 1));
    on('next', () => this.goTo(this.wanted + 1));
    on('last', () => this.goTo(this.count - 1));
    on('play', () => (this.playing ? this.stop() : this.play()));
    on('help', () => element('keys').showModal());
    on('theme', () => this.setTheme(document.documentElement.dataset.theme === 'light' ? 'dark' : 'light'));
    element('slider').addEventListener('input', () => this.goTo(Number(element('slider').value)));
    element('sensor').addEventListener('change', () => this.openSensor(Number(element('sensor').value), 0));
    document.addEventListener('keydown', (event) => this.onKey(event));
    document.addEventListener('trackchosen', (/** @type {any} */ { detail }) => {
      this.chosenTrack = detail;
      this.panels.show('why');
    });
    const light = matchMedia('(prefers-color-scheme: light)');
    light.addEventListener('change', () => this.setTheme(light.matches ? 'light' : 'dark'));
    this.setTheme(light.matches ? 'light' : 'dark');
  }

  setTheme(name) {
    document.documentElement.dataset.theme = name;
    this.plots.draw();
    this.frameView.drawHistogram();
    document.dispatchEvent(new CustomEvent('themechanged'));
  }

  onKey(event) {
    const target = event.target, view = this.frameView;
    if (event.ctrlKey || event.altKey || event.metaKey || element('keys').open || element('changes').open || !this.panels.frameShown) return;
    if (target instanceof HTMLSelectElement || (target instanceof HTMLInputElement && ['number', 'text'].includes(target.type))) return;
    if (event.key === ' ' && (target instanceof HTMLButtonElement || target instanceof HTMLInputElement)) return;
    if (event.key === 'Enter' && target === view.overlay && view.cursor) view.chooseAt(view.cursor);
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const actions = {
      PageUp: () => this.goTo(this.wanted - 10), PageDown: () => this.goTo(this.wanted + 10),
      Home: () => this.goTo(0), End: () => this.goTo(this.count - 1), ' ': () => (this.playing ? this.stop() : this.play()),
      '+': () => view.zoomTo(view.view.scale * 1.5), '=': () => view.zoomTo(view.view.scale * 1.5), '-': () => view.zoomTo(view.view.scale / 1.5),
      0: () => view.fit(), 1: () => view.zoomTo(1), w: () => view.pan(0, -60), a: () => view.pan(-60, 0), s: () => view.pan(0, 60), d: () => view.pan(60, 0),
      c: () => view.centreTarget(), m: () => view.toggleMarks(), b: () => this.blink.next(), y: () => this.panels.show('why'), '[': () => this.plots.zoom(0.5), ']': () => this.plots.zoom(2),
      '?': () => element('keys').showModal(),
      r: () => this.live && this.live.toggle(), n: () => this.live && this.live.step(),
    };
    if (step && event.shiftKey) view.moveCursor(step[0], step[1]);
    else if (step && step[0] !== 0) this.goTo(this.wanted + step[0]);
    else if (actions[event.key]) actions[event.key]();
    else return;
    event.preventDefault();
  }
}

const app = new App();
document.boresight = app; // for tests of the page
app.start().catch((error) => app.showProblems([`The run cannot be shown: ${error.message}`]));
