/** How often values occur: fetched once per volume, drawn on a logarithmic scale. */

import { api } from './api.js';

const BINS = 512;
/** Share of the voxels that may be out of sight at either end: a few outliers must not squeeze the rest. */
const OUTLIERS = 2e-5;
const KEPT = 8;

/** @typedef {{range: [number, number], counts: number[]}} Histogram */

/** @type {Map<string, Promise<Histogram>>} */
const cache = new Map();

/** @param {string} volumeId */
export function histogramOf(volumeId) {
  if (!cache.has(volumeId)) {
    const fetched = api.histogram(volumeId, BINS);
    fetched.catch(() => cache.delete(volumeId));
    cache.set(volumeId, fetched);
    if (cache.size > KEPT) cache.delete(cache.keys().next().value);
  }
  return cache.get(volumeId);
}

/**
 * The values worth looking at: all but outliers.
 * @param {Histogram} histogram
 * @returns {[number, number]}
 */
export function interestingRange({ range: [low, high], counts }) {
  const limit = counts.reduce((sum, count) => sum + count, 0) * OUTLIERS;
  const skipped = (list) => {
    let seen = 0;
    return list.findIndex((count) => (seen += count) > limit);
  };
  const width = (high - low) / counts.length;
  const first = Math.max(0, skipped(counts));
  const last = Math.max(0, skipped([...counts].reverse()));
  const interesting = [low + first * width, high - last * width];
  return interesting[1] > interesting[0] ? /** @type {[number, number]} */ (interesting) : [low, low + 1];
}

/**
 * An SVG path of log counts over `[low, high]`, in a box of the given size.
 * @param {Histogram} histogram
 * @param {[number, number]} axis
 * @param {number} width
 * @param {number} height
 */
export function histogramPath({ range, counts }, [low, high], width, height) {
  const top = Math.log1p(Math.max(1, ...counts));
  const bin = (range[1] - range[0]) / counts.length || 1;
  const x = (value) => (((value - low) / (high - low)) * width).toFixed(2);
  let path = '';
  counts.forEach((count, index) => {
    const from = range[0] + index * bin;
    if (from + bin < low || from > high) return;
    const y = (height * (1 - Math.log1p(count) / top)).toFixed(2);
    path += `${path ? 'L' : `M${x(from)},${height}L`}${x(from)},${y}L${x(from + bin)},${y}`;
  });
  return path ? `${path}V${height}Z` : '';
}
