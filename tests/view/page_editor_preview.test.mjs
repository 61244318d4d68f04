// Unit tests of the editor's pictures and of the speed in words. Run by node's test runner:
//   node --test tests/view/page_editor_preview.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';

Object.assign(globalThis, { location: { search: '' }, document: { getElementById: () => null } });
const { fieldScale, spansOf, starRadius, statesOfDay } = await import('../../view/page/editor_preview.js');
const { speedText, trialTime } = await import('../../view/page/editor_figures.js');

test('SNR over the day follows from the magnitude; what hides the target is told apart', () => {
  const day = { v_mag: [15, 12.5, 16, null, 12.5, 12.5], sunlit_fraction: [1, 1, 1, 0, 1, 0.5], occulted: [false, false, false, false, true, false] };
  const states = statesOfDay(day, 15);
  assert.deepEqual(states.map((one) => one.state), ['visible', 'visible', 'faint', 'dark', 'occulted', 'visible']);
  assert.ok(Math.abs(states[0].snr - 5) < 1e-12 && Math.abs(states[1].snr - 50) < 1e-9);
  assert.equal(states[3].snr, 0);
  assert.deepEqual(spansOf(states), [{ state: 'visible', first: 0, last: 1 }, { state: 'faint', first: 2, last: 2 }, { state: 'dark', first: 3, last: 3 },
    { state: 'occulted', first: 4, last: 4 }, { state: 'visible', first: 5, last: 5 }]);
});

test('the diagonal of the field fits, and bright stars are large', () => {
  const { scale, width, height } = fieldScale([3, 4], 100);
  assert.deepEqual([scale, width, height], [20, 60, 80]);
  assert.ok(starRadius(2, 2, 10) > starRadius(6, 2, 10) && starRadius(6, 2, 10) > starRadius(10, 2, 10));
  assert.ok(Number.isFinite(starRadius(5, 5, 5)) && starRadius(5, 5, 5) > 0);
});

test('a trial has some frames of the slowest sensor, and is no longer than the run', () => {
  assert.equal(trialTime({ duration_s: 300, sensors: [{ frames: 300 }, { frames: 30 }] }), 40);
  assert.equal(trialTime({ duration_s: 300, sensors: [{ frames: 3000 }] }), 2);
  assert.equal(trialTime({ duration_s: 1, sensors: [{ frames: 0 }] }), 1);
  assert.equal(trialTime({ duration_s: 86400, sensors: [{ frames: 24 }] }), 600);
});

test('the speed in words', () => {
  assert.match(speedText({ real_time_factor: 10, duration_s: 4 }, 300), /^about 10 × real time, the whole run 30 s \(from its first 4 s/);
  assert.match(speedText({ real_time_factor: 2, duration_s: 4 }, 3600), /the whole run 30 min/);
  assert.match(speedText({ real_time_factor: 0.5, duration_s: 4 }, 86400), /the whole run 48 h/);
  assert.equal(speedText({ problem: 'no' }, 3), 'no');
});
