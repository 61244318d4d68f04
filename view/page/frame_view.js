// The picture of a frame: zoom, stretch, marks, the pixel under the cursor.
import { makePainter, placeOf } from './frame_gl.js';
import { binningAt, covers, longestSide, partFor, valueAt } from './frame_parts.js';
import { drawCompass, drawMarks, KINDS, makeSample, sortMarks } from './marks.js';
import { describePixels, limitsOf } from './statistics.js';
import { setText } from './text.js';
import { formatDec, formatRa, pixelToSky } from './wcs.js';

const SCALE_LEAST = 0.02, SCALE_MOST = 128;
/** From this scale on, pixels show their values. */
const VALUE_SCALE = 34;
/** Least time between two statistics of live frames, ms. */
const STATISTICS_MS = 1000;
const NUMBER = new Intl.NumberFormat('en', { maximumFractionDigits: 1 });

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

export class FrameView {
  constructor() {
    this.stage = element('stage');
    this.canvas = element('image');
    this.overlay = element('overlay');
    /** @type {ReturnType<typeof makePainter> | null} */
    this.made = null; // the painter
    /** @type {import('./frame_parts.js').Image | null} */
    this.image = null;
    /** @type {import('./frame_parts.js').Image | null} */
    this.part = null; // of the frame, with finer pixels
    /** Gets a part of the frame that is shown; null: there is no more than the image. @type {((part: import('./frame_parts.js').Part) => Promise<any>) | null} */
    this.getPart = null;
    this.loadingPart = false;
    this.clean = this.cleanPart = null; // the frame without noise, and a part of it; null: not shown
    /** Gets a part of the frame without noise. @type {((part: import('./frame_parts.js').Part) => Promise<any>) | null} */
    this.getCleanPart = null;
    this.cleanShown = false; // else the frame, in turn
    this.sensorWidth = this.sensorHeight = 0; // 0: unknown
    this.statistics = null;
    this.counted = 0; // time of the statistics
    this.details = null;
    this.sorted = null;
    this.view = { x: 0, y: 0, scale: 1, fitted: true };
    this.fittedSize = { width: 0, height: 0 }; // of the frame for which the zoom was chosen
    this.limits = null;
    this.cursor = null;
    this.shown = Object.fromEntries(KINDS.map((kind) => [kind.name, kind.shown]));
    /** What draws in the place of this page. @type {import('./live_picture.js').LivePicture | null} */
    this.remote = null;
    this.waiting = true; // until all is there
    this.makeLegend();
    this.listen();
    this.waiting = false;
    new ResizeObserver(() => this.resize()).observe(this.stage);
    this.resize();
  }

  // ---------------------------------------------------------------- what is shown

  /** A new sensor: its stretch and zoom begin anew. */
  reset() {
    this.limits = null;
    this.view.fitted = true;
    element('show-windows').hidden = true; // until a frame has them
  }

  /** @param {import('./frame_parts.js').Image | null} image @param {any} details @param {string} why no pixels
   * @param {boolean} live one of many frames a second @param {import('./frame_parts.js').Image | null} part of it */
  show(image, details, why, live = false, part = null) {
    // statistics of a million pixels take longer than drawing them
    const counted = !live || performance.now() - this.counted > STATISTICS_MS;
    if (counted) this.counted = performance.now();
    this.image = image;
    this.part = part;
    this.setClean(null); // that of the frame before
    this.details = details;
    this.sorted = details ? sortMarks(details) : null;
    if (counted || !image || !this.statistics) this.statistics = image ? describePixels(image.data) : null;
    element('no-pixels').hidden = Boolean(image);
    element('no-pixels').classList.toggle('first', !image && !details);
    setText(element('no-pixels'), image ? '' : why);
    if (image && !this.painter.fits(image)) this.usePlain();
    if (image && !this.limits) this.findLimits();
    const size = this.frameSize();
    if (image && (this.fittedSize.width !== size.width || this.fittedSize.height !== size.height)) this.view.fitted = true;
    if (image) this.fittedSize = size;
    if (this.view.fitted) this.fit();
    if (!live) this.sayCounts();
    if (details && details.windows) element('show-windows').hidden = false;
    if (counted) this.drawHistogram();
    this.redraw();
  }

