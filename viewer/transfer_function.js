/** Control points: pure functions. A point is `{value, color: '#rrggbb', opacity}`; lists are sorted by value. */

/** @typedef {{value: number, color: string, opacity: number}} ControlPoint */

/** @param {string} color */
const channels = (color) => [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16));

/** @param {string} a @param {string} b @param {number} t */
export function mixColors(a, b, t) {
  const [from, to] = [channels(a), channels(b)];
  return `#${from.map((x, i) => Math.round(x + (to[i] - x) * t).toString(16).padStart(2, '0')).join('')}`;
}

/**
 * The function's value: linear between points, constant outside.
 * @param {ControlPoint[]} points
 * @param {number} value
 */
export function sampleAt(points, value) {
  const next = points.findIndex((point) => point.value > value);
  if (next === 0) return { ...points[0], value };
  if (next < 0) return { ...points.at(-1), value };
  const [a, b] = [points[next - 1], points[next]];
  const t = (value - a.value) / (b.value - a.value);
  return { value, color: mixColors(a.color, b.color, t), opacity: a.opacity + (b.opacity - a.opacity) * t };
}

/**
 * With a point moved, kept between its neighbours.
 * @param {ControlPoint[]} points
 * @param {number} index
 * @param {Partial<ControlPoint>} change
 * @param {number} gap smallest distance between values
 */
export function changePoint(points, index, change, gap) {
  const point = { ...points[index], ...change };
  if (change.value !== undefined) {
    const low = index > 0 ? points[index - 1].value + gap : -Infinity;
    const high = index < points.length - 1 ? points[index + 1].value - gap : Infinity;
    // Neighbours nearer than two gaps leave no room: then it stays.
    point.value = low <= high ? Math.min(high, Math.max(low, point.value)) : points[index].value;
  }
  point.opacity = Math.min(1, Math.max(0, point.opacity));
  return points.map((old, i) => (i === index ? point : old));
}

/**
 * With a point added on the function, or with the given opacity.
 * @param {ControlPoint[]} points
 * @param {number} value
 * @param {number} [opacity]
 * @returns {{points: ControlPoint[], index: number}}
 */
export function addPoint(points, value, opacity) {
  const point = sampleAt(points, value);
  if (opacity !== undefined) point.opacity = opacity;
  const at = points.findIndex((other) => other.value > value);
  const index = at < 0 ? points.length : at;
  return { points: [...points.slice(0, index), point, ...points.slice(index)], index };
}

/** Rounds to what a person would type: whole numbers for integers, four digits of the range otherwise. */
export function valueRounder(voxelType, [low, high]) {
  if (!/^f/.test(voxelType) && high - low >= 64) return Math.round;
  const digits = Math.min(12, Math.max(0, 4 - Math.ceil(Math.log10(Math.max(high - low, 1e-9)))));
  return (value) => Number(value.toFixed(digits));
}
