/** The volumes of the server: choose, open, make, look up, delete. */

import { button, segments } from '../controls.js';
import { formatBytes, formatNumber, h } from '../dom.js';
import { icon } from '../icons.js';
import { isAveraged } from '../information.js';
import { loadsList } from './loads.js';
import { section } from './section.js';

/** Kinds of `source.procedural`, and what people call them. */
const PROCEDURAL = {
  gyroid: 'Gyroid', mandelbulb: 'Mandelbulb', menger: 'Menger sponge', marschner_lobb: 'Marschner–Lobb',
  cloud: 'Cloud', sphere_flake: 'Sphere flake', boxes: 'Boxes', sphere_on_plane: 'Sphere on a plane',
};

/**
 * @typedef {Object} VolumeActions
 * @property {(volume: any) => void} choose
 * @property {() => void} open data from anywhere
 * @property {(volume: any) => void} about what is known of a volume
 * @property {(kind: string, size: number) => void} makeProcedural
 * @property {(volume: any) => void} remove
 */

/**
 * @param {import('../app.js').Context} context
 * @param {VolumeActions} actions
 */
export function volumesPanel({ library, session }, actions) {
  const list = h('ul', { class: 'volumes' });
  const refresh = () => list.replaceChildren(...library.volumes.map((volume) => entry(volume, session.volume, actions)));
  library.on('change', refresh);
  session.on('volume', refresh);
  return section('volumes', 'Volumes', { open: true }, h('div', { class: 'stack' }, list, loadsList(library.loads),
    addButtons(actions)));
}

/**
 * A button for data from anywhere and a menu of computed volumes; also the empty page has them.
 * @param {VolumeActions} actions
 * @param {boolean} [isFirst] whether there is nothing else to do
 */
export function addButtons(actions, isFirst = false) {
  const open = button('', () => actions.open(), { class: isFirst ? 'button primary' : 'button', 'aria-haspopup': 'dialog' });
  open.append(icon('upload'), 'Open data…');
  return h('div', { class: 'row add-volume' }, open, proceduralMenu(actions));
}

function proceduralMenu({ makeProcedural }) {
  let size = 128;
  const sizes = segments({
    label: 'Size', options: [64, 128, 256].map((n) => [String(n), `${n}³`]), onInput: (value) => {
      size = Number(value);
    },
  });
  sizes.set('128');
  const menu = h('details', { class: 'menu' }, h('summary', { class: 'button' }, 'Procedural'),
    h('div', { class: 'menu-body' }, sizes.element,
      ...Object.entries(PROCEDURAL).map(([kind, name]) => button(name, () => {
        menu.open = false;
        makeProcedural(kind, size);
      }, { class: 'button menu-item' }))));
  document.addEventListener('pointerdown', (event) => {
    if (!menu.contains(/** @type {Node} */ (event.target))) menu.open = false;
  });
  menu.addEventListener('keydown', (event) => {
    if (event.key !== 'Escape' || !menu.open) return;
    menu.open = false;
    menu.querySelector('summary').focus();
  });
  return menu;
}

function entry(volume, current, { choose, about, remove }) {
  const isCurrent = volume.id === current?.id;
  // Taken off the GPU to make room: the next picture brings it back.
  const size = volume.state === 'evicted' ? 'in host memory' : formatBytes(volume.gpu_bytes);
  const facts = [volume.dims.join(' × '), volume.voxel_type, size, isAveraged(volume) && 'averaged'].filter(Boolean).join(' · ');
  const [low, high] = volume.value_range;
  const pick = h('button', {
    type: 'button', class: 'volume', 'aria-current': isCurrent ? 'true' : null,
    title: `Values ${formatNumber(low)} … ${formatNumber(high)}`, onclick: () => choose(volume),
  }, h('span', { class: 'name' }, volume.name), h('span', { class: 'facts-line' }, facts));
  const info = h('button', {
    type: 'button', class: volume.notes?.length > 0 ? 'icon-button about noted' : 'icon-button about', 'aria-label': `About ${volume.name}`, title: 'Information', 'aria-haspopup': 'dialog',
    onclick: () => about(volume),
  }, icon('info'));
  const drop = h('button', {
    type: 'button', class: 'icon-button', 'aria-label': `Delete ${volume.name}`, title: 'Delete from the server',
    onclick: () => remove(volume),
  }, icon('trash'));
  return h('li', { class: isCurrent ? 'current' : null }, pick, info, drop);
}
