// Unit tests of the space view's mathematics. Run by node's test runner: node --test tests/view/page_space.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';
import * as math from '../../view/page/space_math.js';

const MU = 3.986004418e14 / math.EARTH_M ** 3; // Earth radii, seconds

/** State on a circular orbit of radius r, inclined by 0.9 rad, at angle a. */
function circular(r, a) {
  const v = Math.sqrt(MU / r), c = Math.cos(0.9), s = Math.sin(0.9);
  return [[r * Math.cos(a), r * c * Math.sin(a), r * s * Math.sin(a)], [-v * Math.sin(a), v * c * Math.cos(a), v * s * Math.cos(a)]];
}

const near = (a, b, tolerance, text) => a.forEach((value, k) => assert.ok(Math.abs(value - b[k]) <= tolerance, `${text}: ${a} for ${b}`));

test('cubics between states each minute', () => {
  const r = 1.05, rate = Math.sqrt(MU / r ** 3), [p0, v0] = circular(r, 0.3), [p1, v1] = circular(r, 0.3 + 60 * rate);
  for (const u of [0, 0.25, 0.5, 1]) {
    const [p, v] = circular(r, 0.3 + 60 * u * rate);
    // h^4 r'''' / 384 for a cubic of Hermite: 0.4 m
    near(math.between(p0, v0, p1, v1, 60, u), p, 0.5 / math.EARTH_M, 'place');
    near(math.rateBetween(p0, v0, p1, v1, 60, u), v, 0.1 / math.EARTH_M, 'velocity'); // its derivative: 0.04 m/s
  }
});

test('the orbit of a state', () => {
  const [p, v] = circular(2, 1), ring = math.orbitPoints(p, v, 64);
  for (let k = 0; k < ring.length; k += 3) near([math.length(ring.slice(k, k + 3))], [2], 1e-6, 'radius'); // float32
  // perigee 2, speed of e = 0.5: apogee 6; a point of the ellipse has the two distances' sum 2 a = 8 from the foci
  const fast = math.scaled(v, Math.sqrt(1.5)), points = math.orbitPoints(p, fast, 64), other = math.scaled(math.unit(p), -4);
  for (let k = 0; k < points.length; k += 3) {
    const at = [...points.slice(k, k + 3)];
    near([math.length(at) + math.length(math.add(at, other, -1))], [8], 1e-5, 'ellipse');
  }
  assert.ok(math.orbitPoints(p, math.scaled(v, 2), 64).every((value) => Math.abs(value) <= 100.1)); // open
  assert.equal(math.orbitPoints([NaN, 0, 0], v).length, 0);
  assert.equal(math.orbitPoints(p, math.scaled(p, 0.001)).length, 0); // falls: no plane
});

test('what the Earth hides', () => {
  assert.ok(math.hidden([2, 0, 0], [-2, 0, 0]));
  assert.ok(!math.hidden([2, 0, 0], [0, 2, 0])); // passes at sqrt 2
  assert.ok(!math.hidden([2, 0, 0], [5, 0.1, 0])); // the Earth is behind
});

test('directions of the camera', () => {
  // q_cam_from_gcrf of a turn by 90 degrees about z: the camera's x is GCRF's -y
  const h = Math.SQRT1_2;
  near(math.turnedBack([0, 0, h, h], [1, 0, 0]), [0, -1, 0], 1e-12, 'turned back');
  // a point ahead is in the middle, one to the right on the right; one behind has no place
  const matrix = math.product(math.perspective(1, 2, 0.1, 100), math.looking([1, 0, 0], [0, 0, 1]));
  const middle = math.onScreen(matrix, [5, 0, 0], 200, 100), right = math.onScreen(matrix, [5, -1, 1], 200, 100);
  near([middle.x, middle.y], [100, 50], 1e-9, 'middle');
  assert.ok(right.x > 100 && right.y < 50);
  assert.equal(math.onScreen(matrix, [-5, 0, 0], 200, 100), null);
});

test('coastlines of a shapefile', () => {
  const file = new ArrayBuffer(100 + 8 + 44 + 8 + 80), view = new DataView(file);
  view.setUint32(104, (44 + 8 + 80) / 2);
  view.setInt32(108, 5, true);
  view.setUint32(144, 2, true); // parts: points 0 to 2, 3 and 4
  view.setUint32(148, 5, true);
  view.setUint32(156, 3, true);
  [[0, 0], [90, 0], [0, 90], [180, 0], [0, -90]].forEach(([x, y], k) => {
    view.setFloat64(160 + 16 * k, x, true);
    view.setFloat64(168 + 16 * k, y, true);
  });
  const found = math.coastSegments(file);
  near([...found], [1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, -1, 0, 0, 0, 0, -1], 1e-6, 'segments');
  for (const bytes of [0, 99, 130, file.byteLength - 1]) assert.equal(math.coastSegments(file.slice(0, bytes)).length, 0); // cut
  view.setUint32(148, 0xffffffff, true);
  assert.equal(math.coastSegments(file).length, 0);
  // turned with the Earth: a quarter turn takes longitude 0 to 90 degrees
  const matrix = math.earthMatrix(new Float64Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]), [0, 0, 0], [0, 1, 0, -1, 0, 0, 0, 0, 1], 1);
  near([matrix[0], matrix[1], matrix[2]], [0, 1, 0], 1e-12, 'Greenwich');
});

