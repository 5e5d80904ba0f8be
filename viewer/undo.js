/**
 * Undo and redo by what a person did rather than by what was sent: a drag sends many updates, each a revision of its
 * own, so one step goes on until the scene is one that had come to rest.
 */

import { ApiError, api } from './api.js';
import { canonical } from './merge_patch.js';
import { Emitter } from './store.js';

/** As many steps as a server remembers. */
const MAX_STEPS = 100;

/** Emits `error` ({message}) when a step fails. */
export class Undo extends Emitter {
  /** @type {Set<string>} */ #rests = new Set();
  #busy = false;

  /** @param {import('./session.js').Session} session */
  constructor(session) {
    super();
    this.session = session;
    /** While something is only tried out, such as a comparison, its states are no rests. */
    this.paused = false;
    session.on('settled', () => this.#rest());
  }

  undo() {
    return this.#walk(api.undo);
  }

  redo() {
    return this.#walk(api.redo);
  }

  #rest() {
    if (this.paused || this.#busy || !this.session.store.isSettled) return;
    this.#rests.add(canonical(this.session.store.scene));
    if (this.#rests.size > MAX_STEPS) this.#rests.delete(this.#rests.values().next().value);
  }

  /** @param {(id: string) => Promise<any>} step */
  async #walk(step) {
    const { store } = this.session;
    if (this.#busy || !store.id) return;
    this.#busy = true;
    const start = canonical(store.scene);
    try {
      for (let steps = 0; steps < MAX_STEPS; steps += 1) {
        const answer = await step(store.id);
        const { id, revision, ...scene } = answer;
        this.session.adopt(answer);
        const now = canonical(scene);
        if (now !== start && (this.#rests.has(now) || this.#rests.size === 0)) break;
      }
    } catch (error) {
      if (!(error instanceof ApiError)) throw error;
      // At the end of the history: whatever steps were possible have been made.
      if (canonical(store.scene) === start) this.emit('error', error);
    } finally {
      this.#busy = false;
    }
  }
}
