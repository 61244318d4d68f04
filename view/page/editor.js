// The editor panel: the form, the text beside it, problems and figures that the program finds, saving.
import { addStyle, getJson, post } from './api.js';
import { EditorForm, layout, make } from './editor_form.js';
import { DropDialog } from './editor_drop.js';
import { showFigures } from './editor_figures.js';
import { SatelliteDialog } from './satellites.js';
import { extended, putAt, removeAt, smallFile } from './scenario_values.js';

/** Time without a key pressed after which the text is checked, ms. */
const CHECK_AFTER_MS = 350;
/** The file that is opened first, where it is there. */
const FIRST = 'neossat_geo_track.json';

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

export class Editor {
  constructor(schema) {
    this.root = {}; // the values, with those of the file that is extended
    this.base = {}; // values of that file
    this.baseFile = ''; // "": none
    this.number = 0; // of the latest change
    this.form = new EditorForm(element('editor-form'), schema, {
      root: () => this.root,
      base: () => this.base,
      set: (pointer, value, structure) => this.set(pointer, value, structure),
      satellites: (pointer) => this.satellites.ask(pointer),
    });
    /** @type {DropDialog | null} */
    this.drop = null;
    this.satellites = new SatelliteDialog((pointer, orbit, name) => this.setOrbit(pointer, orbit, name));
    this.listen();
  }

  listen() {
    const drawAgain = () => this.form.draw(element('editor-search').value, element('editor-shown').value);
    element('editor-open').addEventListener('click', () => this.openFile(element('editor-file').value));
    element('editor-file').addEventListener('keydown', (event) => { if (event.key === 'Enter') this.openFile(element('editor-file').value); });
    element('editor-search').addEventListener('input', drawAgain);
    element('editor-shown').addEventListener('change', drawAgain);
    element('editor-save').addEventListener('click', () => this.save());
    element('editor-run').addEventListener('click', () => this.run());
    element('editor-small').addEventListener('change', () => this.writeText());
    element('editor-text').addEventListener('input', () => this.readText());
  }

  say(text) { element('editor-message').textContent = text; }

  async start() {
    const { folder, files } = await getJson('editor/list');
    element('editor-files').replaceChildren(...files.map((one) => make('option', { value: one.file, label: `${one.name} ${one.shipped ? '' : '(yours)'}` })));
    const first = files.find((one) => one.file.endsWith(FIRST)) || files[0];
    this.folder = folder;
    if (first) await this.openFile(first.file);
    else this.draw();
  }

  /** Opens a file: it becomes the one that the small file extends. */
  async openFile(file) {
    try {
      const { file: path, document: values } = await post('editor/open', JSON.stringify({ file }));
      this.baseFile = path;
      this.base = values;
      this.root = structuredClone(values);
      element('editor-file').value = path;
      this.say(`${path} is open. Files are saved in ${this.folder}.`);
      this.draw();
      this.writeText();
    } catch (error) {
      this.say(error.message);
    }
  }

  draw() { this.form.draw(element('editor-search').value, element('editor-shown').value); }

  // ---------------------------------------------------------------- changes

  /** Sets a value. @param {boolean} structure other rows depend on it */
  set(pointer, value, structure) {
    if (value === undefined) removeAt(this.root, pointer); else putAt(this.root, pointer, value);
    this.writeText();
    if (structure) this.draw();
  }

  /** Sets several values. @param {[string, any][]} changes pointer and value */
  setAll(changes) {
    for (const [pointer, value] of changes) putAt(this.root, pointer, value);
    this.writeText();
    this.draw();
  }

  setOrbit(pointer, orbit, name) {
    putAt(this.root, pointer, orbit);
    const owner = pointer.replace(/\/orbit$/, ''), renamed = name && /^\/world\/objects\/\d+$/.test(owner);
    if (renamed) this.rename(owner, name);
    this.writeText();
    this.draw();
  }

  /** Names an object, and the cues to it. */
  rename(owner, name) {
    const at = owner.split('/').pop(), before = this.root.world.objects[at].name;
    putAt(this.root, `${owner}/name`, name);
    for (const observer of this.root.observers || []) {
      for (const sensor of observer.sensors || []) if (sensor.cue && sensor.cue.object === before) sensor.cue.object = name;
    }
  }

  /** Writes the text of the values. */
  writeText() {
    const small = this.baseFile && element('editor-small').checked ? smallFile(this.baseFile, this.base, this.root) : null;
    element('editor-text').value = JSON.stringify(small || this.root, null, 2);
    this.changed();
  }

