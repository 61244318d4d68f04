// Unit tests of where tracks were expected in a frame, and of the list of detections that made a track. Run by node's test runner:
//   node --test tests/view/page_marks.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';

Object.assign(globalThis, { location: { search: '' }, document: { getElementById: () => null } });
const { covarianceAfter, directionAfter, placeOf, placesOf } = await import('../../view/page/prediction.js');
const { sortMarks, windowsOf } = await import('../../view/page/marks.js');
const { rowsOfTrack, kindOfDetection } = await import('../../view/page/why.js');

const ARCSEC = Math.PI / 648000;
/** A frame of 2 arcsec a pixel with north up and east to the left, at declination 60. */
const frame = { wcs: { crpix: [101, 51], crval_deg: [40, 60], cd_deg: [-2 / 3600, 0, 0, 2 / 3600], A: [], B: [] }, names: {}, truth: [], detections: [], target: -1, tracks: [] };
const state = (time, east, north, more = {}) => [time, east, north, more.d11 ?? 0, more.d12 ?? 0, more.d22 ?? 0, more.d1r1 ?? 0, more.d1r2 ?? 0, more.d2r1 ?? 0, more.d2r2 ?? 0, more.r11 ?? 0, more.r12 ?? 0, more.r22 ?? 0];
const near = (found, expected, within) => assert.ok(Math.abs(found - expected) <= within, `${found}, expected ${expected}`);

test('a direction moves at its rates, and its covariance grows with theirs', () => {
  const after = directionAfter({ ra_deg: 40, dec_deg: 60, state: state(3, 18, -36) }, 2);
  near(after.ra, 40 + 36 / 3600 / 0.5, 1e-12);
  near(after.dec, 60 - 72 / 3600, 1e-12);
  const [a, b, c] = covarianceAfter(state(0, 0, 0, { d11: 1, d12: 2, d22: 3, d1r1: 4, d1r2: 5, d2r1: 6, d2r2: 7, r11: 8, r12: 9, r22: 10 }), 2);
  assert.deepEqual([a, b, c], [1 + 16 + 32, 2 + 22 + 36, 3 + 28 + 40]);
});

test('a direction has its pixel and its error ellipse there', () => {
  // 20 arcsec east and 10 north; errors of 4 and 2 arcsec
  const place = placeOf(frame, { ra: 40 + 20 / 3600 / 0.5, dec: 60 + 10 / 3600 }, [(4 * ARCSEC) ** 2, 0, (2 * ARCSEC) ** 2]);
  near(place.x, 100 - 10, 0.01); // the sphere is curved
  near(place.y, 50 + 5, 0.01);
  near(place.xx, 4, 0.01);
  near(place.yy, 1, 0.01);
  near(place.xy, 0, 0.01);
});

test('ghosts in the optics are neither the target nor an object of their own', () => {
  const truth = ['object', 'object_ghost', 'star', 'star_ghost'].map((kind, k) => ({ kind, id: k < 2 ? 3 : 2147483650, norad: 0, x: k, y: 0 }));
  const sorted = sortMarks({ ...frame, names: { 3: 'A' }, target: 3, truth });
  assert.deepEqual(sorted.target.map(({ x, text }) => [x, text]), [[0, 'A']]);
  assert.deepEqual(sorted.objects.map(({ x, text }) => [x, text]), [[1, 'ghost of A']]);
  assert.deepEqual(sorted.stars.map(({ x }) => x), [2, 3]);
});

test('a track that was not updated is where its state says; the others where their detections are', () => {
  const now = { now: true, id: 7, status: 'confirmed', target: true, x: 3, y: 4, misses: 0, ra_deg: 40, dec_deg: 60, state: state(10, 20, 0) };
  const before = { ...now, now: false, ra_deg: 40 - 20 / 3600 / 0.5, state: state(9, 24, 0) }, older = { ...before, state: state(8, 90, 90) };
  const seen = placesOf({ ...frame, tracks: [now, older, before] });
  assert.deepEqual([seen.tracks[0].x, seen.tracks[0].y, seen.tracks[0].coasts], [3, 4, false]);
  near(seen.predicted[0].x, 100 - 2, 1e-6); // 4 arcsec too far east
  near(seen.predicted[0].y, 50, 1e-3);
  const lost = sortMarks({ ...frame, tracks: [{ ...now, misses: 1 }] });
  near(lost.tracks[0].x, 100, 1e-6);
  assert.equal(lost.tracks[0].coasts, true);
  assert.deepEqual(lost.predicted, []);
  // without a state, as in live frames: as it was sent
  assert.deepEqual(placesOf({ ...frame, tracks: [{ ...now, misses: 1, state: undefined }] }).tracks[0].x, 3);
  assert.deepEqual(placesOf({ ...frame, wcs: undefined, tracks: [now] }).tracks, [now]);
});

test('ghosts are said to be ghosts, and that of the target is not the target', () => {
  const at = (kind, id) => ({ kind, id, norad: 0, x: id, y: 0 }), truth = [at('star', 9), at('star_ghost', 3), at('object_ghost', 3), at('object', 3), at('object', 4)];
  const sorted = sortMarks({ ...frame, names: { 3: 'AURA' }, target: 3, truth });
  assert.deepEqual(sorted.stars.map((mark) => mark.said), [undefined, 'ghost of star 3']);
  assert.deepEqual(sorted.objects.map((mark) => mark.text), ['ghost of AURA', 'object 4']);
  assert.deepEqual(sorted.target.map((mark) => [mark.kind, mark.text]), [['object', 'AURA']]);
});

test('exposures without a detection are one row, newest first', () => {
  const one = (row, detection, status = 'confirmed') => ({ frame: row, time_s: row + 0.5, status, detection });
  const found = { label: 'object', streak: true, blend: true, x: 1, y: 2 };
  assert.deepEqual(rowsOfTrack([one(3, found), one(4), one(5), one(6, undefined, 'coasting'), one(7, found)]).map((row) => [row.first, row.last, row.time, Boolean(row.detection)]),
    [[7, 7, 7.5, true], [6, 6, 6.5, false], [4, 5, 4.5, false], [3, 3, 3.5, true]]);
  assert.equal(kindOfDetection(found), 'object, streak, blended');
});

test('a window is drawn once, around its pixels, with all that was expected there', () => {
  const row = { window: 1, x0: 10, y0: 20, width: 4, height: 3, reason: 'target', track_id: 7, star_id: 0 };
  const windows = windowsOf([{ ...row, window: 0, reason: 'track', track_id: 9 }, row, { ...row, reason: 'star', track_id: 0, star_id: 5 }]);
  assert.equal(windows.length, 2);
  assert.deepEqual(windows[1], { x: 11.5, y: 21, left: 9.5, top: 19.5, right: 13.5, bottom: 22.5, said: 'window: target (track 7), star 5' });
  assert.equal(windows[0].said, 'window: track 9');
  assert.deepEqual(sortMarks({ ...frame, windows: undefined }).windows, []);
});
