/** The canvas: how large pictures should be, and the newest of those that arrived. */

import { Emitter } from './store.js';

/** Device pixels per CSS pixel and longest side in pixels, per quality. */
const QUALITIES = {
  economy: { ratio: 0.6, side: 1280 },
  standard: { ratio: 1.5, side: 1920 },
  full: { ratio: 4, side: 3840 },
};
/** Milliseconds without a change before a new size is asked for. */
const RESIZE_DELAY = 120;
/** Smallest side worth asking for. */
const MIN_SIDE = 16;

/** Emits `resize` (aspect before) when pictures of another size are wanted. */
export class Picture extends Emitter {
  /** @type {keyof typeof QUALITIES} */ #quality = 'standard';
  #box;
  #canvas;
  #context;
  /** Most pixels along a side that the server draws. */
  #limit = Infinity;
  #newest = 0;
  #timer = 0;
  /** @type {{width: number, height: number}} */ size;

  /**
   * @param {HTMLElement} box what the picture fills
   * @param {HTMLCanvasElement} canvas
   */
  constructor(box, canvas) {
    super();
    this.#box = box;
    this.#canvas = canvas;
    this.#context = canvas.getContext('2d');
    this.size = this.#wantedSize();
    new ResizeObserver(() => {
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => this.#resize(), RESIZE_DELAY);
    }).observe(box);
  }

  get aspect() {
    return this.size.width / this.size.height;
  }

  /** @param {string} quality */
  setQuality(quality) {
    this.#quality = quality in QUALITIES ? /** @type {any} */ (quality) : 'standard';
    this.#resize();
  }

  /** @param {number} limit */
  setLimit(limit) {
    this.#limit = limit;
    this.#resize();
  }

  /** Frames of a new connection are counted from the beginning. */
  restart() {
    this.#newest = 0;
  }

  /** Shows nothing, until the next frame. */
  clear() {
    this.#context.clearRect(0, 0, this.#canvas.width, this.#canvas.height);
  }

  /**
   * Decodes a frame and draws it unless a newer one is there already.
   * @param {{frame: number, width: number, height: number}} header
   * @param {Blob} image
   * @returns {Promise<boolean>} whether it was drawn
   */
  async show(header, image) {
    this.#newest = Math.max(this.#newest, header.frame);
    const bitmap = await createImageBitmap(image);
    try {
      if (header.frame < this.#newest) return false;
      this.#draw(bitmap);
      return true;
    } finally {
      bitmap.close();
    }
  }

  /** Fits by height, as the camera does, so that a picture of the last window size is not distorted. */
  #draw(bitmap) {
    const { width, height } = this.size;
    if (this.#canvas.width !== width || this.#canvas.height !== height) {
      this.#canvas.width = width;
      this.#canvas.height = height;
    }
    const context = this.#context;
    const drawn = Math.abs(bitmap.width / bitmap.height - width / height) < 0.02
      ? width
      : (bitmap.width / bitmap.height) * height;
    context.clearRect(0, 0, width, height);
    context.imageSmoothingEnabled = bitmap.width !== width || bitmap.height !== height;
    context.imageSmoothingQuality = 'high';
    context.drawImage(bitmap, (width - drawn) / 2, 0, drawn, height);
  }

  #wantedSize() {
    const { clientWidth, clientHeight } = this.#box;
    const { ratio, side } = QUALITIES[this.#quality];
    const density = this.#quality === 'economy' ? ratio : Math.min(devicePixelRatio || 1, ratio);
    const longest = Math.max(1, clientWidth, clientHeight) * density;
    const factor = density * Math.min(1, Math.min(side, this.#limit) / longest);
    const pixels = (length) => Math.max(MIN_SIDE, Math.round(length * factor));
    return { width: pixels(clientWidth), height: pixels(clientHeight) };
  }

  #resize() {
    const wanted = this.#wantedSize();
    if (wanted.width === this.size.width && wanted.height === this.size.height) return;
    const aspectBefore = this.aspect;
    this.size = wanted;
    this.emit('resize', aspectBefore);
  }
}
