// Unit tests of what charts have in common, and of the charts of a report: marks, places, values. Run by node's test runner:
//   node --test tests/view/page_chart.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';
import { countUntil, decadesOf, listenToChart, shortNumber, textsOf, ticksOf, valueAt } from '../../view/page/chart.js';
import { axisOf, nearestPoint, numbersOf, pointsOf, rangeOf, shareOf, valueOf } from '../../view/page/report_charts.js';

test('marks of an axis are round and inside', () => {
  for (const [from, to] of [[0, 300], [-0.37, 0.41], [1e-7, 3e-7], [12.99, 13.07], [-1e9, 2.5e10]]) {
    const ticks = ticksOf(from, to, 7);
    assert.ok(ticks.length >= 3 && ticks.length <= 15, `${from} ${to}: ${ticks}`);
    assert.ok(ticks.every((tick) => tick >= from - 1e-9 * (to - from) && tick <= to + 1e-9 * (to - from)));
  }
  assert.deepEqual(ticksOf(3, 3, 5), []);
});

test('texts of neighbouring marks differ, however close they are', () => {
  for (const [from, to] of [[0, 300], [45.121, 45.139], [1000.2, 1001.3], [86399, 86399.5], [-0.001, 0.001], [1e6, 1e6 + 3]]) {
    const ticks = ticksOf(from, to, 6), texts = textsOf(ticks);
    assert.equal(new Set(texts).size, ticks.length, texts.join(' '));
    texts.forEach((text, k) => assert.ok(Math.abs(Number(text.replace('−', '-').replace('e−', 'e-')) - ticks[k]) < 1e-9 * Math.max(1, Math.abs(ticks[k])), text));
  }
  assert.deepEqual(textsOf([-1, 0, 1]), ['−1', '0', '1']);
});

test('marks of a logarithmic axis', () => {
  assert.deepEqual(decadesOf(-1.2, 2.1), [0.1, 1, 10, 100]);
  assert.ok(decadesOf(0.1, 0.6).length >= 2 && decadesOf(0.1, 0.6).every((tick) => tick > 1.2 && tick < 4));
});

test('numbers are short, and none is said', () => {
  assert.equal(shortNumber(NaN), '–');
  assert.equal(shortNumber(-0.123456), '−0.123');
  assert.equal(shortNumber(0.343761, 5), '0.34376');
  assert.equal(shortNumber(1234567, 5), '1.2346e6');
});

test('the value at a time is that of the last point before it; the nearest point is the nearest', () => {
  const points = [{ time: 1, low: 2, high: 4 }, { time: 3, low: 5, high: 5 }];
  assert.deepEqual([0, 1, 2.9, 3, 99].map((time) => countUntil(points, time)), [0, 1, 1, 2, 2]);
  assert.deepEqual([valueAt(points, 0), valueAt(points, 2), valueAt(points, 3)], [NaN, 3, 5]);
  assert.deepEqual([-5, 1.9, 2.1, 7].map((time) => nearestPoint(points, time).time), [1, 1, 3, 3]);
  assert.equal(nearestPoint([], 1), null);
});

test('values of an element: numbers, gaps, extremes of a column', () => {
  assert.deepEqual(numbersOf('1 - 2.5e-3'), [1, NaN, 0.0025]);
  assert.deepEqual(numbersOf(''), []);
  assert.deepEqual(numbersOf(undefined), []);
  assert.deepEqual(pointsOf([0, 1, 2], '3 - -1:4'), [{ time: 0, low: 3, high: 3 }, { time: 1, low: NaN, high: NaN }, { time: 2, low: -1, high: 4 }]);
  assert.deepEqual(pointsOf([], ''), []);
});

test('an axis has ends, flags, a name and a unit', () => {
  const { low, high, log, bare, name, unit } = axisOf('0.01 100 log', 'pointing error, px');
  assert.deepEqual([low, high, log, bare, name, unit], [0.01, 100, true, false, 'pointing error', 'px']);
  assert.deepEqual([axisOf('0 5 bare').bare, axisOf('0 5', 'SNR').name, axisOf('0 5', 'SNR').unit], [true, 'SNR', '']);
});

test('places and values of an axis are inverse to each other', () => {
  for (const [range, log] of [[{ low: 0.01, high: 1000 }, true], [{ low: -3, high: 7 }, false]]) {
    for (const share of [0, 0.25, 1]) assert.ok(Math.abs(shareOf(range, valueOf(range, share, log), log) - share) < 1e-12);
  }
  assert.equal(shareOf({ low: 1, high: 10 }, 0, true), -Infinity);
});

test('the range of values has a margin, and is none without values', () => {
  assert.equal(rangeOf([NaN, Infinity], false), null);
  assert.equal(rangeOf([-1, 0], true), null);
  assert.deepEqual(rangeOf([0, 10], false), { low: 0, high: 10.6 });
  const { low, high } = rangeOf([3, 3], false);
  assert.ok(low < 3 && high > 3);
});

test('only the first button begins a gesture: a menu of the second one takes its end', () => {
  const heard = {}, dragged = [], canvas = { addEventListener: (name, act) => { heard[name] = act; }, setPointerCapture() {} };
  listenToChart(canvas, { click() {}, drag: () => dragged.push('drag'), dragged: (part) => dragged.push(part.x1 - part.x0), reset() {}, zoom() {} });
  const gesture = (button) => {
    heard.pointerdown({ button, offsetX: 10, offsetY: 5, pointerId: 1 });
    heard.pointermove({ offsetX: 40, offsetY: 5 });
  };
  gesture(2);
  assert.deepEqual(dragged, []);
  gesture(0);
  heard.pointerup({});
  assert.deepEqual(dragged, ['drag', 30]);
});
