/** JSON Merge Patch (RFC 7396): how every edit of a scene travels. */

/** @typedef {Object<string, any>} Patch */

/** @param {any} value */
const isObject = (value) => value !== null && typeof value === 'object' && !Array.isArray(value);

/**
 * `target` with `patch` applied; neither is changed.
 * @param {any} target
 * @param {any} patch
 */
export function applyPatch(target, patch) {
  if (!isObject(patch)) return patch;
  const result = isObject(target) ? { ...target } : {};
  for (const [key, value] of Object.entries(patch)) {
    if (value === null) delete result[key];
    else result[key] = applyPatch(result[key], value);
  }
  return result;
}

/**
 * One patch that does what `first` and then `second` do. Unlike applying, nulls are kept: they still have to
 * reach the server.
 * @param {Patch | null} first
 * @param {Patch} second
 * @returns {Patch}
 */
export function combinePatches(first, second) {
  if (!isObject(first) || !isObject(second)) return second;
  const result = { ...first };
  for (const [key, value] of Object.entries(second)) {
    result[key] = key in result ? combinePatches(result[key], value) : value;
  }
  return result;
}

/**
 * Text that is equal for equal JSON values, whatever the order of their keys.
 * @param {any} value
 * @returns {string}
 */
export function canonical(value) {
  const sorted = (_, inner) => (isObject(inner) ? Object.fromEntries(Object.entries(inner).sort()) : inner);
  return JSON.stringify(value, sorted);
}
