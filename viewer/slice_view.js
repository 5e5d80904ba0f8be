/** One slice: its picture, the letters of its edges, a slider through the volume, and lines where the others cut it. */

import { api } from './api.js';
import { h, s, setAttributes } from './dom.js';
import { nearestWorldAxis } from './grid.js';
import { Latest } from './latest.js';

const AXES = ['x', 'y', 'z'];
/** What runs across and down a slice; `up`: from the bottom. */
const IN_PICTURE = [
  { across: 1, down: 2, up: true },
  { across: 0, down: 2, up: true },
  { across: 0, down: 1, up: false },
];
/** Of slices across a patient's x, y and z. */
const PLANES = ['Sagittal', 'Coronal', 'Axial'];
/** The server's head and feet are superior and inferior, as in the 3D view. */
const LETTERS = { H: 'S', F: 'I' };
const EDGES = ['left', 'right', 'top', 'bottom'];
/** Most pixels across that are asked for: slices are small beside the 3D view. */
const MOST_PIXELS = 1024;
const FEWEST_PIXELS = 32;
/** Pixels of scrolling for one slice: a notch of a wheel is about a hundred. */
const WHEEL_STEP = 80;

/**
 * What all slices of a volume have in common.
 * @typedef {Object} SliceState
 * @property {import('./store.js').Volume} volume
 * @property {number[]} index of the voxel where the slices meet
 * @property {[number, number]} window values that are black and white
 * @property {boolean} isPatient whether world axes are a patient's
 */

/**
 * What a slice is called: patients' have names of planes, oblique ones that of the nearest.
 * @param {SliceState} state
 * @param {number} axis
 */
export const planeName = ({ volume, isPatient }, axis) =>
  (isPatient ? PLANES[nearestWorldAxis(volume.direction[axis])] : `Across ${AXES[axis]}`);

export class SliceView {
  /** @type {SliceState | null} */ #state = null;
  #latest = new Latest((request) => this.#load(request));
  /** What is asked for already, so that a move along another axis costs nothing here. */
  #asked = '';
  #url = '';
  #limit;

