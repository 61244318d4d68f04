// Requests to the program that serves this page. The token is part of the page's own address.

/** The server refused or failed; the message is for the user. */
export class ServerError extends Error {}

/** Number of the run that the page shows: ?run=N in its address. */
const RUN = new URLSearchParams(location.search).get('run') || '0';

/**
 * @param {string} route below "api/"
 * @param {Record<string, string | number>} query
 * @param {AbortSignal} [signal]
 */
async function get(route, query, signal) {
  const words = new URLSearchParams({ run: RUN });
  for (const [name, value] of Object.entries(query)) words.set(name, String(value));
  const response = await fetch(`api/${route}?${words}`, { signal, cache: 'no-store' });
  if (!response.ok) {
    const text = await response.text();
    throw new ServerError(text || `${response.status} ${response.statusText}`);
  }
  return response;
}

/** @param {string} route @param {Record<string, string | number>} [query] @param {AbortSignal} [signal] */
export async function getJson(route, query = {}, signal = undefined) {
  return (await get(route, query, signal)).json();
}

/** @param {string} route */
export async function getBytes(route) {
  return (await get(route, {}, undefined)).arrayBuffer();
}

/** 64-bit floating-point numbers. @param {string} route @param {Record<string, string | number>} query */
export async function getNumbers(route, query, signal = undefined) {
  return new Float64Array(await (await get(route, query, signal)).arrayBuffer());
}

/**
 * Pixels of a frame or of a part of it, [height][width], 16 bits, or the means of their bins.
 * @param {number} sensor @param {number} frame @param {AbortSignal} [signal]
 * @param {number | string} [run] another one than the page's
 * @param {{x?: number, y?: number, width?: number, height?: number, binning?: number, longest?: number}} [part] longest: side of the answer at most
 */
export async function getPixels(sensor, frame, signal = undefined, run = RUN, part = {}) {
  return getImage('pixels', { sensor, frame, run, ...part }, signal);
}

/** A small picture of a frame: peaks of its bins. @param {number} sensor @param {number} frame @param {AbortSignal} [signal] */
export async function getThumbnail(sensor, frame, signal = undefined) {
  return getImage('thumbnail', { sensor, frame }, signal);
}

/** The frame without noise, or a part of it as `getPixels`, from planes that the run recorded. @param {number} sensor @param {number} frame @param {AbortSignal} [signal] */
export async function getNoiseFree(sensor, frame, signal = undefined, part = {}) {
  return getImage('noise_free', { sensor, frame, ...part }, signal);
}

/** @param {string} route @param {Record<string, string | number>} query @param {AbortSignal} [signal] */
async function getImage(route, query, signal) {
  const response = await get(route, query, signal), { headers } = response, data = new Uint16Array(await response.arrayBuffer());
  const width = Number(headers.get('X-Frame-Width')), height = Number(headers.get('X-Frame-Height'));
  const pair = (name, other) => (headers.get(name) || other).split(' ').map(Number);
  const [frameWidth, frameHeight] = pair('X-Frame-Size', `${width} ${height}`), [x, y] = pair('X-Frame-Part', '0 0');
  return { width, height, data, binning: Number(headers.get('X-Frame-Binning')) || 1, frameWidth, frameHeight, x, y };
}

/** Adds a style sheet of the page. @param {string} file */
export function addStyle(file) {
  const link = document.createElement('link');
  link.rel = 'stylesheet';
  link.href = file;
  document.head.append(link);
  return new Promise((done) => { link.onload = link.onerror = done; });
}

/** Sends text to a route and gets JSON. @param {string} route @param {string} body */
export async function post(route, body) {
  const response = await fetch(`api/${route}?run=${RUN}`, { method: 'POST', body, cache: 'no-store' });
  if (!response.ok) throw new ServerError((await response.text()) || `${response.status} ${response.statusText}`);
  return response.json();
}

/** Sends a file to a route and gets JSON. @param {string} route @param {string} name @param {Blob} file */
export async function postFile(route, name, file) {
  const response = await fetch(`api/${route}?run=${RUN}&name=${encodeURIComponent(name)}`, { method: 'POST', body: file, cache: 'no-store' });
  if (!response.ok) throw new ServerError((await response.text()) || `${response.status} ${response.statusText}`);
  return response.json();
}
