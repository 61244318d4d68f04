// The form of the editor: rows for keys, sections for objects and lists, made from the JSON Schema.
import { branchName, chosen, documented, firstValue, keysOfObject, kindOf, numberOf, rangeOf, textOf } from './schema.js';
import { same, valueAt } from './scenario_values.js';

/** Rows that a search shows. */
const FOUND_MOST = 150;

/** Makes an element. @param {string} tag @param {object} properties @param {...(Node | string)} children */
export function make(tag, properties = {}, ...children) {
  const one = Object.assign(document.createElement(tag), properties);
  one.append(...children);
  return one;
}

/** A copy of a template of index.html. @param {string} id */
export function layout(id) {
  const template = document.getElementById(id);
  if (!(template instanceof HTMLTemplateElement)) throw new Error(`${id} is no template`);
  return template.content.cloneNode(true);
}

const button = (text, name, act, className = '') => {
  const one = make('button', { type: 'button', textContent: text, className });
  one.setAttribute('aria-label', name);
  one.addEventListener('click', act);
  return one;
};

/** Name of a part for people: of an element its "name" where it has one. */
const partName = (key, value) => (typeof value === 'object' && value !== null && typeof value.name === 'string' && value.name ? `${key}: ${value.name}` : key);

/**
 * The control of a value that has no rows of its own.
 * @param {object} schema @param {any} value shown; undefined: none
 * @param {(value: any) => void} changed called with undefined to go back to the default
 */
export function control(schema, value, changed) {
  const kind = kindOf(schema);
  if (kind === 'boolean') {
    const box = make('input', { type: 'checkbox', checked: value === true });
    box.addEventListener('change', () => changed(box.checked));
    return box;
  }
  if (kind === 'choice') {
    const known = schema.enum.includes(value) || value === undefined ? schema.enum : [value, ...schema.enum];
    const list = make('select', {}, ...known.map((word) => make('option', { value: String(word), textContent: String(word) })));
    list.value = String(value ?? known[0]);
    list.addEventListener('change', () => changed(schema.enum.find((word) => String(word) === list.value) ?? list.value));
    return list;
  }
  if (kind === 'choices') {
    const given = Array.isArray(value) ? value : [], group = make('span', { className: 'choices' });
    group.setAttribute('role', 'group');
    for (const word of schema.items.enum) {
      const box = make('input', { type: 'checkbox', checked: given.includes(word), value: word });
      box.addEventListener('change', () => changed([...group.querySelectorAll('input')].filter((one) => one.checked).map((one) => one.value)));
      group.append(make('label', {}, box, word));
    }
    return group;
  }
  const text = kind === 'text' ? String(value ?? '') : value === undefined || value === null ? '' : kind === 'numbers' && Array.isArray(value) ? value.join(', ') : kind === 'number' ? String(value) : JSON.stringify(value);
  const input = make('input', { type: 'text', value: text, spellcheck: false, autocomplete: 'off' });
  if (kind === 'number') input.inputMode = 'decimal';
  input.addEventListener('input', () => changed(readTyped(schema, kind, input.value)));
  return input;
}

/** The value of what was typed; text that is none of the kind is kept, and the program says what is wrong. */
function readTyped(schema, kind, text) {
  if (kind === 'text') return textOf(schema, text);
  if (kind === 'number') return numberOf(schema, text);
  if (text.trim() === '') return undefined;
  if (kind === 'numbers') return text.split(/[\s,;]+/).filter(Boolean).map((word) => (Number.isFinite(Number(word)) ? Number(word) : word));
  try {
    return JSON.parse(text);
  } catch {
    return text;
  }
}

export class EditorForm {
  /**
   * @param {HTMLElement} box
   * @param {{ root: () => any, base: () => any, set: (pointer: string, value: any, structure: boolean) => void, satellites: (pointer: string) => void }} editor
   */
  constructor(box, schema, editor) {
    this.box = box;
    this.schema = schema;
    this.editor = editor;
    this.open = new Set(['/world', '/observers', '/observers/0']);
    this.problems = new Map();
    this.rows = new Map();
  }

  /** Draws the form anew. @param {string} search words @param {'all'|'given'|'changed'} shown */
  draw(search, shown) {
    const at = document.activeElement && this.box.contains(document.activeElement) ? document.activeElement.id : '';
    this.rows.clear();
    const words = search.toLowerCase().split(/\s+/).filter(Boolean);
    if (words.length > 0 || shown !== 'all') this.drawFound(words, shown);
    else this.box.replaceChildren(...this.parts(this.schema, ''));
    this.markProblems();
    if (at) document.getElementById(at)?.focus();
  }

  /** Rows and sections of an object. */
  parts(schema, pointer) {
    const value = valueAt(this.editor.root(), pointer);
    const keys = keysOfObject(schema, value).filter(([key]) => !(pointer === '' && ['extends', 'set', 'boresight'].includes(key)));
    const alternatives = schema.oneOf && typeof chosen(schema, value).properties.type?.maxLength === 'undefined';
    const simple = [], sections = [];
    for (const [key, child] of keys) {
      if (alternatives && key === 'type') continue;
      const way = `${pointer}/${key}`, kind = kindOf(child);
      if (kind === 'object' || kind === 'list') sections.push(this.section(child, way, key));
      else simple.push(this.row(child, way, key));
    }
    return [...simple, ...sections];
  }

