// Unit tests of the editor's modules that need no browser: values, small files, schema. Run by node's test runner:
//   node --test tests/view/page_values.test.mjs    (SCHEMA: path of the JSON Schema)
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import test from 'node:test';
import * as schema from '../../view/page/schema.js';
import * as values from '../../view/page/scenario_values.js';

const root = JSON.parse(readFileSync(process.env.SCHEMA || 'scenarios/boresight.schema.json'));

test('a small file gives back the document', () => {
  const before = { a: 1, b: { c: [1, 2, { d: 'x' }], e: { f: null } }, list: [{ x: 1 }] };
  const cases = [
    [(v) => { v.a = 2; }, { a: 2 }],
    [(v) => { v.b.c[2].d = 'y'; }, { set: { '/b/c/2/d': 'y' } }],
    [(v) => { v.b.c.push(4); }, { set: { '/b/c': [1, 2, { d: 'x' }, 4] } }],
    [(v) => { delete v.b.e.f; v.b.e.g = 3; }, { set: { '/b/e': { g: 3 } } }],
    [(v) => { v.b.e.f = { deep: true }; }, { set: { '/b/e/f': { deep: true } } }],
    [(v) => { v.list = []; }, { list: [] }],
    [(v) => { v.new = { k: 1 }; }, { new: { k: 1 } }],
    [(v) => { values.putAt(v, '/b/__proto__', 5); }, { set: { '/b/__proto__': 5 } }],
  ];
  for (const [change, expected] of cases) {
    const after = structuredClone(before);
    change(after);
    const small = values.smallFile('f.json', before, after);
    assert.deepEqual(JSON.parse(JSON.stringify(small)), JSON.parse(JSON.stringify({ boresight: 1, extends: 'f.json', ...expected })));
    assert.ok(values.same(values.extended(before, { ...small, boresight: undefined }).b, after.b), JSON.stringify(small));
    const again = values.extended(before, small);
    delete again.boresight;
    assert.ok(values.same(again, after), JSON.stringify(small));
  }
  const gone = structuredClone(before);
  delete gone.a;
  assert.equal(values.smallFile('f.json', before, gone), null); // a key of the root cannot be removed
  const slash = structuredClone(before);
  slash.b.e['x/y'] = 1; // no pointer names it: the object is replaced
  assert.deepEqual(values.smallFile('f.json', before, slash).set, { '/b/e': { f: null, 'x/y': 1 } });
});

test('values are put and removed', () => {
  const v = { a: { b: { c: 1 } }, list: [1, 2, 3] };
  values.removeAt(v, '/a/b/c');
  assert.deepEqual(v, { list: [1, 2, 3] }); // objects that are empty go with it
  values.removeAt(v, '/list/1');
  assert.deepEqual(v, { list: [1, 3] });
  values.putAt(v, '/x/y', 4);
  assert.equal(values.valueAt(v, '/x/y'), 4);
  assert.equal(values.valueAt(v, '/x/constructor'), undefined);
});

test('every key of the schema has a kind, a unit that is apart, and limits', () => {
  const kinds = new Map();
  schema.everyKey(root, (way, of) => {
    const kind = schema.kindOf(of), { text, unit } = schema.documented(of);
    kinds.set(kind, (kinds.get(kind) || 0) + 1);
    assert.ok(!unit.includes(']') && !/\[[^\]]*\]$/.test(unit ? text : ''), way.join('/'));
    if (of.minimum !== undefined || of.maximum !== undefined) assert.notEqual(schema.rangeOf(of), '', way.join('/'));
    if (kind === 'number') assert.equal(schema.numberOf(of, ' 1e-3 '), 0.001);
    // what nobody edits as JSON: only blocks whose keys a plug-in or a channel defines, and "set"
    if (kind === 'json') assert.match(way.join('/'), /delay_s$|\/parameters$|^set$|type$/, way.join('/'));
  });
  for (const kind of ['object', 'list', 'numbers', 'choice', 'choices', 'boolean', 'number', 'text']) assert.ok(kinds.get(kind) > 0, kind);
  assert.ok([...kinds.values()].reduce((a, b) => a + b) > 1500);
});

test('alternatives follow "type" and "plugin"', () => {
  const { gimbal, imgproc } = root.properties.observers.items.properties.sensors.items.properties.modules.properties;
  assert.ok('natural_frequency_hz' in schema.chosen(gimbal, { type: 'second_order' }).properties);
  for (const branch of gimbal.oneOf.filter((one) => one.properties.type.const)) {
    assert.equal(schema.chosen(gimbal, { type: branch.properties.type.const }), branch);
  }
  assert.deepEqual(schema.chosen(gimbal, { type: 'second_order', plugin: 'x.so' }).required, ['plugin']);
  const detector = imgproc.oneOf[0].properties.detector;
  assert.ok('type' in schema.chosen(detector, { plugin: 'x.so' }).properties);
  assert.ok('plugin' in schema.chosen(detector, {}).properties);
  assert.deepEqual(schema.firstValue(root.properties.world.properties.objects.items).name, '');
});

test('numbers and seeds as they are typed', () => {
  const open = { type: ['number', 'null'] }, plain = { type: 'number' };
  assert.deepEqual([schema.numberOf(open, ''), schema.numberOf(plain, ' '), schema.numberOf(plain, '1e400'), schema.numberOf(plain, '12x')], [null, undefined, '1e400', '12x']);
  assert.deepEqual([schema.textOf(root.properties.seed, '42'), schema.textOf(root.properties.seed, '0x2A'), schema.textOf(root.properties.name, '42')], [42, '0x2A', '42']);
});

test('places that can take what a dropped file has: the target first', async () => {
  Object.assign(globalThis, { location: { search: '' } });
  const { placesFor, plainName } = await import('../../view/page/editor_drop.js');
  const root = { world: { objects: [{ name: 'A' }, { name: 'B' }] }, observers: [{ name: 'eye', sensors: [{ name: 'wide', cue: { object: 'B' } }, {}] }] };
  const pointers = (kind) => placesFor(kind, root).map((one) => one.pointer);
  assert.deepEqual(pointers('elements'), ['/world/objects/1', '/world/objects/0', '/observers/0']);
  assert.deepEqual(pointers('shape'), ['/world/objects/1', '/world/objects/0']);
  assert.deepEqual(pointers('frame'), ['/observers/0/sensors/0', '/observers/0/sensors/1']);
  assert.deepEqual(placesFor('shape', {}), []);
  assert.equal(plainName('../my sat (2).glb'), '_._my_sat__2_.glb');
});
