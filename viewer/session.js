/**
 * Which scene is shown, and the connection to it: opens, reconnects, makes a lost scene again, sends what changed
 * once per animation frame, and confirms what was drawn.
 */

import { ApiError, api } from './api.js';
import { remakeScene, restoreScene } from './recovery.js';
import { Emitter, splitScene } from './store.js';
import { Stream } from './stream.js';

const FIRST_DELAY = 300;
const LAST_DELAY = 10_000;

/**
 * @typedef {'idle' | 'connecting' | 'live' | 'waiting'} Phase
 * @typedef {{phase: Phase, message?: string, retryAt?: number}} Status
 */

/**
 * Emits `busy` (whether the picture is behind what was asked for), `status`, `volume` (the scene's), `frame` (header), `progress`, `settled` (nothing moves and the server has
 * everything), `notice` ({kind, message}), `lost` (message: the scene is gone and cannot be made again).
 */
export class Session extends Emitter {
  /** @type {Status} */ status = { phase: 'idle' };
  /** @type {import('./store.js').Volume | null} */ volume = null;
  /** @type {Stream | null} */ #stream = null;
  #resumeToken = null;
  #attempts = 0;
  #timer = 0;
  #seq = 0;
  /** The last update that this connection sent. */
  #seqOfStream = 0;
  #viewChanged = false;
  #flushAsked = false;
  /** Whether the camera belongs to this scene already. */
  #cameraIsOurs = false;
  #syncedRevision = 0;
  #farewell = '';

