// The canvas of the pictures of a live run, which a worker draws.

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

/** Time after which the worker is not waited for, ms: it does not draw what is not on the screen. */
const WAIT_MS = 300;

export class LivePicture {
  /** @param {any} frameView */
  constructor(frameView) {
    this.frameView = frameView;
    /** @type {Worker | null} */
    this.worker = null;
    this.failed = !('transferControlToOffscreen' in HTMLCanvasElement.prototype);
    this.shown = false;
    this.drawn = null; // called when the newest picture is drawn
    this.timer = 0;
  }

  /** True if pictures can be drawn by the worker: whole ones without values, where no graphics processor draws them. @param {any} image */
  suits(image) {
    const { made, view, clean } = this.frameView;
    return Boolean(!this.failed && image && made && made.plain && !clean && !(view.scale * image.binning >= 6));
  }

  start() {
    const canvas = element('live-image').transferControlToOffscreen();
    this.worker = new Worker('live_worker.js', { type: 'module' });
    this.worker.onmessage = () => this.next();
    this.worker.onerror = () => { // it could not be loaded: the page draws again
      this.failed = true;
      this.hide();
      this.next();
    };
    this.worker.postMessage({ canvas }, [canvas]);
  }

  /** Draws an answer, which is given away. @param {ArrayBuffer} answer @param {any[]} trail of the exposures before it @param {() => void} drawn */
  show(answer, trail, drawn) {
    if (!this.worker) this.start();
    this.drawn = drawn;
    this.timer = window.setTimeout(() => this.next(), WAIT_MS);
    if (this.shown) {
      this.worker.postMessage({ answer }, [answer]);
      return;
    }
    this.shown = true;
    this.frameView.remote = this;
    this.worker.postMessage({ answer, trail, view: this.frameView.picture() }, [answer]);
    element('live-image').hidden = false;
    element('stage').classList.add('live-shown');
  }

  next() {
    const { drawn } = this;
    clearTimeout(this.timer);
    this.drawn = null;
    if (drawn) drawn();
  }

  /** What is shown of the frame has changed. @param {any} view */
  setView(view) { this.worker.postMessage({ view }); }

  /** The page draws again. */
  hide() {
    if (!this.shown) return;
    this.shown = false;
    this.frameView.remote = null;
    element('live-image').hidden = true;
    element('stage').classList.remove('live-shown');
    this.frameView.redraw();
  }
}
