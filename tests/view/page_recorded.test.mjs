// Unit test of the answers that an exported page holds: reasons of its frames, and spans around them. Run by node's test runner:
//   node --test tests/view/page_recorded.test.mjs
import assert from 'node:assert/strict';
import test from 'node:test';
import { deflateSync } from 'node:zlib';

const pack = (json) => deflateSync(Buffer.from(JSON.stringify(json))).toString('base64');
const SPANS = [{ first: 0, last: 249, kind: 'faint', text: 'a' }, { first: 250, last: 250, kind: 'dark', text: 'b' }, { first: 251, last: 999, kind: 'tracked', text: 'c' }];
const ANSWERS = {
  session: { exported: { sensors: [{ rows: [0, 100, 200, 300, 600] }] } },
  'spans?sensor=0': { around: 200, spans: SPANS },
  'why?frame=2&sensor=0': { target: 'T', frame: { kind: 'faint', text: 'a' } },
  'why?frame=4&sensor=0': { target: 'T', frame: { kind: 'tracked', text: 'c' } },
  'why?frame=0&sensor=1': { target: null },
};
globalThis.document = { querySelectorAll: () => Object.entries(ANSWERS).map(([key, json]) => ({ dataset: { key }, textContent: pack(json) })) };
const { getJson } = await import('../../view/page/recorded_api.js');

test('spans are those around the frame, in frames of the page', async () => {
  await getJson('session');
  // rows 0 to 400: frames 0 to 3; the one frame of the span at row 250 is not in the page
  assert.deepEqual((await getJson('why', { sensor: 0, frame: 2 })).spans, [{ first: 0, last: 2, kind: 'faint', text: 'a' }, { first: 3, last: 3, kind: 'tracked', text: 'c' }]);
  assert.deepEqual((await getJson('why', { sensor: 0, frame: 4 })).spans, [{ first: 4, last: 4, kind: 'tracked', text: 'c' }]);
  assert.deepEqual(await getJson('why', { sensor: 1, frame: 0 }), { target: null });
});

test('what the page does not hold is said', async () => {
  await assert.rejects(getJson('why', { sensor: 0, frame: 3 }), /does not have it/);
});
