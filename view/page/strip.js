// The film-strip under the frame: small pictures of frames, evenly over the time that the plots show, as many as fit.
import { getThumbnail } from './api.js';

/** Numbers of a frame in the list (view/recorded_run.h). */
const NUMBERS = 5;
/** Width of a picture with the gap beside it, px of the screen; the first picture's place, and its side (style.css). */
const CELL_PX = 62, LEFT_PX = 13, TOP_PX = 8, SIDE_PX = 52;
/** Pictures that are kept; a picture takes 13 KB at most. */
const KEPT_MOST = 400;
/** Pictures that are asked for at a time: the frame itself goes first. */
const AT_A_TIME = 2;

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

/**
 * Frames that a film-strip shows: evenly from the first to the last one. While a run goes on, the distance is a power of
 * two, so that pictures stay as frames are added.
 * @param {number} first @param {number} last rows of the list of frames @param {number} room pictures that fit
 * @param {boolean} growing @returns {number[]}
 */
export function chooseFrames(first, last, room, growing) {
  const count = last - first + 1, most = Math.min(count, Math.max(1, room));
  if (!(count > 0)) return [];
  if (growing && count > most) {
    let step = 2;
    while (Math.floor(last / step) - Math.ceil(first / step) + 1 > most) step *= 2;
    const chosen = [];
    for (let k = Math.ceil(first / step); k * step <= last; k++) chosen.push(k * step);
    return chosen.length ? chosen : [first];
  }
  return Array.from({ length: most }, (_, k) => (most > 1 ? first + Math.round(k * (count - 1) / (most - 1)) : first));
}

/** Grey levels of a small picture: asinh over the spread of its darker part. @param {Uint16Array} data @returns {Uint8ClampedArray} RGBA */
export function greyOf(data) {
  const sorted = Uint16Array.from(data).sort(), at = (share) => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
  const black = at(0.3), soft = Math.max(1, 3 * (at(0.7) - black)), white = Math.max(at(0.998), black + 3 * soft);
  const most = Math.asinh((white - black) / soft), pixels = new Uint8ClampedArray(4 * data.length);
  data.forEach((value, k) => pixels.fill(255 * Math.asinh(Math.max(0, value - black) / soft) / most, 4 * k, 4 * k + 3));
  for (let k = 3; k < pixels.length; k += 4) pixels[k] = 255;
  return pixels;
}

/** A small picture as a canvas that is not on the page. */
function canvasOf({ width, height, data }) {
  const canvas = Object.assign(document.createElement('canvas'), { width, height });
  canvas.getContext('2d').putImageData(new ImageData(/** @type {any} */ (greyOf(data)), width, height), 0, 0);
  return canvas;
}

export class Strip {
  /** @param {any} app */
  constructor(app) {
    this.app = app;
    this.box = element('strip');
    // one canvas for all: the browser composes each canvas anew in every picture of the page
    this.canvas = document.createElement('canvas');
    this.canvas.setAttribute('aria-hidden', 'true');
    this.frames = []; // that are shown
    this.kept = new Map(); // pictures by sensor, exposure and its time
    this.request = null;
    this.low = matchMedia('(max-height: 560px)'); // windows in which style.css hides the strip
    this.looked = { frames: null, any: false }; // at which list of frames, and whether one has pixels
    this.box.addEventListener('click', (event) => {
      const cell = event.target instanceof Element && event.target.closest('[data-frame]');
      if (cell instanceof HTMLElement) this.app.goTo(Number(cell.dataset.frame));
    });
    this.box.addEventListener('keydown', (event) => this.onKey(event));
    element('strip-shown').addEventListener('change', () => this.update());
    document.addEventListener('frameshown', () => this.mark());
    document.addEventListener('rangechanged', () => this.update());
    new ResizeObserver(() => { if (this.frames.length !== this.choose().length) this.update(); }).observe(element('stage'));
  }

