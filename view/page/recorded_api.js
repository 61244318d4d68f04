// In the place of api.js in a page of `boresight export --page`: answers that the page holds, each in an element with the
// request as its key, compressed (zlib), in base64.

/** The page does not have it; the message is for the user. */
export class ServerError extends Error {}

/** @type {Map<string, HTMLElement>} */
const held = new Map([.../** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll('script[data-key]'))].map((one) => [one.dataset.key, one]));
/** What the page holds of the run: {space, sensors: [{rows, total, every, binning}]}. */
let about = null;

/** Key of a request: its names in the order of the alphabet. */
function keyOf(route, query) {
  const words = Object.keys(query).sort().map((name) => `${name}=${query[name]}`);
  return words.length ? `${route}?${words.join('&')}` : route;
}

/** @returns {Promise<ArrayBuffer>} what an element holds */
async function unpack(one) {
  const text = atob(one.textContent), packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'))).arrayBuffer();
}

async function get(route, query) {
  const one = held.get(keyOf(route, query));
  if (!one) throw new ServerError('this page does not have it: ask "boresight view" for the whole run');
  return unpack(one);
}

/** Spans of frames in the numbers of this page's frames; those without a frame here are left out. */
function spansHere(spans, rows) {
  const from = (row) => { // first frame here that is not before a row of the run
    let low = 0, high = rows.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (rows[middle] < row) low = middle + 1; else high = middle;
    }
    return low;
  };
  return spans.map((span) => ({ ...span, first: from(span.first), last: from(span.last + 1) - 1 })).filter((span) => span.first <= span.last);
}

/** Spans of all exposures of a sensor: an element for all frames. @type {Map<number, Promise<{around: number, spans: any[]}>>} */
const spansOf = new Map();

/** Spans of the exposures around a frame of this page, in its numbers. @param {number} sensor @param {number} frame */
async function spansAround(sensor, frame) {
  if (!spansOf.has(sensor)) spansOf.set(sensor, getJson('spans', { sensor }));
  const { around, spans } = await spansOf.get(sensor), { rows } = about.sensors[sensor], first = rows[frame] - around, last = rows[frame] + around;
  return spansHere(spans.filter((span) => span.last >= first && span.first <= last).map((span) => ({ ...span, first: Math.max(span.first, first), last: Math.min(span.last, last) })), rows);
}

/** @param {string} route @param {Record<string, string | number>} [query] */
export async function getJson(route, query = {}) {
  const answer = JSON.parse(new TextDecoder().decode(await get(route, query)));
  if (route === 'session') about = answer.exported;
  if (route === 'why' && answer.target) answer.spans = await spansAround(Number(query.sensor), Number(query.frame));
  return answer;
}

/** @param {string} route */
export async function getBytes(route) { return get(route, {}); }

/** 64-bit floating-point numbers. @param {string} route @param {Record<string, string | number>} query */
export async function getNumbers(route, query) {
  if (route === 'plot') return plotPart(new Float64Array(await get(route, { sensor: query.sensor, panel: query.panel })), { from: Number(query.from), to: Number(query.to) });
  return new Float64Array(await get(route, query));
}

/** The extents of a plot's lines in a range of time, and those beside it. */
function plotPart(numbers, { from, to }) {
  const found = [];
  for (let at = 0; at < numbers.length;) {
    const count = numbers[at++], place = found.push(0) - 1, end = at + 3 * count;
    for (let k = at; k < end; k += 3) {
      const before = k + 3 < end && numbers[k + 3] < from, after = k > at && numbers[k - 3] > to;
      if (before || after) continue;
      found.push(numbers[k], numbers[k + 1], numbers[k + 2]);
      found[place]++;
    }
    at = end;
  }
  return Float64Array.from(found);
}

/** Pixels of a frame: means of `binning` x `binning`, whatever part is asked for. @param {number} sensor @param {number} frame */
export async function getPixels(sensor, frame) {
  const one = held.get(keyOf('pixels', { frame, sensor })), bytes = new Uint8Array(await get('pixels', { frame, sensor }));
  const { width, height, binning, frame: size } = one.dataset, count = bytes.length / 2, data = new Uint16Array(count);
  for (let i = 0; i < count; i++) data[i] = bytes[i] | bytes[count + i] << 8;
  const [frameWidth, frameHeight] = size.split(',').map(Number);
  return { width: Number(width), height: Number(height), data, binning: Number(binning), frameWidth, frameHeight };
}

/** Longest side of a small picture (BST_VIEW_THUMBNAIL_PX). */
const THUMBNAIL_PX = 80;

/** @returns {Promise<any>} never: a page has no planes */
export async function getNoiseFree() { throw new ServerError('this page has no noise-free frames'); }

/** A small picture of a frame: peaks of bins of its pixels in this page. @param {number} sensor @param {number} frame */
export async function getThumbnail(sensor, frame) {
  const { width, height, data } = await getPixels(sensor, frame), n = Math.ceil(Math.max(width, height) / THUMBNAIL_PX);
  const across = Math.ceil(width / n), peaks = new Uint16Array(across * Math.ceil(height / n));
  for (let y = 0, k = 0; y < height; y++) {
    for (let x = 0, row = across * Math.floor(y / n); x < width; x++, k++) {
      const bin = row + Math.floor(x / n);
      if (data[k] > peaks[bin]) peaks[bin] = data[k];
    }
  }
  return { width: across, height: peaks.length / across, data: peaks };
}

/** The styles are in the page. */
export async function addStyle() {}

export async function postFile() { throw new ServerError('this page has no program behind it'); }

export async function post() { throw new ServerError('this page has no program behind it'); }
