// The panel of space: Earth, orbits, observers with their fields of view, targets, Sun and Moon at the time of the frame.
import { addStyle, getBytes, getJson, getNumbers } from './api.js';
import { layout, make } from './editor_form.js';
import { clearance, conesOf, coneShape, drawCones } from './space_cones.js';
import { SpacePainter } from './space_gl.js';
import * as math from './space_math.js';
import { ShapePass } from './space_shape.js';

/** Numbers of an answer (view/space.h). */
const HEAD = 15, BODY = 6, POSE = 5;
/** Time between two states of the bodies, s; between them they move on cubics (0.4 m from the lowest orbits). */
const STEP_S = 60;
/** Places of Sun and Moon in the picture, Earth radii: the Sun is at its direction only. */
const SUN_AT = 170;
const FAR = 400;
/** Bodies whose orbits and names are drawn. */
const NAMED_MOST = 40;
/** Distance of a close-up, radii of the object. */
const CLOSE_RADII = 6;

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);
const km = (radii) => `${Math.round(radii * math.EARTH_M / 1000).toLocaleString('en')} km`;

export class SpaceView {
  constructor(app, scene) {
    this.app = app;
    this.scene = scene;
    this.names = [...scene.observers, ...scene.objects];
    this.camera = { azimuth: 0.6, elevation: 0.35, distance: 18 };
    this.time = 0;
    this.steps = new Map(); // states by number of the step
    this.step = NaN; // of the states that are shown
    /** @type {Float64Array | null} */
    this.before = null; // states at its begin and end
    /** @type {Float64Array | null} */
    this.after = null;
    this.orbitsAt = NaN;
    this.poses = [];
    this.shown = false;
    this.through = false;
    this.targets = new Set(scene.sensors.map((sensor) => sensor.object).filter((k) => k >= 0).map((k) => k + scene.observers.length));
    this.painter = new SpacePainter(element('space-image'));
    this.shapes = new ShapePass(this.painter, app.exported ? [] : scene.shapes, () => this.draw());
    this.overlay = element('space-overlay');
    this.fillControls();
    this.listen();
  }

  fillControls() {
    const list = ['Earth', ...this.named().map((k) => this.names[k])], values = ['-1', ...this.named().map(String)];
    element('space-follow').replaceChildren(...list.map((name, k) => make('option', { value: values[k], textContent: name, dir: 'auto' })));
    element('space-close').hidden = this.shapes.shapes.size === 0;
    element('space-keep-out').parentElement.hidden = !this.scene.sensors.some((sensor) => sensor.keep_out);
    element('space-time').max = String(this.scene.span_s || 1);
    if (this.scene.total > this.scene.objects.length) element('space-stage').title = `The first ${this.scene.objects.length} of ${this.scene.total} objects are shown.`;
  }

  /** Bodies with name and orbit: observers, targets, then objects as far as there is room. */
  named() {
    const few = [...this.scene.observers.keys(), ...this.targets];
    for (let k = this.scene.observers.length; k < this.names.length && this.names.length <= NAMED_MOST; k++) if (!this.targets.has(k)) few.push(k);
    return few.slice(0, NAMED_MOST);
  }

