// Marks over a frame: truth, detections, identified stars, tracks. Kinds differ by shape and colour.
import { placesOf } from './prediction.js';
import { compassOf, scaleOf, skyToPixel } from './wcs.js';

/** Kinds in the order in which they are drawn. Colours: Okabe and Ito (2008). */
export const KINDS = [
  { name: 'windows', title: 'Windows', colour: '#cfb0ff', shape: 'window', shown: true },
  { name: 'stars', title: 'True stars', colour: '#b8c4cf', shape: 'plus', shown: false },
  { name: 'identified', title: 'Stars', colour: '#2fc79b', shape: 'circle', shown: true },
  { name: 'detections', title: 'Detections', colour: '#f0e442', shape: 'circle', shown: true },
  { name: 'objects', title: 'True objects', colour: '#e884c0', shape: 'square', shown: true },
  { name: 'target', title: 'True target', colour: '#ff7a33', shape: 'square', shown: true },
  { name: 'predicted', title: 'Predicted', colour: '#a9d8ff', shape: 'cross', shown: false },
  { name: 'tracks', title: 'Tracks', colour: '#56b4e9', shape: 'diamond', shown: true },
];

/** Ellipses contain 98.9 % of the errors: 3 sigma in two dimensions. */
const SIGMAS = 3;

/**
 * Windows that image processing searched, each once with what was expected there. Edges are those of pixels.
 * @param {any[]} rows one for each reason of a window, in pixels of the frame
 */
export function windowsOf(rows) {
  const windows = new Map();
  for (const row of rows) {
    const what = row.reason === 'star' ? `star ${row.star_id}` : row.reason === 'target' ? `target (track ${row.track_id})` : `track ${row.track_id}`;
    const held = windows.get(row.window);
    if (held) held.said += `, ${what}`;
    else {
      windows.set(row.window, {
        x: row.x0 + (row.width - 1) / 2, y: row.y0 + (row.height - 1) / 2,
        left: row.x0 - 0.5, top: row.y0 - 0.5, right: row.x0 + row.width - 0.5, bottom: row.y0 + row.height - 0.5, said: `window: ${what}`,
      });
    }
  }
  return [...windows.keys()].sort((a, b) => a - b).map((number) => windows.get(number));
}

/** Sorts what the server sent about a frame by kind. */
export function sortMarks(frame) {
  const sorted = { windows: windowsOf(frame.windows || []), stars: [], identified: [], detections: [], objects: [], target: [], predicted: [], tracks: [], trail: [] };
  for (const mark of frame.truth) {
    if (mark.kind === 'star') sorted.stars.push(mark);
    else if (mark.kind === 'star_ghost') sorted.stars.push({ ...mark, said: `ghost of star ${mark.id}` });
    else {
      const name = frame.names[mark.id] || (mark.norad > 0 ? `NORAD ${mark.norad}` : `object ${mark.id}`);
      if (mark.kind === 'object_ghost') sorted.objects.push({ ...mark, text: `ghost of ${name}` });
      else (mark.id === frame.target ? sorted.target : sorted.objects).push({ ...mark, text: name });
    }
  }
  for (const mark of frame.detections) {
    (mark.label === 'star' ? sorted.identified : sorted.detections).push(mark);
  }
  const { tracks, predicted } = placesOf(frame);
  sorted.tracks = tracks.map((mark) => ({ ...mark, text: `track ${mark.id}` }));
  sorted.predicted = predicted;
  sorted.trail = frame.tracks.filter((mark) => !mark.now);
  return sorted;
}

export function drawShape(context, shape, x, y, r) {
  context.beginPath();
  if (shape === 'circle') context.arc(x, y, r, 0, 2 * Math.PI);
  else if (shape === 'square') context.rect(x - r, y - r, 2 * r, 2 * r);
  else if (shape === 'plus') {
    context.moveTo(x - r, y); context.lineTo(x + r, y); context.moveTo(x, y - r); context.lineTo(x, y + r);
  } else if (shape === 'cross') {
    context.moveTo(x - r, y - r); context.lineTo(x + r, y + r); context.moveTo(x - r, y + r); context.lineTo(x + r, y - r);
  } else {
    context.moveTo(x, y - r); context.lineTo(x + r, y); context.lineTo(x, y + r); context.lineTo(x - r, y);
    context.closePath();
  }
  context.stroke();
}