  /**
   * @param {number} axis index axis that the slice is across
   * @param {{onIndex: (axis: number, index: number) => void, onPoint: (index: number[]) => void,
   *   onHover: (index: number[] | null) => void}} listeners
   *   the slider; a click; the pointer, as an index between voxels
   * @param {number} [limit] most pixels along a side that the server draws
   */
  constructor(axis, { onIndex, onPoint, onHover }, limit = MOST_PIXELS) {
    this.axis = axis;
    this.#limit = Math.min(limit, MOST_PIXELS);
    this.title = h('h3', {});
    this.number = h('output', { 'aria-hidden': 'true' });
    this.slider = h('input', {
      type: 'range', min: 0, step: 1, oninput: () => onIndex(axis, Number(this.slider.value)),
    });
    this.image = h('img', { alt: '', draggable: 'false' });
    this.lines = s('svg', { class: 'cross', viewBox: '0 0 1 1', preserveAspectRatio: 'none', 'aria-hidden': 'true' },
      s('line', { y1: 0, y2: 1 }), s('line', { x1: 0, x2: 1 }));
    this.letters = EDGES.map((edge) => h('span', { class: `edge ${edge}`, 'aria-hidden': 'true' }));
    this.fault = h('p', { class: 'fault', role: 'status', hidden: true });
    this.frame = h('div', { class: 'slice-frame' }, this.image, this.lines);
    this.box = h('div', { class: 'slice-box' }, this.frame, ...this.letters, this.fault);
    this.element = h('section', { class: 'slice' }, h('header', {}, this.title, this.number), this.box, this.slider);
    this.#listen(onIndex, onPoint, onHover);
    new ResizeObserver(() => this.#fit()).observe(this.box);
  }

  #listen(onIndex, onPoint, onHover) {
    const { frame } = this;
    frame.addEventListener('pointerdown', (event) => {
      if (event.button !== 0 || !this.#state) return;
      frame.setPointerCapture(event.pointerId);
      onPoint(this.#indexAt(event).map(Math.round));
    });
    frame.addEventListener('pointermove', (event) => {
      if (!this.#state) return;
      const index = this.#indexAt(event);
      onHover(index);
      if (frame.hasPointerCapture(event.pointerId)) onPoint(index.map(Math.round));
    });
    frame.addEventListener('pointerleave', () => onHover(null));
    let turned = 0;
    this.box.addEventListener('wheel', (event) => {
      event.preventDefault();
      if (!this.#state) return;
      turned += event.deltaY * [1, 16, 400][event.deltaMode];
      const steps = Math.trunc(turned / WHEEL_STEP);
      turned -= steps * WHEEL_STEP;
      if (steps !== 0) onIndex(this.axis, this.#state.index[this.axis] + steps);
    }, { passive: false });
  }

  /** @param {SliceState | null} state */
  show(state) {
    if (state?.volume.id !== this.#state?.volume.id) this.#clear();
    this.#state = state;
    if (!state) return;
    const { volume, index } = state;
    const count = volume.dims[this.axis];
    const name = planeName(state, this.axis);
    this.title.textContent = name;
    this.element.setAttribute('aria-label', name);
    this.number.textContent = `${index[this.axis]} / ${count - 1}`;
    setAttributes(this.slider, { max: count - 1, 'aria-label': `${name} slice` });
    this.slider.disabled = count === 1;
    this.slider.value = String(index[this.axis]);
    this.slider.style.setProperty('--filled', String(count > 1 ? index[this.axis] / (count - 1) : 0));
    this.#drawLines();
    this.#fit();
  }

  #clear() {
    this.#latest.forget();
    this.#asked = '';
    this.image.removeAttribute('src');
    for (const letter of this.letters) letter.textContent = '';
    this.fault.hidden = true;
  }

  /** World extent across and down. */
  #extent() {
    const { dims, spacing } = this.#state.volume;
    const { across, down } = IN_PICTURE[this.axis];
    return [dims[across] * spacing[across], dims[down] * spacing[down]];
  }

  /** Makes the frame as large as the box allows, and asks for a picture of that size. */
  #fit() {
    if (!this.#state) return;
    const { clientWidth: width, clientHeight: height } = this.box;
    if (width === 0 || height === 0) return;
    const [right, down] = this.#extent();
    const scale = Math.min(width / right, height / down);
    this.frame.style.setProperty('width', `${right * scale}px`);
    this.frame.style.setProperty('height', `${down * scale}px`);
    this.#ask(right * scale * devicePixelRatio, right / down);
  }

  #ask(pixels, aspect) {
    const { volume, index, window: [low, high] } = this.#state;
    // Neither side may be longer than the limit, nor vanish.
    const limit = Math.min(this.#limit, this.#limit * aspect);
    const width = Math.max(1, Math.round(Math.min(limit, Math.max(FEWEST_PIXELS * Math.min(1, aspect), pixels))));
    const query = { axis: AXES[this.axis], index: index[this.axis], low, high, width };
    const asked = JSON.stringify([volume.id, query]);
    if (asked === this.#asked) return;
    this.#asked = asked;
    this.#latest.ask({ id: volume.id, query });
  }

  async #load({ id, query }) {
    try {
      const response = await api.slice(id, query);
      const picture = await response.blob();
      if (id !== this.#state?.volume.id) return;
      this.#showLetters(response.headers.get('X-Orientation'));
      await this.#showPicture(picture);
      this.fault.hidden = true;
    } catch (error) {
      if (id !== this.#state?.volume.id) return;
      this.fault.textContent = error.message;
      this.fault.hidden = false;
      // The next move asks again, even if it comes back to this slice.
      this.#asked = '';
    }
  }

  async #showPicture(picture) {
    const before = this.#url;
    this.#url = URL.createObjectURL(picture);
    this.image.src = this.#url;
    try {
      await this.image.decode();
    } finally {
      URL.revokeObjectURL(before);
    }
  }

  /** @param {string | null} text `left=R,right=L,top=A,bottom=P`; null: nobody knows */
  #showLetters(text) {
    const letters = Object.fromEntries((text ?? '').split(',').map((pair) => pair.split('=')));
    EDGES.forEach((edge, i) => {
      this.letters[i].textContent = LETTERS[letters[edge]] ?? letters[edge] ?? '';
    });
    const to = (edge) => this.letters[EDGES.indexOf(edge)].textContent;
    const name = planeName(this.#state, this.axis);
    this.image.alt = text ? `${name} slice: ${to('left')} on the left, ${to('top')} at the top` : `${name} slice`;
  }

  #drawLines() {
    const { volume: { dims }, index } = this.#state;
    const { across, down, up } = IN_PICTURE[this.axis];
    const x = (index[across] + 0.5) / dims[across];
    const y = (index[down] + 0.5) / dims[down];
    const [vertical, horizontal] = this.lines.children;
    setAttributes(vertical, { x1: x, x2: x });
    setAttributes(horizontal, { y1: up ? 1 - y : y, y2: up ? 1 - y : y });
  }

  /** Where the pointer is, as an index between voxels, inside of the volume. */
  #indexAt({ clientX, clientY }) {
    const { volume: { dims }, index } = this.#state;
    const { across, down, up } = IN_PICTURE[this.axis];
    const area = this.frame.getBoundingClientRect();
    const x = (clientX - area.left) / area.width;
    const y = (clientY - area.top) / area.height;
    const at = (share, axis) => Math.min(dims[axis] - 0.5001, Math.max(-0.4999, share * dims[axis] - 0.5));
    return index.with(across, at(x, across)).with(down, at(up ? 1 - y : y, down));
  }
}
