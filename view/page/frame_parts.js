// Parts of frames that are too large to be sent whole: a binned picture of all, and the shown part with finer pixels.

/** Sides up to which a frame is sent whole, px. */
export const WHOLE_PX = 2048;
/** Corners of parts are multiples of so many bins: a small move asks for nothing. */
const GRID = 64;
/** Share of the stage that a part has beside it, on each side, while it has few pixels. */
const MARGIN = 0.25;
/** Pixels of a part with a margin. */
const WITH_MARGIN_MOST = 1 << 23;

/**
 * Pixels of the sent image, and where they are in the frame (`x`, `y`: its first pixel; missing: 0).
 * @typedef {{ width: number, height: number, data: Uint16Array, binning?: number, frameWidth?: number, frameHeight?: number, x?: number, y?: number }} Image
 * @typedef {{ x: number, y: number, width: number, height: number, binning: number }} Part
 * @typedef {{ left: number, top: number, right: number, bottom: number }} Box edges in pixels of the frame: pixel i covers i to i + 1
 */

/**
 * Longest side of the picture of a whole frame: larger frames are binned until they fit.
 * @param {number} side longest one of the frame; 0: unknown @param {number} stage longest side of the stage, pixels of the screen
 */
export function longestSide(side, stage) {
  if (side > 0 && side <= WHOLE_PX) return WHOLE_PX;
  return Math.min(WHOLE_PX, Math.max(512, 256 * Math.ceil(stage / 256)));
}

/** Pixels of the frame along a side of those that the screen can show: a power of two. @param {number} scale pixels of the screen per pixel of the frame */
export function binningAt(scale) { return 2 ** Math.floor(Math.log2(Math.max(1, 1.02 / scale))); }

/**
 * The part of a frame to ask for; null: nothing of it is shown.
 * @param {Box} box what is shown @param {{width: number, height: number}} frame @param {number} binning
 * @returns {Part | null}
 */
export function partFor(box, frame, binning) {
  const step = GRID * binning, across = box.right - box.left, down = box.bottom - box.top;
  const many = across * down * (1 + 2 * MARGIN) ** 2 / binning ** 2 > WITH_MARGIN_MOST, margin = many ? 0 : MARGIN;
  const low = (edge, side) => Math.max(0, step * Math.floor((edge - margin * side) / step));
  const high = (edge, side, most) => Math.min(most, step * Math.ceil((edge + margin * side) / step));
  const x = low(box.left, across), y = low(box.top, down), width = high(box.right, across, frame.width) - x, height = high(box.bottom, down, frame.height) - y;
  return width > 0 && height > 0 ? { x, y, width, height, binning } : null;
}

/** True if an image has what is shown of a frame, in bins of at most this size. @param {Image | null} image @param {Box} box @param {{width: number, height: number}} frame @param {number} binning */
export function covers(image, box, frame, binning) {
  if (!image || (image.binning || 1) > binning) return false;
  const n = image.binning || 1, x = image.x || 0, y = image.y || 0;
  return x <= Math.max(0, box.left) && y <= Math.max(0, box.top) && x + n * image.width >= Math.min(frame.width, box.right) && y + n * image.height >= Math.min(frame.height, box.bottom);
}

/** Value of the image at a pixel of the frame; undefined: it has none. @param {Image | null} image @param {number} x @param {number} y */
export function valueAt(image, x, y) {
  if (!image) return undefined;
  const n = image.binning || 1, column = Math.floor((x - (image.x || 0)) / n), row = Math.floor((y - (image.y || 0)) / n);
  return column >= 0 && row >= 0 && column < image.width && row < image.height ? image.data[row * image.width + column] : undefined;
}
