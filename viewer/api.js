/** The REST calls: one place that knows addresses, keys and the error envelope. */

const KEY_ITEM = 'spao.api_key';

/** What the server said went wrong, or that it could not be reached (`code` is `unreachable`). */
export class ApiError extends Error {
  /**
   * @param {number} status
   * @param {{code: string, message: string, details?: any, request_id?: string}} error
   */
  constructor(status, { code, message, details, request_id: requestId }) {
    super(message);
    this.status = status;
    this.code = code;
    this.details = details;
    this.requestId = requestId;
  }
}

/** @param {string} path relative to where the page lives, so that a proxy may serve it under a prefix */
export const urlOf = (path) => new URL(path, document.baseURI);

/** The key of this tab, if one was asked for. */
export function apiKey() {
  try {
    return sessionStorage.getItem(KEY_ITEM);
  } catch {
    return null;
  }
}

/** @param {string} key */
export function setApiKey(key) {
  try {
    sessionStorage.setItem(KEY_ITEM, key);
  } catch {
    // Without storage the key is asked for again.
  }
}

/** @returns {Record<string, string>} */
export const authorization = () => (apiKey() ? { Authorization: `Bearer ${apiKey()}` } : {});

/**
 * The error of an answer, whatever its body is.
 * @param {number} status
 * @param {string} text
 */
export function errorFrom(status, text) {
  try {
    const { error } = JSON.parse(text);
    if (error?.message) return new ApiError(status, error);
  } catch {
    // Not ours: a proxy's page, perhaps.
  }
  return new ApiError(status, { code: `http_${status}`, message: `the server answered with status ${status}` });
}

/** Asks a person for a key; set by the page. @type {(wrong: boolean) => Promise<string>} */
let askForKey = () => Promise.reject(new Error('a key is needed'));
/** @type {Promise<string> | null} One question at a time, however many calls wait for its answer. */
let asking = null;

/** @param {typeof askForKey} ask */
export function onKeyNeeded(ask) {
  askForKey = ask;
}

/**
 * @param {string} method
 * @param {string} path
 * @param {{json?: any, signal?: AbortSignal}} [options]
 * @returns {Promise<Response>} of a good status
 * @throws {ApiError}
 */
export async function call(method, path, { json, signal } = {}) {
  const keyBefore = apiKey();
  const headers = { ...authorization(), ...(json === undefined ? {} : { 'Content-Type': 'application/json' }) };
  const body = json === undefined ? undefined : JSON.stringify(json);
  let response;
  try {
    response = await fetch(urlOf(path), { method, headers, body, signal });
  } catch (cause) {
    if (signal?.aborted) throw cause;
    throw new ApiError(0, { code: 'unreachable', message: 'the server cannot be reached' });
  }
  if (response.ok) return response;
  if (response.status !== 401) throw errorFrom(response.status, await response.text());
  await renewKey(keyBefore);
  return call(method, path, { json, signal });
}

/**
 * Waits until there is another key than the refused one.
 * @param {string | null} refused
 */
export async function renewKey(refused) {
  if (apiKey() !== refused) return;
  asking ??= askForKey(refused !== null).finally(() => {
    asking = null;
  });
  setApiKey(await asking);
}

const json = async (method, path, body, signal) => (await call(method, path, { json: body, signal })).json();
const part = encodeURIComponent;

export const api = {
  server: () => json('GET', 'v1/server'),
  volumes: async () => (await json('GET', 'v1/volumes')).volumes,
  volume: (id) => json('GET', `v1/volumes/${part(id)}`),
  loadVolume: (body, signal) => json('POST', 'v1/volumes?wait=false', body, signal),
  deleteVolume: (id, force) => call('DELETE', `v1/volumes/${part(id)}${force ? '?force=true' : ''}`),
  metadata: (id) => json('GET', `v1/volumes/${part(id)}/metadata`),
  probe: (id, [x, y, z]) => json('GET', `v1/volumes/${part(id)}/probe?x=${x}&y=${y}&z=${z}`),
  slice: (id, query, signal) => call('GET', `v1/volumes/${part(id)}/slice?${new URLSearchParams(query)}`, { signal }),
  files: (path, after) => json('GET', `v1/files?${new URLSearchParams({ path, headers: 'true', ...(after ? { after } : {}) })}`),
  histogram: (id, bins) => json('GET', `v1/volumes/${part(id)}/histogram?bins=${bins}`),
  presets: async (volume) => (await json('GET', `v1/presets?volume=${part(volume)}`)).presets,
  scenes: async () => (await json('GET', 'v1/scenes')).scenes,
  scene: (id) => json('GET', `v1/scenes/${part(id)}`),
  createScene: (scene) => json('POST', 'v1/scenes', scene),
  replaceScene: (id, scene) => json('PUT', `v1/scenes/${part(id)}`, scene),
  undo: (id) => json('POST', `v1/scenes/${part(id)}/undo`),
  redo: (id) => json('POST', `v1/scenes/${part(id)}/redo`),
  render: async (body) => (await call('POST', 'v1/render', { json: body })).blob(),
};