  /** A part that opens. Its rows are made when it is opened. @param {Node[]} tools further buttons */
  section(schema, pointer, key, tools = []) {
    const value = valueAt(this.editor.root(), pointer), { text } = documented(schema);
    const summary = make('summary', {}, make('span', { className: 'key', textContent: partName(key, value), dir: 'auto' }));
    const body = make('div', { className: 'body' }), one = make('details', { open: this.open.has(pointer) }, summary, body);
    if (value === undefined) summary.append(make('span', { className: 'state', textContent: 'default' }));
    if (Array.isArray(value)) summary.append(make('span', { className: 'state', textContent: String(value.length) }));
    one.dataset.pointer = pointer;
    const fill = () => {
      body.replaceChildren();
      if (text) body.append(make('p', { className: 'doc', textContent: text }));
      if (tools.length > 0) body.append(make('div', { className: 'tools' }, ...tools));
      body.append(...(kindOf(schema) === 'list' ? this.listParts(schema, pointer) : this.objectParts(schema, pointer)));
    };
    one.addEventListener('toggle', () => {
      if (!one.isConnected) return;
      if (one.open) this.open.add(pointer); else this.open.delete(pointer);
      if (one.open && body.childElementCount === 0) {
        fill();
        this.markProblems();
      }
    });
    if (one.open) fill();
    return one;
  }

  objectParts(schema, pointer) {
    const value = valueAt(this.editor.root(), pointer), parts = [], tools = make('div', { className: 'tools' });
    if (schema.oneOf) tools.append(this.alternatives(schema, pointer, value));
    if ('tle_line1' in (schema.properties || {})) tools.append(button('Satellite or TLE…', 'Satellite or TLE…: choose a satellite, or paste a TLE', () => this.editor.satellites(pointer)));
    if (value !== undefined && !/\/\d+$/.test(pointer)) tools.append(button('Default', `Default: remove what is given of ${pointer}`, () => this.editor.set(pointer, undefined, true), 'quiet'));
    if (tools.childElementCount > 0) parts.push(tools);
    if (schema.oneOf && value === undefined) return parts; // such a module is not there
    return [...parts, ...this.parts(schema, pointer)];
  }

  /** The list of alternatives of an object, for example the types of a module. */
  alternatives(schema, pointer, value) {
    const list = make('select', { id: `type${pointer}` });
    if (value === undefined) list.append(make('option', { value: '', textContent: 'none' }));
    for (const [k, branch] of schema.oneOf.entries()) {
      const words = branch.properties.type?.enum || [branchName(branch)];
      for (const word of words) list.append(make('option', { value: `${k} ${word}`, textContent: word }));
    }
    const branch = chosen(schema, value), index = schema.oneOf.indexOf(branch), type = branch.properties.type;
    if (value !== undefined) list.value = `${index} ${type?.enum || type?.const !== undefined ? value.type : branchName(branch)}`;
    list.addEventListener('change', () => {
      const [, number, word] = /^(\d+) (.*)$/.exec(list.value), wanted = schema.oneOf[Number(number)];
      const keys = new Set(Object.keys(wanted.properties)), kept = {};
      for (const [key, held] of Object.entries(value || {})) {
        if (keys.has(key) && key !== 'type' && same(wanted.properties[key].type, branch.properties[key]?.type)) kept[key] = held;
      }
      const first = firstValue(wanted);
      if ('type' in wanted.properties && wanted.properties.type.maxLength === undefined) first.type = word;
      this.editor.set(pointer, { ...first, ...kept }, true);
    });
    return make('label', {}, 'Type ', list);
  }

  listParts(schema, pointer) {
    const value = valueAt(this.editor.root(), pointer) ?? schema.default ?? [], items = Array.isArray(value) ? value : [];
    const parts = items.map((item, k) => {
      const remove = button('Remove', `Remove element ${k} of ${pointer}`, () => this.editor.set(pointer, items.filter((_, i) => i !== k), true), 'quiet');
      return this.section(schema.items, `${pointer}/${k}`, String(k), [remove]);
    });
    const add = button('Add', `Add an element to ${pointer}`, () => {
      this.open.add(`${pointer}/${items.length}`);
      this.editor.set(pointer, [...items, firstValue(schema.items)], true);
    });
    add.disabled = items.length >= (schema.maxItems ?? Infinity);
    return [...parts, make('div', { className: 'tools' }, add)];
  }

