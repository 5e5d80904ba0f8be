/**
 * Drawing of a transfer function over a histogram, as SVG: axes, curve, colours and points, and the way between
 * pixels and values. Opacity runs along a square root, so that thin veils can be told apart.
 */

import { formatNumber, freshId, s, setAttributes } from './dom.js';
import { histogramPath, interestingRange } from './histogram.js';
import { sampleAt } from './transfer_function.js';

const HEIGHT = 182;
const MARGIN = { top: 10, right: 10, bottom: 30, left: 30 };
/** Height of the strip of colours under the curve. */
const STRIP = 6;
const GRID = [0.01, 0.1, 0.25, 0.5, 1];
const RADIUS = 6;

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

/** @typedef {import('./transfer_function.js').ControlPoint} ControlPoint */

export class TransferFunctionPlot {
  /** @type {ControlPoint[]} */ #points = [];
  #selected = -1;
  /** @type {import('./histogram.js').Histogram | null} */ #histogram = null;
  /** @type {[number, number]} Values at the ends of the axis. */ #axis = [0, 1];
  /** @type {[number, number]} The axis that shows everything. */ #wholeAxis = [0, 1];
  #width = 300;
  #parts;
  #dotListeners;

  /** @param {Record<string, any>} dotListeners `onname` listeners of every point; they get the event and the index */
  constructor(dotListeners) {
    this.#dotListeners = dotListeners;
    const [gradient, clip] = [freshId(), freshId()];
    const fill = `url(#${gradient})`;
    const parts = {
      gradient: s('linearGradient', { id: gradient, gradientUnits: 'userSpaceOnUse', y1: 0, y2: 0 }),
      clip: s('rect', {}),
      grid: s('g', { class: 'grid', 'aria-hidden': 'true' }),
      bars: s('path', { class: 'bars' }),
      area: s('path', { class: 'area', fill }),
      line: s('path', { class: 'line' }),
      strip: s('rect', { class: 'strip', height: STRIP, rx: STRIP / 2, fill }),
      ticks: s('g', { class: 'ticks', 'aria-hidden': 'true' }),
      dots: s('g', { class: 'dots' }),
    };
    this.#parts = parts;
    this.element = s('svg', {
      class: 'tf-editor', height: HEIGHT, role: 'group',
      'aria-label': 'Transfer function: opacity over value. Double-click adds a point.',
    },
    s('defs', {}, parts.gradient, s('clipPath', { id: clip }, parts.clip)), parts.grid,
    s('g', { 'clip-path': `url(#${clip})` }, parts.bars, parts.area, parts.line), parts.strip, parts.ticks, parts.dots);
    new ResizeObserver(([entry]) => {
      if (entry.contentRect.width < 1) return;
      this.#width = entry.contentRect.width;
      this.#draw();
    }).observe(this.element);
  }

  /** Values at the ends of the axis. */
  get axis() {
    return this.#axis;
  }

  /** Whether only a part of the values is in sight. */
  get isZoomed() {
    return this.#axis[0] !== this.#wholeAxis[0] || this.#axis[1] !== this.#wholeAxis[1];
  }

  /** Pixels between the ends of the axis. */
  get width() {
    return this.#plot.width;
  }

  /** @param {import('./histogram.js').Histogram} histogram */
  setHistogram(histogram) {
    this.#histogram = histogram;
    this.showAll();
  }

  /** @param {ControlPoint[]} points @param {number} selected index, or -1 */
  show(points, selected) {
    this.#points = points;
    this.#selected = selected;
    this.#draw();
  }

  /** Shows every value of note, and the points among the volume's values. */
  showAll() {
    const range = this.#histogram?.range ?? [0, 1];
    const [low, high] = this.#histogram ? interestingRange(this.#histogram) : range;
    const inside = this.#points.map((point) => point.value).filter((value) => value >= range[0] && value <= range[1]);
    const [from, to] = [Math.min(low, ...inside), Math.max(high, ...inside)];
    const rim = (to - from) * 0.02;
    this.#wholeAxis = [from - rim, to + rim];
    this.#axis = [...this.#wholeAxis];
    this.#draw();
  }

  /** Shows values from `low` to `high`, as far as there is something to see. */
  setAxis(low, high) {
    const [first, last] = this.#wholeAxis;
    const span = clamp(high - low, (last - first) * 1e-3, last - first);
    const from = clamp(low, first, last - span);
    this.#axis = span >= (last - first) * 0.999 ? [first, last] : [from, from + span];
    this.#draw();
  }

  /** @param {number} index */
  focus(index) {
    this.#parts.dots.children[index]?.focus({ preventScroll: true });
  }

