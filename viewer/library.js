/** The server's volumes as this page knows them, and everything that adds to or takes from them. */

import { api } from './api.js';
import { confirmDialog, describeRawFile } from './dialogs.js';
import { formatBytes } from './dom.js';
import { groupFiles } from './file_groups.js';
import { Loads } from './loads.js';
import { Emitter } from './store.js';
import { toast, toastError } from './toast.js';
import { needsDescription, upload, volumeName } from './upload.js';
import { zipOf } from './zip.js';

/** Emits `change` (the list). */
export class Library extends Emitter {
  /** Those that can be shown. @type {import('./store.js').Volume[]} */ volumes = [];
  /** Those that cannot yet, or could not. */
  loads = new Loads();
  /** Longest file that the server takes. */
  maxBytes = Infinity;
  /** @type {Map<string, string>} Volume to the scene that this page last showed of it. */ #scenes = new Map();

  /**
   * @param {import('./session.js').Session} session
   * @param {import('./picture.js').Picture} picture
   */
  constructor(session, picture) {
    super();
    this.session = session;
    this.picture = picture;
    this.loads.on('ready', (ready) => this.#ready(ready));
    this.loads.on('dismissed', () => this.refresh());
    session.on('settled', () => {
      const { volume, store } = session;
      if (volume && store.id) this.#scenes.set(volume.id, store.id);
      if (volume && !this.volumes.some(({ id }) => id === volume.id)) this.refresh();
    });
  }

  /** Asks the server for the list. */
  async refresh() {
    try {
      const all = await api.volumes();
      const isComing = ({ state }) => state === 'loading' || state === 'failed';
      this.volumes = all.filter((volume) => !isComing(volume));
      this.loads.adopt(all.filter(isComing));
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

  /**
   * Files of this computer, each volume a load of its own.
   * @param {import('./file_groups.js').Found[]} found
   */
  async openFiles(found) {
    let sorted;
    try {
      sorted = await groupFiles(found);
    } catch (error) {
      toastError(error);
      return;
    }
    const { groups, passedOver } = sorted;
    if (groups.length === 0) toast('No volume is among these files.', 'error');
    else if (passedOver > 0) toast(`${passedOver} other file${passedOver === 1 ? ' was' : 's were'} passed over.`);
    for (const group of groups) await this.#openGroup(group);
  }

  /**
   * A file or folder of the server, an address, or what the server computes.
   * @param {string} name
   * @param {Record<string, any>} source
   */
  openSource(name, source) {
    const what = 'procedural' in source ? 'computing' : 'url' in source ? 'fetching' : 'reading';
    this.loads.start(name, (choice, signal, report) => {
      report(what);
      return api.loadVolume({ name, source: { ...source, ...choice } }, signal);
    });
  }

  /**
   * @param {string} kind
   * @param {number} size voxels along every axis
   */
  makeProcedural(kind, size) {
    this.openSource(`${kind}-${size}`, { procedural: { kind, dims: [size, size, size], seed: 1 } });
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

  /** @param {import('./file_groups.js').Group} group */
  async #openGroup(group) {
    if ('files' in group) {
      const format = group.format ? { format: group.format } : {};
      const name = (group.format ? group.name : volumeName(group.name)).slice(0, 200);
      this.loads.start(group.name, async (choice, signal, report) => {
        const archive = await zipOf(group.files, (fraction) => report('packing', fraction), signal);
        return this.#send(archive, { name, ...format, ...choice }, report, signal);
      });
      return;
    }
    const { name, file } = group;
    const query = needsDescription(file) ? await describeRawFile(file) : {};
    if (!query) return;
    this.loads.start(name, (choice, signal, report) =>
      this.#send(file, { name: volumeName(name), ...query, ...choice }, report, signal));
  }

  async #send(file, query, report, signal) {
    // Told before it is sent: a server that refuses in the middle can only break the connection.
    if (file.size > this.maxBytes) {
      throw new RangeError(`it has ${formatBytes(file.size)}, and this server takes ${formatBytes(this.maxBytes)} at most`);
    }
    report('sending', 0);
    return upload(file, query, (fraction) => (fraction < 1 ? report('sending', fraction) : report('reading')), signal);
  }

  async #ready({ volume, isShown }) {
    await this.refresh();
    // Begun elsewhere, it is shown only where there is nothing to see.
    if (!isShown && this.session.volume) return;
    await this.choose(volume);
    const notes = volume.notes ?? [];
    const more = notes.length > 1 ? `${notes.length} notes on it are under Information (I).` : notes[0] ?? '';
    toast(`“${volume.name}” is loaded. ${more.replaceAll('`', '')}`.trim());
  }
}
