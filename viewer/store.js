/**
 * What the server last said of the scene, and the edits it has not confirmed yet. Nothing here knows the page.
 */

import { applyPatch, combinePatches } from './merge_patch.js';

/**
 * @typedef {Object<string, any>} Scene   A scene document without `id` and `revision`.
 * @typedef {Object<string, any>} Volume  As `GET /v1/volumes/{id}` answers.
 * @typedef {import('./merge_patch.js').Patch} Patch
 */

/** Splits an answer of the server into the document and its identity. */
export function splitScene({ id, revision, ...scene }) {
  return { id, revision, scene };
}

/** A list of listeners per event name. */
export class Emitter {
  #listeners = new Map();

  /**
   * @param {string} event
   * @param {(value?: any) => void} listener
   */
  on(event, listener) {
    this.#listeners.set(event, [...(this.#listeners.get(event) ?? []), listener]);
  }

  /**
   * @param {string} event
   * @param {any} [value]
   */
  emit(event, value) {
    for (const listener of this.#listeners.get(event) ?? []) listener(value);
  }
}

/**
 * One scene: the server's document (`base`), edits on their way (`pending`), edits not sent yet (`queued`).
 * Emits `scene` whenever what should be shown changes.
 */
export class SceneStore extends Emitter {
  /** @type {string | null} */ id = null;
  revision = 0;
  /** @type {Scene | null} */ #base = null;
  /** @type {{seq: number, patch: Patch}[]} */ #pending = [];
  /** @type {Patch | null} */ #queued = null;
  /** @type {Scene | null} */ #shown = null;

  /** The scene as the page shows it: the server's, with our edits on top. */
  get scene() {
    return this.#shown;
  }

  /** Whether the server has confirmed every edit. */
  get isSettled() {
    return this.#pending.length === 0 && this.#queued === null;
  }

  /** Whether there is something to send. */
  get hasQueued() {
    return this.#queued !== null;
  }

  /**
   * Takes over what the server says; edits under way stay on top of it.
   * @param {string} id
   * @param {number} revision
   * @param {Scene} scene
   */
  load(id, revision, scene) {
    if (id !== this.id) {
      this.#pending = [];
      this.#queued = null;
    } else if (revision < this.revision && this.#base) {
      return; // An answer that was overtaken.
    }
    this.id = id;
    this.revision = revision;
    this.#base = scene;
    this.#refresh();
  }

  /** Forgets the scene. */
  clear() {
    this.id = null;
    this.revision = 0;
    this.#base = null;
    this.#pending = [];
    this.#queued = null;
    this.#refresh();
  }

  /**
   * The same scene lives on under another id: edits under way are sent again there.
   * @param {string} id
   */
  moveTo(id) {
    this.requeue();
    this.id = id;
    this.revision = 0;
  }

  /**
   * Someone else changed the scene.
   * @param {number} revision
   * @param {Patch} patch
   */
  applyRemote(revision, patch) {
    this.revision = Math.max(this.revision, revision);
    this.#base = applyPatch(this.#base, patch);
    this.#refresh();
  }

  /**
   * A local edit: shown at once, sent with the next update.
   * @param {Patch} patch
   */
  edit(patch) {
    if (!this.#base) return;
    this.#queued = combinePatches(this.#queued, patch);
    this.#refresh();
  }

  /**
   * The edits to send as update `seq`; they count as pending from here on.
   * @param {number} seq
   * @returns {Patch | null}
   */
  take(seq) {
    const patch = this.#queued;
    if (patch) this.#pending.push({ seq, patch });
    this.#queued = null;
    return patch;
  }

  /**
   * A frame shows every update up to `seq`.
   * @param {number} seq
   * @param {number} revision
   */
  confirm(seq, revision) {
    const done = this.#pending.filter((edit) => edit.seq <= seq);
    if (done.length > 0) {
      for (const { patch } of done) this.#base = applyPatch(this.#base, patch);
      this.#pending = this.#pending.filter((edit) => edit.seq > seq);
      this.#refresh();
    }
    this.revision = Math.max(this.revision, revision);
  }

  /**
   * The server refused update `seq`, which changed nothing.
   * @param {number} seq
   */
  reject(seq) {
    this.#pending = this.#pending.filter((edit) => edit.seq !== seq);
    this.#refresh();
  }

  /** After a broken connection: whatever was not confirmed is sent once more. */
  requeue() {
    const patches = this.#pending.map((edit) => edit.patch);
    if (this.#queued) patches.push(this.#queued);
    this.#pending = [];
    this.#queued = patches.length > 0 ? patches.reduce((all, patch) => combinePatches(all, patch)) : null;
  }

  #refresh() {
    let shown = this.#base;
    for (const { patch } of this.#pending) shown = applyPatch(shown, patch);
    if (this.#queued) shown = applyPatch(shown, this.#queued);
    this.#shown = shown;
    this.emit('scene', shown);
  }
}
