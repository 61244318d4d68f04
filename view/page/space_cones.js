// What an observer keeps away from: cones about Sun, Moon and Earth, as control/guidance/keep_out.h has them.
import { add, across, cross, dot, EARTH_M, length, scaled, unit } from './space_math.js';

/** Colours of the cones, without opacity. */
const COLOURS = { Sun: [0.94, 0.78, 0.25], Moon: [0.75, 0.78, 0.82], Earth: [0.34, 0.62, 0.91] };
/** Length of the cones of Sun and Moon, Earth radii. */
const LONG = 2.5;
/** Greatest half angle of the Earth's cone, rad (control/guidance/keep_out.c). */
const WIDEST = Math.PI - 1e-6;

/**
 * @typedef {{ name: string, axis: number[], angle: number, length: number, limit: number, body: number, from: string }} Cone
 * angle: half angle, rad; limit: what the scenario gives, rad, from the centre or the limb; body: angle from the axis to there, rad
 */

/**
 * Cones of an observer.
 * @param {{ sun_deg: number, moon_deg: number, earth: boolean, earth_limb_deg: number, earth_limb_altitude_km: number }} keepOut
 * @param {number[]} eye place of the observer, Earth radii @param {number[]} sun direction @param {number[]} moon place
 * @returns {Cone[]}
 */
export function conesOf(keepOut, eye, sun, moon) {
  const rad = Math.PI / 180, cones = [], far = length(eye);
  if (keepOut.sun_deg > 0) cones.push({ name: 'Sun', axis: unit(sun), angle: keepOut.sun_deg * rad, limit: keepOut.sun_deg * rad, body: 0, length: LONG, from: 'Sun' });
  if (keepOut.moon_deg > 0) cones.push({ name: 'Moon', axis: unit(add(moon, eye, -1)), angle: keepOut.moon_deg * rad, limit: keepOut.moon_deg * rad, body: 0, length: LONG, from: 'Moon' });
  if (keepOut.earth) {
    const radius = 1 + 1000 * keepOut.earth_limb_altitude_km / EARTH_M, limit = keepOut.earth_limb_deg * rad;
    const limb = radius < far ? Math.asin(radius / far) : Math.PI / 2;
    cones.push({ name: 'Earth', axis: scaled(unit(eye), -1), angle: Math.min(limb + limit, WIDEST), limit, body: limb, length: Math.max(0.3, Math.sqrt(Math.max(0, far * far - 1))), from: 'Earth\'s limb' });
  }
  return cones.filter((cone) => cone.angle > 0 && cone.angle < Math.PI);
}

/** Angle from a cone's body, as its limit is measured, rad. @param {Cone} cone @param {number[]} direction unit */
export function clearance(cone, direction) {
  return Math.acos(Math.min(1, Math.max(-1, dot(cone.axis, direction)))) - cone.body;
}

/** Points of a cone: its rim, lines of its side, and triangles. @param {number[]} apex @param {Cone} cone */
export function coneShape(apex, cone) {
  const x = across(cone.axis), y = cross(cone.axis, x), lines = [], triangles = [], parts = 48;
  const at = (k) => {
    const turn = 2 * Math.PI * k / parts, side = add(scaled(x, Math.cos(turn)), y, Math.sin(turn));
    return add(apex, add(scaled(cone.axis, Math.cos(cone.angle)), side, Math.sin(cone.angle)), cone.length);
  };
  for (let k = 0; k < parts; k++) {
    const a = at(k), b = at(k + 1);
    lines.push(...a, ...b);
    if (k % 6 === 0) lines.push(...apex, ...a);
    triangles.push(...apex, ...a, ...b);
  }
  return { lines, triangles, top: at(parts / 4) };
}

/** Draws cones. @param {import('./space_gl.js').SpacePainter} painter @param {number[]} apex @param {Cone[]} cones */
export function drawCones(painter, apex, cones) {
  for (const cone of cones) {
    const { lines, triangles } = coneShape(apex, cone), colour = COLOURS[cone.name];
    painter.draw('triangles', triangles, [...colour, 0.07]);
    painter.draw('lines', lines, [...colour, 0.55]);
  }
}
