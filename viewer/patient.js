/** Whether a volume's world is a patient's: asked once for each volume. */

import { api } from './api.js';

/** @type {Map<string, Promise<boolean>>} */
const known = new Map();

/**
 * x to the left, y to the back, z to the head.
 * @param {import('./store.js').Volume} volume
 * @returns {Promise<boolean>} false if the server does not say
 */
export function hasPatientAxes({ id, sha256 }) {
  // After a restart of the server an id may be another volume's.
  const key = `${id} ${sha256}`;
  if (!known.has(key)) {
    known.set(key, api.metadata(id).then(({ patient_axes: isPatient }) => isPatient, () => {
      known.delete(key);
      return false;
    }));
  }
  return known.get(key);
}
