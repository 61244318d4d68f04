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

/** Laws of attitude that need nothing more than their name (sim/satellite, "attitude" of an object). */
const SHAPE_LAWS = ['nadir', 'nadir_sun', 'velocity', 'sun'];
/** Laws of a spacecraft's body (gimbal/platform/spacecraft/attitude). */
const BODY_LAWS = ['inertial', 'nadir', 'sun', 'target', 'free'];

/**
 * A key that is offered. `count`: numbers in a list; `words`: choices; else one number.
 * `pointer`: where it is; "": this scenario has none. `fallback`: its value where the scenario does not give it.
 * @typedef {{ group: string, title: string, unit?: string, fallback?: any, count?: number, words?: string[],
 *   pointer: (scenario: any, sensor: string) => string }} Field
 */

/** True for a module of the program itself, whose keys are known. */
const known = (scenario, pointer, types) => { const node = valueAt(scenario, pointer); return Boolean(node) && !node.plugin && types.includes(node.type); };
const control = (scenario, sensor) => known(scenario, `${sensor}/modules/control`, ['standard']);
/** Stacks are of whole frames, by the detector of the program. */
const stacks = (scenario, sensor) => known(scenario, `${sensor}/modules/imgproc`, ['standard'])
  && !['track_windows', 'detector/plugin', 'extended/enabled'].some((key) => valueAt(scenario, `${sensor}/modules/imgproc/${key}`));
const onImageError = (scenario, sensor) => ['pi', 'pid', 'lead_lag'].includes(valueAt(scenario, `${sensor}/modules/control/compensator/type`));

/** @type {Field[]} */
const FIELDS = [
  { group: 'Exposure', title: 'Exposure', unit: 's', pointer: (scenario, sensor) => (valueAt(scenario, `${sensor}/modules/control/exposure_s`) > 0
    ? `${sensor}/modules/control/exposure_s` : `${sensor}/exposure/exposure_s`) },
  { group: 'Exposure', title: 'Period of the frames', unit: 's', pointer: (scenario, sensor) => (valueAt(scenario, `${sensor}/modules/control/period_s`) > 0
    ? `${sensor}/modules/control/period_s` : `${sensor}/exposure/period_s`) },
  { group: 'Exposure', title: 'Window: column, row, width, height', unit: 'px', count: 4, fallback: [0, 0, 0, 0], pointer: (_, sensor) => `${sensor}/exposure/window_px` },
  { group: 'Exposure', title: 'Binning', unit: 'px', fallback: 1, pointer: (_, sensor) => `${sensor}/exposure/binning` },
  { group: 'Exposure', title: 'Camera gain', unit: 'e⁻/DN', fallback: 1.5, pointer: (_, sensor) => `${sensor}/camera/gain_e_per_dn` },
  { group: 'Exposure', title: 'Lost frames', unit: 'fraction', fallback: 0, pointer: (_, sensor) => `${sensor}/exposure/dropped_fraction` },
  { group: 'Sky', title: 'Faintest star drawn', unit: 'V', fallback: 16, pointer: (scenario, sensor) => (known(scenario, `${sensor}/modules/scenegen`, ['opencl'])
    ? `${sensor}/modules/scenegen/star_limit_v_mag` : '') },
  { group: 'Sky', title: 'Faintest statistical star', unit: 'V', fallback: 16, pointer: (scenario) => (valueAt(scenario, '/world/faint_stars') === 'statistical' ? '/world/faint_limit_v_mag' : '') },
  { group: 'Image processing', title: 'Frames in a stack (0: none, or a multiple of 4)', fallback: 0, pointer: (scenario, sensor) => (stacks(scenario, sensor) ? `${sensor}/modules/imgproc/stack/frames` : '') },
  { group: 'Platform and loop', title: 'Slow jitter', unit: 'px', fallback: 0, pointer: (_, sensor) => `${sensor}/modules/gimbal/platform/jitter_low_px_rms` },
  { group: 'Platform and loop', title: 'Fast jitter', unit: 'px', fallback: 0, pointer: (_, sensor) => `${sensor}/modules/gimbal/platform/jitter_high_px_rms` },
  { group: 'Platform and loop', title: 'Gain of the compensator', unit: 'factor', fallback: 1, pointer: (scenario, sensor) => (control(scenario, sensor) && onImageError(scenario, sensor)
    ? `${sensor}/modules/control/compensator/gain_scale` : '') },
  { group: 'Platform and loop', title: 'Jitter that the observer\'s gains expect', unit: 'px', fallback: 0.5, pointer: (scenario, sensor) => (control(scenario, sensor) && !onImageError(scenario, sensor)
    ? `${sensor}/modules/control/disturbance_px_rms` : '') },
  { group: 'Platform and loop', title: 'Natural frequency of the mount', unit: 'Hz', pointer: (scenario, sensor) => (valueAt(scenario, `${sensor}/modules/gimbal/natural_frequency_hz`) === undefined
    ? '' : `${sensor}/modules/gimbal/natural_frequency_hz`) },
  { group: 'Platform and loop', title: 'Rate of the control', unit: 'Hz', pointer: (scenario, sensor) => (valueAt(scenario, `${sensor}/modules/control/rate_hz`) > 0 ? `${sensor}/modules/control/rate_hz` : '') },
  { group: 'Platform and loop', title: 'Attitude mode of the spacecraft', words: BODY_LAWS, fallback: 'inertial', pointer: (scenario, sensor) => (valueAt(scenario, `${sensor}/modules/gimbal/platform/spacecraft`)
    ? `${sensor}/modules/gimbal/platform/spacecraft/attitude/law` : '') },
];

