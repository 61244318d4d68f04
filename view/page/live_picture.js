// The page's side of the worker that has the connection of a live run and draws its pictures (live_worker.js).

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

/** From this scale on the page draws: it has the pixel under the cursor, and values. */
const SCALE_MOST = 6;

/** A WebSocket in the worker, as far as the page uses one: events "open", "message" and "close". */
class WorkerSocket extends EventTarget {
  /** @param {Worker} worker */
  constructor(worker) {
    super();
    this.worker = worker;
    /** @type {number} */
    this.readyState = WebSocket.CONNECTING;
    this.binaryType = 'arraybuffer';
  }

  /** @param {string} text */
  send(text) { this.worker.postMessage({ send: text }); }

  /** @param {string} type @param {any} [data] @param {number} [state] */
  tell(type, data = null, state = this.readyState) {
    this.readyState = state;
    this.dispatchEvent(new MessageEvent(type, { data }));
  }
}

export class LivePicture {
  /** @param {any} live @param {any} frameView */
  constructor(live, frameView) {
    this.live = live;
    this.frameView = frameView;
    /** @type {Worker | null} */
    this.worker = null;
    this.canvas = false; // the worker has it
    this.failed = typeof Worker === 'undefined' || !('transferControlToOffscreen' in HTMLCanvasElement.prototype);
    this.shown = false;
    this.scale = 0; // of the view that the worker has
    /** @type {WorkerSocket | null} */
    this.socket = null;
    this.counted = null; // gets the number of frames
  }

  /** @param {URL} address @returns {WebSocket | WorkerSocket} */
  connect(address) {
    if (!this.worker && !this.failed) {
      this.worker = new Worker('live_worker.js', { type: 'module' });
      this.worker.onmessage = ({ data }) => this.take(data);
      this.worker.onerror = () => { // it could not be loaded, or failed: the page does all itself
        this.failed = true;
        this.hide();
        this.worker.terminate(); // and closes its connection, which may control the run
        if (this.socket) this.socket.tell('close', null, WebSocket.CLOSED);
      };
    }
    if (this.failed) return new WebSocket(address);
    this.worker.postMessage({ connect: address.href });
    this.socket = new WorkerSocket(this.worker);
    return this.socket;
  }

  /** @param {any} data of the worker */
  take({ open, closed, message, shown = 0, trail, count }) {
    const { live, socket } = this;
    if (this.failed || !socket) return;
    live.shown += shown;
    if (trail && live.asked === live.app.sensor) live.trail.exposures = trail; // not of the sensor before
    if (open) socket.tell('open', null, WebSocket.OPEN);
    else if (closed) socket.tell('close', null, WebSocket.CLOSED);
    else if (message) socket.tell('message', message);
    else if (count !== undefined) this.counted(live.shown + count);
    else live.ask(); // it has the turn
  }

  /** True if pictures can be drawn by the worker: whole ones, where no graphics processor draws them. @param {any} image */
  suits(image) {
    const { made, view, clean } = this.frameView;
    return Boolean(!this.failed && this.worker && image && made && made.plain && !clean && !(view.scale * image.binning >= SCALE_MOST));
  }

  /**
   * Lets the worker draw an answer, which is given away, and go on alone.
   * @param {ArrayBuffer} answer @param {{asked: any, trail: any[], time: number}} how what it asks for next, tracks before this one, and for how long, ms
   */
  show(answer, how) {
    const first = this.shown ? {} : { trail: how.trail, view: this.frameView.picture() }, message = { answer, asked: how.asked, time: how.time, ...first };
    if (!this.canvas) {
      const canvas = element('live-image').transferControlToOffscreen();
      this.canvas = true;
      this.worker.postMessage({ ...message, canvas }, [answer, canvas]);
    } else this.worker.postMessage(message, [answer]);
    if (this.shown) return;
    this.shown = true;
    this.scale = this.frameView.view.scale;
    this.frameView.remote = this;
    element('live-image').hidden = false;
    element('stage').classList.add('live-shown');
  }

  /** What is shown of the frame has changed: other pixels may be asked for. @param {any} view */
  setView(view) {
    this.worker.postMessage({ view, stop: view.scale !== this.scale });
    this.scale = view.scale;
  }

  /** The page has something to ask for. */
  stop() { if (this.shown) this.worker.postMessage({ stop: true }); }

  /** Number of the frames that were shown. @returns {Promise<number>} */
  count() {
    if (!this.shown) return Promise.resolve(this.live.shown);
    return new Promise((done) => {
      this.counted = done;
      this.worker.postMessage({ count: true });
    });
  }

  /** The page draws again. */
  hide() {
    if (!this.shown) return;
    this.stop();
    this.shown = false;
    this.frameView.remote = null;
    element('live-image').hidden = true;
    element('stage').classList.remove('live-shown');
    this.frameView.redraw();
  }
}