  /**
   * @param {import('./store.js').SceneStore} store
   * @param {import('./camera.js').OrbitCamera} camera
   * @param {import('./picture.js').Picture} picture
   * @param {import('./ledger.js').Ledger} ledger
   */
  constructor(store, camera, picture, ledger) {
    super();
    Object.assign(this, { store, camera, picture, ledger });
    store.on('scene', () => store.hasQueued && this.#askFlush());
    camera.on('change', () => this.#changeView());
    picture.on('resize', (aspectBefore) => this.#resized(aspectBefore));
    document.addEventListener('visibilitychange', () => this.#stream?.visibility(!document.hidden));
    window.addEventListener('online', () => this.retryNow());
  }

  /**
   * Shows a scene.
   * @param {any} answer of the server
   * @param {any} [camera] of a link
   */
  async open(answer, camera) {
    const { id, revision, scene } = splitScene(answer);
    // Asked before the last scene goes, so that the page does not stand empty meanwhile.
    const volume = await api.volume(scene.volume);
    this.#disconnect();
    this.store.clear();
    this.picture.clear();
    this.#setVolume(volume);
    this.store.load(id, revision, scene);
    this.#syncedRevision = revision;
    this.#cameraIsOurs = Boolean(camera);
    if (camera) this.camera.load(camera);
    this.#resumeToken = null;
    this.#connect();
    this.emit('settled');
  }

  /** Shows nothing. */
  close() {
    this.#disconnect();
    this.store.clear();
    this.#setVolume(null);
    this.#setStatus({ phase: 'idle' });
  }

  /** Does not wait for the next attempt to connect. */
  retryNow() {
    if (this.status.phase !== 'waiting') return;
    clearTimeout(this.#timer);
    this.#probe();
  }

  /** Takes over an answer of undo, redo or the like. */
  adopt(answer) {
    const { id, revision, scene } = splitScene(answer);
    if (id !== this.store.id) return;
    this.store.load(id, revision, scene);
    this.#followVolume(scene.volume);
  }

  /** The scene with the camera of this view: what a link and a saved picture are of. */
  documentOfView() {
    return { ...this.store.scene, camera: this.camera.toJson() };
  }

  #disconnect() {
    this.#stream?.close();
    this.#stream = null;
    clearTimeout(this.#timer);
    this.#attempts = 0;
  }

  #connect() {
    this.#setStatus({ phase: 'connecting' });
    this.emit('busy', true);
    this.#seqOfStream = 0;
    this.picture.restart();
    this.#stream = new Stream(this.store.id, { ...this.picture.size, resume: this.#resumeToken }, {
      welcome: (message) => this.#welcome(message),
      frame: (header, image) => this.#frame(header, image),
      scene: ({ revision, patch }) => this.#remoteChange(revision, patch),
      progress: (message) => this.emit('progress', message),
      error: (message) => this.#error(message),
      goodbye: ({ reason }) => {
        this.#farewell = reason;
      },
      closed: () => this.#closed(),
    });
  }

  #welcome({ scene, revision, view, resume_token: token }) {
    this.#resumeToken = token ?? null;
    this.#farewell = '';
    this.store.requeue();
    this.store.load(this.store.id, revision, splitScene(scene).scene);
    this.#followVolume(scene.volume);
    const camera = view?.camera ?? scene.camera;
    if (this.#cameraIsOurs) {
      this.#viewChanged = true;
    } else if (camera) {
      this.camera.load(camera);
      this.#cameraIsOurs = true;
      // A camera that frames a wide picture cuts the sides off a tall one.
      if (this.volume && this.picture.aspect < 1) this.camera.fit(this.volume, this.picture.aspect);
    }
    this.#setStatus({ phase: 'live' });
    if (document.hidden) this.#stream?.visibility(false);
    this.#askFlush();
  }

  async #frame(header, image) {
    const stream = this.#stream;
    const started = performance.now();
    let drawn = false;
    try {
      drawn = await this.picture.show(header, image);
    } catch {
      this.emit('notice', { kind: 'error', message: 'A picture arrived that cannot be decoded.' });
    }
    stream?.ack(header.frame);
    if (stream !== this.#stream) return;
    this.#attempts = 0;
    this.store.confirm(header.seq ?? 0, header.scene_revision ?? 0);
    if (!drawn) return;
    this.ledger.add(header, performance.now() - started);
    this.emit('frame', header);
    const isNewest = this.store.isSettled && !this.#viewChanged && (header.seq ?? 0) >= this.#seqOfStream;
    if (header.phase === 'final' && isNewest) this.#settle();
  }

  /** Fetches what the server made of our edits: defaults filled in, numbers in range. */
  async #settle() {
    const id = this.store.id;
    if (this.store.revision !== this.#syncedRevision) {
      try {
        const answer = await api.scene(id);
        if (id !== this.store.id) return;
        this.adopt(answer);
        this.#syncedRevision = this.store.revision;
      } catch {
        return; // The next frame tries again.
      }
    }
    if (this.store.isSettled && !this.#viewChanged) this.emit('busy', false);
    this.emit('settled');
  }

  #remoteChange(revision, patch) {
    this.emit('busy', true);
    this.store.applyRemote(revision, patch);
    if (patch.volume) this.#followVolume(patch.volume);
  }