test('keep-out cones: their half angles, and how far a direction is from what they keep away from', async () => {
  const { clearance, conesOf, coneShape } = await import('../../view/page/space_cones.js');
  const off = { sun_deg: 0, moon_deg: 0, earth: false, earth_limb_deg: 0, earth_limb_altitude_km: 100 };
  assert.deepEqual(conesOf(off, [2, 0, 0], [0, 1, 0], [60, 0, 0]), []);
  const cones = conesOf({ sun_deg: 40, moon_deg: 20, earth: true, earth_limb_deg: 10, earth_limb_altitude_km: 0 }, [2, 0, 0], [0, 5, 0], [60, 0, 0]);
  assert.deepEqual(cones.map((one) => one.name), ['Sun', 'Moon', 'Earth']);
  const degrees = cones.map((one) => one.angle * 180 / Math.PI);
  [40, 20, 30 + 10].forEach((expected, k) => assert.ok(Math.abs(degrees[k] - expected) < 1e-9)); // the limb is asin(1/2) from the nadir
  // 90 deg from the nadir is 60 deg from the limb
  assert.ok(Math.abs(clearance(cones[2], [0, 0, 1]) * 180 / Math.PI - 60) < 1e-9);
  assert.ok(Math.abs(clearance(cones[0], [0, 1, 0])) < 1e-9);
  // the whole sky is kept out, but for a millionth of a radian, as the program has it
  const [wide] = conesOf({ ...off, earth: true, earth_limb_deg: 179 }, [1.001, 0, 0], [0, 1, 0], [60, 0, 0]);
  assert.ok(Math.abs(wide.angle - Math.PI + 1e-6) < 1e-12);
  assert.ok(Math.abs(clearance(wide, [0, 0, 1])) < 1e-9); // within the air: the limb is at 90 deg
  const { lines } = coneShape([2, 0, 0], cones[0]);
  for (let k = 0; k < lines.length; k += 3) { // the apex, or a point of the rim
    const along = [lines[k] - 2, lines[k + 1], lines[k + 2]], far = Math.hypot(...along);
    assert.ok(far < 1e-12 || (Math.abs(far - 2.5) < 1e-9 && Math.abs(along[1] / far - Math.cos(cones[0].angle)) < 1e-9));
  }
});

test('facets of a joint are turned and moved; their normals look outside', async () => {
  Object.assign(globalThis, { location: { search: '' } });
  const { bodyVertices } = await import('../../view/page/space_shape.js');
  const corners = [0, 0, 0, 1, 0, 0, 0, 1, 0];
  const shape = Float64Array.from([1, 2, -1, 0.5, 0.5, 0.5, ...corners, 0, 1, 0, 0, ...corners]);
  // a quarter of a turn about x, then 5 m along z
  const pose = Float64Array.from([0, 0, 0, 1, 1, 0, 1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0, 5]);
  const found = bodyVertices(shape, pose);
  assert.deepEqual([...found.slice(9, 18)], [1, 0, 0, 0, 0, 1, 0.5, 0.5, 0.5]);
  assert.deepEqual([...found.slice(45, 54)], [0, 0, 6, 0, -1, 0, 1, 0, 0]);
});

test('a failed request for an attitude is made again at another time; an attitude counts as recorded at its own time only', async () => {
  const { ShapePass } = await import('../../view/page/space_shape.js'), asked = [];
  globalThis.fetch = async (address) => {
    asked.push(String(address));
    if (asked.length === 1) return { ok: false, status: 503, text: async () => 'busy' };
    const numbers = String(address).includes('shape') ? [0, 0] : [0, 0, 0, 1, 1, 1];
    return { ok: true, arrayBuffer: async () => Float64Array.from(numbers).buffer };
  };
  const gl = new Proxy({}, { get: () => () => {} }), program = { at: () => 0 };
  const painter = { gl, program: () => program, buffer: () => ({ buffer: 0 }), use() {}, input() {}, draw() {} };
  const pass = new ShapePass(painter, [{ object: 0, radius_m: 5 }], () => {}), one = pass.shapes.get(0);
  const camera = { eye: [1, 1e-5, 0], field: 0.7, aspect: 1, turned: Float64Array.from({ length: 16 }, (_, k) => Number(k % 5 === 0)) };
  const drawn = async (time) => {
    const now = pass.draw(0, { sensor: 0, time, sun: [0, 1, 0], place: [1, 0, 0], observer: null }, camera);
    await new Promise((done) => { setTimeout(done, 5); });
    return now;
  };
  await drawn(1);
  assert.equal(one.problem, 'busy');
  await drawn(1);
  assert.equal(asked.length, 1); // not again and again
  await drawn(2);
  assert.deepEqual([one.problem, one.poseAt], ['', 2]);
  const now = await drawn(2), later = await drawn(3);
  assert.deepEqual([now.recorded && now.current, later.current, (await drawn(3)).current], [true, false, true]);
});