  /** Numbers of marks, in the legend: of live frames some times a second, as texts change more of the page than the picture. */
  sayCounts() {
    for (const kind of KINDS) setText(element(`count-${kind.name}`), this.sorted ? String(this.sorted[kind.name].length) : '');
  }

  /** The frame without noise, of the same size and binning as the frame; null: none. @param {any} image @param {boolean} shown in place of the frame @returns {boolean} it is of that size */
  setClean(image, shown = true) {
    const { image: frame } = this, fits = Boolean(image && frame && ['width', 'height', 'binning', 'frameWidth', 'frameHeight'].every((name) => image[name] === frame[name]));
    if (!fits && !this.clean) return false;
    if (!fits || this.clean !== image) this.cleanPart = null;
    this.clean = fits ? image : null;
    this.cleanShown = fits && shown;
    element('clean-shown').hidden = !this.cleanShown;
    this.redraw();
    return fits;
  }

  /** What is drawn now. */
  get drawn() { return this.clean && this.cleanShown ? this.clean : this.image; }

  /** Its part with finer pixels. */
  get drawnPart() { return this.clean && this.cleanShown ? this.cleanPart : this.part; }

  /** What draws the pixels. It is made with the first of them: WebGL takes up to seconds to start, and a run may have none. */
  get painter() {
    const address = new URLSearchParams(location.search);
    this.made = this.made || makePainter(this.canvas, address.has('plain'), address.has('webgl'));
    return this.made;
  }

  /** A canvas has one kind of context for life: the 2D painter needs a new one. */
  usePlain() {
    const fresh = this.canvas.cloneNode();
    this.canvas.replaceWith(fresh);
    this.canvas = fresh;
    this.made = makePainter(fresh, true);
    this.resize();
  }

  findLimits() {
    const law = element('law').value;
    if (law !== 'manual' || !this.limits) this.limits = limitsOf(law, this.image.data, this.statistics);
    element('black').value = String(Math.round(this.limits.black));
    element('white').value = String(Math.round(this.limits.white));
  }

  /** @param {import('./frame_parts.js').Image | null} [image] */
  drawing(image = this.image) {
    const n = (image && image.binning) || 1, { x, y, scale } = this.origin();
    return { originX: x + ((image && image.x) || 0) * scale, originY: y + ((image && image.y) || 0) * scale, scale: scale * n, ...this.stretch() };
  }

  /** How values become grey levels. */
  stretch() {
    const law = element('law').value, limits = this.limits || { black: 0, white: 65535 }, sigma = this.statistics ? this.statistics.sigma : 1;
    return { black: limits.black, white: Math.max(limits.white, limits.black + 1), soft: law === 'asinh' ? 3 * sigma : 0, invert: element('invert').checked };
  }

  /** What a worker needs to draw pictures in the place of this page. */
  picture() {
    const { x, y, scale } = this.view, { width, height } = this.canvas, { names, target } = this.details || { names: {}, target: -1 };
    return {
      x, y, scale, width, height, ratio: devicePixelRatio || 1, stretch: this.stretch(), shown: this.shown, names, target,
      background: getComputedStyle(this.stage).backgroundColor || '#000',
    };
  }

  // ---------------------------------------------------------------- geometry

  /** Size of the picture in px of the page: whole pixels of the screen. */
  size() {
    if (!this.measured) { // until it changes: a look at an element lays out the page
      const ratio = devicePixelRatio || 1, whole = (side) => Math.max(1, Math.round(side * ratio)) / ratio;
      this.measured = { width: whole(this.stage.clientWidth), height: whole(this.stage.clientHeight) };
    }
    return this.measured;
  }

  /** Where the corner of the frame is on the canvas, and pixels of the screen per pixel of the frame. */
  origin() {
    return placeOf(this.view, this.canvas, this.binning(), devicePixelRatio || 1);
  }

  // ---------------------------------------------------------------- parts of large frames