  #error({ code, message, seq }) {
    if (code === 'volume_not_found') this.#loseIfDeleted();
    this.emit('notice', { kind: 'error', message, code });
    const id = this.store.id;
    if (typeof seq !== 'number' || !id) return;
    this.store.reject(seq);
    // Refused, or accepted but impossible to draw: the server's document tells which.
    api.scene(id).then((answer) => this.adopt(answer), () => {});
  }

  #closed() {
    this.#stream = null;
    this.emit('progress', { what: '', fraction: 1 });
    this.#retryLater(this.#farewell ? `The server said goodbye: ${this.#farewell}.` : 'The connection was lost.');
  }

  #retryLater(message) {
    const longest = Math.min(LAST_DELAY, FIRST_DELAY * 2 ** this.#attempts);
    // Jitter keeps many pages from coming back in the same instant.
    const delay = longest * (0.7 + 0.3 * Math.random());
    this.#attempts += 1;
    this.#setStatus({ phase: 'waiting', message, retryAt: Date.now() + delay });
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#probe(), delay);
  }

  /** A WebSocket does not say why it failed; the same scene over HTTP does. */
  async #probe() {
    const { id, scene } = this.store;
    this.#setStatus({ phase: 'connecting' });
    try {
      const answer = await api.scene(id).catch((error) => {
        if (error.status === 404) return null;
        throw error;
      });
      if (id !== this.store.id) return;
      if (!answer) await this.#remake(scene);
      else if (answer.revision < this.store.revision) await this.#restore(answer, scene);
      if (this.store.id) this.#connect();
    } catch (error) {
      if (!(error instanceof ApiError)) throw error;
      if (id !== this.store.id) return;
      const isPassing = error.status === 0 || error.status === 429 || error.status >= 500;
      if (isPassing) this.#retryLater(capitalized(error.message));
      else this.#lose(`The server no longer has this scene, and making it again failed: ${error.message}.`);
    }
  }

  /** The scene is gone, with the server's memory most likely. */
  async #remake(scene) {
    const made = await remakeScene(scene, this.volume);
    if (!made) {
      this.#lose(`The server no longer has this scene, nor the volume “${this.volume?.name ?? ''}” to make it again.`);
      return;
    }
    this.#moveTo(made);
    this.emit('notice', { kind: 'info', message: 'The server had lost this scene; it was made again.' });
  }

  /** A revision before ours: the scene began anew while we were away. */
  async #restore(answer, scene) {
    const restored = await restoreScene(answer, scene, this.volume);
    this.#moveTo(restored);
    if (!restored.isRestored) this.#cameraIsOurs = false;
    const message = restored.isRestored
      ? 'The server was restarted; the scene is as it was here.'
      : 'The server was restarted, and this scene now shows another volume.';
    this.emit('notice', { kind: 'info', message });
  }

  #moveTo({ answer, volume }) {
    const { id, revision, scene } = splitScene(answer);
    this.#resumeToken = null;
    this.store.moveTo(id);
    this.store.load(id, revision, scene);
    this.#setVolume(volume);
  }

  /** Somebody else may delete what is shown here; or a change asked for a volume that is not there. */
  async #loseIfDeleted() {
    const { id } = this.store;
    const isGone = (asked) => asked.then(() => false, ({ status }) => status === 404);
    const answer = await api.scene(id).catch(() => null);
    // The scene may be of another volume by now.
    if (!answer || !(await isGone(api.volume(answer.volume))) || id !== this.store.id) return;
    const name = answer.volume === this.volume?.id ? ` “${this.volume.name}”` : '';
    this.#lose(`The volume${name} of this scene was deleted from the server.`);
  }

  #lose(message) {
    this.close();
    this.emit('lost', message);
  }

  /** What a tall picture shows is limited by its width, so that is what stays the same. */
  #resized(aspectBefore) {
    const factor = Math.min(1, aspectBefore) / Math.min(1, this.picture.aspect);
    if (this.#cameraIsOurs && Math.abs(factor - 1) > 0.01) this.camera.zoom(factor);
    this.#changeView();
  }

  #changeView() {
    this.#viewChanged = true;
    this.#askFlush();
  }

  #askFlush() {
    this.emit('busy', true);
    if (this.#flushAsked) return;
    this.#flushAsked = true;
    requestAnimationFrame(() => {
      this.#flushAsked = false;
      this.#flush();
    });
  }

  /** Sends the newest state; what cannot be sent now waits for the next welcome. */
  #flush() {
    if (!this.#stream?.isReady || !(this.#viewChanged || this.store.hasQueued)) return;
    this.#seq += 1;
    const scene = this.store.take(this.#seq);
    const view = this.#viewChanged ? { camera: this.camera.toJson(), ...this.picture.size } : null;
    this.#viewChanged = false;
    this.#seqOfStream = this.#seq;
    this.#stream.update(this.#seq, { scene, view });
    this.ledger.sent(this.#seq);
  }

  /** Someone changed which volume the scene shows. */
  #followVolume(id) {
    const { id: scene } = this.store;
    const follow = (volume) => scene === this.store.id && this.store.scene?.volume === id && this.#setVolume(volume);
    if (id !== this.volume?.id) api.volume(id).then(follow, () => {});
  }

  #setVolume(volume) {
    this.volume = volume;
    if (volume) this.camera.setVolume(volume);
    this.emit('volume', volume);
  }

  /** @param {Status} status */
  #setStatus(status) {
    this.status = status;
    this.emit('status', status);
  }
}

const capitalized = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;
