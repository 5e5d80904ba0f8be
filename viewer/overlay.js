/** What lies over the picture: connection, numbers of the last frame, progress, and the empty page. */

import { byId, formatNumber, h } from './dom.js';
import { addButtons } from './panels/volumes.js';

const WORDS = { idle: 'No scene', connecting: 'Connecting…', live: 'Live', waiting: 'Offline' };
/** Milliseconds without news after which a progress bar goes away. */
const PROGRESS_PATIENCE = 8000;
/** Work shorter than this needs no bar. */
const PROGRESS_DELAY = 250;

/** @param {import('./app.js').Context} context */
export function attachOverlay({ session, ledger, store }) {
  attachStatus(session);
  attachNumbers(ledger, session);
  attachProgress(session);
  const stage = byId('stage');
  session.on('frame', () => stage.classList.add('has-picture'));
  session.on('volume', () => stage.classList.remove('has-picture'));
  session.on('busy', (isBusy) => stage.setAttribute('aria-busy', String(isBusy)));
  store.on('scene', (scene) => {
    const background = scene?.rendering?.background ?? '#000000';
    stage.style.setProperty('--picture-background', background.slice(0, 7));
    stage.classList.toggle('transparent', background.length === 9 && !background.endsWith('ff'));
  });
}

function attachStatus(session) {
  const dot = byId('status');
  const banner = byId('banner');
  let timer = 0;
  const retry = h('button', { type: 'button', class: 'button', onclick: () => session.retryNow() }, 'Try now');
  const text = h('span', {});
  banner.append(text, retry);

  const describe = () => {
    const { phase, message, retryAt } = session.status;
    dot.dataset.phase = phase;
    dot.textContent = WORDS[phase];
    if (phase === 'waiting') {
      const seconds = Math.max(0, Math.ceil((retryAt - Date.now()) / 1000));
      text.textContent = `${message} Trying again in ${seconds} s. What you change meanwhile is kept.`;
      banner.hidden = false;
    } else if (phase !== 'connecting') {
      banner.hidden = true;
    }
  };
  session.on('status', ({ phase }) => {
    clearInterval(timer);
    if (phase === 'waiting') timer = setInterval(describe, 500);
    describe();
  });
  describe();
}

function attachNumbers(ledger, session) {
  const element = byId('numbers');
  let timer = 0;
  const show = () => {
    const record = ledger.records.at(-1);
    if (!record) return;
    const { header, stages } = record;
    const total = Math.round(stages.reduce((sum, ms) => sum + ms, 0));
    const fps = ledger.fps;
    const first = header.phase === 'moving' && fps !== null ? `${formatNumber(fps, 2)} fps` : header.phase === 'final' ? 'Exact' : 'Moving';
    element.textContent = `${first} · ${total} ms · ${header.width} × ${header.height}`;
    element.hidden = false;
  };
  ledger.on('frame', () => {
    if (timer) return;
    // Numbers that change faster cannot be read.
    show();
    timer = setTimeout(() => {
      timer = 0;
      show();
    }, 150);
  });
  session.on('volume', (volume) => {
    if (!volume) element.hidden = true;
  });
}

function attachProgress(session) {
  const box = byId('progress');
  const bar = h('progress', { max: 1, 'aria-label': 'Progress' });
  const text = h('span', {});
  box.append(text, bar);
  let delay = 0;
  let patience = 0;
  const hide = () => {
    clearTimeout(delay);
    clearTimeout(patience);
    delay = 0;
    box.hidden = true;
  };
  session.on('progress', ({ what, fraction }) => {
    if (!(fraction < 1)) return hide();
    text.textContent = String(what).replaceAll('_', ' ');
    bar.value = fraction;
    delay ||= setTimeout(() => {
      box.hidden = false;
    }, PROGRESS_DELAY);
    clearTimeout(patience);
    patience = setTimeout(hide, PROGRESS_PATIENCE);
    return undefined;
  });
  session.on('frame', (header) => header.phase === 'final' && hide());
}

/**
 * The page without a scene.
 * @param {import('./app.js').Context} context
 * @param {import('./panels/volumes.js').VolumeActions} actions
 */
export function attachEmptyState({ session, picture }, actions) {
  const element = byId('empty');
  const message = h('p', { class: 'lost', role: 'alert', hidden: true });
  element.append(
    h('div', { class: 'empty-art', 'aria-hidden': 'true' }),
    h('h2', {}, 'Drop a volume here'), message,
    h('p', {}, 'A file, a folder of DICOM slices, anywhere on this page. Or start with a computed one.'),
    addButtons(actions, true),
  );
  session.on('status', ({ phase }) => {
    if (phase === 'idle') picture.clear();
    element.hidden = phase !== 'idle';
    document.body.classList.toggle('without-scene', phase === 'idle');
    if (phase !== 'idle') message.hidden = true;
  });
  session.on('lost', (text) => {
    message.textContent = text;
    message.hidden = false;
  });
}