  listen() {
    const redraw = () => this.draw();
    for (const id of ['space-orbits', 'space-fields', 'space-names', 'space-shadow', 'space-keep-out']) element(id).addEventListener('change', redraw);
    element('space-follow').addEventListener('change', () => this.setThrough(false));
    element('space-close').addEventListener('click', () => this.setClose(!this.isClose()));
    element('space-through').addEventListener('click', () => this.setThrough(!this.through));
    element('space-time').addEventListener('input', () => this.goTo(Number(element('space-time').value), true));
    document.addEventListener('frameshown', () => { if (this.shown) this.follow(); });
    new ResizeObserver(redraw).observe(element('space-stage'));
    this.overlay.addEventListener('pointerdown', (event) => {
      this.drag = { x: event.clientX, y: event.clientY };
      this.overlay.setPointerCapture(event.pointerId);
    });
    this.overlay.addEventListener('pointermove', (event) => {
      if (!this.drag) return;
      this.turn((this.drag.x - event.clientX) * 0.006, (event.clientY - this.drag.y) * 0.006);
      this.drag = { x: event.clientX, y: event.clientY };
    });
    this.overlay.addEventListener('pointerup', () => { this.drag = null; });
    this.overlay.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY * 0.0012));
    }, { passive: false });
    this.overlay.addEventListener('keydown', (event) => this.onKey(event));
  }

  onKey(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const step = this.scene.span_s / 100;
    const actions = {
      ArrowLeft: () => this.turn(-0.1, 0), ArrowRight: () => this.turn(0.1, 0), ArrowUp: () => this.turn(0, 0.1), ArrowDown: () => this.turn(0, -0.1),
      '+': () => this.zoom(0.8), '=': () => this.zoom(0.8), '-': () => this.zoom(1.25), ',': () => this.goTo(this.time - step, true), '.': () => this.goTo(this.time + step, true),
      f: () => element('space-follow').focus(), t: () => this.setThrough(!this.through), z: () => this.setClose(!this.isClose()),
    };
    if (!actions[event.key]) return;
    actions[event.key]();
    event.preventDefault();
  }

  turn(azimuth, elevation) {
    this.camera.azimuth += azimuth;
    this.camera.elevation = Math.min(1.5, Math.max(-1.5, this.camera.elevation + elevation));
    this.draw();
  }

  zoom(by) {
    const least = 1.5 * this.shapes.radiusOf(this.followedObject()) || 0.002;
    this.camera.distance = Math.min(200, Math.max(least, this.camera.distance * by));
    this.draw();
  }

  /** Index of the object in the middle; below 0: something else. */
  followedObject() { return Number(element('space-follow').value) - this.scene.observers.length; }

  isClose() {
    const radius = this.shapes.radiusOf(this.followedObject());
    return !this.through && radius > 0 && this.camera.distance < 100 * radius;
  }

  /** Goes near an object with a shape, the sensor's target first, or away from it. */
  setClose(on) {
    const sensor = this.scene.sensors[this.app.sensor], list = element('space-follow');
    const [first] = [this.followedObject(), sensor ? sensor.object : -1, ...this.shapes.shapes.keys()].filter((object) => this.shapes.radiusOf(object) > 0);
    if (first === undefined) return;
    if (on) {
      const value = String(first + this.scene.observers.length);
      if (![...list.options].some((one) => one.value === value)) list.append(make('option', { value, textContent: this.scene.objects[first], dir: 'auto' }));
      list.value = value;
    }
    this.camera.distance = on ? CLOSE_RADII * this.shapes.radiusOf(first) : 4;
    if (on) { // its lit side, with the Sun beside the camera
      const sun = math.unit([...this.before.slice(0, 3)]);
      Object.assign(this.camera, { azimuth: Math.atan2(sun[1], sun[0]) + 0.7, elevation: Math.asin(sun[2]) + 0.3 });
    }
    this.setThrough(false);
  }

  setThrough(on) {
    this.through = on;
    element('space-through').setAttribute('aria-pressed', String(on));
    const followed = Number(element('space-follow').value);
    if (!on) this.camera.distance = followed < 0 ? 18 : Math.min(this.camera.distance, 4);
    this.draw();
  }

  // ---------------------------------------------------------------- time

  /** Takes the time of the frame that is shown. */
  follow() {
    const { app } = this;
    return this.goTo(app.current >= 0 ? app.timeOf(app.current) : this.time, false);
  }

  /** Goes to a time. @param {boolean} frames the frames follow */
  async goTo(time, frames) {
    this.time = Math.min(this.scene.span_s, Math.max(0, time));
    element('space-time').value = String(this.time);
    element('space-clock').textContent = `${this.time.toFixed(1)} s`;
    if (frames && this.app.count) this.app.seek(this.time);
    if (this.loading) return;
    this.loading = true;
    try {
      for (let step = -1; step !== this.stepNow();) { // the time may have gone on meanwhile
        step = this.stepNow();
        const states = await Promise.all([this.statesOf(step), this.statesOf(step + 1)]);
        if (step === this.stepNow()) this.setStates(step, ...states);
      }
    } catch (error) {
      element('space-readout').textContent = `The bodies cannot be shown: ${error.message}`;
    } finally {
      this.loading = false;
    }
    this.draw();
  }

  stepNow() { return Math.floor(this.time / STEP_S); }

  statesOf(step) {
    if (!this.steps.has(step)) {
      if (this.steps.size > 8) this.steps.delete(this.steps.keys().next().value);
      const states = getNumbers('space/states', { from: step * STEP_S });
      states.catch(() => this.steps.delete(step));
      this.steps.set(step, states);
    }
    return this.steps.get(step);
  }

  /** Takes the states at both ends of a step, in Earth radii. */
  setStates(step, before, after) {
    if (this.step === step) return;
    const bodies = new Float32Array(13 * this.names.length);
    for (let k = 0; k < this.names.length; k++) {
      for (let i = 0; i < BODY; i++) {
        const at = HEAD + BODY * k + i;
        bodies[13 * k + i] = before[at] / math.EARTH_M;
        bodies[13 * k + BODY + i] = after[at] / math.EARTH_M;
      }
      bodies[13 * k + 12] = k < this.scene.observers.length || this.targets.has(k) ? 1 : 0;
    }
    this.painter.setBodies(bodies);
    Object.assign(this, { step, before, after, orbitsAt: NaN });
  }

  /** Place of a body now, Earth radii; NaN: it has none. */
  placeOf(body) {
    const of = (states, from) => [0, 1, 2].map((i) => states[HEAD + BODY * body + from + i] / math.EARTH_M);
    return math.between(of(this.before, 0), of(this.before, 3), of(this.after, 0), of(this.after, 3), STEP_S, this.share());
  }

  velocityOf(body) {
    const of = (states, from) => [0, 1, 2].map((i) => states[HEAD + BODY * body + from + i] / math.EARTH_M);
    return math.rateBetween(of(this.before, 0), of(this.before, 3), of(this.after, 0), of(this.after, 3), STEP_S, this.share());
  }

  share() { return Math.min(1, Math.max(0, this.time / STEP_S - this.step)); }

  /** Attitude of a sensor's camera at the exposure nearest to the time; null: none. */
  poseOf(sensor) {
    const poses = this.poses[sensor];
    if (!poses || poses.length === 0) return null;
    let low = 0, high = poses.length / POSE - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (poses[POSE * middle] < this.time) low = middle + 1; else high = middle;
    }
    if (low > 0 && this.time - poses[POSE * (low - 1)] < poses[POSE * low] - this.time) low--;
    return poses.slice(POSE * low + 1, POSE * low + 5);
  }

  // ---------------------------------------------------------------- picture

  /** Camera: eye and matrix of points relative to it. */
  view(width, height) {
    const followed = Number(element('space-follow').value), centre = followed < 0 ? [0, 0, 0] : this.placeOf(followed);
    const sensor = this.scene.sensors[this.app.sensor], pose = this.through && sensor && sensor.corners ? this.poseOf(this.app.sensor) : null;
    if (pose) {
      const [first, , , last] = sensor.corners, forward = math.turnedBack(pose, [0, 0, 1]), up = math.turnedBack(pose, math.add(first, last, -1));
      const field = Math.min(2, Math.max(3 * math.length(math.add(first, last, -1)), 0.002));
      const turned = math.looking(forward, up), eye = this.placeOf(sensor.observer), near = Math.min(1e-3, 0.1 * this.rangeOf(sensor, eye));
      return { eye, field, turned, matrix: math.product(math.perspective(field, width / height, near, FAR), turned) };
    }
    const { azimuth, elevation, distance } = this.camera;
    const back = [Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation)];
    const eye = math.add(centre.some(Number.isNaN) ? [0, 0, 0] : centre, back, followed < 0 ? Math.max(distance, 1.05) : distance);
    const field = 0.75, turned = math.looking(math.scaled(back, -1), [0, 0, 1]);
    return { eye, field, turned, matrix: math.product(math.perspective(field, width / height, Math.max(1e-4, 0.01 * distance), FAR), turned) };
  }

  /** Distance of a sensor's target, Earth radii. */
  rangeOf(sensor, eye) {
    return sensor.object >= 0 ? math.length(math.add(this.placeOf(sensor.object + this.scene.observers.length), eye, -1)) || 1 : 1;
  }

  draw() {
    const stage = element('space-stage'), width = stage.clientWidth, height = stage.clientHeight;
    if (!this.shown || !this.before || width === 0) return;
    const ratio = window.devicePixelRatio || 1, camera = this.view(width, height), { eye, matrix } = camera, { painter } = this;
    const sun = math.unit([...this.before.slice(0, 3)]), moon = math.scaled([...this.before.slice(3, 6)], 1 / math.EARTH_M);
    painter.begin(Math.round(width * ratio), Math.round(height * ratio), matrix, eye);
    const earth = [...this.before.slice(6, 15)];
    painter.drawEarth(sun, earth);
    painter.drawCoast(math.earthMatrix(matrix, eye, earth, 1.0015), [0.78, 0.84, 0.72, 1]);
    painter.draw('points', [...math.scaled(sun, SUN_AT)], [1, 0.86, 0.35, 1]);
    painter.draw('points', moon, [0.8, 0.82, 0.85, 1]);
    painter.drawBodies(this.share(), STEP_S, 3 * ratio, [0.62, 0.7, 0.78, 1], [0.9, 0.62, 0, 1]);
    const close = this.isClose(); // the shape alone, with what is far away
    if (element('space-orbits').checked && !close) this.drawOrbits();
    if (element('space-fields').checked && !close) this.drawFields();
    if (element('space-shadow').checked) this.drawShadow(sun);
    const cones = this.conesNow(sun, moon), shape = this.drawShape(sun, { ...camera, aspect: width / height }, cones);
    element('space-close').setAttribute('aria-pressed', String(this.isClose()));
    this.drawNames(matrix, eye, width, height, ratio, { sun: math.scaled(sun, SUN_AT), moon, cones, shape });
    this.describe(moon, cones, shape);
  }

  /** What the page's sensor keeps away from. */
  conesNow(sun, moon) {
    const sensor = this.scene.sensors[this.app.sensor];
    if (!sensor || !sensor.keep_out || sensor.observer < 0) return [];
    const eye = this.placeOf(sensor.observer);
    return eye.some(Number.isNaN) ? [] : conesOf(sensor.keep_out, eye, sun, moon);
  }

  /** Draws keep-out cones, then over all else the shape that is near. */
  drawShape(sun, camera, cones) {
    const sensor = this.scene.sensors[this.app.sensor], observer = sensor && sensor.observer >= 0 ? this.placeOf(sensor.observer) : null;
    if (cones.length && !this.through && !this.isClose() && element('space-keep-out').checked) drawCones(this.painter, observer, cones);
    const object = this.through && sensor ? sensor.object : this.followedObject();
    if (!(this.shapes.radiusOf(object) > 0)) return null;
    const place = this.placeOf(object + this.scene.observers.length);
    const drawn = this.shapes.draw(object, { sensor: this.app.sensor, time: this.time, sun, place, observer: this.through ? null : observer }, camera);
    return drawn && { ...drawn, object, place };
  }

  drawOrbits() {
    if (this.orbitsAt !== this.time) { // not for each turn of the camera
      this.orbits = this.named().map((body) => ({ body, points: math.orbitPoints(this.placeOf(body), this.velocityOf(body)) }));
      this.orbitsAt = this.time;
    }
    for (const { body, points } of this.orbits) {
      const observer = body < this.scene.observers.length;
      this.painter.draw('strip', points, observer ? [0.34, 0.71, 0.91, 0.8] : [0.9, 0.62, 0, 0.75]);
    }
  }

  /** Fields of view as pyramids that end at the target, and lines of sight. */
  drawFields() {
    this.scene.sensors.forEach((sensor, number) => {
      const q = this.poseOf(number);
      if (!sensor.corners) return;
      const eye = this.placeOf(sensor.observer), target = sensor.object >= 0 ? this.placeOf(sensor.object + this.scene.observers.length) : null;
      const range = target ? math.length(math.add(target, eye, -1)) : 6;
      if (target) this.painter.draw('lines', [...eye, ...target], math.hidden(eye, target) ? [0.84, 0.37, 0, 1] : [0.18, 0.78, 0.61, 0.9]);
      if (!q || !(range > 0)) return;
      const corners = sensor.corners.map((ray) => math.add(eye, math.turnedBack(q, ray), range));
      const sides = corners.flatMap((corner, k) => [...eye, ...corner, ...corners[(k + 1) % 4]]);
      this.painter.draw('triangles', sides, [0.34, 0.71, 0.91, 0.2]);
      this.painter.draw('lines', corners.flatMap((corner, k) => [...eye, ...corner, ...corner, ...corners[(k + 1) % 4]]), [0.34, 0.71, 0.91, 0.7]);
    });
  }

  /** The umbra, as a cone of lines to 12 Earth radii: it ends at 217. */
  drawShadow(sun) {
    const x = math.across(sun), y = math.cross(sun, x), far = 12, narrow = 1 - far / 217, lines = [];
    const at = (angle, radius, back) => math.add(math.add(math.scaled(x, radius * Math.cos(angle)), y, radius * Math.sin(angle)), sun, -back);
    for (let k = 0; k < 48; k++) {
      const a = Math.PI * k / 24, b = Math.PI * (k + 1) / 24;
      if (k % 2 === 0) lines.push(...at(a, 1, 0), ...at(a, narrow, far));
      lines.push(...at(a, narrow, far), ...at(b, narrow, far));
    }
    this.painter.draw('lines', lines, [0.6, 0.65, 0.75, 0.45]);
  }

  drawNames(matrix, eye, width, height, ratio, bodies) {
    const context = this.overlay.getContext('2d');
    Object.assign(this.overlay, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
    context.scale(ratio, ratio);
    if (!element('space-names').checked) return;
    context.font = '12px system-ui, sans-serif';
    context.textBaseline = 'middle';
    const write = (name, place, colour) => {
      const at = math.onScreen(matrix, math.add(place, eye, -1), width, height);
      if (!at || at.x < 0 || at.y < 0 || at.x > width || at.y > height) return;
      context.fillStyle = colour;
      context.fillText(name, at.x + 8, at.y);
    };
    const near = Boolean(bodies.shape && !this.through); // only what its lines are
    for (const body of near ? [] : this.named()) {
      const place = this.placeOf(body);
      if (!place.some(Number.isNaN) && !math.hidden(eye, place)) write(this.names[body], place, body < this.scene.observers.length ? '#8fd0f5' : '#f0b95a');
    }
    if (near) {
      const { ends, place, sunlit } = bodies.shape, sensor = this.scene.sensors[this.app.sensor];
      write(sunlit > 0 ? 'Sun' : 'Sun, behind the Earth', math.add(place, ends.sun), '#ffe08a');
      if (ends.eye) write(this.scene.observers[sensor.observer], math.add(place, ends.eye), '#8fd0f5');
      return;
    }
    if (!this.through && element('space-keep-out').checked) {
      const sensor = this.scene.sensors[this.app.sensor];
      for (const cone of bodies.cones) write(`${cone.name} keep-out`, coneShape(this.placeOf(sensor.observer), cone).top, '#c8cfd6');
    }
    if (!math.hidden(eye, bodies.sun)) write('Sun', bodies.sun, '#ffe08a');
    if (!math.hidden(eye, bodies.moon)) write('Moon', bodies.moon, '#d3d8de');
  }

  /** The geometry of the sensor's target in words. */
  describe(moon, cones, shape) {
    const sensor = this.scene.sensors[this.app.sensor], parts = [];
    const pair = (key, text) => parts.push(make('span', {}, make('span', { className: 'key', textContent: key }), text));
    if (sensor && sensor.observer >= 0) {
      const eye = this.placeOf(sensor.observer), sun = math.unit([...this.before.slice(0, 3)]);
      pair(this.scene.observers[sensor.observer], `${km(math.length(eye) - 1)} high`);
      if (sensor.object >= 0) {
        const target = this.placeOf(sensor.object + this.scene.observers.length), way = math.add(target, eye, -1);
        const degrees = (a, b) => `${(Math.acos(Math.min(1, Math.max(-1, math.dot(math.unit(a), math.unit(b))))) * 180 / Math.PI).toFixed(1)}°`;
        pair(this.scene.objects[sensor.object], math.hidden(eye, target) ? 'behind the Earth' : 'in view');
        pair('Range', km(math.length(way)));
        pair('Sun from the line of sight', degrees(way, sun));
        pair('Moon', degrees(way, math.add(moon, eye, -1)));
        pair('Phase angle', degrees(sun, math.scaled(way, -1)));
      }
      const q = this.poseOf(this.app.sensor), boresight = q && math.turnedBack(q, [0, 0, 1]);
      for (const cone of boresight ? cones : []) {
        const angle = clearance(cone, boresight), degree = (value) => `${(value * 180 / Math.PI).toFixed(1)}°`;
        pair(`Boresight from the ${cone.from}`, `${degree(angle)}, ${angle < cone.limit ? 'inside' : 'outside'} the keep-out of ${degree(cone.limit)}`);
      }
    }
    if (shape) {
      pair('Sunlight', `${Math.round(100 * shape.sunlit)} %`);
      pair('Attitude', !shape.current ? 'of another time, until it is loaded' : shape.recorded ? 'as recorded in this frame' : 'of the scenario at this time');
    }
    for (const { problem, problemAt } of this.shapes.shapes.values()) if (problem && problemAt === this.time) pair('Shape', problem);
    element('space-readout').replaceChildren(...parts);
  }
}

/** Opens the panel. @param {HTMLElement} box @param {any} app */
export async function open(box, app) {
  await addStyle('space.css');
  box.classList.add('space');
  box.append(layout('layout-space'));
  const view = new SpaceView(app, await getJson('space/scene'));
  view.poses = await Promise.all(view.scene.sensors.map((_, sensor) => getNumbers('space/poses', { sensor })));
  view.painter.setCoast(math.coastSegments(await getBytes('space/coast')));
  document.space = view; // for tests of the page
  return {
    shown() {
      view.shown = true;
      view.follow();
    },
    hidden() { view.shown = false; },
  };
}