function make(tag, properties, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

const labelled = (title, input) => make('label', { className: 'inline' }, `${title} `, input);
const fieldset = (text, ...children) => make('fieldset', {}, make('legend', { textContent: text }), ...children);

function numberInput(value) {
  return make('input', { type: 'number', step: 'any', value: value === undefined ? '' : String(value) });
}

/** @param {string[]} words @param {string} value shown; added where it is none of them */
function choice(words, value, id = '') {
  const all = words.includes(value) ? words : [value, ...words];
  const select = make('select', { id }, ...all.map((word) => make('option', { value: word, textContent: word, dir: 'auto' })));
  select.value = value;
  return select;
}

/** A key's label and control; null: this scenario does not have it. @param {Field} field */
function keyOf(field, scenario, sensor) {
  const pointer = field.pointer(scenario, sensor);
  if (!pointer) return null;
  const found = valueAt(scenario, pointer) ?? field.fallback;
  const input = field.words ? choice(field.words, String(found)) : field.count ? make('input', { type: 'text', size: 18, value: found.join(', ') }) : numberInput(found);
  Object.assign(input.dataset, { pointer, before: input.value, count: field.count ? String(field.count) : '' });
  return labelled(field.unit ? `${field.title} (${field.unit})` : field.title, input);
}

/** Law of an object's shape at a time. @param {any[]} phases */
function lawAt(phases, timeS) {
  const now = (phases || []).filter((phase) => (phase.from_s ?? -1e9) <= timeS);
  return now.length ? now[now.length - 1].law || 'nadir' : 'nadir';
}

/**
 * Phases of an attitude in which a law begins at a time; those that began before it stay. A phase without time begins long before the epoch.
 * @param {any[]} phases @param {string} law @param {number} timeS
 */
export function phasesWith(phases, law, timeS) {
  return [...(phases || []).filter((phase) => (phase.from_s ?? -1e9) < timeS), { from_s: timeS, law }];
}

/**
 * Fills the form. @param {HTMLElement} box @param {any} scenario @param {number} number of the sensor @param {number} timeS of the run
 */
export function changeFields(box, scenario, number, timeS = 0) {
  const sensor = placeOfSensor(scenario, number), objects = (scenario.world && scenario.world.objects) || [], names = objects.map((object) => object.name);
  const groups = [...new Set(FIELDS.map(({ group }) => group))].map((group) => fieldset(group,
    ...FIELDS.filter((field) => field.group === group).map((field) => keyOf(field, scenario, sensor)).filter(Boolean)));
  const targets = [];
  if (names.length) {
    const pointer = `${sensor}/cue/object`, target = choice(names, String(valueAt(scenario, pointer) || ''), 'change-target');
    Object.assign(target.dataset, { pointer, before: target.value });
    targets.push(labelled('Target', target));
  }
  objects.forEach((object, k) => {
    if (!object.shape) return;
    const law = choice(SHAPE_LAWS, lawAt(object.attitude, timeS));
    Object.assign(law.dataset, { attitude: String(k), before: law.value });
    targets.push(labelled(`Attitude mode of ${object.name}`, law));
  });
  const axes = ['radial', 'along', 'normal'].map((axis) => labelled(`${axis} (m/s)`, Object.assign(numberInput(0), { id: `change-burn-${axis}` })));
  const burn = fieldset('Burn now', ...(names.length ? [labelled('Object', choice(names, names[0], 'change-burn-object'))] : []), ...axes);
  burn.hidden = names.length === 0;
  box.replaceChildren(...groups.filter((group) => group.children.length > 1), ...(targets.length ? [fieldset('Target', ...targets)] : []), burn);
}

/** The value of a field as a JSON text. @param {HTMLInputElement | HTMLSelectElement} field */
function jsonOf(field) {
  if (field instanceof HTMLSelectElement) return JSON.stringify(field.value);
  if (!field.dataset.count) return String(Number(field.value));
  const numbers = field.value.split(/[\s,;]+/).filter(Boolean).map(Number);
  return numbers.every(Number.isFinite) ? JSON.stringify(numbers) : JSON.stringify(field.value); // the program says what is wrong
}

/** Commands for what differs. @param {HTMLElement} box @param {any} scenario @param {number} timeS of the run */
export function changesOf(box, scenario, timeS = 0) {
  const commands = [];
  /** @type {(selector: string) => any} */
  const part = (selector) => box.querySelector(selector);
  /** @type {NodeListOf<HTMLInputElement | HTMLSelectElement>} */
  const fields = box.querySelectorAll('[data-pointer]');
  for (const field of fields) {
    if (field.value === field.dataset.before || field.value === '') continue;
    commands.push({ do: 'set', set: `${field.dataset.pointer}=${jsonOf(field)}` });
  }
  /** @type {NodeListOf<HTMLSelectElement>} */
  const laws = box.querySelectorAll('[data-attitude]');
  for (const law of laws) {
    if (law.value === law.dataset.before) continue;
    const pointer = `/world/objects/${law.dataset.attitude}/attitude`;
    commands.push({ do: 'set', set: `${pointer}=${JSON.stringify(phasesWith(valueAt(scenario, pointer), law.value, timeS))}` });
  }
  const dv = ['radial', 'along', 'normal'].map((axis) => Number(part(`#change-burn-${axis}`).value) || 0);
  if (dv.some((speed) => speed !== 0)) commands.push({ do: 'burn', object: part('#change-burn-object').value, dv_rtn_mps: dv });
  return commands;
}
