// The start page: runs of the folder runs/, and the scenarios that come with the program.
import { getJson, post } from './api.js';

/** An element by its id; which kind it is stands in index.html. @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);

function card(title, words, picture, act) {
  const button = document.createElement('button'), box = document.createElement('span'), head = document.createElement('strong');
  button.type = 'button';
  button.className = 'card';
  box.className = 'words';
  head.textContent = title;
  head.dir = 'auto';
  if (picture) {
    const image = document.createElement('img');
    image.src = picture;
    image.alt = '';
    image.loading = 'lazy';
    button.append(image);
  }
  box.append(head, ...words.filter(Boolean).map((text) => {
    const line = document.createElement('p');
    line.textContent = text;
    line.dir = 'auto';
    return line;
  }));
  button.append(box);
  button.addEventListener('click', async () => {
    button.disabled = true;
    try {
      await act();
    } catch (error) {
      element('problems').hidden = false;
      element('problems').textContent = `${title}: ${error.message}`;
    }
    button.disabled = false;
  });
  return button;
}

function section(title, hint, cards) {
  const head = document.createElement('h2'), text = document.createElement('p'), box = document.createElement('div');
  head.textContent = title;
  text.textContent = hint;
  text.className = 'hint';
  box.className = 'cards';
  box.append(...cards);
  return [head, text, box];
}

function age(seconds) {
  const minutes = (Date.now() / 1000 - seconds) / 60;
  if (minutes < 60) return `${Math.max(0, Math.round(minutes))} min ago`;
  return minutes < 2880 ? `${Math.round(minutes / 60)} h ago` : `${Math.round(minutes / 1440)} days ago`;
}

export async function showStart() {
  const { folder, runs, scenarios } = await getJson('start'), box = element('start');
  for (const part of [element('main'), document.querySelector('footer'), document.querySelector('.run')]) part.hidden = true;
  document.title = 'Boresight';
  const ofRuns = runs.map((run) => card(run.name, [run.scenario, `${run.state}, ${age(run.modified_s)}`],
    run.picture && /^[\w-][\w.-]*$/.test(run.name) ? `api/picture?name=${encodeURIComponent(run.name)}` : '', async () => {
      const { run: number } = await post('open', JSON.stringify({ run: run.name }));
      location.search = `?run=${number}`;
    }));
  const ofScenarios = scenarios.map(({ file, description }) => card(file.replace(/\.json$/, ''), [description], '', async () => {
    const { url } = await post('launch', JSON.stringify({ scenario: file }));
    location.href = url;
  }));
  const { panels } = document.boresight;
  panels.withoutRun(box);
  ofScenarios.splice(1, 0, card('New scenario', ['Change one of these in a form, with your own satellites and telescope, and save it as a file of your own.'], '', () => panels.show('editor')));
  box.replaceChildren(...(runs.length ? section('Runs', `In ${folder}/runs, the newest first. Click one to play it back.`, ofRuns) : []),
    ...section('Scenarios', `Click one to run it live: pause it, step it, change it. It is recorded in ${folder}/runs; scenarios of your own are kept in ${folder}.`, ofScenarios));
  box.hidden = false;
  document.dispatchEvent(new CustomEvent('startshown'));
}