  /** What is shown of the frame. */
  box() {
    const { width, height } = this.size(), a = this.toFrame(0, 0), b = this.toFrame(width, height);
    return { left: a.x + 0.5, top: a.y + 0.5, right: b.x + 0.5, bottom: b.y + 0.5 };
  }

  /** Longest side of the picture of a whole frame. */
  longest() {
    const { width, height } = this.size();
    return longestSide(Math.max(this.sensorWidth || 0, this.sensorHeight || 0), Math.max(width, height) * (devicePixelRatio || 1));
  }

  /** The part of the frame that is shown, as the screen can show it; null: the image has it. @param {import('./frame_parts.js').Image | null} [image] */
  wantedPart(image = this.image) {
    const frame = this.frameSize(), box = this.box(), binning = binningAt(this.view.scale * (devicePixelRatio || 1));
    return !image || covers(image, box, frame, binning) ? null : partFor(box, frame, binning);
  }

  /** Gets the part that is shown, if it is not there: one request at a time. */
  async loadPart() {
    const { image, clean } = this, get = clean && this.cleanShown ? this.getCleanPart : this.getPart, wanted = get && !this.loadingPart ? this.wantedPart() : null;
    if (!wanted || covers(this.drawnPart, this.box(), this.frameSize(), wanted.binning)) return;
    this.loadingPart = true;
    let part = null;
    try {
      part = await get(wanted);
    } catch { /* the binned picture stays; another look asks again */ }
    this.loadingPart = false;
    if (part && get === this.getCleanPart) { if (this.clean === clean) this.cleanPart = part; } else if (part && this.image === image) this.part = part;
    if (part) this.redraw(); // which asks for more if the view has moved
  }