  /** Row of the first frame at or after a time. */
  rowAt(time) {
    let low = 0, high = this.app.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.app.timeOf(middle) < time) low = middle + 1; else high = middle;
    }
    return low;
  }

  anyPixels() {
    const { frames } = this.app;
    if (this.looked.frames !== frames) this.looked = { frames, any: frames.some((value, k) => k % NUMBERS === 3 && value >= 0) };
    return this.looked.any;
  }

  choose() {
    const { app } = this;
    if (!element('strip-shown').checked || this.low.matches || app.count === 0 || !this.anyPixels()) return [];
    const { from, to } = app.plots.range, first = this.rowAt(from - 1e-9), last = this.rowAt(to + 1e-9) - 1;
    return chooseFrames(first, last, Math.floor((element('stage').clientWidth - 16) / CELL_PX), app.inProgress());
  }

  /** Chooses the frames anew and asks for the pictures that are not there. */
  update() {
    const { app } = this;
    if (app.current < 0 && !app.live) return; // the frame comes first
    this.frames = this.choose();
    this.box.hidden = this.frames.length === 0;
    this.box.replaceChildren(this.canvas, ...this.frames.map((frame) => this.cell(frame)));
    this.mark();
    this.draw();
    if (this.request) this.request.abort();
    this.request = new AbortController();
    const { signal } = this.request, wanted = this.frames.filter((frame) => this.hasPixels(frame) && !this.kept.has(this.keyOf(frame)));
    this.loading = Promise.all(Array.from({ length: AT_A_TIME }, () => this.load(wanted, signal)));
  }

  /** Drops all pictures: the run goes on from an earlier time. */
  forget() {
    if (this.request) this.request.abort();
    this.kept.clear();
  }

  hasPixels(frame) { return this.app.frames[frame * NUMBERS + 3] >= 0; }

  keyOf(frame) { return `${this.app.sensor} ${this.app.frames[frame * NUMBERS]} ${this.app.timeOf(frame)}`; }

  /** Asks for pictures until none is wanted. @param {number[]} wanted @param {AbortSignal} signal */
  async load(wanted, signal) {
    while (wanted.length && !signal.aborted) {
      const frame = wanted.shift(), key = this.keyOf(frame);
      try {
        const picture = canvasOf(await getThumbnail(this.app.sensor, frame, signal));
        if (signal.aborted) return;
        this.kept.set(key, picture);
        if (this.kept.size > KEPT_MOST) this.kept.delete(this.kept.keys().next().value);
        this.draw();
      } catch {
        if (signal.aborted) return; // else this picture stays dark; the frame itself says why
      }
    }
  }

  cell(frame) {
    const { app } = this, cell = document.createElement('div'), time = app.timeOf(frame);
    const state = app.frames[frame * NUMBERS + 4] === 1 ? 'dropped' : this.hasPixels(frame) ? '' : 'not kept';
    const shortTime = `${time.toFixed(time < 1000 ? 1 : 0)} s`;
    cell.id = `strip-${frame}`;
    cell.dataset.frame = String(frame);
    cell.setAttribute('role', 'option');
    cell.setAttribute('aria-label', `Frame ${frame + 1}, ${shortTime}${state ? `, ${state}` : ''}`);
    cell.title = `Frame ${frame + 1}, ${time.toFixed(2)} s`;
    cell.append(state || shortTime);
    return cell;
  }

  /** Draws the pictures that are there; the others stay dark. */
  draw() {
    const ratio = devicePixelRatio || 1, { canvas } = this;
    Object.assign(canvas, { width: Math.round(this.box.clientWidth * ratio), height: Math.round((TOP_PX + SIDE_PX) * ratio) });
    Object.assign(canvas.style, { width: `${canvas.width / ratio}px`, height: `${canvas.height / ratio}px` });
    const context = canvas.getContext('2d');
    context.scale(ratio, ratio);
    context.imageSmoothingEnabled = false;
    context.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--stage');
    this.frames.forEach((frame, k) => {
      const picture = this.kept.get(this.keyOf(frame)), x = LEFT_PX + k * CELL_PX;
      context.fillRect(x, TOP_PX, SIDE_PX, SIDE_PX);
      if (!picture) return;
      const scale = SIDE_PX / Math.max(picture.width, picture.height), width = picture.width * scale, height = picture.height * scale;
      context.drawImage(picture, x + (SIDE_PX - width) / 2, TOP_PX + (SIDE_PX - height) / 2, width, height);
    });
  }

  /** Place of the frame that is shown, or of the last one before it. */
  placeNow() {
    const { live } = this.app;
    if (live && live.newest && !live.over) return this.frames.length - 1;
    let place = 0;
    this.frames.forEach((frame, k) => { if (frame <= this.app.current) place = k; });
    return place;
  }

  mark() {
    const now = this.placeNow();
    this.box.querySelectorAll('[data-frame]').forEach((cell, k) => cell.setAttribute('aria-selected', String(k === now)));
    if (this.frames.length) this.box.setAttribute('aria-activedescendant', `strip-${this.frames[now]}`);
  }

  /** Arrow keys go from picture to picture; all other keys are the frame's. */
  onKey(event) {
    const now = this.placeNow(), before = this.frames[now] < this.app.current ? now : now - 1;
    const place = { ArrowLeft: before, ArrowRight: now + 1, Home: 0, End: this.frames.length - 1 }[event.key];
    if (place === undefined || event.shiftKey || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    const frame = this.frames[Math.min(this.frames.length - 1, Math.max(0, place))];
    if (frame !== undefined) this.app.goTo(frame);
  }
}
