// What the program answers about a live run (view/live_socket.h), for the page and for the worker that draws.

/** Exposures whose track positions are drawn as trails, as those of recorded runs. */
const TRAIL_EXPOSURES = 40;

/** The words of an answer. @param {ArrayBuffer} data */
export function readAnswer(data) {
  const length = new DataView(data).getUint32(0, true);
  return JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
}

/** Its pixels; null: none. @param {ArrayBuffer} data @param {any} answer @returns {import('./frame_parts.js').Image | null} */
export function imageOf(data, answer) {
  const { width, height } = answer, length = new DataView(data).getUint32(0, true);
  return width > 0 ? { width, height, data: new Uint16Array(data, 4 + length, width * height), binning: answer.binning,
    frameWidth: answer.frame_width, frameHeight: answer.frame_height, x: answer.x, y: answer.y } : null;
}

/** Tracks of the exposures before the newest one. */
export class Trail {
  /** @param {{id: number, tracks: any[]}[]} [exposures] */
  constructor(exposures = []) { this.exposures = exposures; }

  /** Number of the newest exposure; -1: none. */
  get newest() { return this.exposures.length ? this.exposures[this.exposures.length - 1].id : -1; }

  /** Adds an exposure: its tracks before, and whether it was there already (with other pixels). @param {any} details */
  add(details) {
    const { exposures } = this, again = exposures.length > 0 && details.exposure_id === this.newest;
    if (again) exposures.pop();
    if (exposures.length && details.exposure_id <= this.newest) exposures.length = 0; // the run has gone back
    const earlier = exposures.flatMap((one) => one.tracks);
    exposures.push({ id: details.exposure_id, tracks: details.tracks.map((track) => ({ ...track, now: false })) });
    if (exposures.length > TRAIL_EXPOSURES) exposures.shift();
    return { earlier, again };
  }
}
