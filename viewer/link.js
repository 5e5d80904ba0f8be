/**
 * A scene as a link: `#s=<scene id>&d=<everything>`. The id finds the scene where it lives; the document, with the
 * camera of the view, makes it again where it does not.
 */

/**
 * @typedef {Object} LinkedScene
 * @property {{name: string, sha256: string}} volume
 * @property {number} [revision] of the scene; one that is behind is another that got the same id
 * @property {import('./store.js').Scene} scene with the camera of the view
 */

const toBase64url = (bytes) => {
  let text = '';
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text).replaceAll('+', '-').replaceAll('/', '_').replaceAll('=', '');
};

const fromBase64url = (text) =>
  Uint8Array.from(atob(text.replaceAll('-', '+').replaceAll('_', '/')), (char) => char.charCodeAt(0));

const through = (bytes, stream) => new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer();

/**
 * @param {string} sceneId
 * @param {LinkedScene} linked
 * @returns {Promise<string>} the hash, with `#`
 */
export async function hashOf(sceneId, linked) {
  const bytes = new TextEncoder().encode(JSON.stringify(linked));
  const packed = await through(bytes, new CompressionStream('deflate-raw'));
  return `#s=${encodeURIComponent(sceneId)}&d=${toBase64url(new Uint8Array(packed))}`;
}

/**
 * @param {string} hash
 * @returns {Promise<{sceneId: string | null, linked: LinkedScene | null}>}
 */
export async function parseHash(hash) {
  const fields = new URLSearchParams(hash.replace(/^#/, ''));
  let linked = null;
  try {
    const packed = fields.get('d');
    if (packed) {
      const bytes = await through(fromBase64url(packed), new DecompressionStream('deflate-raw'));
      const parsed = JSON.parse(new TextDecoder().decode(bytes));
      if (parsed?.volume && parsed?.scene) linked = parsed;
    }
  } catch {
    // A link that was cut short still has its id.
  }
  return { sceneId: fields.get('s'), linked };
}
