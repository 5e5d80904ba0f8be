/**
 * The transfer function over the histogram: points are dragged, added by a double click or tap, removed by another or
 * by Delete, and moved by arrow keys. Opacity runs along a square root, so that thin veils can be set finely.
 */

import { formatNumber, freshId, s, setAttributes } from './dom.js';
import { histogramPath, interestingRange } from './histogram.js';
import { Emitter } from './store.js';
import { addPoint, changePoint, sampleAt, valueRounder } from './transfer_function.js';

const HEIGHT = 182;
const MARGIN = { top: 10, right: 10, bottom: 30, left: 30 };
/** Height of the strip of colours under the curve. */
const STRIP = 6;
const GRID = [0.01, 0.1, 0.25, 0.5, 1];
/** Pixels from a point that still count as on it. */
const REACH = { mouse: 13, touch: 24, pen: 16 };
const DOUBLE_TAP = { milliseconds: 350, pixels: 22 };
const RADIUS = 6;

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

/** Emits `edit` (points) for a person's edits and `select` (index, or -1). */
export class TransferFunctionEditor extends Emitter {
  /** @type {import('./transfer_function.js').ControlPoint[]} */ points = [];
  selected = -1;
  /** @type {import('./histogram.js').Histogram | null} */ #histogram = null;
  /** @type {[number, number]} Values at the ends of the axis. */ #axis = [0, 1];
  /** @type {[number, number]} The axis that shows everything. */ #wholeAxis = [0, 1];
  #round = (value) => value;
  #width = 300;
  /**
   * Where a drag began, and for a point how far off its middle.
   * @type {null | {onPoint: boolean, x: number, y: number, dx: number, dy: number, axis: [number, number],
   *   moved: boolean}}
   */
  #drag = null;
  #lastTap = { time: -1e9, x: 0, y: 0 };

  constructor() {
    super();
    const gradient = freshId();
    this.#buildParts(gradient);
    this.element = s('svg', {
      class: 'tf-editor', height: HEIGHT, role: 'group',
      'aria-label': 'Transfer function: opacity over value. Double-click adds a point.',
    },
    s('defs', {}, this.#parts.gradient, s('clipPath', { id: `${gradient}c` }, this.#parts.clip)),
    this.#parts.grid,
    s('g', { 'clip-path': `url(#${gradient}c)` }, this.#parts.bars, this.#parts.area, this.#parts.line),
    this.#parts.strip, this.#parts.ticks, this.#parts.dots);
    this.#attach();
    new ResizeObserver(([entry]) => {
      if (entry.contentRect.width < 1) return;
      this.#width = entry.contentRect.width;
      this.#draw();
    }).observe(this.element);
  }

  /** Whether only a part of the values is in sight. */
  get isZoomed() {
    return this.#axis[0] !== this.#wholeAxis[0] || this.#axis[1] !== this.#wholeAxis[1];
  }

  /**
   * @param {import('./histogram.js').Histogram} histogram
   * @param {string} voxelType
   */
  setHistogram(histogram, voxelType) {
    this.#histogram = histogram;
    this.#round = valueRounder(voxelType, histogram.range);
    this.showAll();
  }

  /** @param {import('./transfer_function.js').ControlPoint[]} points */
  set(points) {
    this.points = points;
    if (this.selected >= points.length) this.select(-1);
    this.#draw();
  }

  /** Shows every value of note. */
  showAll() {
    const [low, high] = this.#histogram ? interestingRange(this.#histogram) : [0, 1];
    const inside = this.points.map((point) => point.value).filter((value) => this.#histogram
      && value >= this.#histogram.range[0] && value <= this.#histogram.range[1]);
    const [from, to] = [Math.min(low, ...inside), Math.max(high, ...inside)];
    const rim = (to - from) * 0.02;
    this.#wholeAxis = [from - rim, to + rim];
    this.#axis = [...this.#wholeAxis];
    this.#draw();
    this.emit('zoom');
  }

  /** @param {number} index */
  select(index) {
    this.selected = index;
    this.emit('select', index);
    this.#draw();
  }

  /**
   * Changes the selected point.
   * @param {Partial<import('./transfer_function.js').ControlPoint>} change
   */
  change(change) {
    if (this.selected < 0) return;
    const rounded = change.value === undefined ? change : { ...change, value: this.#round(change.value) };
    this.#edit(changePoint(this.points, this.selected, rounded, this.#gap));
  }

  /** Removes the selected point. */
  removeSelected() {
    if (this.selected < 0 || this.points.length < 2) return;
    const points = this.points.filter((_, index) => index !== this.selected);
    this.selected = Math.min(this.selected, points.length - 1);
    this.#edit(points);
    this.emit('select', this.selected);
  }

  /** Adds a point in the widest gap in sight: for those who cannot double-click. */
  addAnywhere() {
    const [low, high] = this.#axis;
    const stops = [low, ...this.points.map((p) => p.value).filter((v) => v > low && v < high), high];
    let widest = 0;
    stops.forEach((stop, i) => {
      if (i + 1 < stops.length && stops[i + 1] - stop > stops[widest + 1] - stops[widest]) widest = i;
    });
    this.#add((stops[widest] + stops[widest + 1]) / 2);
  }

  /** @type {any} */ #parts;

  #buildParts(gradient) {
    this.#parts = {
      gradient: s('linearGradient', { id: gradient, gradientUnits: 'userSpaceOnUse', y1: 0, y2: 0 }),
      clip: s('rect', {}),
      grid: s('g', { class: 'grid', 'aria-hidden': 'true' }),
      bars: s('path', { class: 'bars' }),
      area: s('path', { class: 'area', fill: `url(#${gradient})` }),
      line: s('path', { class: 'line' }),
      strip: s('rect', { class: 'strip', height: STRIP, rx: STRIP / 2, fill: `url(#${gradient})` }),
      ticks: s('g', { class: 'ticks', 'aria-hidden': 'true' }),
      dots: s('g', { class: 'dots' }),
    };
  }

  get #plot() {
    return {
      left: MARGIN.left, top: MARGIN.top,
      width: Math.max(1, this.#width - MARGIN.left - MARGIN.right), height: HEIGHT - MARGIN.top - MARGIN.bottom,
    };
  }

  /** Smallest distance between values: integers stay apart, others by a hair of the range. */
  get #gap() {
    const [low, high] = this.#histogram?.range ?? [0, 1];
    return this.#round === Math.round ? 1 : (high - low) * 1e-4 || 1e-6;
  }

  #x(value) {
    const { left, width } = this.#plot;
    return left + ((value - this.#axis[0]) / (this.#axis[1] - this.#axis[0])) * width;
  }

  #y(opacity) {
    const { top, height } = this.#plot;
    return top + height * (1 - Math.sqrt(clamp(opacity, 0, 1)));
  }

  #valueAt(x) {
    const { left, width } = this.#plot;
    return this.#axis[0] + ((x - left) / width) * (this.#axis[1] - this.#axis[0]);
  }

  #opacityAt(y) {
    const { top, height } = this.#plot;
    return Number((clamp(1 - (y - top) / height, 0, 1) ** 2).toFixed(4));
  }