  /** A key with its control, unit, range and documentation. */
  row(schema, pointer, name) {
    const value = valueAt(this.editor.root(), pointer), { text, unit } = documented(schema), range = rangeOf(schema);
    const row = make('div', { className: 'row' }), id = `value${pointer}`;
    const back = button('↺', `${pointer}: back to the default`, () => this.editor.set(pointer, undefined, true), 'quiet');
    const mark = (given) => {
      row.classList.toggle('given', given !== undefined);
      row.classList.toggle('changed', !same(given, valueAt(this.editor.base(), pointer)));
      back.hidden = given === undefined || schema.default === undefined;
    };
    const one = control(schema, value === undefined ? schema.default : value, (typed) => {
      this.editor.set(pointer, typed, ['source', 'name', 'plugin'].includes(name));
      mark(typed);
    });
    const label = make('label', { className: 'key', textContent: name, htmlFor: id });
    if (one.tagName === 'SPAN') one.setAttribute('aria-label', name);
    one.id = id;
    one.setAttribute('aria-describedby', `doc${pointer}`);
    const limits = [range, schema.default !== undefined && schema.default !== '' ? `default ${JSON.stringify(schema.default)}` : ''].filter(Boolean).join(' · ');
    const doc = make('p', { className: 'doc', id: `doc${pointer}` }, text, make('span', { className: 'range', textContent: limits }));
    row.dataset.pointer = pointer;
    row.append(label, make('span', { className: 'field' }, one, make('span', { className: 'unit', textContent: unit }), back), doc, make('p', { className: 'problem', hidden: true }));
    mark(value);
    this.rows.set(pointer, row);
    return row;
  }

  // ---------------------------------------------------------------- search

  /** Goes through the keys of the document, with those that are not given. */
  everyRow(visit, schema = this.schema, pointer = '') {
    const value = valueAt(this.editor.root(), pointer);
    if (schema.oneOf && value === undefined) return;
    if (kindOf(schema) === 'list') {
      (Array.isArray(value) ? value : []).forEach((_, k) => this.everyRow(visit, schema.items, `${pointer}/${k}`));
    } else if (kindOf(schema) === 'object') {
      for (const [key, child] of keysOfObject(schema, value)) {
        if (!(pointer === '' && ['extends', 'set', 'boresight'].includes(key))) this.everyRow(visit, child, `${pointer}/${key}`);
      }
    } else {
      visit(schema, pointer, value);
    }
  }

  drawFound(words, shown) {
    const found = [];
    this.everyRow((schema, pointer, value) => {
      if (shown === 'given' && (value === undefined || same(value, schema.default))) return;
      if (shown === 'changed' && same(value, valueAt(this.editor.base(), pointer))) return;
      const text = `${pointer} ${schema.description || ''}`.toLowerCase(), key = pointer.split('/').pop().toLowerCase();
      if (!words.every((word) => text.includes(word))) return;
      found.push({ schema, pointer, first: words.some((word) => key.includes(word)) });
    });
    found.sort((a, b) => Number(b.first) - Number(a.first)); // those whose own name has the words
    const count = found.length;
    const more = count > FOUND_MOST ? `The first ${FOUND_MOST} of ${count} keys; type more letters.` : `${count} ${count === 1 ? 'key' : 'keys'}`;
    const rows = found.slice(0, FOUND_MOST).map(({ schema, pointer }) => {
      const row = this.row(schema, pointer, pointer.split('/').pop());
      const above = pointer.split('/').slice(1, -1).join(' / ');
      row.prepend(make('p', { className: 'above', textContent: above, dir: 'auto' }));
      row.querySelector('input, select')?.setAttribute('aria-label', pointer.slice(1));
      return row;
    });
    this.box.replaceChildren(make('p', { className: 'doc', textContent: more }), ...rows);
    this.box.scrollTop = 0;
  }

  // ---------------------------------------------------------------- problems

  /** @param {{ pointer?: string, text: string, kind: string }[]} problems of the program */
  showProblems(problems) {
    this.problems = new Map(problems.filter((one) => one.pointer).map((one) => [one.pointer, one]));
    this.markProblems();
  }

  markProblems() {
    for (const [pointer, row] of this.rows) {
      const problem = this.problems.get(pointer), place = row.querySelector('.problem');
      place.hidden = !problem;
      place.textContent = problem ? problem.text : '';
      row.classList.toggle('wrong', problem?.kind === 'error');
    }
    for (const section of this.box.querySelectorAll('details')) {
      const inside = [...this.problems.values()].some((one) => one.kind === 'error' && `${one.pointer}/`.startsWith(`${section.dataset.pointer}/`));
      section.classList.toggle('wrong', inside);
    }
  }

  /** Opens the sections above a key and moves to it. */
  goTo(pointer) {
    const keys = pointer.split('/').slice(1);
    keys.forEach((_, k) => this.open.add(`/${keys.slice(0, k + 1).join('/')}`));
    this.draw('', 'all');
    for (let k = keys.length; k > 0; k--) {
      const way = `/${keys.slice(0, k).join('/')}`;
      const place = this.rows.get(way) || [...this.box.querySelectorAll('details')].find((one) => one.dataset.pointer === way);
      if (place) {
        place.scrollIntoView({ block: 'center' });
        (place.querySelector('input, select, summary') || place).focus();
        return;
      }
    }
  }
}
