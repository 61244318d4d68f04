// Unit tests of what compares runs: figures, nearest frames, tables and means of a study. Run by node's test runner:
//   node --test tests/view/page_compare.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';

Object.assign(globalThis, { location: { search: '' }, document: { getElementById: () => null } });
const { differences, figuresOf, nearestFrame } = await import('../../view/page/compare.js');
const { meansOf, placesOf, sorted } = await import('../../view/page/study.js');

test('figures are the numbers and texts of a summary, also of its parts', () => {
  assert.deepEqual([...figuresOf({ frames: 3, mode: 'track', sensors: [{ rms: 0.5 }], ok: true, none: null })],
    [['frames', 3], ['mode', 'track'], ['sensors / 0 / rms', 0.5], ['ok', 1]]);
});

test('a figure that only one run has is there, without a number for the other', () => {
  assert.deepEqual(differences({ a: 1, b: 2 }, { b: 5, c: 7 }), [{ name: 'a', a: 1, b: NaN }, { name: 'b', a: 2, b: 5 }, { name: 'c', a: NaN, b: 7 }]);
});

test('the nearest frame of any time', () => {
  const times = [0.5, 1, 1, 2.5, 9], frames = Float64Array.from(times.flatMap((time, k) => [k, time, 0.1, -1, 0]));
  for (let time = -1; time < 11; time += 0.03) {
    const found = nearestFrame(frames, time), least = Math.min(...times.map((one) => Math.abs(one - time)));
    assert.ok(Math.abs(times[found] - time) <= least + 1e-12, `${time}: ${found}`);
  }
  assert.equal(nearestFrame(new Float64Array(0), 1), -1);
});

test('texts have places in the order of the alphabet', () => {
  assert.deepEqual(placesOf(['b', 'a', null, 'b']), { places: [1, 0, null, 1], names: ['a', 'b'] });
  assert.deepEqual(placesOf([3, null]), { places: [3, null], names: null });
});

test('means join the runs of one parameter value', () => {
  assert.deepEqual(meansOf([2, 1, 2, null, 1], [10, 1, 20, 5, null]), [{ x: 1, y: 1, count: 1 }, { x: 2, y: 15, count: 2 }]);
});

test('rows sort by numbers, texts, and empty cells last', () => {
  const runs = [[null], [2], ['x'], [1], [2]].map((cells, run) => ({ run, cells }));
  assert.deepEqual(sorted(runs, 0, false).map((one) => one.run), [3, 1, 4, 2, 0]);
  assert.deepEqual(sorted(runs, 0, true).map((one) => one.run), [1, 4, 3, 2, 0]);
});
