/** Index space and world of a volume. An index is of a voxel's centre: the first voxel reaches from -0.5 to 0.5. */

import { add, cross, dot, scale, subtract } from './vector.js';

/** @typedef {import('./vector.js').Vec3} Vec3 */

/**
 * @param {import('./store.js').Volume} volume
 * @param {number[]} index may lie between voxels
 * @returns {Vec3}
 */
export function worldFromIndex({ spacing, origin, direction }, index) {
  return [0, 1, 2].reduce((point, axis) => add(point, scale(direction[axis], index[axis] * spacing[axis])),
    /** @type {Vec3} */ ([...origin]));
}

/**
 * The inverse of {@link worldFromIndex}, also of axes that are not at right angles.
 * @param {import('./store.js').Volume} volume
 * @param {Vec3} point
 * @returns {Vec3}
 */
export function indexFromWorld({ spacing, origin, direction }, point) {
  const steps = [0, 1, 2].map((axis) => scale(direction[axis], spacing[axis]));
  const offset = subtract(point, origin);
  const volume = dot(steps[0], cross(steps[1], steps[2]));
  return /** @type {Vec3} */ ([0, 1, 2].map((axis) => dot(offset, cross(steps[(axis + 1) % 3], steps[(axis + 2) % 3])) / volume));
}

/** Which world axis an index axis is nearest to. @param {Vec3} direction */
export function nearestWorldAxis(direction) {
  const sizes = direction.map(Math.abs);
  return sizes.indexOf(Math.max(...sizes));
}

/**
 * The voxels of the whole file that a world box touches, half open: what `region` takes.
 * @param {import('./store.js').Volume} volume may be averaged, and a part itself
 * @param {[Vec3, Vec3]} box
 * @returns {[number[], number[]] | null} null: the box is beside the volume
 */
export function regionOfBox(volume, box) {
  const { full_dims: full, factor, region } = volume.resolution;
  const first = region?.[0] ?? [0, 0, 0];
  const end = region?.[1] ?? full;
  const corners = Array.from({ length: 8 }, (_, corner) =>
    indexFromWorld(volume, /** @type {Vec3} */ ([0, 1, 2].map((axis) => box[(corner >> axis) & 1][axis]))));
  const edges = (axis) => corners.map((index) => first[axis] + (index[axis] + 0.5) * factor[axis]);
  // What lies on the boundary of a voxel but for rounding does not touch it.
  const low = [0, 1, 2].map((axis) => Math.max(first[axis], Math.floor(Math.min(...edges(axis)) + 1e-6)));
  const high = [0, 1, 2].map((axis) => Math.min(end[axis], Math.ceil(Math.max(...edges(axis)) - 1e-6)));
  return low.some((at, axis) => at >= high[axis]) ? null : [low, high];
}
