/**
 * Editing a transfer function by hand: points are dragged, added by a double click or tap, removed by another or by
 * Delete, and moved by arrow keys.
 */

import { Emitter } from './store.js';
import { addPoint, changePoint, valueRounder } from './transfer_function.js';
import { TransferFunctionPlot } from './transfer_function_plot.js';

/** Pixels from a point that still count as on it. */
const REACH = { mouse: 13, touch: 24, pen: 16 };
const DOUBLE_TAP = { milliseconds: 350, pixels: 22 };
/** Pixels that a hand trembles while it clicks. */
const TREMOR = 3;
/** A step of an arrow key, as a share of the axis and of the height. */
const KEY_STEP = { value: 1 / 250, height: 0.01, large: 10 };

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

/** @typedef {import('./transfer_function.js').ControlPoint} ControlPoint */

/** Emits `edit` (points) for a person's edits, `select` (index, or -1) and `zoom`. */
export class TransferFunctionEditor extends Emitter {
  /** @type {ControlPoint[]} */ points = [];
  selected = -1;
  #plot = new TransferFunctionPlot({
    onfocus: (_, index) => this.selected !== index && this.select(index),
    onkeydown: (event) => this.#key(event),
  });
  /** @type {[number, number]} */ #range = [0, 1];
  #round = (value) => value;
  /**
   * Where a drag began, and for a point how far off its middle.
   * @type {null | {onPoint: boolean, x: number, y: number, dx: number, dy: number, axis: [number, number],
   *   moved: boolean}}
   */
  #drag = null;
  #lastTap = { time: -1e9, x: 0, y: 0 };

  constructor() {
    super();
    this.element = this.#plot.element;
    this.#attach();
  }

  /** Whether only a part of the values is in sight. */
  get isZoomed() {
    return this.#plot.isZoomed;
  }

  /**
   * @param {import('./histogram.js').Histogram} histogram
   * @param {string} voxelType
   */
  setHistogram(histogram, voxelType) {
    this.#range = histogram.range;
    this.#round = valueRounder(voxelType, histogram.range);
    this.#plot.setHistogram(histogram);
    this.emit('zoom');
  }

  /** @param {ControlPoint[]} points */
  set(points) {
    this.points = points;
    if (this.selected >= points.length) this.select(-1);
    this.#show();
  }

  /** Shows every value of note. */
  showAll() {
    this.#plot.showAll();
    this.emit('zoom');
  }

  /** @param {number} index */
  select(index) {
    this.selected = index;
    this.emit('select', index);
    this.#show();
  }

  /**
   * Changes the selected point.
   * @param {Partial<ControlPoint>} change
   */
  change(change) {
    if (this.selected < 0) return;
    const rounded = change.value === undefined ? change : { ...change, value: this.#round(change.value) };
    this.#edit(changePoint(this.points, this.selected, rounded, this.#gap));
  }

  /** Removes the selected point; the last one stays. */
  removeSelected() {
    if (this.selected < 0 || this.points.length < 2) return;
    const points = this.points.filter((_, index) => index !== this.selected);
    this.selected = Math.min(this.selected, points.length - 1);
    this.#edit(points);
    this.emit('select', this.selected);
  }

  /** Adds a point in the widest gap in sight: for those who cannot double-click. */
  addAnywhere() {
    const [low, high] = this.#plot.axis;
    const stops = [low, ...this.points.map((p) => p.value).filter((v) => v > low && v < high), high];
    const gaps = stops.slice(1).map((stop, i) => stop - stops[i]);
    const widest = gaps.indexOf(Math.max(...gaps));
    this.#add((stops[widest] + stops[widest + 1]) / 2);
  }

  /** Smallest distance between values: integers stay apart, others by a hair of the range. */
  get #gap() {
    return this.#round === Math.round ? 1 : (this.#range[1] - this.#range[0]) * 1e-4 || 1e-6;
  }

  #show() {
    this.#plot.show(this.points, this.selected);
  }

  #edit(points) {
    this.points = points;
    this.#show();
    this.emit('edit', points);
  }

  #add(value, opacity) {
    const { points, index } = addPoint(this.points, this.#round(value), opacity);
    this.selected = index;
    this.#edit(points);
    this.emit('select', index);
    this.#plot.focus(index);
  }

  #key(event) {
    const point = this.points[this.selected];
    if (!point) return;
    const large = event.shiftKey ? KEY_STEP.large : 1;
    const [low, high] = this.#plot.axis;
    const value = Math.max(this.#gap, (high - low) * KEY_STEP.value) * large;
    const height = (step) => clamp(Math.sqrt(point.opacity) + step * large, 0, 1) ** 2;
    const change = {
      ArrowLeft: { value: point.value - value },
      ArrowRight: { value: point.value + value },
      ArrowUp: { opacity: height(KEY_STEP.height) },
      ArrowDown: { opacity: height(-KEY_STEP.height) },
    }[event.key];
    if (change) this.change(change);
    else if (event.key === 'Delete' || event.key === 'Backspace') this.removeSelected();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  #attach() {
    const at = (event) => {
      const box = this.element.getBoundingClientRect();
      return { x: event.clientX - box.left, y: event.clientY - box.top };
    };
    const end = () => {
      this.#drag = null;
    };
    this.element.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      this.element.setPointerCapture(event.pointerId);
      this.#press(at(event), event.timeStamp, REACH[event.pointerType] ?? REACH.mouse);
    });
    this.element.addEventListener('pointermove', (event) => this.#drag && this.#dragTo(at(event)));
    this.element.addEventListener('pointerup', end);
    this.element.addEventListener('pointercancel', end);
    this.element.addEventListener('wheel', (event) => {
      // Without a key the wheel scrolls the panel, in which this stands.
      if (!event.ctrlKey && !event.metaKey && !event.shiftKey) return;
      event.preventDefault();
      this.#zoom(Math.exp(clamp(event.deltaY || event.deltaX, -200, 200) * 0.003), this.#plot.valueAt(at(event).x));
    }, { passive: false });
  }

  #press({ x, y }, time, reach) {
    const index = this.#plot.nearest(x, y, reach);
    const point = this.points[index];
    if (this.#isDoubleTap(time, x, y)) {
      this.#doubleTap(index, x, y);
      return;
    }
    const [dx, dy] = point ? [this.#plot.x(point.value) - x, this.#plot.y(point.opacity) - y] : [0, 0];
    this.#drag = { onPoint: Boolean(point), x, y, dx, dy, axis: [...this.#plot.axis], moved: false };
    if (point) {
      this.select(index);
      this.#plot.focus(index);
    }
  }

  #dragTo({ x, y }) {
    const drag = this.#drag;
    if (!drag.moved && Math.hypot(x - drag.x, y - drag.y) < TREMOR) return;
    drag.moved = true;
    if (drag.onPoint) {
      this.change({ value: this.#plot.valueAt(x + drag.dx), opacity: this.#plot.opacityAt(y + drag.dy) });
    } else if (this.isZoomed) {
      const shift = ((drag.x - x) / this.#plot.width) * (drag.axis[1] - drag.axis[0]);
      this.#plot.setAxis(drag.axis[0] + shift, drag.axis[1] + shift);
      this.emit('zoom');
    }
  }

  #isDoubleTap(time, x, y) {
    const last = this.#lastTap;
    const near = Math.hypot(x - last.x, y - last.y) < DOUBLE_TAP.pixels;
    const double = time - last.time < DOUBLE_TAP.milliseconds && near;
    this.#lastTap = { time: double ? -1e9 : time, x, y };
    return double;
  }

  #doubleTap(index, x, y) {
    if (index < 0) {
      this.#add(this.#plot.valueAt(x), this.#plot.opacityAt(y));
    } else {
      this.selected = index;
      this.removeSelected();
    }
  }

  #zoom(factor, about) {
    const [low, high] = this.#plot.axis;
    this.#plot.setAxis(about + (low - about) * factor, about + (high - about) * factor);
    this.emit('zoom');
  }
}
