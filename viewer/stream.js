/**
 * One connection to a scene's stream, and nothing about what to do when it ends.
 *
 * The key, if there is one, travels as a subprotocol, because browsers cannot set headers on a WebSocket:
 * `Sec-WebSocket-Protocol: spao.v1, bearer.<key in base64url without padding>`; the server selects `spao.v1`.
 * Without a key no subprotocol is offered.
 */

import { apiKey, urlOf } from './api.js';

/** Moving frames, best first: photographs of volumes are smallest as JPEG. */
const ENCODINGS = ['jpeg', 'webp', 'png'];
/** One being decoded, one on the wire. */
const MAX_IN_FLIGHT = 2;

/**
 * @typedef {Object} StreamHandlers
 * @property {(welcome: any) => void} welcome
 * @property {(header: any, image: Blob) => void} frame a frame's header and its picture, complete
 * @property {(message: {revision: number, patch: any}) => void} scene
 * @property {(message: {what: string, fraction: number}) => void} progress
 * @property {(message: {code: string, message: string, seq?: number}) => void} error
 * @property {(message: {reason: string}) => void} goodbye
 * @property {(wasWelcomed: boolean) => void} closed
 */

/** @param {string} text */
const base64url = (text) =>
  btoa(String.fromCharCode(...new TextEncoder().encode(text)))
    .replaceAll('+', '-').replaceAll('/', '_').replaceAll('=', '');

export class Stream {
  /** @type {WebSocket} */ #socket;
  /** @type {any} The header whose picture comes next. */ #header = null;
  #welcomed = false;

  /**
   * @param {string} sceneId
   * @param {{width: number, height: number, resume: string | null}} hello
   * @param {StreamHandlers} handlers
   */
  constructor(sceneId, hello, handlers) {
    const url = urlOf(`v1/scenes/${encodeURIComponent(sceneId)}/stream`);
    url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
    const key = apiKey();
    this.#socket = key ? new WebSocket(url, ['spao.v1', `bearer.${base64url(key)}`]) : new WebSocket(url);
    this.#socket.onopen = () =>
      this.#send({ type: 'hello', protocol: 1, encodings: ENCODINGS, max_in_flight: MAX_IN_FLIGHT, ...hello });
    this.#socket.onmessage = ({ data }) => this.#receive(data, handlers);
    this.#socket.onclose = () => handlers.closed(this.#welcomed);
  }

  /** Whether updates may be sent. */
  get isReady() {
    return this.#welcomed && this.#socket.readyState === WebSocket.OPEN;
  }

  /**
   * @param {number} seq
   * @param {{scene?: any, view?: any}} update
   */
  update(seq, { scene, view }) {
    this.#send({ type: 'update', seq, ...(scene ? { scene } : {}), ...(view ? { view } : {}) });
  }

  /** @param {number} frame */
  ack(frame) {
    this.#send({ type: 'ack', frame });
  }

  /** @param {boolean} visible */
  visibility(visible) {
    this.#send({ type: 'visibility', visible });
  }

  /** Ends the connection without telling anyone. */
  close() {
    this.#socket.onmessage = null;
    this.#socket.onclose = null;
    this.#socket.onopen = () => this.#socket.close();
    this.#socket.close();
  }

  #send(message) {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }

  /** @param {string | Blob} data @param {StreamHandlers} handlers */
  #receive(data, handlers) {
    if (typeof data !== 'string') {
      const header = this.#header;
      this.#header = null;
      if (header) handlers.frame(header, new Blob([data], { type: `image/${header.encoding}` }));
      return;
    }
    const message = JSON.parse(data);
    if (message.type === 'frame') {
      this.#header = message;
      return;
    }
    if (message.type === 'welcome') this.#welcomed = true;
    // Kinds of messages that a later server may add are passed over.
    handlers[message.type]?.(message);
  }
}
