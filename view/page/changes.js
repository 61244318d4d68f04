// The form of changes to a live run: the keys that one changes most, with the values that they have.

/** The place of a sensor by its number in the order of the scenario. @param {any} scenario @param {number} number */
export function placeOfSensor(scenario, number) {
  let left = number;
  for (const [o, observer] of scenario.observers.entries()) {
    if (left < observer.sensors.length) return `/observers/${o}/sensors/${left}`;
    left -= observer.sensors.length;
  }
  return '/observers/0/sensors/0';
}

/** The value at a JSON pointer; undefined: none. @param {any} scenario @param {string} pointer */
export function valueAt(scenario, pointer) {
  let node = scenario;
  for (const word of pointer.slice(1).split('/')) {
    if (node === null || typeof node !== 'object') return undefined;
    node = node[word.replaceAll('~1', '/').replaceAll('~0', '~')];
  }
  return node;
}

/** Keys that are offered. `last`: the pointer's end below the sensor; the first one that fits is used. */
const FIELDS = [
  { title: 'Exposure', unit: 's', pointers: (scenario, sensor) => (valueAt(scenario, `${sensor}/modules/control/exposure_s`) > 0
    ? `${sensor}/modules/control/exposure_s` : `${sensor}/exposure/exposure_s`) },
  { title: 'Lost frames', unit: 'fraction', fallback: 0, pointers: (_, sensor) => `${sensor}/exposure/dropped_fraction` },
  { title: 'Slow jitter', unit: 'px', fallback: 0, pointers: (_, sensor) => `${sensor}/modules/gimbal/platform/jitter_low_px_rms` },
  { title: 'Fast jitter', unit: 'px', fallback: 0, pointers: (_, sensor) => `${sensor}/modules/gimbal/platform/jitter_high_px_rms` },
];

function labelled(title, input) {
  const label = document.createElement('label');
  label.className = 'inline';
  label.append(`${title} `, input);
  return label;
}

function numberInput(value) {
  const input = document.createElement('input');
  input.type = 'number';
  input.step = 'any';
  input.value = value === undefined ? '' : String(value);
  return input;
}

/**
 * Fills the form. @param {HTMLElement} box @param {any} scenario @param {number} number of the sensor
 */
export function changeFields(box, scenario, number) {
  const sensor = placeOfSensor(scenario, number), objects = (scenario.world && scenario.world.objects) || [];
  const values = document.createElement('fieldset'), burn = document.createElement('fieldset');
  const legend = (text) => { const node = document.createElement('legend'); node.textContent = text; return node; };
  values.append(legend('Sensor'), ...FIELDS.map(({ title, unit, pointers, fallback }) => {
    const pointer = pointers(scenario, sensor), found = valueAt(scenario, pointer);
    const input = numberInput(found === undefined ? fallback : found);
    input.dataset.pointer = pointer;
    input.dataset.before = input.value;
    return labelled(`${title} (${unit})`, input);
  }));
  const names = objects.map((object) => object.name), choose = (id, first) => {
    const select = document.createElement('select');
    select.id = id;
    select.append(...(first ? [first] : []).concat(names).map((name) => {
      const option = document.createElement('option');
      option.value = name;
      option.textContent = name;
      return option;
    }));
    return select;
  };
  const target = choose('change-target');
  target.dataset.pointer = `${sensor}/cue/object`;
  target.dataset.before = target.value = String(valueAt(scenario, target.dataset.pointer) || '');
  values.append(labelled('Target', target));
  const axes = ['radial', 'along', 'normal'].map((axis) => {
    const input = numberInput(0);
    input.id = `change-burn-${axis}`;
    return labelled(`${axis} (m/s)`, input);
  });
  burn.append(legend('Burn now'), labelled('Object', choose('change-burn-object')), ...axes);
  burn.hidden = names.length === 0;
  box.replaceChildren(values, burn);
}

/** Commands for what differs. @param {HTMLElement} box @param {any} scenario */
export function changesOf(box, scenario) {
  const commands = [];
  /** @type {(selector: string) => any} */
  const part = (selector) => box.querySelector(selector);
  /** @type {NodeListOf<HTMLInputElement | HTMLSelectElement>} */
  const fields = box.querySelectorAll('[data-pointer]');
  for (const field of fields) {
    if (field.value === field.dataset.before || field.value === '') continue;
    const text = field instanceof HTMLSelectElement ? JSON.stringify(field.value) : String(Number(field.value));
    commands.push({ do: 'set', set: `${field.dataset.pointer}=${text}` });
  }
  const dv = ['radial', 'along', 'normal'].map((axis) => Number(part(`#change-burn-${axis}`).value) || 0);
  if (dv.some((speed) => speed !== 0)) commands.push({ do: 'burn', object: part('#change-burn-object').value, dv_rtn_mps: dv });
  return commands;
}
