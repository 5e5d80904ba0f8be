/** The server's data directory: folders to go into, files to load with one click. */

import { api } from './api.js';
import { choiceIn } from './choice.js';
import { button } from './controls.js';
import { formatBytes, h } from './dom.js';
import { icon } from './icons.js';
import { volumeName } from './upload.js';

/** Where a person was last. */
let lastPath = '';

/**
 * @param {(name: string, source: {path: string}) => void} load
 * @returns {HTMLElement}
 */
export function serverFiles(load) {
  const crumbs = h('nav', { class: 'crumbs', 'aria-label': 'Folder' });
  const list = h('ul', { class: 'files' });
  const note = h('p', { role: 'status' });
  const whole = button('', () => {}, { class: 'button', hidden: true });
  const more = button('More', () => {}, { class: 'button quiet', hidden: true });
  /** Which folder is wanted: answers for another come too late. */
  let wanted = '';

  const go = async (path, isAsked) => {
    wanted = path;
    lastPath = path;
    crumbs.replaceChildren(...crumbsOf(path, (to) => go(to, true)));
    list.replaceChildren();
    note.textContent = 'Reading the folder…';
    whole.hidden = true;
    more.hidden = true;
    await page(path, null);
    // The button that was pressed is gone; the list begins anew.
    if (isAsked && wanted === path) (list.querySelector('button') ?? crumbs.querySelector('button'))?.focus();
  };

  const page = async (path, after) => {
    let answer;
    try {
      answer = await api.files(path, after);
    } catch (error) {
      if (wanted === path) note.textContent = error.message;
      return;
    }
    if (wanted !== path) return;
    const { entries, next } = answer;
    list.append(...entries.map((entry) => h('li', {}, entryOf(entry, go, load))));
    note.textContent = list.children.length === 0 ? 'This folder is empty.' : '';
    more.hidden = next === null;
    more.onclick = () => page(path, next);
    if (path !== '' && entries.some(isSlice)) offerWhole(path);
  };

  const offerWhole = (path) => {
    const name = path.split('/').pop();
    whole.textContent = `Load “${name}” as one DICOM series`;
    whole.onclick = () => load(name, { path });
    whole.hidden = false;
  };

  go(lastPath, false);
  return h('div', { class: 'stack' }, crumbs, whole, h('div', { class: 'files-box' }, list, note, more));
}

/** Whether a file may be one slice of a series. */
const isSlice = ({ kind, format, dims }) => kind === 'file' && (format === 'dicom' || format === null) && dims?.[2] === 1;

function crumbsOf(path, go) {
  const parts = path === '' ? [] : path.split('/');
  const steps = [['Data', ''], ...parts.map((part, i) => [part, parts.slice(0, i + 1).join('/')])];
  return steps.map(([name, to], i) => (i === steps.length - 1
    ? h('span', { 'aria-current': 'page' }, name)
    : h('span', {}, button(name, () => go(to), { class: 'button quiet' }), h('span', { 'aria-hidden': 'true' }, '/'))));
}

function entryOf({ kind, name, path, bytes, format, dims, voxel_type: type, error }, go, load) {
  const isFolder = kind === 'directory';
  const choice = error ? choiceIn(error) : null;
  const several = choice && `${choice.options.length} ${choice.parameter === 'series' ? 'series' : 'channels'}`;
  // What is not recognised may be anything, and is no fault of the file.
  const isVolume = isFolder || !error || Boolean(format);
  const facts = [format, several, dims?.join(' × '), type, bytes === undefined ? null : formatBytes(bytes)];
  return h('button', {
    type: 'button', class: 'volume', disabled: !isVolume,
    onclick: () => (isFolder ? go(path, true) : load(volumeName(name), { path })),
  }, icon(isFolder ? 'folder' : 'file'), h('span', { class: 'name' }, name),
  isFolder ? null : h('span', { class: 'facts-line' }, isVolume ? facts.filter(Boolean).join(' · ') : 'not a volume'),
  error && isVolume && !choice ? h('span', { class: 'facts-line fault' }, error) : null);
}