  /** Reads the text that was typed; the form follows where it is JSON. */
  async readText() {
    const number = this.changed();
    try {
      const typed = JSON.parse(element('editor-text').value);
      if (typeof typed !== 'object' || typed === null || Array.isArray(typed)) return;
      if (typeof typed.extends === 'string' && typed.extends !== this.baseFile) {
        const { file, document: values } = await post('editor/open', JSON.stringify({ file: typed.extends }));
        if (number !== this.number) return;
        this.baseFile = file;
        this.base = values;
      }
      this.root = typeof typed.extends === 'string' ? extended(this.base, typed) : typed;
      this.draw();
    } catch {
      // the check says what is wrong
    }
  }

  /** The text is another one: it is checked when no more is typed. */
  changed() {
    this.number += 1;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.check(), CHECK_AFTER_MS);
    return this.number;
  }

  async check() {
    if (this.checking) { // one at a time
      this.again = true;
      return;
    }
    this.checking = true;
    const { number } = this, body = JSON.stringify({ text: element('editor-text').value });
    try {
      const result = await post('editor/check', body);
      if (number === this.number) this.showResult(result);
      if (result.good && number === this.number) {
        const { loops } = await post('editor/loops', body);
        if (number === this.number) showFigures(element('editor-figures'), result.figures, loops, (duration) => this.measure(duration));
      }
      this.checked = number;
    } catch (error) {
      this.showResult({ good: false, figures: null, problems: [{ kind: 'error', text: error.message }] });
    } finally {
      this.checking = false;
      if (this.again) {
        this.again = false;
        this.check();
      }
    }
  }

  showResult({ good, problems, figures }) {
    const box = element('editor-problems');
    box.classList.toggle('good', good);
    const lines = problems.map((one) => {
      const place = one.line ? `line ${one.line}, column ${one.column}` : one.pointer || '';
      const line = make('button', { type: 'button', className: one.kind }, make('b', { textContent: one.kind === 'error' ? 'Error' : 'Warning' }));
      if (place) line.append(make('span', { className: 'place', textContent: place, dir: 'auto' }));
      line.append(make('span', { textContent: one.text, dir: 'auto' }));
      line.addEventListener('click', () => this.goToProblem(one));
      return line;
    });
    box.replaceChildren(make('p', { textContent: good ? `The scenario is right${problems.length ? `; ${problems.length} ${problems.length === 1 ? 'warning' : 'warnings'}` : ''}.` : 'The scenario is wrong.' }), ...lines);
    this.form.showProblems(problems);
    showFigures(element('editor-figures'), figures, null, (duration) => this.measure(duration));
  }

  /** Speed of the beginning of the scenario. @param {number} duration s */
  measure(duration) {
    return post('editor/speed', JSON.stringify({ text: element('editor-text').value, duration_s: duration }));
  }

  goToProblem({ pointer, line, column }) {
    const text = element('editor-text');
    if (pointer) {
      element('editor-search').value = '';
      element('editor-shown').value = 'all';
      this.form.goTo(pointer);
    } else if (line) {
      const at = text.value.split('\n').slice(0, line - 1).reduce((sum, one) => sum + one.length + 1, 0) + column - 1;
      text.focus();
      text.setSelectionRange(at, at + 1);
    }
  }

  /** Saves, and opens a page on which the scenario runs live. */
  async run() {
    const file = await this.save();
    if (!file) return;
    try {
      this.say(`${file} is starting …`);
      const { url } = await post('editor/run', JSON.stringify({ file }));
      location.href = url;
    } catch (error) {
      this.say(error.message);
    }
  }

  /** @returns {Promise<string>} name of the file; "": not saved */
  async save() {
    try {
      const request = { file: element('editor-name').value.trim(), text: `${element('editor-text').value}\n`, overwrite: element('editor-overwrite').checked };
      const { file } = await post('editor/save', JSON.stringify(request));
      this.say(`Saved: ${this.folder}/${file}. Run it: boresight run ${file}`);
      return file;
    } catch (error) {
      this.say(error.message);
      return '';
    }
  }
}

/** Opens the panel. @param {HTMLElement} box */
export async function open(box) {
  await addStyle('editor.css');
  box.classList.add('editor');
  box.append(layout('layout-editor'));
  const editor = new Editor(await getJson('editor/schema'));
  editor.drop = new DropDialog(box, editor);
  document.editor = editor; // for tests of the page
  await editor.start();
  return {};
}
