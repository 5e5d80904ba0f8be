/** Three-vectors as plain arrays. */

/** @typedef {[number, number, number]} Vec3 */

/** @param {Vec3} a @param {Vec3} b @returns {Vec3} */
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

/** @param {Vec3} a @param {Vec3} b @returns {Vec3} */
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

/** @param {Vec3} a @param {number} factor @returns {Vec3} */
export const scale = (a, factor) => [a[0] * factor, a[1] * factor, a[2] * factor];

/** @param {Vec3} a @param {Vec3} b */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** @param {Vec3} a @param {Vec3} b @returns {Vec3} */
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** @param {Vec3} a */
export const length = (a) => Math.hypot(...a);

const DEGREE = Math.PI / 180;

/**
 * Unit vector from angles in degrees: azimuth 0 is a patient's front (-y) and grows towards +x, elevation is
 * above the xy plane.
 * @param {number} azimuth
 * @param {number} elevation
 * @returns {Vec3}
 */
export function directionFromAngles(azimuth, elevation) {
  const [a, e] = [azimuth * DEGREE, elevation * DEGREE];
  return [Math.sin(a) * Math.cos(e), -Math.cos(a) * Math.cos(e), Math.sin(e)];
}

/**
 * The inverse of {@link directionFromAngles}, for a vector of any length but zero.
 * @param {Vec3} direction
 */
export function anglesFromDirection(direction) {
  const [x, y, z] = direction;
  return { azimuth: Math.atan2(x, -y) / DEGREE, elevation: Math.atan2(z, Math.hypot(x, y)) / DEGREE };
}

/**
 * The corners of a volume's cells in the world: half a voxel beyond the outermost centres.
 * @param {import('./store.js').Volume} volume
 * @returns {Vec3[]}
 */
export function volumeCorners({ dims, spacing, origin, direction }) {
  const corners = [];
  for (let corner = 0; corner < 8; corner += 1) {
    let point = /** @type {Vec3} */ ([...origin]);
    for (let axis = 0; axis < 3; axis += 1) {
      const index = corner & (1 << axis) ? dims[axis] - 0.5 : -0.5;
      point = add(point, scale(direction[axis], index * spacing[axis]));
    }
    corners.push(point);
  }
  return corners;
}

/**
 * The world box around a volume: `[[min], [max]]`.
 * @param {import('./store.js').Volume} volume
 * @returns {[Vec3, Vec3]}
 */
export function volumeBounds(volume) {
  const corners = volumeCorners(volume);
  const extreme = (pick) => /** @type {Vec3} */ ([0, 1, 2].map((axis) => pick(...corners.map((c) => c[axis]))));
  return [extreme(Math.min), extreme(Math.max)];
}
