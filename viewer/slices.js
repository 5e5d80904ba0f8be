/** Three slices of the volume below the picture, on a phone one of them over it; one window, one point, one value. */

import { api } from './api.js';
import { button, rangePair, segments } from './controls.js';
import { byId, formatNumber, h } from './dom.js';
import { nearestWorldAxis, worldFromIndex } from './grid.js';
import { icon } from './icons.js';
import { Latest } from './latest.js';
import { hasPatientAxes } from './patient.js';
import { preference, setPreference } from './preferences.js';
import { SliceView, planeName } from './slice_view.js';

/** The part of a transfer function that is too narrow a window would show one bright spot. */
const NARROWEST = 0.02;

/**
 * @param {import('./app.js').Context} context
 * @returns {{toggle: () => void}}
 */
export function attachSlices({ session, store, server }) {
  const element = byId('slices');
  const opener = byId('open-slices');
  opener.prepend(icon('slices'));
  /** @type {import('./slice_view.js').SliceState | null} */ let state = null;
  /** Whether a person set the window, which colours then no longer do. */
  let isWindowOurs = false;
  let isOpen = false;

  const value = h('output', { class: 'facts-line' });
  const probe = new Latest(async ({ volume, index }) => {
    const world = worldFromIndex(volume, index);
    try {
      describe(value, index, world, await api.probe(volume.id, world));
    } catch (error) {
      value.textContent = error.message;
    }
  });
  const hover = (index) => {
    const at = index ?? state?.index;
    if (at) probe.ask({ volume: state.volume, index: at });
  };
  const moveTo = (index) => {
    if (!state) return;
    const { dims } = state.volume;
    state = { ...state, index: index.map((at, axis) => Math.min(dims[axis] - 1, Math.max(0, at))) };
    refresh();
  };
  const views = [0, 1, 2].map((axis) => new SliceView(axis, {
    onIndex: (which, at) => {
      moveTo(state.index.with(which, at));
      hover(null);
    },
    onPoint: moveTo,
    onHover: hover,
  }, server.limits?.max_image_axis));

  const windowPair = rangePair({
    label: 'Window', onInput: (low, high) => {
      isWindowOurs = true;
      setWindow([low, high]);
    },
  });
  const byColours = button('Colours', () => {
    isWindowOurs = false;
    setWindow(windowOfColours(state.volume, store.scene));
  }, { class: 'button quiet', title: 'The values that the transfer function is about' });
  const whole = button('All values', () => {
    isWindowOurs = true;
    setWindow(rangeOf(state.volume));
  }, { class: 'button quiet', title: 'From the lowest to the highest value' });
  const planes = segments({ label: 'Plane', options: [], onInput: (axis) => choosePlane(axis) });
  const close = h('button', { type: 'button', class: 'icon-button', 'aria-label': 'Close the slices', title: 'Close (S)', onclick: () => toggle() },
    icon('close'));
  const row = h('div', { class: 'slice-row' });
  element.append(row, h('div', { class: 'slice-tools' }, planes.element, windowPair.element,
    h('div', { class: 'row' }, byColours, whole), value, close));

  const choosePlane = (axis) => {
    planes.set(axis);
    for (const view of views) view.element.classList.toggle('chosen', String(view.axis) === axis);
    setPreference('plane', axis);
  };
  const setWindow = (window) => {
    if (!state) return;
    state = { ...state, window };
    windowPair.set(rangeOf(state.volume), ...window);
    refresh();
  };
  const refresh = () => isOpen && views.forEach((view) => view.show(state));

  const arrange = () => {
    // As patients' slices are read: axial, coronal, sagittal; without a patient z, y, x.
    const rank = (view) => (state.isPatient ? nearestWorldAxis(state.volume.direction[view.axis]) : view.axis);
    const ordered = [...views].sort((a, b) => rank(b) - rank(a));
    row.replaceChildren(...ordered.map((view) => view.element));
    planes.setOptions(ordered.map((view) => [String(view.axis), planeName(state, view.axis)]));
    choosePlane(preference('plane', String(ordered[0].axis)));
  };

  const load = async () => {
    const { volume } = session;
    if (!isOpen || (state && state.volume.id === volume?.id && state.volume.sha256 === volume?.sha256)) return;
    state = null;
    isWindowOurs = false;
    views.forEach((view) => view.show(null));
    value.textContent = '';
    if (!volume) return;
    const isPatient = await hasPatientAxes(volume);
    if (session.volume?.id !== volume.id) return;
    const index = volume.dims.map((count) => Math.floor(count / 2));
    state = { volume, index, isPatient, window: windowOfColours(volume, store.scene) };
    windowPair.set(rangeOf(volume), ...state.window);
    refresh();
    arrange();
    hover(null);
  };

  const toggle = (wanted = !isOpen) => {
    if (wanted && !session.volume) return;
    // The button that closes goes away with what it closes.
    const hadFocus = element.contains(document.activeElement);
    isOpen = wanted;
    element.hidden = !isOpen;
    document.body.classList.toggle('with-slices', isOpen);
    opener.setAttribute('aria-pressed', String(isOpen));
    if (!isOpen && hadFocus) opener.focus();
    load();
    refresh();
  };
  opener.addEventListener('click', () => toggle());
  element.addEventListener('keydown', (event) => event.key === 'Escape' && toggle(false));
  // What could not be had while the server was away.
  session.on('status', ({ phase }) => phase === 'live' && refresh());
  session.on('volume', (volume) => (volume ? load() : toggle(false)));
  store.on('scene', (scene) => {
    if (!state || isWindowOurs || !scene || scene.volume !== state.volume.id) return;
    const window = windowOfColours(state.volume, scene);
    if (String(window) !== String(state.window)) setWindow(window);
  });
  return { toggle: () => toggle() };
}

/** Value, voxel and place in a line. */
function describe(output, index, world, { inside, value }) {
  const list = (numbers, digits) => numbers.map((number) => formatNumber(number, digits)).join(', ');
  const words = !inside ? 'outside' : value === null ? 'not a number' : formatNumber(value, 6);
  output.textContent = `${words} · voxel ${index.map(Math.round).join(', ')} · at ${list(world, 5)}`;
}

/** The range of a volume; never empty. @returns {[number, number]} */
function rangeOf({ value_range: [low, high] }) {
  return high > low ? [low, high] : [low, low + Math.max(1, Math.abs(low))];
}

/**
 * The values between the first and the last point of the transfer function, as far as the volume has them.
 * @returns {[number, number]}
 */
function windowOfColours(volume, scene) {
  const [lowest, highest] = rangeOf(volume);
  const points = scene?.transfer_function?.points ?? [];
  const low = Math.max(lowest, points[0]?.value ?? lowest);
  const high = Math.min(highest, points.at(-1)?.value ?? highest);
  return high - low > NARROWEST * (highest - lowest) ? [low, high] : [lowest, highest];
}
