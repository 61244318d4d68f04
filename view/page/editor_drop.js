// Files that are dropped onto the editor, or chosen: element sets, shapes and frames become parts of the scenario.
import { postFile } from './api.js';
import { layout, make } from './editor_form.js';

/** Longest file (BST_VIEW_FILE_BYTES). */
const FILE_BYTES = 40 * 2 ** 20;

/** A name as the server takes it. @param {string} name */
export const plainName = (name) => name.replace(/[^A-Za-z0-9_.-]/g, '_').slice(-60).replace(/^[.-]/, '_');

/**
 * Parts of a scenario that can take what a file has, by pointer.
 * @param {'elements' | 'shape' | 'frame'} kind @param {any} root the scenario @returns {{ pointer: string, name: string }[]}
 */
export function placesFor(kind, root) {
  const name = (one, what, k) => `${what} ${one && one.name ? one.name : k}`, places = [];
  const observers = Array.isArray(root.observers) ? root.observers : [], objects = Array.isArray(root.world?.objects) ? root.world.objects : [];
  if (kind === 'frame') {
    observers.forEach((observer, k) => (observer.sensors || []).forEach((sensor, i) => places.push({ pointer: `/observers/${k}/sensors/${i}`, name: name(sensor, `${observer.name || k},`, i) })));
    return places;
  }
  const target = observers[0]?.sensors?.[0]?.cue?.object, order = objects.map((one, k) => k).sort((a, b) => Number(objects[b].name === target) - Number(objects[a].name === target));
  for (const k of order) places.push({ pointer: `/world/objects/${k}`, name: name(objects[k], 'object', k) });
  if (kind === 'elements') observers.forEach((one, k) => places.push({ pointer: `/observers/${k}`, name: name(one, 'observer', k) }));
  return places;
}

/** @param {DragEvent} event */
const hasFiles = (event) => Boolean(event.dataTransfer) && [...event.dataTransfer.types].includes('Files');

export class DropDialog {
  /** @param {HTMLElement} area onto which files are dropped @param {any} editor */
  constructor(area, editor) {
    this.editor = editor;
    this.area = area;
    this.reading = false;
    this.dialog = make('dialog', { className: 'satellites drop' });
    this.dialog.append(layout('layout-drop'));
    this.dialog.setAttribute('aria-labelledby', 'drop-title');
    document.body.append(this.dialog);
    this.element = (id) => this.dialog.querySelector(`#${id}`);
    this.element('drop-use').addEventListener('click', () => this.use());
    this.element('drop-close').addEventListener('click', () => this.dialog.close());
    /** @type {any} */
    const input = document.getElementById('editor-file-input');
    document.getElementById('editor-from-file').addEventListener('click', () => input.click());
    input.addEventListener('change', () => {
      if (input.files.length) this.take(input.files[0]);
      input.value = '';
    });
    // anywhere else the browser would leave the page for the file
    for (const name of ['dragover', 'drop']) {
      document.addEventListener(name, (/** @type {any} */ event) => {
        if (!hasFiles(event)) return;
        event.preventDefault();
        if (!this.isFor(event)) event.dataTransfer.dropEffect = 'none';
      });
    }
    area.addEventListener('dragover', (event) => { if (this.isFor(event)) area.classList.add('dropping'); });
    for (const name of ['dragleave', 'drop']) area.addEventListener(name, () => area.classList.remove('dropping'));
    area.addEventListener('drop', (event) => {
      const files = event.dataTransfer.files;
      if (!files.length || !this.isFor(event)) return;
      if (files.length > 1) this.editor.say(`${files.length} files were dropped (allowed: one).`);
      else this.take(files[0]);
    });
  }

  /** True for a drag of files over the editor, while no dialog is open. @param {DragEvent} event */
  isFor(event) {
    return hasFiles(event) && this.area.contains(/** @type {Node} */ (event.target)) && !document.querySelector('dialog[open]');
  }

  /** @param {File} file */
  async take(file) {
    const { editor } = this;
    if (this.reading) {
      editor.say(`${file.name}: another file is being read.`);
      return;
    }
    if (file.size > FILE_BYTES) {
      editor.say(`${file.name}: has ${(file.size / 2 ** 20).toFixed(1)} MiB (allowed: ${FILE_BYTES / 2 ** 20} MiB).`);
      return;
    }
    this.reading = true;
    try {
      editor.say(`${file.name} is read …`);
      this.found = await postFile('editor/file', plainName(file.name), file);
      this.show(file.name);
      editor.say('');
    } catch (error) {
      editor.say(error.message);
    }
    this.reading = false;
  }

  show(name) {
    const { found } = this, places = placesFor(found.kind, this.editor.root), element = this.element;
    const many = found.satellites && found.satellites.length > 1;
    const what = {
      elements: () => `${found.total} element ${found.total === 1 ? 'set' : 'sets'}${found.total - found.left_out > found.satellites.length ? `; the first ${found.satellites.length} are listed` : ''}${found.left_out ? `; ${found.left_out} that a TLE cannot hold left out` : ''}.`,
      shape: () => `A shape of ${found.parts} ${found.parts === 1 ? 'part' : 'parts'} and ${found.facets} facets, ${(2 * found.radius_m).toPrecision(3)} m across, now in the folder as ${found.file}.`,
      frame: () => 'A frame. What its header says:',
    }[found.kind]();
    element('drop-title').textContent = name;
    element('drop-what').textContent = places.length ? what : `${what} The scenario has nothing that could take it.`;
    element('drop-set-label').hidden = !many;
    element('drop-set').replaceChildren(...(found.satellites || []).map((one, k) => make('option', { value: String(k), textContent: `${one.name || 'without name'} (${one.norad})`, dir: 'auto' })));
    element('drop-for').replaceChildren(...places.map((one) => make('option', { value: one.pointer, textContent: one.name, dir: 'auto' })));
    element('drop-offers').hidden = found.kind !== 'frame';
    element('drop-offers').replaceChildren(...(found.offers || []).map((offer, k) => {
      const box = make('input', { type: 'checkbox', checked: !offer.unsure, value: String(k) });
      return make('label', { className: 'inline' }, box, offer.text, make('span', { className: 'state', textContent: `(${offer.from})` }));
    }));
    element('drop-use').disabled = places.length === 0;
    this.dialog.showModal();
  }

  use() {
    const { editor, found } = this, place = this.element('drop-for').value;
    if (found.kind === 'elements') {
      const { line1, line2, name } = found.satellites[Number(this.element('drop-set').value) || 0];
      editor.setOrbit(`${place}/orbit`, { source: 'sgp4', tle_line1: line1, tle_line2: line2 }, name);
    } else if (found.kind === 'shape') {
      editor.setAll([[`${place}/shape`, { file: found.file }], [`${place}/brightness/model`, 'shape']]);
    } else {
      const chosen = [...this.element('drop-offers').querySelectorAll('input')].filter((box) => box.checked).map((box) => found.offers[Number(box.value)]);
      editor.setAll(chosen.flatMap((offer) => offer.changes.map(({ key, value }) => [key.startsWith('/') ? key : `${place}/${key}`, value])));
    }
    this.dialog.close();
    editor.form.goTo(found.kind === 'elements' ? `${place}/orbit` : found.kind === 'shape' ? `${place}/shape` : place);
  }
}
