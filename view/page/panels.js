// The panels of the page, of which one is shown. Frame is part of index.html; others are modules that are loaded when
// they are opened first. A module exports `open(box, app)`: it fills `box` and may return { shown(), hidden() }.

/** A new panel is a line here. @type {{ name: string, title: string, module?: string }[]} */
const PANELS = [
  { name: 'frame', title: 'Frame' },
  { name: 'space', title: 'Space', module: './space.js' },
  { name: 'why', title: 'Why', module: './why.js' },
  { name: 'compare', title: 'Compare', module: './compare.js' },
  { name: 'editor', title: 'Editor', module: './editor.js' },
];

export class Panels {
  /** @param {HTMLElement} bar @param {HTMLElement} area beside which panels are put @param {object} app */
  constructor(bar, area, app) {
    this.bar = bar;
    this.app = app;
    /** @type {Map<string, { box: HTMLElement, panel: any, ready?: Promise<void> | null }>} */
    this.boxes = new Map([['frame', { box: area, panel: {} }]]);
    this.current = 'frame';
    bar.hidden = PANELS.length < 2;
    bar.replaceChildren(...PANELS.map(({ name, title }) => {
      const tab = document.createElement('button');
      tab.type = 'button';
      tab.id = `tab-${name}`;
      tab.textContent = title;
      if (name === this.current) tab.setAttribute('aria-current', 'page');
      tab.addEventListener('click', () => this.show(name));
      return tab;
    }));
  }

  /** Puts the start page in the place of the frame; without a run there is no space. @param {HTMLElement} start */
  withoutRun(start, title = 'Start') {
    this.boxes.get('frame').box = start;
    this.keep(['frame', 'editor']);
    for (const tab of this.bar.children) {
      if (tab.id === 'tab-frame') tab.textContent = title;
    }
  }

  /** Hides all other panels. @param {string[]} names */
  keep(names) {
    /** @type {NodeListOf<HTMLElement>} */
    const tabs = this.bar.querySelectorAll('button');
    for (const tab of tabs) tab.hidden = !names.includes(tab.id.replace('tab-', ''));
  }

  /** True if keys belong to the frame. */
  get frameShown() { return this.current === 'frame'; }

  /** @param {string} name of a panel */
  async show(name) {
    const wanted = PANELS.find((panel) => panel.name === name);
    if (!wanted || name === this.current) return;
    const before = this.boxes.get(this.current);
    if (!this.boxes.has(name)) this.boxes.set(name, this.make(wanted));
    const { box } = this.boxes.get(name);
    before.box.hidden = true;
    box.hidden = false;
    this.current = name;
    for (const tab of this.bar.children) {
      if (tab.id === `tab-${name}`) tab.setAttribute('aria-current', 'page');
      else tab.removeAttribute('aria-current');
    }
    const { ready, panel } = this.boxes.get(name);
    if (before.panel.hidden) before.panel.hidden();
    await ready;
    const opened = this.boxes.get(name).panel || panel;
    if (this.current === name && opened.shown) opened.shown();
  }

  /** @param {{ name: string, title: string, module?: string }} panel */
  make({ name, title, module }) {
    const box = document.createElement('main');
    /** @type {{ box: HTMLElement, panel: any, ready?: Promise<void> | null }} */
    const made = { box, panel: {}, ready: null };
    box.className = 'panel';
    box.id = `panel-${name}`;
    box.setAttribute('aria-label', title);
    document.getElementById('main').after(box);
    made.ready = import(module).then((loaded) => loaded.open(box, this.app)).then((panel) => { made.panel = panel || {}; })
      .catch((error) => { box.textContent = `This panel cannot be shown: ${error.message}`; });
    return made;
  }
}
