// Unit test of choices in quick succession in the comparison of runs: the answers to the first ones come last.
//   node --test tests/view/page_compare_choice.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';

const element = () => ({ append() {}, setAttribute() {}, children: [], replaceChildren(...children) { this.children = children; } });
Object.assign(globalThis, { location: { search: '' }, document: { getElementById: () => null, createElement: element } });
const { Comparison, matchSensor, rowOf } = await import('../../view/page/compare.js');

const SENSORS = ['wide', 'narrow'].map((name) => ({ observer: 'A', name, target: 'T', panels: [{ name: 'snr', title: 'SNR', unit: '', lines: ['true'] }] }));

/** Answers of a program whose first runs are slow. */
function serve(delays) {
  globalThis.fetch = async (address) => {
    const [route, query] = address.split('?'), words = new URLSearchParams(query), run = Number(words.get('run'));
    await new Promise((done) => { setTimeout(done, delays[run] || 0); });
    const json = { 'api/run': { name: `run ${run}`, sensors: run === 3 ? SENSORS.slice().reverse() : run === 4 ? [SENSORS[0]] : SENSORS, manifest: { summary: { frames: run } } }, 'api/names': { names: {} } }[route];
    const numbers = route === 'api/frames' ? [0, run, 0.1, 0, 0] : [1, run, 1, 1];
    return { ok: true, json: async () => json, arrayBuffer: async () => Float64Array.from(numbers).buffer };
  };
}

function makeComparison() {
  const app = { current: 0, sensor: 0, names: {}, frames: Float64Array.from([0, 0.5, 0.1, 0, 0]), timeOf: () => 0.5, run: { name: 'own', sensors: SENSORS, manifest: { summary: { frames: 1 } } } };
  const side = () => ({ load(source) { this.source = source; }, clear() { this.source = null; } });
  const comparison = Object.assign(Object.create(Comparison.prototype), { app, turn: 0, asked: -1, b: null, shown: true, sides: [side(), side()],
    choice: { value: '' }, message: {}, table: element(), plots: element(), draw() {}, drawPlots() {} });
  const choose = (value) => {
    comparison.choice.value = value;
    return comparison.choose();
  };
  return { app, comparison, choose };
}

test('of two choices in quick succession all that is shown is the second one\'s', async () => {
  serve({ 1: 40, 2: 5 });
  const { comparison, choose } = makeComparison();
  await Promise.all([choose('1'), choose('2')]);
  assert.equal(comparison.b.described.name, 'run 2');
  assert.equal(comparison.sides[1].source.run, 2);
  assert.deepEqual(comparison.panels.map((panel) => panel.lines[1][0][0].time), [2]);
  assert.equal(comparison.plots.children.length, 1);
});

test('a choice while the plots of the former one are loaded', async () => {
  serve({ 1: 10 });
  const { comparison, choose } = makeComparison(), first = choose('1');
  await new Promise((done) => { setTimeout(done, 25); }); // its plots are asked for
  await Promise.all([first, choose('2')]);
  assert.equal(comparison.sides[1].source.run, 2);
  assert.deepEqual(comparison.panels.map((panel) => panel.lines[1][0][0].time), [2]);
});

test('sensors belong together by name, and without one by number', async () => {
  assert.deepEqual(matchSensor(SENSORS[1], SENSORS.slice().reverse(), 1), { number: 0, same: true });
  assert.deepEqual(matchSensor(SENSORS[1], [SENSORS[0]], 1), { number: 0, same: false });
  assert.deepEqual(matchSensor(SENSORS[1], [], 1), { number: -1, same: false });
});

test('the other run follows the sensor of the page, and says where it has none of that name', async () => {
  serve({});
  const { app, comparison, choose } = makeComparison();
  await choose('3');
  assert.deepEqual([comparison.b.sensor, comparison.sides[1].source.sensorName, comparison.message.textContent], [1, 'A/wide', '']);
  app.sensor = 1;
  await comparison.follow();
  assert.deepEqual([comparison.b.sensor, comparison.sides[1].source.sensorName], [0, 'A/narrow']);
  await choose('4');
  assert.equal(comparison.message.textContent, 'B has no sensor A/narrow: its sensor A/wide is shown.');
});

test('texts and figures of the machine have rows that say no difference in numbers', () => {
  assert.deepEqual(rowOf({ name: 'final_mode', a: 'track', b: 'search' }), { cells: ['track', 'search', 'differs'], differs: true });
  assert.deepEqual(rowOf({ name: 'final_mode', a: 'track', b: 'track' }), { cells: ['track', 'track', ''], differs: false });
  assert.deepEqual(rowOf({ name: 'sensors / 0 / real_time_factor', a: 1, b: 3 }), { cells: ['1', '3', '2'], differs: false });
  assert.equal(rowOf({ name: 'frames', a: 1, b: NaN }).differs, true);
});