/** Shapes in the legend, of 16 x 16. */
const SAMPLES = {
  circle: 'M8 2.7a5.3 5.3 0 1 0 0 10.6a5.3 5.3 0 1 0 0-10.6z', square: 'M3.5 3.5h9v9h-9z', plus: 'M2.7 8h10.6M8 2.7v10.6',
  cross: 'M2.7 2.7l10.6 10.6M2.7 13.3L13.3 2.7', diamond: 'M8 2.7L13.3 8L8 13.3L2.7 8z',
  window: 'M3 6.5v-3.5h3.5M9.5 3h3.5v3.5M13 9.5v3.5h-3.5M6.5 13h-3.5v-3.5',
};

/** Picture of a mark for the legend. No canvas: the browser composes each of those anew in every picture of the page. @param {typeof KINDS[number]} kind */
export function makeSample(kind) {
  const of = (name, attributes) => {
    const node = document.createElementNS('http://www.w3.org/2000/svg', name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    return node;
  };
  const sample = of('svg', { viewBox: '0 0 16 16', class: 'sample', 'aria-hidden': 'true' });
  sample.append(of('path', { d: SAMPLES[kind.shape], stroke: kind.colour }));
  return sample;
}

/** Half axes and angle of an error ellipse; null without a covariance. */
export function ellipseOf(mark) {
  if (![mark.xx, mark.xy, mark.yy].every(Number.isFinite)) return null;
  const mean = (mark.xx + mark.yy) / 2, half = (mark.xx - mark.yy) / 2, root = Math.hypot(half, mark.xy);
  if (mean - root < 0) return null;
  return { major: Math.sqrt(mean + root), minor: Math.sqrt(mean - root), angle: 0.5 * Math.atan2(2 * mark.xy, mark.xx - mark.yy) };
}

/** Windows have their own size: the middle of the line is on the edge of their pixels. */
function drawWindows(context, windows, view) {
  context.strokeStyle = KINDS[0].colour;
  context.lineWidth = 1;
  context.setLineDash([6, 3]);
  for (const { left, top, right, bottom } of windows) {
    const a = view.toScreen(left, top), b = view.toScreen(right, bottom);
    context.strokeRect(a.x, a.y, b.x - a.x, b.y - a.y);
  }
  context.setLineDash([]);
}

function drawText(context, text, x, y, colour) {
  context.lineWidth = 3;
  context.strokeStyle = 'rgb(0 0 0 / 75%)';
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

/** A streak is drawn as a line with an open circle at its middle. */
function drawStreak(context, mark, at, scale) {
  const angle = mark.angle_deg * Math.PI / 180, half = 0.5 * mark.length * scale;
  context.beginPath();
  context.moveTo(at.x - half * Math.cos(angle), at.y - half * Math.sin(angle));
  context.lineTo(at.x + half * Math.cos(angle), at.y + half * Math.sin(angle));
  context.stroke();
}

/** Earlier places of the tracks on the sky, relative to their present ones. */
function drawTrails(context, sorted, wcs, view) {
  const colour = KINDS[KINDS.length - 1].colour;
  for (const track of sorted.tracks) {
    const here = wcs && skyToPixel(wcs, track.ra_deg, track.dec_deg);
    if (!here) continue;
    const past = sorted.trail.filter((mark) => mark.id === track.id && Number.isFinite(mark.ra_deg));
    context.strokeStyle = colour;
    context.lineWidth = 1.25;
    context.beginPath();
    for (const mark of [...past, track]) {
      const there = skyToPixel(wcs, mark.ra_deg, mark.dec_deg);
      if (!there) continue;
      // directions have errors of attitude: only differences count
      const at = view.toScreen(track.x + there.x - here.x, track.y + there.y - here.y);
      context.lineTo(at.x, at.y);
    }
    context.stroke();
  }
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {ReturnType<typeof sortMarks>} sorted
 * @param {{toScreen: (x: number, y: number) => {x: number, y: number}, scale: number, width: number,
 *   height: number, shown: Record<string, boolean>}} view
 */
export function drawMarks(context, sorted, wcs, view) {
  const size = Math.min(14, Math.max(6, 1.6 * view.scale));
  context.font = '12px system-ui, sans-serif';
  context.lineJoin = 'round';
  if (view.shown.windows) drawWindows(context, sorted.windows, view);
  if (view.shown.tracks) drawTrails(context, sorted, wcs, view);
  for (const kind of KINDS) {
    if (!view.shown[kind.name] || kind.shape === 'window') continue;
    for (const mark of sorted[kind.name]) {
      if (!Number.isFinite(mark.x) || !Number.isFinite(mark.y)) continue;
      const at = view.toScreen(mark.x, mark.y);
      if (at.x < -40 || at.y < -40 || at.x > view.width + 40 || at.y > view.height + 40) continue;
      context.strokeStyle = kind.colour;
      context.lineWidth = kind.name === 'target' || kind.name === 'tracks' ? 2 : 1.25;
      const r = kind.name === 'target' ? size + 5 : kind.name === 'tracks' ? size + 2 : kind.shape === 'plus' ? 4 : kind.shape === 'cross' ? 5 : size;
      if (mark.coasts) context.setLineDash([4, 3]); // a track that was not updated in this frame
      if (mark.length * view.scale > 3 * r) drawStreak(context, mark, at, view.scale);
      else drawShape(context, kind.shape, at.x, at.y, r);
      const ellipse = ['circle', 'cross', 'diamond'].includes(kind.shape) ? ellipseOf(mark) : null;
      if (ellipse && SIGMAS * ellipse.major * view.scale > 3) {
        context.beginPath();
        context.ellipse(at.x, at.y, SIGMAS * ellipse.major * view.scale, SIGMAS * ellipse.minor * view.scale, ellipse.angle, 0, 2 * Math.PI);
        context.stroke();
      }
      context.setLineDash([]);
      if (mark.text) drawText(context, mark.text, at.x + r + 4, at.y + (kind.name === 'tracks' ? 14 : -4), kind.colour);
    }
  }
}

/** Round number of arcseconds near a length. */
function roundAngle(arcsec) {
  const steps = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 18000, 36000];
  if (arcsec < 1) return 10 ** Math.floor(Math.log10(arcsec));
  return steps.reduce((best, step) => (step <= arcsec ? step : best), 1);
}

function angleText(arcsec) {
  return arcsec >= 3600 ? `${arcsec / 3600}°` : arcsec >= 60 ? `${arcsec / 60}′` : `${arcsec}″`;
}

/** Scale bar, and arrows to north and east. */
export function drawCompass(context, wcs, view) {
  const colour = '#f4f7fa', x = view.width - 52, y = view.height - 54;
  const arcsecPerPx = 3600 * scaleOf(wcs) / view.scale, angle = roundAngle(110 * arcsecPerPx);
  const length = angle / arcsecPerPx, { north, east } = compassOf(wcs);
  const line = (ax, ay, bx, by) => {
    for (const [width, stroke] of [[4, 'rgb(0 0 0 / 65%)'], [1.75, colour]]) {
      context.lineWidth = width;
      context.strokeStyle = stroke;
      context.beginPath(); context.moveTo(ax, ay); context.lineTo(bx, by); context.stroke();
    }
  };
  context.font = '600 12px system-ui, sans-serif';
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  for (const { direction, text } of [{ direction: north, text: 'N' }, { direction: east, text: 'E' }]) {
    line(x, y, x + 26 * direction.x, y + 26 * direction.y);
    drawText(context, text, x + 37 * direction.x, y + 37 * direction.y, colour);
  }
  const left = 16, bottom = view.height - 16;
  line(left, bottom, left + length, bottom);
  line(left, bottom - 4, left, bottom + 4);
  line(left + length, bottom - 4, left + length, bottom + 4);
  drawText(context, angleText(angle), left + length / 2, bottom - 12, colour);
  context.textAlign = 'start';
  context.textBaseline = 'alphabetic';
}
