// The frame without noise in the place of the frame, or both in turn: from the planes that a run recorded beside its frames.
import { getNoiseFree } from './api.js';

/** Time that each of the two is shown, ms: less than three changes a second. */
const TURN_MS = 500;

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

export class Blink {
  /** @param {any} app */
  constructor(app) {
    this.app = app;
    this.turn = false;
    this.timer = 0;
    this.request = null;
    element('shown').addEventListener('change', () => this.update());
    document.addEventListener('frameshown', () => this.update());
    document.addEventListener('liveframe', () => this.update());
  }

  /** What is shown: "frame", "clean" or "blink". */
  get what() { return element('shown').value; }

  /** Offers what a sensor of a run has. @param {any} sensor */
  offer(sensor) {
    const planes = this.app.exported ? [] : (sensor && sensor.planes) || [];
    element('shown-label').hidden = planes.length === 0;
    element('shown-label').title = `Noise-free: expected electrons of ${planes.join(', ')} in digital numbers`;
    if (planes.length === 0) element('shown').value = 'frame';
  }

  /** To the next way of showing the frame. */
  next() {
    const { options, selectedIndex } = element('shown');
    if (element('shown-label').hidden) return;
    element('shown').selectedIndex = (selectedIndex + 1) % options.length;
    this.update();
  }

  /** Asks for the frame without noise, if it is to be shown. */
  async update() {
    const { app } = this, { frameView, current, sensor } = app, live = app.live && app.live.newest && !app.live.over;
    if (this.request) this.request.abort();
    clearInterval(this.timer);
    frameView.setClean(null);
    if (this.what === 'frame' || live || current < 0 || !frameView.image) return;
    this.request = new AbortController();
    const { signal } = this.request;
    try {
      const image = await getNoiseFree(sensor, current, signal, { binning: frameView.binning() });
      if (signal.aborted) return;
      this.turn = true;
      frameView.getCleanPart = (part) => getNoiseFree(sensor, current, undefined, part);
      if (!frameView.setClean(image)) throw new Error(`${image.frameWidth} × ${image.frameHeight} pixels, the frame has ${frameView.image.frameWidth} × ${frameView.image.frameHeight}`);
      if (this.what !== 'blink') return;
      this.timer = window.setInterval(() => {
        this.turn = !this.turn;
        frameView.setClean(image, this.turn);
      }, TURN_MS);
    } catch (error) {
      if (signal.aborted) return;
      element('shown').value = 'frame';
      app.showProblems([`The frame without noise: ${error.message}`]);
    }
  }
}
