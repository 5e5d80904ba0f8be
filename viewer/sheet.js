/** On a phone the panel is a sheet from below: closed, half or whole, with one section at a time. */

import { byId, h } from './dom.js';

const STATES = ['closed', 'half', 'full'];
const NAMES = {
  volumes: 'Volumes', colours: 'Colours', occlusion: 'Occlusion', light: 'Light', scene: 'Clipping', view: 'View',
  performance: 'Speed',
};
/** Pixels of a drag that count as a flick to the next state. */
const FLICK = 36;

/** @returns {{open: (section: string) => void}} shows a section, wherever sections are */
export function attachSheet() {
  const panel = byId('panel');
  const handle = byId('sheet-handle');
  const tabs = byId('tabs');
  let state = 'closed';
  const show = (wanted) => {
    state = wanted;
    document.body.dataset.sheet = state;
    handle.setAttribute('aria-expanded', String(state !== 'closed'));
    for (const tab of tabs.children) tab.setAttribute('aria-pressed', String(state !== 'closed' && tab.dataset.section === panel.dataset.section));
  };
  for (const [id, name] of Object.entries(NAMES)) {
    const tab = h('button', {
      type: 'button', 'data-section': id, 'aria-pressed': 'false', onclick: () => {
        if (panel.dataset.section === id && state !== 'closed') show('closed');
        else open(id);
      },
    }, name);
    tabs.append(tab);
  }

  const open = (id) => {
    panel.dataset.section = id;
    for (const element of document.querySelectorAll('.section')) element.classList.toggle('chosen', element.id === `section-${id}`);
    byId(`section-${id}`).open = true;
    show(state === 'closed' ? 'half' : state);
  };

  let from = null;
  let flicked = false;
  const isTouchable = (event) => event.button === 0;
  handle.addEventListener('pointerdown', (event) => {
    if (!isTouchable(event)) return;
    handle.setPointerCapture(event.pointerId);
    from = event.clientY;
    flicked = false;
  });
  handle.addEventListener('pointermove', (event) => {
    if (from === null || Math.abs(event.clientY - from) < FLICK) return;
    const step = event.clientY < from ? 1 : -1;
    const next = STATES[STATES.indexOf(state) + step];
    from = event.clientY;
    flicked = true;
    if (next) openAt(next);
  });
  const release = () => {
    from = null;
  };
  handle.addEventListener('pointerup', release);
  handle.addEventListener('pointercancel', release);
  handle.addEventListener('click', () => {
    if (!flicked) openAt(state === 'closed' ? 'half' : 'closed');
    flicked = false;
  });
  /** A sheet that opens shows something. */
  const openAt = (wanted) => {
    if (wanted !== 'closed' && !panel.dataset.section) tabs.querySelector('[data-section=colours]').click();
    show(wanted);
  };
  show('closed');
  return { open };
}
