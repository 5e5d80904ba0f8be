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

/** The slices of the volume that is shown. */
export class Slices {
  /** @type {import('./slice_view.js').SliceState | null} */ #state = null;
  /** Whether a person set the window, which colours then no longer do. */
  #isWindowOurs = false;
  #isOpen = false;
  #probe = new Latest((request) => this.#ask(request));
  #element = byId('slices');
  #opener = byId('open-slices');
  #row = h('div', { class: 'slice-row' });
  // Not read out at every move of the pointer.
  #value = h('output', { class: 'facts-line', 'aria-live': 'off', 'aria-label': 'Value under the pointer' });
  #window = rangePair({ label: 'Window', onInput: (low, high) => this.#setWindow([low, high], true) });
  #planes = segments({ label: 'Plane', options: [], onInput: (axis) => this.#choosePlane(axis) });
  /** @type {SliceView[]} */ #views;

  /** @param {import('./app.js').Context} context */
  constructor({ session, store, server }) {
    this.session = session;
    this.store = store;
    const listeners = {
      onIndex: (axis, at) => {
        this.#moveTo(this.#state.index.with(axis, at));
        this.#hover(null);
      },
      onPoint: (index) => this.#moveTo(index),
      onHover: (index) => this.#hover(index),
    };
    this.#views = [0, 1, 2].map((axis) => new SliceView(axis, listeners, server.limits?.max_image_axis));
    this.#element.append(this.#row, this.#tools());
    this.#opener.prepend(icon('slices'));
    this.#opener.addEventListener('click', () => this.toggle());
    this.#element.addEventListener('keydown', (event) => event.key === 'Escape' && this.toggle(false));
    session.on('volume', (volume) => (volume ? this.#load() : this.toggle(false)));
    // What could not be had while the server was away.
    session.on('status', ({ phase }) => phase === 'live' && this.#refresh());
    store.on('scene', (scene) => this.#followColours(scene));
  }

  /** Opens or closes. */
  toggle(isOpen = !this.#isOpen) {
    if (isOpen && !this.session.volume) return;
    // The button that closes goes away with what it closes.
    const hadFocus = this.#element.contains(document.activeElement);
    this.#isOpen = isOpen;
    this.#element.hidden = !isOpen;
    this.#opener.setAttribute('aria-pressed', String(isOpen));
    if (!isOpen && hadFocus) this.#opener.focus();
    this.#load();
    this.#refresh();
  }

  #tools() {
    const byColours = button('Colours', () => this.#setWindow(windowOfColours(this.session.volume, this.store.scene), false),
      { class: 'button quiet', title: 'The values that the transfer function is about' });
    const whole = button('All values', () => this.#setWindow(rangeOf(this.session.volume), true),
      { class: 'button quiet', title: 'From the lowest to the highest value' });
    const close = h('button', {
      type: 'button', class: 'icon-button', 'aria-label': 'Close the slices', title: 'Close (S)', onclick: () => this.toggle(false),
    }, icon('close'));
    return h('div', { class: 'slice-tools' }, this.#planes.element, this.#window.element,
      h('div', { class: 'row' }, byColours, whole), this.#value, close);
  }

  /** Begins with a volume, in its middle. */
  async #load() {
    const { volume } = this.session;
    const known = this.#state?.volume;
    if (!this.#isOpen || (known && known.id === volume?.id && known.sha256 === volume.sha256)) return;
    this.#state = null;
    this.#views.forEach((view) => view.show(null));
    this.#value.textContent = '';
    if (!volume) return;
    const isPatient = await hasPatientAxes(volume);
    if (this.session.volume?.id !== volume.id) return;
    const index = volume.dims.map((count) => Math.floor(count / 2));
    this.#state = { volume, index, isPatient, window: rangeOf(volume) };
    this.#setWindow(windowOfColours(volume, this.store.scene), false);
    this.#arrange();
    this.#hover(null);
  }

  /** As patients' slices are read: axial, coronal, sagittal; without a patient z, y, x. */
  #arrange() {
    const { isPatient, volume } = this.#state;
    const rank = ({ axis }) => (isPatient ? nearestWorldAxis(volume.direction[axis]) : axis);
    const ordered = [...this.#views].sort((a, b) => rank(b) - rank(a));
    this.#row.replaceChildren(...ordered.map((view) => view.element));
    this.#planes.setOptions(ordered.map(({ axis }) => [String(axis), planeName(this.#state, axis)]));
    this.#choosePlane(preference('plane', String(ordered[0].axis)));
  }

  /** Where there is room for one slice, which. @param {string} axis */
  #choosePlane(axis) {
    this.#planes.set(axis);
    for (const view of this.#views) view.element.classList.toggle('chosen', String(view.axis) === axis);
    setPreference('plane', axis);
  }

  #refresh() {
    if (this.#isOpen) this.#views.forEach((view) => view.show(this.#state));
  }

  #moveTo(index) {
    if (!this.#state) return;
    const { dims } = this.#state.volume;
    this.#state = { ...this.#state, index: index.map((at, axis) => Math.min(dims[axis] - 1, Math.max(0, at))) };
    this.#refresh();
  }

  /** @param {[number, number]} window @param {boolean} isOurs */
  #setWindow(window, isOurs) {
    if (!this.#state) return;
    this.#isWindowOurs = isOurs;
    this.#state = { ...this.#state, window };
    this.#window.set(rangeOf(this.#state.volume), ...window);
    this.#refresh();
  }

  #followColours(scene) {
    if (!this.#state || this.#isWindowOurs || scene?.volume !== this.#state.volume.id) return;
    const window = windowOfColours(this.#state.volume, scene);
    if (String(window) !== String(this.#state.window)) this.#setWindow(window, false);
  }

  /** @param {number[] | null} index under the pointer; null: where the slices meet */
  #hover(index) {
    if (this.#state) this.#probe.ask({ volume: this.#state.volume, index: index ?? this.#state.index });
  }

  async #ask({ volume, index }) {
    const world = worldFromIndex(volume, index);
    try {
      const found = await api.probe(volume.id, world);
      if (volume === this.#state?.volume) this.#value.textContent = describe(index, world, found);
    } catch (error) {
      this.#value.textContent = error.message;
    }
  }
}

/** Value, voxel and place in a line. */
function describe(index, world, { inside, value }) {
  const list = (numbers, digits) => numbers.map((number) => formatNumber(number, digits)).join(', ');
  const words = !inside ? 'outside' : value === null ? 'not a number' : formatNumber(value, 6);
  return `${words} · voxel ${index.map(Math.round).join(', ')} · at ${list(world, 5)}`;
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
