/** The server's volumes as this page knows them, and everything that adds to or takes from them. */

import { api } from './api.js';
import { confirmDialog, describeRawFile } from './dialogs.js';
import { formatBytes, h } from './dom.js';
import { icon } from './icons.js';
import { Emitter } from './store.js';
import { toast, toastError } from './toast.js';
import { needsDescription, upload } from './upload.js';

/** Emits `change` (the list) and `upload` (an element that shows one upload). */
export class Library extends Emitter {
  /** @type {import('./store.js').Volume[]} */ volumes = [];
  /** @type {Map<string, string>} Volume to the scene that this page last showed of it. */ #scenes = new Map();

  /**
   * @param {import('./session.js').Session} session
   * @param {import('./picture.js').Picture} picture
   */
  constructor(session, picture) {
    super();
    this.session = session;
    this.picture = picture;
    session.on('settled', () => {
      const { volume, store } = session;
      if (volume && store.id) this.#scenes.set(volume.id, store.id);
      if (volume && !this.volumes.some(({ id }) => id === volume.id)) this.refresh();
    });
  }

  /** Asks the server for the list. */
  async refresh() {
    try {
      this.volumes = await api.volumes();
      this.emit('change');
    } catch (error) {
      toastError(error);
    }
    return this.volumes;
  }

  /**
   * Shows a volume: its last scene of this page, or a new one.
   * @param {import('./store.js').Volume} volume
   */
  async choose(volume) {
    if (volume.id === this.session.volume?.id) return;
    try {
      const known = this.#scenes.get(volume.id);
      const scene = known ? await api.scene(known).catch(() => null) : null;
      const viewport = { ...this.picture.size };
      await this.session.open(scene ?? (await api.createScene({ volume: volume.id, viewport })));
    } catch (error) {
      toastError(error);
    }
  }

  /** @param {File[]} files one after the other: the last one is shown */
  async uploadFiles(files) {
    for (const file of files) await this.#uploadFile(file);
  }

  /**
   * @param {string} kind
   * @param {number} size voxels along every axis
   */
  async makeProcedural(kind, size) {
    const row = uploadRow(`${kind.replaceAll('_', ' ')} ${size}³`, null);
    this.emit('upload', row.element);
    row.busy('Computing');
    try {
      const source = { procedural: { kind, dims: [size, size, size], seed: 1 } };
      await this.#added(await api.createVolume({ name: `${kind}-${size}`, source }));
      row.element.remove();
    } catch (error) {
      row.failed(error);
    }
  }

  /** @param {import('./store.js').Volume} volume */
  async remove(volume) {
    const isShown = volume.id === this.session.volume?.id;
    const question = `Delete “${volume.name}” from the server?`;
    if (!(await confirmDialog(question, 'Everyone who looks at it loses it.', 'Delete'))) return;
    try {
      await api.deleteVolume(volume.id, false);
    } catch (error) {
      if (error.code !== 'volume_in_use') return toastError(error);
      const count = error.details?.scenes?.length ?? 'some';
      const sure = await confirmDialog(question, `It is in use by ${count} scene${count === 1 ? '' : 's'}.`, 'Delete anyway');
      if (!sure) return undefined;
      try {
        await api.deleteVolume(volume.id, true);
      } catch (failure) {
        return toastError(failure);
      }
    }
    this.#scenes.delete(volume.id);
    if (isShown) this.session.close();
    return this.refresh();
  }

  async #uploadFile(file) {
    const query = needsDescription(file) ? await describeRawFile(file) : {};
    if (!query) return;
    const abort = new AbortController();
    const row = uploadRow(file.name, () => abort.abort());
    this.emit('upload', row.element);
    try {
      const volume = await upload(file, query, (fraction) => {
        if (fraction < 1) row.progress(fraction, `${formatBytes(file.size * fraction)} of ${formatBytes(file.size)}`);
        else row.busy('Reading');
      }, abort.signal);
      await this.#added(volume);
      row.element.remove();
      toast(`“${volume.name}” is loaded.`);
    } catch (error) {
      row.failed(error);
    }
  }

  async #added(volume) {
    await this.refresh();
    await this.choose(volume);
  }
}

/** One upload in the list: how far it is, a way to stop it, and what went wrong. */
function uploadRow(name, cancel) {
  const text = h('span', { class: 'facts-line', role: 'status' }, 'Waiting');
  const bar = h('progress', { max: 1, 'aria-label': `Upload of ${name}` });
  const close = h('button', {
    type: 'button', class: 'icon-button', 'aria-label': cancel ? `Cancel ${name}` : `Dismiss ${name}`,
    onclick: () => {
      cancel?.();
      element.remove();
    },
  }, icon('close'));
  const element = h('div', { class: 'upload' }, h('span', { class: 'name' }, name), text, bar, close);
  return {
    element,
    progress(fraction, words) {
      bar.value = fraction;
      text.textContent = words;
    },
    busy(word) {
      bar.removeAttribute('value');
      text.textContent = `${word}…`;
    },
    failed(error) {
      if (error?.code === 'cancelled') {
        element.remove();
        return;
      }
      bar.remove();
      element.classList.add('failed');
      text.setAttribute('role', 'alert');
      text.textContent = error?.message ?? String(error);
      if (error?.requestId) text.title = `${error.code} · request ${error.requestId}`;
    },
  };
}
