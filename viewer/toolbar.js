/** The buttons that are always there, and the keys that work everywhere. */

import { byId } from './dom.js';
import { icon } from './icons.js';

const ICONS = { undo: 'undo', redo: 'redo', share: 'share', save: 'save', theme: 'theme', fit: 'fit', help: 'keyboard' };
/** Azimuth and elevation behind the keys 1 to 6. */
const VIEWS = [[0, 0], [180, 0], [90, 0], [-90, 0], [0, 90], [0, -90]];

/**
 * @param {import('./app.js').Context} context
 * @param {{share: () => void, save: () => void, help: () => void, slices: () => void, about: () => void}} dialogs
 */
export function decorateToolbar({ undo, session, camera, picture, store }, { share, save, help, slices, about }) {
  for (const [id, name] of Object.entries(ICONS)) byId(id).prepend(icon(/** @type {any} */ (name)));
  byId('compare').prepend(icon('compare'));
  const fit = () => session.volume && camera.fit(session.volume, picture.aspect);
  const commands = { undo: () => undo.undo(), redo: () => undo.redo(), share, save, fit, help };
  for (const [id, run] of Object.entries(commands)) byId(id).addEventListener('click', run);
  const needScene = ['undo', 'redo', 'share', 'save', 'fit', 'compare', 'open-slices'];
  const enable = () => {
    for (const id of needScene) byId(id).disabled = !store.scene;
    const method = store.scene?.ambient_occlusion?.method;
    if (!method || method === 'off') byId('compare').disabled = true;
  };
  store.on('scene', enable);
  enable();

  window.addEventListener('keydown', (event) => {
    const target = /** @type {HTMLElement} */ (event.target);
    if (document.querySelector('dialog[open]') || isEditing(target)) return;
    const key = event.key.toLowerCase();
    if ((event.ctrlKey || event.metaKey) && (key === 'z' || key === 'y')) {
      event.preventDefault();
      if (key === 'y' || event.shiftKey) undo.redo();
      else undo.undo();
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const isRange = target instanceof HTMLInputElement;
    if (key === 'f' || (key === 'home' && !isRange)) fit();
    else if (key === 'h') document.body.classList.toggle('panel-hidden');
    else if (key === 's') slices();
    else if (key === 'i') about();
    else if (key === '?') help();
    else if (VIEWS[Number(key) - 1] && session.volume) camera.lookFrom(...VIEWS[Number(key) - 1]);
    else return;
    event.preventDefault();
  });
}

/** Whether keys are text here. @param {EventTarget | null} target */
function isEditing(target) {
  return target instanceof HTMLElement
    && target.matches('textarea, select, input:not([type=range], [type=checkbox], [type=radio], [type=color], [type=file])');
}
