/** What the last frames cost. */

import { Emitter } from './store.js';

/** Stages of a frame in the order in which they happen; `decode` is the browser's. */
export const STAGES = ['queue', 'ao', 'raycast', 'readback', 'encode', 'decode'];
const KEPT = 72;
/** Milliseconds over which frames per second are counted. */
const FPS_WINDOW = 2000;

/**
 * @typedef {Object} FrameRecord
 * @property {number} time     when it was shown, ms
 * @property {any} header      the server's `frame` message
 * @property {number[]} stages ms, in the order of {@link STAGES}
 * @property {number | null} latency ms from the update that it shows to the screen
 */

/** Emits `frame` for every new record. */
export class Ledger extends Emitter {
  /** @type {FrameRecord[]} */ records = [];
  /** @type {Map<number, number>} */ #sent = new Map();

  /** @param {number} seq an update that leaves now */
  sent(seq) {
    this.#sent.set(seq, performance.now());
    if (this.#sent.size > 500) this.#sent.delete(this.#sent.keys().next().value);
  }

  /**
   * @param {any} header
   * @param {number} decode ms
   */
  add(header, decode) {
    const time = performance.now();
    const stages = STAGES.map((stage) => (stage === 'decode' ? decode : header.timings_ms?.[stage] ?? 0));
    const sent = this.#sent.get(header.seq);
    // Only the first frame that shows an update says how long it took.
    this.#sent.delete(header.seq);
    this.records.push({ time, header, stages, latency: sent === undefined ? null : time - sent });
    if (this.records.length > KEPT) this.records.shift();
    this.emit('frame', this.records.at(-1));
  }

  /** Frames per second of the last two seconds; null while nothing moves. */
  get fps() {
    const now = performance.now();
    const recent = this.records.filter((record) => now - record.time < FPS_WINDOW);
    if (recent.length < 3) return null;
    const span = recent.at(-1).time - recent[0].time;
    return span > 0 ? ((recent.length - 1) * 1000) / span : null;
  }

  /** Middle latency of the last frames in ms. */
  get latency() {
    const values = this.records.slice(-15).flatMap(({ latency }) => (latency === null ? [] : [latency]));
    return values.sort((a, b) => a - b)[values.length >> 1] ?? null;
  }
}