  resize() {
    this.measured = null;
    const ratio = devicePixelRatio || 1, { width, height } = this.size();
    for (const canvas of [this.canvas, this.overlay]) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
      Object.assign(canvas.style, { width: `${width}px`, height: `${height}px` });
    }
    if (this.view.fitted) this.fit();
    this.redraw();
  }

  toScreen(x, y) {
    const origin = this.origin(), ratio = devicePixelRatio || 1;
    return { x: origin.x / ratio + (x + 0.5) * this.view.scale, y: origin.y / ratio + (y + 0.5) * this.view.scale };
  }

  toFrame(x, y) {
    const origin = this.origin(), ratio = devicePixelRatio || 1;
    return { x: (x - origin.x / ratio) / this.view.scale - 0.5, y: (y - origin.y / ratio) / this.view.scale - 0.5 };
  }

  frameSize() {
    const { image } = this;
    if (!image) return { width: this.sensorWidth || 1024, height: this.sensorHeight || 1024 };
    return { width: image.frameWidth || image.width, height: image.frameHeight || image.height };
  }

  /** Pixels of the frame along a side of one of the image. */
  binning() { return (this.image && this.image.binning) || 1; }

  fit() {
    const { width, height } = this.size(), frame = this.frameSize();
    this.view = {
      x: (frame.width - 1) / 2, y: (frame.height - 1) / 2, fitted: true,
      scale: Math.max(SCALE_LEAST, Math.min(width / frame.width, height / frame.height)),
    };
    this.redraw();
  }

  /** Zooms so that the place under (x, y) of the screen stays. */
  zoomTo(scale, x, y) {
    const { width, height } = this.size(), dx = (x ?? width / 2) - width / 2, dy = (y ?? height / 2) - height / 2;
    const next = Math.min(SCALE_MOST, Math.max(SCALE_LEAST, scale)), change = 1 / this.view.scale - 1 / next;
    this.view = { scale: next, fitted: false, x: this.view.x + dx * change, y: this.view.y + dy * change };
    this.redraw();
  }

  pan(dx, dy) {
    this.view.x += dx / this.view.scale;
    this.view.y += dy / this.view.scale;
    this.view.fitted = false;
    this.redraw();
  }

  centreTarget() {
    const mark = this.sorted && (this.sorted.target[0] || this.sorted.tracks.find((track) => track.target));
    if (!mark) return;
    Object.assign(this.view, { x: mark.x, y: mark.y, fitted: false, scale: Math.max(this.view.scale, 8) });
    this.redraw();
  }

  // ---------------------------------------------------------------- drawing

  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      const part = this.drawnPart;
      if (this.remote) this.remote.setView(this.picture());
      else if (this.made || this.drawn) this.painter.draw(this.drawn, this.drawing(), part, part && this.drawing(part));
      if (!this.remote) this.drawOverlay();
      this.describeCursor();
      const percent = 100 * this.view.scale;
      setText(element('zoom'), `${percent < 10 ? percent.toFixed(1) : Math.round(percent)} %`);
      if (this.binning() > 1 && !this.remote) this.loadPart();
    });
  }

  drawOverlay() {
    const context = this.overlay.getContext('2d'), ratio = devicePixelRatio || 1, { width, height } = this.size();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    if (!this.image) this.drawOutline(context);
    const image = this.drawnPart || this.drawn;
    if (image && this.view.scale * (image.binning || 1) >= VALUE_SCALE) this.drawValues(context, image);
    const wcs = this.details && this.details.wcs;
    if (this.sorted) {
      drawMarks(context, this.sorted, wcs, { toScreen: (x, y) => this.toScreen(x, y), scale: this.view.scale, width, height, shown: this.shown });
    }
    if (wcs) drawCompass(context, wcs, { scale: this.view.scale, width, height });
    if (this.cursor && this.view.scale >= 6) {
      const at = this.toScreen(this.cursor.x, this.cursor.y), side = this.view.scale;
      context.strokeStyle = '#ffffff';
      context.lineWidth = 1;
      context.strokeRect(at.x - side / 2, at.y - side / 2, side, side);
    }
  }

  /** Edge of a frame whose pixels are not there. */
  drawOutline(context) {
    const frame = this.frameSize(), a = this.toScreen(-0.5, -0.5), b = this.toScreen(frame.width - 0.5, frame.height - 0.5);
    context.strokeStyle = '#5b6b7a';
    context.lineWidth = 1;
    context.strokeRect(a.x, a.y, b.x - a.x, b.y - a.y);
  }

  drawValues(context, image) {
    const { width, height } = this.size(), a = this.toFrame(0, 0), b = this.toFrame(width, height), x0 = image.x || 0, y0 = image.y || 0;
    const n = image.binning || 1, side = this.view.scale * n, first = (at) => Math.max(0, Math.floor((at + 0.5) / n));
    context.font = `${Math.min(13, Math.round(side / 3.6))}px system-ui, sans-serif`;
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    for (let y = first(a.y - y0); y <= Math.min(image.height - 1, first(b.y - y0)); y++) {
      for (let x = first(a.x - x0); x <= Math.min(image.width - 1, first(b.x - x0)); x++) {
        const at = this.toScreen(x0 + (x + 0.5) * n - 0.5, y0 + (y + 0.5) * n - 0.5), text = String(image.data[y * image.width + x]);
        context.lineWidth = 2.5;
        context.strokeStyle = 'rgb(0 0 0 / 70%)';
        context.strokeText(text, at.x, at.y + 0.32 * side);
        context.fillStyle = '#ffffff';
        context.fillText(text, at.x, at.y + 0.32 * side);
      }
    }
    context.textAlign = 'start';
    context.textBaseline = 'alphabetic';
  }

  drawHistogram() {
    const canvas = element('histogram'), context = canvas.getContext('2d'), { width, height } = canvas;
    context.clearRect(0, 0, width, height);
    const s = this.statistics;
    if (!s || !this.limits) return;
    const from = s.low - 0.02 * (s.bright - s.low), to = Math.max(s.bright, from + 10) * 1.0, bins = new Float64Array(width), values = new Float64Array(width);
    for (let value = Math.max(0, Math.floor(from)); value <= Math.min(65535, to); value++) {
      const x = Math.min(width - 1, Math.max(0, Math.floor((value - from) / (to - from) * width)));
      bins[x] += s.counts[value];
      values[x] += 1;
    }
    values.forEach((count, x) => { if (count > 1 && x < width - 1) bins[x] /= count; }); // columns have one number more or less
    const most = Math.log1p(Math.max(...bins)), style = getComputedStyle(document.documentElement);
    context.fillStyle = style.getPropertyValue('--faint');
    bins.forEach((count, x) => {
      const h = most > 0 ? Math.log1p(count) / most * (height - 2) : 0;
      context.fillRect(x, height - h, 1, h);
    });
    context.fillStyle = style.getPropertyValue('--accent');
    for (const limit of [this.limits.black, this.limits.white]) {
      const x = Math.min(width - 2, Math.max(0, (limit - from) / (to - from) * width));
      context.fillRect(x, 0, 2, height);
    }
  }

  // ---------------------------------------------------------------- the cursor

  describeCursor() {
    const place = this.cursor, parts = [], image = this.image;
    if (place) {
      const x = Math.round(place.x), y = Math.round(place.y);
      parts.push(['Pixel', this.cursor.exact ? `${place.x.toFixed(1)}, ${place.y.toFixed(1)}` : `${x}, ${y}`]);
      const fine = valueAt(this.part, x, y), dn = fine === undefined ? valueAt(image, x, y) : fine, n = ((fine === undefined ? image : this.part) || {}).binning || 1;
      if (dn !== undefined) {
        const d = this.details;
        parts.push(['Value', n > 1 ? `${dn} DN (mean of ${n} × ${n})` : `${dn} DN`]);
        if (d && Number.isFinite(d.gain_e_per_dn)) {
          parts.push(['Charge', `${NUMBER.format((dn - (d.offset_dn || 0)) * d.gain_e_per_dn)} e−`]);
        }
        if (this.clean && d && Number.isFinite(d.gain_e_per_dn)) {
          const expected = valueAt(this.cleanPart, x, y) ?? valueAt(this.clean, x, y) ?? NaN;
          parts.push(['Expected', `${NUMBER.format((expected - (d.offset_dn || 0)) * d.gain_e_per_dn)} e−`]);
        }
        if (d && d.saturation_dn && dn >= d.saturation_dn) parts.push(['', 'saturated']);
      }
      if (this.details && this.details.wcs) {
        const sky = pixelToSky(this.details.wcs, place.x, place.y);
        parts.push(['RA', formatRa(sky.ra)], ['Dec', formatDec(sky.dec)]);
        if (this.details.wcs.without_distortion) parts.push(['', '(without distortion)']);
      }
      const near = this.nearest(place);
      if (near) parts.push(['At', near]);
    } else {
      parts.push(['', 'Point at a pixel for its value and direction.']);
    }
    const said = JSON.stringify(parts);
    if (said === this.said) return;
    this.said = said;
    element('readout').replaceChildren(...parts.map(([key, value]) => {
      const span = document.createElement('span');
      if (key) {
        const name = document.createElement('span');
        name.className = 'key';
        name.textContent = key;
        span.append(name);
      }
      span.append(value);
      return span;
    }));
  }

  /** Text about the nearest mark that is shown, within 12 px of the screen. */
  nearest(place) {
    let best = 12 / this.view.scale, text = '';
    for (const kind of this.sorted ? KINDS : []) {
      for (const mark of this.shown[kind.name] ? this.sorted[kind.name] : []) {
        const distance = Math.hypot(mark.x - place.x, mark.y - place.y);
        if (distance <= best) {
          best = distance;
          text = `${mark.text || mark.said || kind.title.toLowerCase().replace(/s$/, '')}` +
            (Number.isFinite(mark.v_mag) ? `, V ${mark.v_mag.toFixed(2)}` : '') +
            (Number.isFinite(mark.snr) ? `, SNR ${NUMBER.format(mark.snr)}` : '') +
            (kind.name === 'detections' && mark.label ? ` (${mark.label})` : '') +
            (mark.status ? ` (${mark.status})` : '');
        }
      }
    }
    return text;
  }

  /** A click on a track, or a key at the pixel cursor: what made it is asked for. @param {{x: number, y: number}} place */
  chooseAt(place) {
    const reach = 14 / this.view.scale, away = (mark) => Math.hypot(mark.x - place.x, mark.y - place.y);
    const [track] = (this.sorted && this.shown.tracks ? this.sorted.tracks : []).filter((mark) => away(mark) <= reach).sort((a, b) => away(a) - away(b));
    if (track) document.dispatchEvent(new CustomEvent('trackchosen', { detail: track.id }));
  }

  moveCursor(dx, dy) {
    const frame = this.frameSize(), from = this.cursor || { x: Math.round(this.view.x), y: Math.round(this.view.y) };
    this.cursor = {
      x: Math.min(frame.width - 1, Math.max(0, Math.round(from.x) + dx)),
      y: Math.min(frame.height - 1, Math.max(0, Math.round(from.y) + dy)),
    };
    const at = this.toScreen(this.cursor.x, this.cursor.y), { width, height } = this.size();
    if (at.x < 10 || at.y < 10 || at.x > width - 10 || at.y > height - 10) {
      Object.assign(this.view, { x: this.cursor.x, y: this.cursor.y, fitted: false });
    }
    this.redraw();
  }

  // ---------------------------------------------------------------- controls

  makeLegend() {
    element('legend').replaceChildren(...KINDS.map((kind) => {
      const button = document.createElement('button'), count = document.createElement('span');
      button.type = 'button';
      button.id = `show-${kind.name}`;
      button.addEventListener('click', () => this.setShown(kind.name, !this.shown[kind.name]));
      count.className = 'count';
      count.id = `count-${kind.name}`;
      button.append(makeSample(kind), kind.title, count);
      return button;
    }));
    for (const kind of KINDS) this.setShown(kind.name, kind.shown);
  }

  setShown(name, shown) {
    this.shown[name] = shown;
    element(`show-${name}`).setAttribute('aria-pressed', String(shown));
    this.redraw();
  }

  toggleMarks() {
    const any = Object.values(this.shown).some(Boolean);
    for (const kind of KINDS) this.setShown(kind.name, any ? false : kind.shown);
  }

  listen() {
    const overlay = this.overlay;
    let held = null;
    overlay.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.zoomTo(this.view.scale * 2 ** (-event.deltaY / 240), event.offsetX, event.offsetY);
    }, { passive: false });
    overlay.addEventListener('pointerdown', (event) => {
      held = { x: event.clientX, y: event.clientY, firstX: event.clientX, firstY: event.clientY };
      overlay.setPointerCapture(event.pointerId);
    });
    overlay.addEventListener('pointermove', (event) => {
      this.cursor = { ...this.toFrame(event.offsetX, event.offsetY), exact: true };
      if (held) {
        this.pan(held.x - event.clientX, held.y - event.clientY);
        Object.assign(held, { x: event.clientX, y: event.clientY });
      }
      this.redraw();
    });
    overlay.addEventListener('pointerup', (event) => {
      if (held && Math.hypot(event.clientX - held.firstX, event.clientY - held.firstY) < 4) this.chooseAt(this.toFrame(event.offsetX, event.offsetY));
    });
    for (const name of ['pointerup', 'pointercancel']) overlay.addEventListener(name, () => { held = null; });
    overlay.addEventListener('pointerleave', () => { this.cursor = null; this.redraw(); });
    overlay.addEventListener('dblclick', () => this.fit());
    this.canvas.addEventListener('redraw', () => this.redraw());
    element('law').addEventListener('change', () => { if (this.image) this.findLimits(); this.drawHistogram(); this.redraw(); });
    element('invert').addEventListener('change', () => this.redraw());
    for (const id of ['black', 'white']) {
      element(id).addEventListener('input', () => {
        const value = Number(element(id).value);
        if (!Number.isFinite(value) || !this.limits) return;
        if (element('law').value === 'zscale') element('law').value = 'manual';
        this.limits = { ...this.limits, [id]: value };
        this.drawHistogram();
        this.redraw();
      });
    }
    element('zoom-in').addEventListener('click', () => this.zoomTo(this.view.scale * 1.5));
    element('zoom-out').addEventListener('click', () => this.zoomTo(this.view.scale / 1.5));
    element('fit').addEventListener('click', () => this.fit());
    element('actual').addEventListener('click', () => this.zoomTo(1));
  }
}
