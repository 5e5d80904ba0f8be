/** Volumes on their way: packed and sent by this page, then loaded by the server, until they are there or failed. */

import { api } from './api.js';
import { choiceOf, chosen, isElsewhere } from './choice.js';
import { Emitter } from './store.js';

/** More at once would take the connections that pictures and slices need. */
const MOST_SENT = 2;
/** Milliseconds between two questions how far the server is. */
const FIRST_PAUSE = 250;
const LAST_PAUSE = 1500;

/** What is being done, for people. */
const WORDS = {
  waiting: 'Waiting', packing: 'Packing', sending: 'Sending', fetching: 'Fetching', reading: 'Reading',
  preparing: 'Preparing', uploading: 'Copying to the GPU', computing: 'Computing',
};

/**
 * @typedef {(choice: Record<string, any>, signal: AbortSignal, report: (what: string, fraction?: number) => void)
 *   => Promise<import('./store.js').Volume>} Send asks the server for a volume, perhaps still loading
 */

/** One volume on its way. Emits `change`. */
export class Load extends Emitter {
  what = 'waiting';
  /** @type {number | null} */ fraction = null;
  /** @type {any} */ error = null;
  /** What the error lets one choose from. @type {import('./choice.js').Choice | null} */ choice = null;
  /** Of the volume, once the server knows it. @type {string | null} */ id = null;
  abort = new AbortController();
  /** @type {Record<string, any>} */ chosen = {};
  /** Later ones have higher numbers; 0: begun elsewhere. */
  order = 0;

  /**
   * @param {string} name
   * @param {Send | null} send null: this page does not have the file
   */
  constructor(name, send) {
    super();
    this.name = name;
    this.send = send;
  }

  get words() {
    return WORDS[this.what] ?? this.what.replaceAll('_', ' ');
  }

  /** @param {string} what @param {number} [fraction] 0 to 1; missing: nobody knows */
  report(what, fraction) {
    this.what = what;
    this.fraction = typeof fraction === 'number' ? fraction : null;
    this.emit('change');
  }

  /** @param {any} error */
  fail(error) {
    this.error = error;
    this.choice = this.send ? choiceOf(error) : null;
    this.emit('change');
  }

  /** Begins anew, with what was chosen. @param {Record<string, any>} choice */
  restart(choice) {
    this.abort = new AbortController();
    Object.assign(this, { error: null, choice: null, id: null, chosen: choice });
    this.report('waiting');
  }
}

/**
 * Emits `add` and `remove` (a Load), `ready` (`{volume, isShown}`: whether it should be shown), `failed` (a Load) and
 * `dismissed`.
 */
export class Loads extends Emitter {
  /** @type {Load[]} In the order of their beginning. */ all = [];
  #begun = 0;
  /** The latest of the loads whose volume was shown: an earlier one that takes longer does not take its place. */
  #shown = 0;
  #sending = 0;
  /** @type {(() => void)[]} */ #line = [];

  /** @param {string} name @param {Send} send */
  start(name, send) {
    const load = new Load(name, send);
    this.#begin(load);
    this.#add(load);
    this.#run(load);
  }

  /** Shows what the server lists as loading or failed and this page did not begin. @param {any[]} volumes */
  adopt(volumes) {
    for (const volume of volumes) {
      if (this.all.some(({ id }) => id === volume.id)) continue;
      const { name, source } = volume;
      // Of files that the server has, this page can choose as well.
      const again = (choice, signal) => api.loadVolume({ name, source: { ...source, ...choice } }, signal);
      const load = new Load(name, isElsewhere(source) ? again : null);
      load.id = volume.id;
      this.#add(load);
      this.#follow(load, volume).then((done) => this.#done(load, done), (error) => this.#failed(load, error));
    }
  }

  /** Stops a load, or forgets a failed one. @param {Load} load */
  async dismiss(load) {
    load.abort.abort();
    this.#remove(load);
    await this.#forget(load);
    this.emit('dismissed');
  }

  /** Loads again what was several, now one of them. @param {Load} load @param {string} value */
  async choose(load, value) {
    const choice = chosen(load.choice, value);
    await this.#forget(load);
    load.restart(choice);
    this.#begin(load);
    this.#run(load);
  }

  #begin(load) {
    this.#begun += 1;
    load.order = this.#begun;
  }

  #add(load) {
    this.all.push(load);
    this.emit('add', load);
  }

  #remove(load) {
    this.all = this.all.filter((other) => other !== load);
    this.emit('remove', load);
  }

  /** The server's side of a load ends too. */
  async #forget(load) {
    if (load.id) await api.deleteVolume(load.id, false).catch(() => {});
  }

  async #run(load) {
    const { signal } = load.abort;
    try {
      const volume = await this.#inTurn(() => load.send(load.chosen, signal, (...news) => load.report(...news)), signal);
      load.id = volume.id;
      // The list may have told of it first.
      const twin = this.all.find((other) => other !== load && other.id === load.id);
      if (twin) this.#remove(twin);
      this.#done(load, await this.#follow(load, volume));
    } catch (error) {
      if (!signal.aborted) this.#failed(load, error);
    }
  }

  #done(load, volume) {
    if (!this.all.includes(load)) return;
    this.#remove(load);
    const isShown = load.order > this.#shown;
    if (isShown) this.#shown = load.order;
    this.emit('ready', { volume, isShown });
  }

  #failed(load, error) {
    if (!this.all.includes(load)) return;
    load.fail(error);
    this.emit('failed', load);
  }

  /** Sends when fewer than {@link MOST_SENT} others are being sent. */
  async #inTurn(send, signal) {
    if (this.#sending >= MOST_SENT) await new Promise((resolve) => this.#line.push(resolve));
    this.#sending += 1;
    try {
      signal.throwIfAborted();
      return await send();
    } finally {
      this.#sending -= 1;
      this.#line.shift()?.();
    }
  }

  /**
   * Asks the server how far it is, until it is done.
   * @returns {Promise<any>} the volume
   * @throws why it failed
   */
  async #follow(load, volume) {
    const { signal } = load.abort;
    for (let pause = FIRST_PAUSE; volume.state === 'loading'; pause = Math.min(pause * 1.3, LAST_PAUSE)) {
      const { what = 'reading', fraction } = volume.progress ?? {};
      const isComputed = volume.source?.procedural && (what === 'fetching' || what === 'reading');
      load.report(isComputed ? 'computing' : what, fraction);
      await new Promise((resolve) => setTimeout(resolve, pause));
      signal.throwIfAborted();
      volume = await api.volume(volume.id).catch((error) => {
        if (error.status === 404) throw new Error('It was cancelled, or the server has lost it.');
        // Away or busy: it will tell later.
        if (error.status === 0 || error.status === 429 || error.status >= 500) return volume;
        throw error;
      });
    }
    if (volume.state === 'failed') throw volume.error;
    return volume;
  }
}
