/** After a restart of the server: makes a scene what it was, from the copy that this page has. */

import { api } from './api.js';

/** @typedef {import('./store.js').Scene} Scene */
/** @typedef {import('./store.js').Volume} Volume */

/**
 * The volume with the same voxels, or at least the same name and size.
 * @param {Volume[]} volumes
 * @param {{sha256?: string, name?: string, dims?: number[]} | null} wanted
 * @returns {Volume | undefined}
 */
export function findVolume(volumes, wanted) {
  if (!wanted) return undefined;
  const usable = volumes.filter(({ state }) => state !== 'failed' && state !== 'loading');
  const sameSize = (volume) => !wanted.dims || String(volume.dims) === String(wanted.dims);
  return (
    usable.find((volume) => volume.sha256 === wanted.sha256)
    ?? usable.find((volume) => volume.name === wanted.name && sameSize(volume))
  );
}

/**
 * Makes a scene that is gone again.
 * @param {Scene} scene
 * @param {Volume | null} volume that it was of
 * @returns {Promise<{answer: any, volume: Volume} | null>} null: the server does not have the volume
 * @throws {import('./api.js').ApiError}
 */
export async function remakeScene(scene, volume) {
  const twin = findVolume(await api.volumes(), volume);
  return twin ? { answer: await api.createScene({ ...scene, volume: twin.id }), volume: twin } : null;
}

/**
 * Brings a scene up to date that began anew under its old id, as the default scene of a volume does.
 * @param {any} answer the scene as the server has it
 * @param {Scene} scene
 * @param {Volume | null} volume that it was of
 * @returns {Promise<{answer: any, volume: Volume, isRestored: boolean}>}
 * @throws {import('./api.js').ApiError}
 */
export async function restoreScene(answer, scene, volume) {
  const now = await api.volume(answer.volume);
  if (!findVolume([now], volume)) return { answer, volume: now, isRestored: false };
  return { answer: await api.replaceScene(answer.id, { ...scene, volume: now.id }), volume: now, isRestored: true };
}
