/** Files to the server, with progress: fetch cannot tell how much has been sent, so this is an XMLHttpRequest. */

import { ApiError, apiKey, authorization, errorFrom, renewKey, urlOf } from './api.js';
import { foundInDrop } from './file_groups.js';
import { toastError } from './toast.js';

/**
 * @param {Blob} file
 * @param {Record<string, string>} query `name`, and what else the server should know of the file
 * @param {(fraction: number) => void} onProgress of sending; 1 while the server still reads
 * @param {AbortSignal} [signal]
 * @returns {Promise<import('./store.js').Volume>} perhaps still loading
 * @throws {ApiError}
 */
export async function upload(file, query, onProgress, signal) {
  const keyBefore = apiKey();
  try {
    return await send(file, query, onProgress, signal);
  } catch (error) {
    if (error.status !== 401) throw error;
    await renewKey(keyBefore);
    return upload(file, query, onProgress, signal);
  }
}

function send(file, query, onProgress, signal) {
  return new Promise((resolve, reject) => {
    signal?.throwIfAborted();
    const url = urlOf('v1/volumes');
    url.search = String(new URLSearchParams({ ...query, wait: 'false' }));
    const request = new XMLHttpRequest();
    request.open('POST', url);
    for (const [name, value] of Object.entries(authorization())) request.setRequestHeader(name, value);
    // Not the browser's guess from the extension: the server looks at the bytes.
    request.setRequestHeader('Content-Type', 'application/octet-stream');
    request.upload.onprogress = ({ loaded, total }) => onProgress(total > 0 ? loaded / total : 0);
    request.upload.onload = () => onProgress(1);
    request.onload = () => {
      if (request.status === 202) resolve(JSON.parse(request.responseText));
      else reject(errorFrom(request.status, request.responseText));
    };
    const failed = (code, message) => () => reject(new ApiError(0, { code, message }));
    request.onerror = failed('unreachable', 'the connection broke while sending the file');
    request.onabort = failed('cancelled', 'cancelled');
    signal?.addEventListener('abort', () => request.abort());
    request.send(file);
  });
}

/** A file's name without what says its format. */
export const volumeName = (name) => name.replace(/(\.nii\.gz|\.tar\.gz|\.[^.]+)$/i, '').slice(0, 200) || name;

/** Whether a file says nothing about itself, so that a person has to. */
export const needsDescription = (file) => /\.(raw|bin|img|dat)$/i.test(file.name);

/**
 * Makes the whole page take files.
 * @param {HTMLElement} overlay shown while files hover
 * @param {(found: import('./file_groups.js').Found[]) => void} onFound
 */
export function attachDrop(overlay, onFound) {
  let depth = 0;
  const hasFiles = (event) => [...(event.dataTransfer?.types ?? [])].includes('Files');
  const show = (visible) => {
    if (!visible) depth = 0;
    overlay.hidden = !visible;
  };
  window.addEventListener('dragenter', (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    depth += 1;
    show(true);
  });
  window.addEventListener('dragover', (event) => hasFiles(event) && event.preventDefault());
  window.addEventListener('dragleave', (event) => {
    if (!hasFiles(event)) return;
    depth -= 1;
    if (depth <= 0) show(false);
  });
  window.addEventListener('drop', (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    show(false);
    foundInDrop(event.dataTransfer).then(onFound, toastError);
  });
}
