// The reason of the frame that is shown, over its picture: whether the target was detected, and if not, why.
import { getJson } from './api.js';
import { setProperty } from './text.js';

/** Reasons in words; shapes beside them, so that colour is not the only difference. */
export const TITLES = {
  tracked: '● in track', detected: '◐ detected, no track', gated: '◇ outside the gate', no_attitude: '⊘ no attitude', star: '★ taken for a star', dropped: '✕ dropped', unlisted: '– not listed',
  outside: '▢ outside the field', occulted: '◍ behind the Earth', dark: '☾ in shadow', unprocessed: '– not processed', saturated: '▲ saturated', merged: '∞ merged',
  near_star: '✶ next to a star', faint: '▽ too faint', chance: '? not detected',
};

/** Reasons that the chip does not say: there is nothing to be seen. */
const QUIET = new Set(['unlisted']);

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

export class Reason {
  /** @param {any} app */
  constructor(app) {
    this.app = app;
    document.addEventListener('frameshown', () => this.show());
    document.addEventListener('liveframe', () => setProperty(element('reason'), 'hidden', true));
    element('reason').addEventListener('click', () => app.panels.show('why'));
  }

  async show() {
    const { app } = this, frame = app.current, { sensor } = app, chip = element('reason');
    if (app.playing || frame < 0) { // a frame that passes by
      chip.hidden = true;
      return;
    }
    try {
      const found = await getJson(app.exported ? 'why' : 'reason', { sensor, frame });
      if (frame !== app.current || sensor !== app.sensor) return;
      chip.hidden = !found.target || QUIET.has(found.frame.kind);
      if (chip.hidden) return;
      chip.textContent = `${found.target} ${TITLES[found.frame.kind] || found.frame.kind}`;
      chip.title = found.frame.text;
    } catch {
      chip.hidden = true; // the panel Why says what is wrong
    }
  }
}
