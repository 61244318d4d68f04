// The panel that says why the target was detected in a frame, or not.
import { addStyle, getJson } from './api.js';
import { make } from './editor_form.js';

/** Reasons in words for the list; shapes beside them, so that colour is not the only difference. */
const TITLES = {
  tracked: '● in track', detected: '◐ detected, no track', gated: '◇ outside the gate', star: '★ taken for a star', dropped: '✕ dropped', unlisted: '– not listed',
  outside: '▢ outside the field', occulted: '◍ behind the Earth', dark: '☾ in shadow', unprocessed: '– not processed', saturated: '▲ saturated', merged: '∞ merged',
  near_star: '✶ next to a star', faint: '▽ too faint', chance: '? not detected',
};

/** Opens the panel. @param {HTMLElement} box @param {any} app */
export async function open(box, app) {
  await addStyle('why.css');
  box.classList.add('why');
  const head = make('h2', { dir: 'auto' }), text = make('p', { className: 'why-text', dir: 'auto' }), list = make('ol', { className: 'why-list' });
  text.setAttribute('role', 'status');
  list.setAttribute('aria-label', 'Frames around this one; each line goes to its first frame');
  box.append(head, text, list);
  let shown = false;

  const show = async () => {
    const frame = app.current;
    if (!shown || frame < 0) return;
    try {
      const found = await getJson('why', { sensor: app.sensor, frame });
      if (frame !== app.current) return;
      if (!found.target) {
        head.textContent = 'This sensor has no target';
        return;
      }
      head.textContent = `${found.target} in frame ${frame + 1}: ${(TITLES[found.frame.kind] || found.frame.kind).slice(2)}`;
      text.textContent = `${found.frame.text[0].toUpperCase()}${found.frame.text.slice(1)}.`;
      list.replaceChildren(...found.spans.map((span) => {
        const button = make('button', { type: 'button' }, make('span', { className: 'when', textContent: span.first === span.last ? String(span.first + 1) : `${span.first + 1} – ${span.last + 1}` }),
          make('span', { className: 'kind', textContent: TITLES[span.kind] || span.kind }), make('span', { textContent: span.text, dir: 'auto' }));
        button.addEventListener('click', () => app.goTo(span.first));
        const item = make('li', { className: frame >= span.first && frame <= span.last ? 'now' : '' }, button);
        return item;
      }));
    } catch (error) {
      text.textContent = error.message;
    }
  };
  document.addEventListener('frameshown', show);
  return {
    shown() {
      shown = true;
      return show();
    },
    hidden() { shown = false; },
  };
}