  #edit(points) {
    this.points = points;
    this.#draw();
    this.emit('edit', points);
  }

  #add(value, opacity) {
    const { points, index } = addPoint(this.points, this.#round(value), opacity);
    this.selected = index;
    this.#edit(points);
    this.emit('select', index);
    this.#parts.dots.children[index]?.focus();
  }

  #draw() {
    if (this.points.length === 0) return;
    const { left, top, width, height } = this.#plot;
    const parts = this.#parts;
    setAttributes(this.element, { viewBox: `0 0 ${this.#width} ${HEIGHT}` });
    setAttributes(parts.clip, { x: left, y: top - 2, width, height: height + 2 });
    if (this.#histogram) parts.bars.setAttribute('d', histogramPath(this.#histogram, this.#axis, width, height));
    parts.bars.setAttribute('transform', `translate(${left} ${top})`);
    const curve = this.#curve();
    parts.line.setAttribute('d', `M${curve}`);
    parts.area.setAttribute('d', `M${left},${top + height}L${curve}L${left + width},${top + height}Z`);
    setAttributes(parts.strip, { x: left, y: top + height + 4, width });
    setAttributes(parts.gradient, { x1: left, x2: left + width });
    parts.gradient.replaceChildren(...this.points.map((point) => s('stop', {
      offset: clamp((this.#x(point.value) - left) / width, 0, 1), 'stop-color': point.color,
    })));
    this.#drawAxes();
    this.#drawDots();
  }

  /** Straight in opacity is bent along a square root: more samples than points. */
  #curve() {
    const { left, width } = this.#plot;
    const values = this.points.map((point) => point.value).filter((v) => v >= this.#axis[0] && v <= this.#axis[1]);
    for (let x = left; x <= left + width + 0.5; x += 3) values.push(this.#valueAt(x));
    values.sort((a, b) => a - b);
    return values.map((value) => `${this.#x(value).toFixed(1)},${this.#y(sampleAt(this.points, value).opacity).toFixed(1)}`)
      .join('L');
  }

  #drawAxes() {
    const { left, top, width, height } = this.#plot;
    this.#parts.grid.replaceChildren(...GRID.flatMap((opacity) => [
      s('line', { x1: left, x2: left + width, y1: this.#y(opacity), y2: this.#y(opacity) }),
      s('text', { x: left - 5, y: this.#y(opacity) + 3.5, 'text-anchor': 'end' }, `${opacity * 100}%`),
    ]));
    const span = this.#axis[1] - this.#axis[0];
    const rough = span / Math.max(2, width / 70);
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
    const ticks = [];
    for (let value = Math.ceil(this.#axis[0] / step) * step; value <= this.#axis[1]; value += step) {
      const clean = Number(value.toPrecision(10));
      ticks.push(s('line', { x1: this.#x(value), x2: this.#x(value), y1: top + height + STRIP + 6, y2: top + height + STRIP + 9 }));
      ticks.push(s('text', { x: this.#x(value), y: HEIGHT - 5, 'text-anchor': 'middle' },
        formatNumber(Math.abs(clean) < step * 1e-6 ? 0 : clean)));
    }
    this.#parts.ticks.replaceChildren(...ticks);
  }

  /** Reuses the elements, so that the one with the focus keeps it. */
  #drawDots() {
    const { left, width } = this.#plot;
    const { dots } = this.#parts;
    while (dots.children.length > this.points.length) dots.lastChild.remove();
    while (dots.children.length < this.points.length) dots.append(this.#makeDot(dots.children.length));
    this.points.forEach((point, index) => {
      const x = this.#x(point.value);
      const dot = dots.children[index];
      setAttributes(dot, {
        cx: x.toFixed(1), cy: this.#y(point.opacity).toFixed(1), fill: point.color,
        'aria-valuenow': point.value, 'aria-valuetext': describe(point),
      });
      dot.classList.toggle('selected', index === this.selected);
      dot.classList.toggle('outside', x < left - 1 || x > left + width + 1);
    });
  }

  #makeDot(index) {
    return s('circle', {
      r: RADIUS, tabindex: 0, role: 'slider', 'aria-label': `Point ${index + 1}`,
      onfocus: () => this.selected !== index && this.select(index),
      onkeydown: (event) => this.#key(event),
    });
  }

  #key(event) {
    const point = this.points[this.selected];
    if (!point) return;
    const fine = event.shiftKey ? 10 : 1;
    const value = Math.max(this.#gap, (this.#axis[1] - this.#axis[0]) / 250) * fine;
    const height = (Math.sqrt(point.opacity) + (event.key === 'ArrowUp' ? 0.01 : -0.01) * fine);
    const change = {
      ArrowLeft: { value: point.value - value }, ArrowRight: { value: point.value + value },
      ArrowUp: { opacity: Math.min(1, height) ** 2 }, ArrowDown: { opacity: Math.max(0, height) ** 2 },
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
    this.element.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      this.element.setPointerCapture(event.pointerId);
      const { x, y } = at(event);
      const index = this.#nearest(x, y, REACH[event.pointerType] ?? REACH.mouse);
      if (this.#isDoubleTap(event.timeStamp, x, y)) {
        this.#doubleTap(index, x, y);
        return;
      }
      const point = this.points[index];
      const [dx, dy] = point ? [this.#x(point.value) - x, this.#y(point.opacity) - y] : [0, 0];
      this.#drag = { onPoint: Boolean(point), x, y, dx, dy, axis: [...this.#axis], moved: false };
      if (point) {
        this.select(index);
        this.#parts.dots.children[index].focus({ preventScroll: true });
      }
    });
    this.element.addEventListener('pointermove', (event) => this.#drag && this.#dragTo(at(event)));
    const end = () => {
      this.#drag = null;
    };
    this.element.addEventListener('pointerup', end);
    this.element.addEventListener('pointercancel', end);
    this.element.addEventListener('wheel', (event) => {
      // Without a key the wheel scrolls the panel, in which this stands.
      if (!event.ctrlKey && !event.metaKey && !event.shiftKey) return;
      event.preventDefault();
      this.#zoom(Math.exp(clamp(event.deltaY || event.deltaX, -200, 200) * 0.003), this.#valueAt(at(event).x));
    }, { passive: false });
  }

  #dragTo({ x, y }) {
    const drag = this.#drag;
    // A hand that trembles while it double-clicks does not drag.
    if (!drag.moved && Math.hypot(x - drag.x, y - drag.y) < 3) return;
    drag.moved = true;
    if (drag.onPoint) {
      this.change({ value: this.#valueAt(x + drag.dx), opacity: this.#opacityAt(y + drag.dy) });
    } else if (this.isZoomed) {
      const shift = ((drag.x - x) / this.#plot.width) * (drag.axis[1] - drag.axis[0]);
      this.#setAxis(drag.axis[0] + shift, drag.axis[1] + shift);
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
      this.#add(this.#valueAt(x), this.#opacityAt(y));
    } else {
      this.selected = index;
      this.removeSelected();
    }
  }

  #nearest(x, y, reach) {
    let best = { index: -1, distance: reach };
    this.points.forEach((point, index) => {
      const distance = Math.hypot(this.#x(point.value) - x, this.#y(point.opacity) - y);
      if (distance < best.distance) best = { index, distance };
    });
    return best.index;
  }

  #zoom(factor, about) {
    const [low, high] = this.#axis;
    this.#setAxis(about + (low - about) * factor, about + (high - about) * factor);
  }

  #setAxis(low, high) {
    const [first, last] = this.#wholeAxis;
    const span = clamp(high - low, (last - first) * 1e-3, last - first);
    const from = clamp(low, first, last - span);
    this.#axis = span >= (last - first) * 0.999 ? [first, last] : [from, from + span];
    this.#draw();
    this.emit('zoom');
  }
}

const describe = ({ value, opacity }) => `value ${formatNumber(value)}, opacity ${formatNumber(opacity * 100, 3)} %`;
