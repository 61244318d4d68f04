// Where a track was expected in a frame: its state before the frame, moved on at its rate, and the covariance of that place.
import { skyToPixel } from './wcs.js';

const DEG = Math.PI / 180;
/** Length of the steps by which directions become pixels, rad. */
const STEP = 1e-6;

/** Numbers of a state (view/frame_details.c): time, rates (arcsec/s), covariances of direction and rate. */
const T = 0, EAST = 1, NORTH = 2, D11 = 3, D12 = 4, D22 = 5, D1R1 = 6, D1R2 = 7, D2R1 = 8, D2R2 = 9, R11 = 10, R12 = 11, R22 = 12;

/**
 * Covariance of a direction after a time, rad^2: [11, 12, 22] along east and north. Process noise is left out.
 * @param {number[]} state @param {number} dt s
 */
export function covarianceAfter(state, dt) {
  return [state[D11] + 2 * dt * state[D1R1] + dt * dt * state[R11], state[D12] + dt * (state[D1R2] + state[D2R1]) + dt * dt * state[R12],
    state[D22] + 2 * dt * state[D2R2] + dt * dt * state[R22]];
}

/** Direction after a time at the rates of a state, deg. @param {{ra_deg: number, dec_deg: number, state: number[]}} mark @param {number} dt s */
export function directionAfter(mark, dt) {
  return { ra: mark.ra_deg + mark.state[EAST] * dt / 3600 / Math.cos(mark.dec_deg * DEG), dec: mark.dec_deg + mark.state[NORTH] * dt / 3600 };
}

/**
 * Place of a direction in a frame with its covariance there, px^2; null: not in front of the camera.
 * The WCS has the places of the catalogue, as directions of tracks are: aberration is in it.
 * @param {any} frame @param {{ra: number, dec: number}} direction deg @param {number[]} covariance rad^2 along east and north
 */
export function placeOf(frame, direction, covariance) {
  const pixel = (east, north) => skyToPixel(frame.wcs, direction.ra + east / DEG / Math.cos(direction.dec * DEG), direction.dec + north / DEG);
  const at = pixel(0, 0), e = pixel(STEP, 0), n = pixel(0, STEP);
  if (!at || !e || !n) return null;
  const [a, b, c, d] = [(e.x - at.x) / STEP, (n.x - at.x) / STEP, (e.y - at.y) / STEP, (n.y - at.y) / STEP], [v11, v12, v22] = covariance;
  return { x: at.x, y: at.y, xx: a * a * v11 + 2 * a * b * v12 + b * b * v22, xy: a * c * v11 + (a * d + b * c) * v12 + b * d * v22, yy: c * c * v11 + 2 * c * d * v12 + d * d * v22 };
}

/**
 * What is known of the tracks' places in a frame: `tracks`: a track that was not updated is where its state says, and all
 * have the covariance of their state; `predicted`: places that were expected of the tracks before the frame.
 * @param {any} frame what the server sent about it
 */
export function placesOf(frame) {
  const tracks = [], predicted = [], able = Boolean(frame.wcs);
  for (const track of frame.tracks) {
    if (!track.now) continue;
    if (!able || !track.state) {
      tracks.push(track);
      continue;
    }
    const here = placeOf(frame, { ra: track.ra_deg, dec: track.dec_deg }, covarianceAfter(track.state, 0));
    const coasts = track.misses > 0 && here;
    tracks.push(here ? { ...track, ...here, ...(coasts ? {} : { x: track.x, y: track.y }), coasts: Boolean(coasts) } : track);
    const before = frame.tracks.filter((one) => !one.now && one.id === track.id && one.state).reduce((last, one) => (last && last.state[T] > one.state[T] ? last : one), null);
    if (!before) continue;
    const dt = track.state[T] - before.state[T], place = placeOf(frame, directionAfter(before, dt), covarianceAfter(before.state, dt));
    if (place) predicted.push({ ...place, text: '', id: track.id, sigma_px: Math.sqrt(Math.max(place.xx, place.yy)) });
  }
  return { tracks, predicted };
}

