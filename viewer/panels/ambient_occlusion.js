/** Ambient occlusion: method and parameters, and a look at the picture without it. */

import { segments, slider, toggle } from '../controls.js';
import { h } from '../dom.js';
import { inHeading, section } from './section.js';

const METHODS = {
  spao: 'SPAO', raytraced: 'Ray traced', directional: 'Directional', vao_cdf: 'VAO (CDF)',
  vao_gaussian: 'VAO (Gaussian)', vao_penner: 'VAO (Penner)', vicinity: 'Vicinity', obscurances: 'Obscurances',
  local: 'Local', histogram: 'Histogram',
};
const STRUCTURES = { n_buffer: 'N-buffers', mipmap: 'Mipmap', hybrid: 'Hybrid' };
/** What a server has that does not say. */
const KNOWN_METHODS = ['off', 'spao', 'raytraced'];

/** @param {import('../app.js').Context} context */
export function ambientOcclusionPanel({ store, session, server }) {
  const edit = (patch) => store.edit({ ambient_occlusion: patch });
  const offered = (server?.features?.ao_methods ?? KNOWN_METHODS).filter((method) => method !== 'off');
  let method = 'spao';

  const power = toggle({ label: '', onInput: (on) => edit({ method: on ? method : 'off' }) });
  power.element.querySelector('input').setAttribute('aria-label', 'Ambient occlusion');
  power.element.id = 'ao-switch';
  const choice = segments({
    label: 'Method', options: offered.map((key) => [key, METHODS[key] ?? key]), onInput: (key) => edit({ method: key }),
  });
  const structure = segments({
    label: 'Structure', options: (server?.features?.ao_structures ?? Object.keys(STRUCTURES)).map((key) => [key, STRUCTURES[key] ?? key]),
    // Hybrid without a mip level is an N-buffer: one level makes the choice mean something.
    onInput: (key) => edit({ structure: key, ...(key === 'hybrid' && shown.mip_levels === 0 ? { mip_levels: 1 } : {}) }),
  });
  const levels = slider({
    label: 'Levels', min: 1, max: 8, step: 1, hint: 'How far occlusion reaches: 2 to the power of levels, in voxels',
    onInput: (value) => edit({ levels: value, mip_levels: Math.min(shown.mip_levels, value) }),
  });
  const mipLevels = slider({
    label: 'Mip levels', min: 0, max: 8, step: 1, hint: 'Of the levels, how many are halved',
    onInput: (value) => edit({ mip_levels: Math.min(value, shown.levels) }),
  });
  const normalFactor = slider({
    label: 'Normal factor', min: 0, max: 2, step: 0.05, hint: 'How far look-ups move along the surface normal',
    onInput: (value) => edit({ normal_factor: value }),
  });
  const rays = slider({
    label: 'Rays', min: 1, max: 4096, step: 1, log: true, hint: 'Directions per voxel',
    onInput: (value) => edit({ rays: value }),
  });
  const strength = slider({ label: 'Strength', min: 0, max: 1, step: 0.01, onInput: (value) => edit({ strength: value }) });
  const body = h('div', { class: 'stack' }, choice.element, structure.element, strength.element, levels.element,
    mipLevels.element, normalFactor.element, rays.element,
    h('p', { class: 'note' }, 'Hold ', h('kbd', {}, 'O'), ' to see the picture without it.'));

  let shown = { levels: 6, mip_levels: 0 };
  store.on('scene', (scene) => {
    const ao = scene?.ambient_occlusion;
    if (!ao) return;
    shown = ao;
    const isOn = ao.method !== 'off';
    if (isOn) method = ao.method;
    power.set(isOn);
    choice.set(method);
    structure.set(ao.structure);
    levels.set(ao.levels);
    mipLevels.set(ao.mip_levels);
    normalFactor.set(ao.normal_factor);
    rays.set(ao.rays);
    strength.set(ao.strength);
    const isSpao = method === 'spao';
    for (const control of [structure, normalFactor]) control.element.hidden = !isSpao;
    mipLevels.element.hidden = !isSpao || ao.structure !== 'hybrid';
    rays.element.hidden = method !== 'raytraced';
    body.toggleAttribute('inert', !isOn);
  });
  session.on('volume', () => body.toggleAttribute('inert', true));
  return section('occlusion', 'Ambient occlusion', { open: true, extra: inHeading(power.element) }, body);
}

/**
 * The picture without occlusion for as long as `O` or the button is held.
 * @param {import('../app.js').Context} context
 * @param {HTMLElement} holdButton
 */
export function attachComparison({ store, undo }, holdButton) {
  let before = null;
  const begin = () => {
    const ao = store.scene?.ambient_occlusion;
    if (before !== null || !ao || ao.method === 'off') return;
    before = ao.strength;
    undo.paused = true;
    holdButton.setAttribute('aria-pressed', 'true');
    // Strength costs nothing to change, while another method would have to be computed again.
    store.edit({ ambient_occlusion: { strength: 0 } });
  };
  const end = () => {
    if (before === null) return;
    store.edit({ ambient_occlusion: { strength: before } });
    before = null;
    undo.paused = false;
    holdButton.setAttribute('aria-pressed', 'false');
  };
  window.addEventListener('keydown', (event) => {
    const isTyping = event.target instanceof HTMLElement && event.target.matches('input[type=number], input[type=text], textarea');
    if (event.key.toLowerCase() === 'o' && !event.ctrlKey && !event.metaKey && !event.altKey && !isTyping) begin();
  });
  window.addEventListener('keyup', (event) => event.key.toLowerCase() === 'o' && end());
  window.addEventListener('blur', end);
  holdButton.addEventListener('pointerdown', (event) => {
    holdButton.setPointerCapture(event.pointerId);
    begin();
  });
  holdButton.addEventListener('pointerup', end);
  holdButton.addEventListener('pointercancel', end);
  holdButton.addEventListener('contextmenu', (event) => event.preventDefault());
  holdButton.addEventListener('keydown', (event) => [' ', 'Enter'].includes(event.key) && begin());
  holdButton.addEventListener('keyup', (event) => [' ', 'Enter'].includes(event.key) && end());
}
