// Vectors, matrices and orbits of the view of space. Lengths in Earth radii, GCRF axes; matrices by columns, as WebGL has them.

/** Equatorial radius of the Earth, m (WGS 84), and its gravitational parameter, m^3/s^2 (EGM 2008). */
export const EARTH_M = 6378137;
const MU = 3.986004418e14;

export const add = (a, b, scale = 1) => [a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]];
export const scaled = (a, by) => [by * a[0], by * a[1], by * a[2]];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => scaled(a, 1 / (length(a) || 1));

/** Any unit vector across. */
export function across(a) {
  const [x, y, z] = a.map(Math.abs);
  return unit(cross(a, x <= y && x <= z ? [1, 0, 0] : y <= z ? [0, 1, 0] : [0, 0, 1]));
}

/** Product of two 4 x 4 matrices. */
export function product(a, b) {
  const out = new Float64Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      for (let k = 0; k < 4; k++) out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
    }
  }
  return out;
}

/** Projection with the vertical field of view in radians. */
export function perspective(field, aspect, near, far) {
  const f = 1 / Math.tan(field / 2);
  return new Float64Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
}

/** Camera at the origin that looks along `forward`. */
export function looking(forward, up) {
  const z = scaled(unit(forward), -1), x = unit(cross(up, z)), y = cross(z, x);
  return new Float64Array([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, 0, 0, 0, 1]);
}

/** Place on the screen of a point relative to the camera; null: behind it. @returns {{ x: number, y: number } | null} */
export function onScreen(matrix, point, width, height) {
  const at = [0, 1, 2, 3].map((row) => matrix[row] * point[0] + matrix[4 + row] * point[1] + matrix[8 + row] * point[2] + matrix[12 + row]);
  return at[3] > 1e-9 ? { x: (at[0] / at[3] + 1) * width / 2, y: (1 - at[1] / at[3]) * height / 2 } : null;
}

/** Vector v turned from the camera to GCRF by the conjugate of q_cam_from_gcrf (scalar last). */
export function turnedBack(q, v) {
  const axis = [-q[0], -q[1], -q[2]], t = scaled(cross(axis, v), 2);
  return add(add(v, t, q[3]), cross(axis, t));
}

/** Position between two states of a body, by Hermite's cubic (as the points' shader). */
export function between(p0, v0, p1, v1, step, u) {
  const h1 = u * u * (3 - 2 * u), h0 = 1 - h1, g0 = u * (1 - u) * (1 - u) * step, g1 = u * u * (u - 1) * step;
  return [0, 1, 2].map((k) => h0 * p0[k] + h1 * p1[k] + g0 * v0[k] + g1 * v1[k]);
}

/** Velocity between two states: the derivative of `between`. */
export function rateBetween(p0, v0, p1, v1, step, u) {
  const h = 6 * u * (1 - u) / step, g0 = 1 + u * (3 * u - 4), g1 = u * (3 * u - 2);
  return [0, 1, 2].map((k) => h * (p1[k] - p0[k]) + g0 * v0[k] + g1 * v1[k]);
}

/**
 * The osculating orbit of a state: points of its ellipse, or the part within 100 Earth radii of an open orbit.
 * Vallado, Fundamentals of Astrodynamics, 2013, section 2.4: eccentricity vector and semi-latus rectum.
 * @param {number[]} position Earth radii @param {number[]} velocity Earth radii per second
 */
export function orbitPoints(position, velocity, count = 256) {
  const mu = MU / EARTH_M ** 3, momentum = cross(position, velocity), p = dot(momentum, momentum) / mu;
  const eccentricity = add(scaled(cross(velocity, momentum), 1 / mu), unit(position), -1), e = length(eccentricity);
  if (!(p > 1e-6) || !Number.isFinite(e)) return new Float32Array(0);
  const x = e > 1e-9 ? unit(eccentricity) : unit(position), y = cross(unit(momentum), x);
  const limit = e < 1 ? Math.PI : Math.acos(Math.max(-1, (p / 100 - 1) / e));
  const points = new Float32Array(3 * (count + 1));
  for (let k = 0; k <= count; k++) {
    const anomaly = limit * (2 * k / count - 1), r = p / (1 + e * Math.cos(anomaly));
    points.set(add(scaled(x, r * Math.cos(anomaly)), scaled(y, r * Math.sin(anomaly))), 3 * k);
  }
  return points;
}

/** True if the Earth, a sphere, is between two places. */
export function hidden(a, b) {
  const way = add(b, a, -1), at = Math.min(1, Math.max(0, -dot(a, way) / (dot(way, way) || 1)));
  return length(add(a, way, at)) < 1;
}

/**
 * Lines of a shapefile of polygons or lines (ESRI Shapefile Technical Description, 1998), in degrees.
 * @param {ArrayBuffer} file @returns {Float32Array} ends of segments on the unit sphere; empty: none
 */
export function coastSegments(file) {
  const view = new DataView(file), points = [];
  const place = (at) => {
    const longitude = view.getFloat64(at, true) * Math.PI / 180, latitude = view.getFloat64(at + 8, true) * Math.PI / 180;
    return [Math.cos(latitude) * Math.cos(longitude), Math.cos(latitude) * Math.sin(longitude), Math.sin(latitude)];
  };
  for (let at = 100; at + 52 <= file.byteLength;) {
    const next = at + 8 + 2 * view.getUint32(at + 4), type = view.getInt32(at + 8, true);
    if (next <= at + 8 || next > file.byteLength) break;
    if (type === 3 || type === 5) {
      const parts = view.getUint32(at + 44, true), count = view.getUint32(at + 48, true), from = at + 52 + 4 * parts;
      if (from + 16 * count > next) break;
      const begins = new Set(Array.from({ length: parts }, (_, k) => view.getUint32(at + 52 + 4 * k, true)));
      for (let k = 1; k < count; k++) if (!begins.has(k)) points.push(...place(from + 16 * (k - 1)), ...place(from + 16 * k));
    }
    at = next;
  }
  return new Float32Array(points);
}

/** Matrix of points of the Earth relative to the camera. @param {number[]} earth rotation from GCRF to the Earth, rows */
export function earthMatrix(matrix, eye, earth, radius) {
  const turn = new Float64Array(16);
  for (let row = 0; row < 3; row++) for (let column = 0; column < 3; column++) turn[4 * column + row] = radius * earth[3 * column + row];
  turn.set([-eye[0], -eye[1], -eye[2], 1], 12);
  return product(matrix, turn);
}
