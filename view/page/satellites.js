// The dialog in which an orbit is chosen: a satellite of the catalogue by name, or a TLE that is pasted.
import { post } from './api.js';
import { layout, make } from './editor_form.js';

/** Reads an element set. @returns {{ name: string, line1: string, line2: string } | null} */
export function readTle(text) {
  const lines = text.split('\n').map((line) => line.trimEnd()).filter(Boolean);
  const first = lines.findIndex((line, k) => line.startsWith('1 ') && lines[k + 1]?.startsWith('2 '));
  if (first < 0) return null;
  return { name: first > 0 ? lines[first - 1].replace(/^0 /, '').trim() : '', line1: lines[first], line2: lines[first + 1] };
}

export class SatelliteDialog {
  /** @param {(pointer: string, orbit: object, name: string) => void} chosen */
  constructor(chosen) {
    this.chosen = chosen;
    this.dialog = make('dialog', { className: 'satellites' });
    this.dialog.append(layout('layout-satellites'));
    this.dialog.setAttribute('aria-labelledby', 'satellite-title');
    document.body.append(this.dialog);
    const element = (id) => this.dialog.querySelector(`#${id}`);
    this.find = element('satellite-find');
    this.list = element('satellite-list');
    this.count = element('satellite-count');
    this.tle = element('satellite-tle');
    this.problem = element('satellite-problem');
    this.find.addEventListener('input', () => this.search());
    element('satellite-use').addEventListener('click', () => this.useTle());
    element('satellite-close').addEventListener('click', () => this.dialog.close());
  }

  /** @param {string} pointer of the orbit */
  ask(pointer) {
    this.pointer = pointer;
    this.problem.textContent = '';
    this.dialog.showModal();
    this.find.focus();
  }

  async search() {
    const find = this.find.value.trim();
    try {
      const { total, satellites } = await post('editor/satellites', JSON.stringify({ find }));
      if (find !== this.find.value.trim()) return;
      this.count.textContent = find ? `${total} found${total > satellites.length ? `, the first ${satellites.length} are shown` : ''}` : '';
      this.list.replaceChildren(...satellites.map((one) => {
        const button = make('button', { type: 'button' }, make('span', { textContent: one.name || 'without name', dir: 'auto' }), make('span', { className: 'state', textContent: String(one.norad) }));
        button.addEventListener('click', () => this.use(one));
        return make('li', {}, button);
      }));
    } catch (error) {
      this.count.textContent = error.message;
    }
  }

  useTle() {
    const tle = readTle(this.tle.value);
    this.problem.textContent = tle ? '' : 'This is no element set: a line that begins with "1 " and one that begins with "2 " are expected.';
    if (tle) this.use(tle);
  }

  use({ name, line1, line2 }) {
    this.dialog.close();
    this.chosen(this.pointer, { source: 'sgp4', tle_line1: line1, tle_line2: line2 }, name);
  }
}