  /** @param {number} value */
  x(value) {
    const { left, width } = this.#plot;
    return left + ((value - this.#axis[0]) / (this.#axis[1] - this.#axis[0])) * width;
  }

  /** @param {number} opacity */
  y(opacity) {
    const { top, height } = this.#plot;
    return top + height * (1 - Math.sqrt(clamp(opacity, 0, 1)));
  }

  /** @param {number} x */
  valueAt(x) {
    const { left, width } = this.#plot;
    return this.#axis[0] + ((x - left) / width) * (this.#axis[1] - this.#axis[0]);
  }

  /** @param {number} y */
  opacityAt(y) {
    const { top, height } = this.#plot;
    return Number((clamp(1 - (y - top) / height, 0, 1) ** 2).toFixed(4));
  }

  /**
   * The point nearest to a pixel, or -1.
   * @param {number} x
   * @param {number} y
   * @param {number} reach pixels
   */
  nearest(x, y, reach) {
    let best = { index: -1, distance: reach };
    this.#points.forEach((point, index) => {
      const distance = Math.hypot(this.x(point.value) - x, this.y(point.opacity) - y);
      if (distance < best.distance) best = { index, distance };
    });
    return best.index;
  }

  get #plot() {
    return {
      left: MARGIN.left, top: MARGIN.top,
      width: Math.max(1, this.#width - MARGIN.left - MARGIN.right), height: HEIGHT - MARGIN.top - MARGIN.bottom,
    };
  }

  #draw() {
    if (this.#points.length === 0) return;
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
    parts.gradient.replaceChildren(...this.#stops());
    this.#drawAxes();
    this.#drawDots();
  }

  /** Colours along the axis; those outside of it are mixed at its ends. */
  #stops() {
    const [low, high] = this.#axis;
    const inside = this.#points.filter(({ value }) => value > low && value < high);
    return [sampleAt(this.#points, low), ...inside, sampleAt(this.#points, high)].map(({ value, color }) =>
      s('stop', { offset: (value - low) / (high - low), 'stop-color': color }));
  }

  /** Straight in opacity is bent along a square root: more samples than points. */
  #curve() {
    const { left, width } = this.#plot;
    const values = this.#points.map((point) => point.value).filter((v) => v >= this.#axis[0] && v <= this.#axis[1]);
    for (let x = left; x <= left + width + 0.5; x += 3) values.push(this.valueAt(x));
    values.sort((a, b) => a - b);
    const at = (value) => `${this.x(value).toFixed(1)},${this.y(sampleAt(this.#points, value).opacity).toFixed(1)}`;
    return values.map(at).join('L');
  }

  #drawAxes() {
    const { left, top, width, height } = this.#plot;
    this.#parts.grid.replaceChildren(...GRID.flatMap((opacity) => [
      s('line', { x1: left, x2: left + width, y1: this.y(opacity), y2: this.y(opacity) }),
      s('text', { x: left - 5, y: this.y(opacity) + 3.5, 'text-anchor': 'end' }, `${opacity * 100}%`),
    ]));
    const [low, high] = this.#axis;
    const rough = (high - low) / Math.max(2, width / 70);
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * ([1, 2, 5].find((factor) => factor * power >= rough) ?? 10);
    const [from, to] = [top + height + STRIP + 6, top + height + STRIP + 9];
    const ticks = [];
    for (let index = Math.ceil(low / step); index * step <= high; index += 1) {
      const x = this.x(index * step);
      ticks.push(s('line', { x1: x, x2: x, y1: from, y2: to }));
      ticks.push(s('text', { x, y: HEIGHT - 3, 'text-anchor': 'middle' }, formatNumber(index * step)));
    }
    this.#parts.ticks.replaceChildren(...ticks);
  }

  /** Reuses the elements, so that the one with the focus keeps it. */
  #drawDots() {
    const { left, width } = this.#plot;
    const { dots } = this.#parts;
    while (dots.children.length > this.#points.length) dots.lastChild.remove();
    while (dots.children.length < this.#points.length) dots.append(this.#makeDot(dots.children.length));
    this.#points.forEach((point, index) => {
      const x = this.x(point.value);
      const dot = dots.children[index];
      setAttributes(dot, {
        cx: x.toFixed(1), cy: this.y(point.opacity).toFixed(1), fill: point.color,
        'aria-valuenow': point.value, 'aria-valuetext': describe(point),
      });
      dot.classList.toggle('selected', index === this.#selected);
      dot.classList.toggle('outside', x < left - 1 || x > left + width + 1);
    });
  }

  #makeDot(index) {
    const listeners = Object.entries(this.#dotListeners).map(([name, listen]) => [name, (event) => listen(event, index)]);
    return s('circle', {
      r: RADIUS, tabindex: 0, role: 'slider', 'aria-label': `Point ${index + 1}`, ...Object.fromEntries(listeners),
    });
  }
}

const describe = ({ value, opacity }) => `value ${formatNumber(value)}, opacity ${formatNumber(opacity * 100, 3)} %`;
