// Unit tests of the form of changes to a live run, with a document of plain objects. Run by node's test runner:
//   node --test tests/view/page_changes.test.mjs
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import test from 'node:test';

class Node {
  constructor(tag) { Object.assign(this, { tag, dataset: {}, children: [], value: '' }); }
  append(...children) { this.children.push(...children); }
  replaceChildren(...children) { this.children = children; }
  /** @returns {Node[]} */
  all() { return this.children.filter((one) => one instanceof Node).flatMap((one) => [one, ...one.all()]); }
  querySelectorAll(selector) { return this.all().filter((one) => selector.slice(6, -1) in one.dataset); }
  querySelector(selector) { return this.all().find((one) => one.id === selector.slice(1)); }
}
class Select extends Node {}
Object.assign(globalThis, { HTMLSelectElement: Select, document: { createElement: (tag) => (tag === 'select' ? new Select(tag) : new Node(tag)) } });
const { changeFields, changesOf, phasesWith } = await import('../../view/page/changes.js');

const read = (name) => JSON.parse(readFileSync(new URL(`../../scenarios/${name}`, import.meta.url), 'utf8'));
const SENSOR = '/observers/0/sensors/0';

/** The form of a scenario, and a function that types values by the ends of their pointers. */
function form(scenario, timeS = 0) {
  const box = new Node('div');
  changeFields(box, scenario, 0, timeS);
  const field = (end) => box.querySelectorAll('[data-pointer]').find((one) => one.dataset.pointer.endsWith(end));
  return { field, sets: () => changesOf(box, scenario, timeS).map((one) => one.set ?? one), box };
}

test('what the packet interface may change has a field, and only what differs is sent', () => {
  const { field, sets } = form(read('neossat_geo_track.json'));
  assert.deepEqual(sets(), []);
  const typed = {
    '/control/exposure_s': ['0.25', '0.25'], '/exposure/period_s': ['2', '2'], '/exposure/window_px': ['256, 256 512;512', '[256,256,512,512]'], '/exposure/binning': ['2', '2'],
    '/camera/gain_e_per_dn': ['3', '3'], '/exposure/dropped_fraction': ['0.1', '0.1'], '/scenegen/star_limit_v_mag': ['9', '9'], '/platform/jitter_low_px_rms': ['1', '1'],
    '/platform/jitter_high_px_rms': ['0.4', '0.4'], '/control/disturbance_px_rms': ['2', '2'],
  };
  for (const [end, [text]] of Object.entries(typed)) field(end).value = text;
  assert.deepEqual(sets().sort(), Object.entries(typed).map(([end, [, json]]) => {
    const pointer = end.startsWith('/control') || end.startsWith('/scenegen') ? `/modules${end}` : end.startsWith('/platform') ? `/modules/gimbal${end}` : end;
    return `${SENSOR}${pointer}=${json}`;
  }).sort());
});

test('keys that a scenario does not have are not offered', () => {
  const scenario = read('neossat_geo_track.json');
  assert.equal(form(scenario).field('/attitude/law'), undefined);
  assert.equal(form(scenario).field('/faint_limit_v_mag'), undefined);
  scenario.world.faint_stars = 'statistical';
  const modules = scenario.observers[0].sensors[0].modules;
  modules.control.compensator = { type: 'pid', bandwidth_hz: 0.1 };
  modules.gimbal.platform.spacecraft = {};
  const { field, sets } = form(scenario);
  field('/world/faint_limit_v_mag').value = '12';
  field('/attitude/law').value = 'nadir';
  field('/compensator/gain_scale').value = '0.5';
  assert.deepEqual(sets(), ['/world/faint_limit_v_mag=12', `${SENSOR}/modules/control/compensator/gain_scale=0.5`, `${SENSOR}/modules/gimbal/platform/spacecraft/attitude/law="nadir"`]);
});

test('a list that is none goes to the program as it was typed', () => {
  const { field, sets } = form(read('neossat_geo_track.json'));
  field('/exposure/window_px').value = 'half';
  assert.deepEqual(sets(), [`${SENSOR}/exposure/window_px="half"`]);
});

test('a satellite with a shape gets another attitude mode from now on', () => {
  const scenario = read('inspection.json'), { box, sets } = form(scenario, 40), law = box.querySelectorAll('[data-attitude]')[0];
  assert.equal(law.value, 'tumble');
  law.value = 'sun';
  assert.deepEqual(sets(), [`/world/objects/0/attitude=${JSON.stringify([...scenario.world.objects[0].attitude, { from_s: 40, law: 'sun' }])}`]);
  assert.deepEqual(phasesWith([{ from_s: 0, law: 'sun' }, { from_s: 50, law: 'nadir' }], 'velocity', 20), [{ from_s: 0, law: 'sun' }, { from_s: 20, law: 'velocity' }]);
});
