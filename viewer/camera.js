/**
 * A camera that turns about a target without ever rolling: the world's z stays up, and the poles cannot be crossed.
 */

import { Emitter } from './store.js';
import {
  add, anglesFromDirection, cross, directionFromAngles, dot, length, scale, subtract, volumeCorners,
} from './vector.js';

/** @typedef {import('./vector.js').Vec3} Vec3 */

/** Degrees: at 90 "up" would be parallel to the view. */
const MAX_ELEVATION = 89.5;
/** Share of the picture that a framed volume fills. */
const FILL = 0.9;
const RADIANS = Math.PI / 180;

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

/** Emits `change` when a person moved it. Angles in degrees, lengths in world units. */
export class OrbitCamera extends Emitter {
  /** @type {Vec3} */ target = [0, 0, 0];
  azimuth = 27;
  elevation = 10;
  distance = 1;
  /** @type {'perspective' | 'orthographic'} */ projection = 'perspective';
  fov = 40;
  /** World height of an orthographic picture. */
  height = 1;
  /** Size of the volume: keeps zooming within reason. */
  #extent = 1;

  /** @param {import('./store.js').Volume} volume */
  setVolume(volume) {
    const corners = volumeCorners(volume);
    this.#extent = Math.max(1e-9, length(subtract(corners[7], corners[0])));
  }

  /**
   * Takes over a camera of the API, righting it if it was rolled.
   * @param {Object<string, any>} json
   */
  load(json) {
    const back = subtract(json.eye, json.target);
    const { azimuth, elevation } = anglesFromDirection(back);
    this.target = [...json.target];
    this.distance = Math.max(length(back), 1e-9);
    this.azimuth = azimuth;
    this.elevation = clamp(elevation, -MAX_ELEVATION, MAX_ELEVATION);
    this.projection = json.projection ?? 'perspective';
    this.fov = json.fov_y_deg ?? 40;
    this.height = json.height ?? this.#heightAtTarget();
  }

  /** The camera as the API takes it; digits beyond a thousandth of a pixel are left out. */
  toJson() {
    const eye = add(this.target, scale(directionFromAngles(this.azimuth, this.elevation), this.distance));
    const digits = clamp(5 - Math.floor(Math.log10(this.distance)), 0, 12);
    const round = (value) => Number(value.toFixed(digits));
    return {
      eye: eye.map(round),
      target: this.target.map(round),
      up: [0, 0, 1],
      projection: this.projection,
      fov_y_deg: Number(this.fov.toFixed(3)),
      height: this.projection === 'orthographic' ? Number(this.height.toPrecision(7)) : null,
    };
  }

  /**
   * @param {number} azimuth   degrees to add
   * @param {number} elevation degrees to add
   */
  orbit(azimuth, elevation) {
    this.azimuth = ((this.azimuth + azimuth + 540) % 360) - 180;
    this.elevation = clamp(this.elevation + elevation, -MAX_ELEVATION, MAX_ELEVATION);
    this.emit('change');
  }

  /**
   * Moves so that what is at the target's depth follows the pointer.
   * @param {number} right share of the picture's height
   * @param {number} down  share of the picture's height
   */
  pan(right, down) {
    this.#shift(-right, down);
    this.emit('change');
  }

  /**
   * Comes nearer (factor < 1) or goes farther; the point under the pointer, at the target's depth, stays there.
   * @param {number} factor
   * @param {number} right pointer's distance from the middle, in picture heights
   * @param {number} down
   */
  zoom(factor, right = 0, down = 0) {
    const size = this.projection === 'orthographic' ? this.height : this.distance;
    const limited = clamp(size * factor, this.#extent * 1e-3, this.#extent * 20) / size;
    this.#shift(right * (1 - limited), -down * (1 - limited));
    if (this.projection === 'orthographic') this.height *= limited;
    else this.distance *= limited;
    this.emit('change');
  }

  /**
   * Looks from a direction, at the same point and distance.
   * @param {number} azimuth
   * @param {number} elevation
   */
  lookFrom(azimuth, elevation) {
    this.azimuth = azimuth;
    this.elevation = clamp(elevation, -MAX_ELEVATION, MAX_ELEVATION);
    this.emit('change');
  }

  /**
   * Changes the projection; what is at the target keeps its size.
   * @param {'perspective' | 'orthographic'} projection
   */
  setProjection(projection) {
    if (projection === this.projection) return;
    if (projection === 'orthographic') {
      this.height = this.#heightAtTarget();
      // The eye must be outside of the volume: orthographic rays start at its plane.
      this.distance = Math.max(this.distance, this.#extent);
    } else {
      this.distance = this.height / (2 * Math.tan((this.fov * RADIANS) / 2));
    }
    this.projection = projection;
    this.emit('change');
  }

  /** @param {number} fov vertical field of view in degrees; what is at the target keeps its size. */
  setFov(fov) {
    const height = this.#heightAtTarget();
    this.fov = fov;
    this.distance = height / (2 * Math.tan((fov * RADIANS) / 2));
    this.emit('change');
  }

  /**
   * Shows the whole volume from where the camera is.
   * @param {import('./store.js').Volume} volume
   * @param {number} aspect width / height of the picture
   */
  fit(volume, aspect) {
    this.setVolume(volume);
    const corners = volumeCorners(volume);
    this.target = scale(add(corners[0], corners[7]), 0.5);
    const { right, up, back } = this.axes;
    const slope = Math.tan((this.fov * RADIANS) / 2) * FILL;
    this.distance = 0;
    this.height = 0;
    for (const corner of corners) {
      const offset = subtract(corner, this.target);
      const reach = Math.max(Math.abs(dot(offset, right)) / aspect, Math.abs(dot(offset, up)));
      this.distance = Math.max(this.distance, reach / slope + dot(offset, back));
      this.height = Math.max(this.height, (2 * reach) / FILL);
    }
    if (this.projection === 'orthographic') this.distance = Math.max(this.distance, this.#extent);
    this.emit('change');
  }

  /** Unit world vectors: what is to the right and up in the picture, and what is towards the viewer. */
  get axes() {
    const back = directionFromAngles(this.azimuth, this.elevation);
    const a = this.azimuth * RADIANS;
    const right = /** @type {Vec3} */ ([Math.cos(a), Math.sin(a), 0]);
    return { back, right, up: cross(back, right) };
  }

  /** World height of the picture at the target. */
  #heightAtTarget() {
    return 2 * this.distance * Math.tan((this.fov * RADIANS) / 2);
  }

  #shift(right, up) {
    const axes = this.axes;
    const height = this.projection === 'orthographic' ? this.height : this.#heightAtTarget();
    const shift = add(scale(axes.right, right * height), scale(axes.up, up * height));
    this.target = add(this.target, shift);
  }
}
