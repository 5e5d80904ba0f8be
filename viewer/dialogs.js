/** Questions and forms in front of the page, as native dialogs: focus, Escape and labels come with them. */

import { api } from './api.js';
import { button, copyText, numberField, segments, toggle } from './controls.js';
import { h } from './dom.js';
import { icon } from './icons.js';
import { toast, toastError } from './toast.js';

/**
 * Opens a dialog; resolves when it is closed, with its return value.
 * @param {string} title
 * @param {(close: (value?: string) => void) => Node[]} build the content
 * @param {string} [kind] a class for what is special to it
 * @returns {Promise<string>}
 */
export function openDialog(title, build, kind) {
  return new Promise((resolve) => {
    const dialog = h('dialog', { 'aria-label': title, class: kind });
    const close = (value = '') => dialog.close(value);
    const dismiss = h('button', { type: 'button', class: 'icon-button', 'aria-label': 'Close', onclick: () => close() }, icon('close'));
    dialog.append(h('header', {}, h('h2', {}, title), dismiss), ...build(close));
    dialog.addEventListener('click', (event) => event.target === dialog && close());
    dialog.addEventListener('close', () => {
      dialog.remove();
      resolve(dialog.returnValue);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}

const footer = (...children) => h('footer', {}, ...children);
const primary = (text, props = {}) => h('button', { type: 'submit', class: 'button primary', ...props }, text);

/**
 * @param {string} question
 * @param {string} text
 * @param {string} word on the button
 */
export async function confirmDialog(question, text, word) {
  const answer = await openDialog(question, (close) => [
    h('p', {}, text),
    footer(button('Cancel', () => close()), button(word, () => close('yes'), { class: 'button danger', autofocus: true })),
  ]);
  return answer === 'yes';
}

/** Asks for an API key. @param {boolean} wrong whether one was refused */
export async function askForKey(wrong) {
  let key = '';
  while (!key) {
    const input = h('input', { type: 'password', autocomplete: 'off', 'aria-label': 'API key', required: true, autofocus: true });
    await openDialog('This server needs an API key', (close) => [
      h('p', {}, wrong ? 'The last key was not accepted.' : 'It is kept for this tab only.'),
      h('form', {
        class: 'stack', onsubmit: (event) => {
          event.preventDefault();
          key = input.value.trim();
          close();
        },
      }, input, footer(primary('Continue'))),
    ]);
  }
  return key;
}

/** The scene as a link and as JSON. @param {string} link @param {any} scene */
export function shareDialog(link, scene) {
  const field = h('input', { type: 'text', readonly: true, 'aria-label': 'Link', value: link, onfocus: () => field.select() });
  const text = JSON.stringify(scene, null, 2);
  const area = h('textarea', { readonly: true, rows: 12, spellcheck: 'false', 'aria-label': 'Scene as JSON' }, text);
  const copy = (what, content) => button('Copy', async (event) => {
    await copyText(content);
    event.target.textContent = 'Copied';
  }, { 'aria-label': `Copy ${what}` });
  return openDialog('Share this view', () => [
    h('p', {}, 'The link opens this scene with this view, and makes it again where it is gone.'),
    h('div', { class: 'row' }, field, copy('the link', link)),
    h('div', { class: 'row spread' }, h('h3', {}, 'Scene document'), copy('the JSON', text)),
    area,
  ]);
}

/**
 * Saves the exact picture in a chosen size.
 * @param {any} scene with the camera of the view
 * @param {{width: number, height: number}} size
 * @param {number} limit longest side the server draws
 * @param {string} name
 */
export function saveDialog(scene, size, limit, name) {
  let { width, height } = size;
  let format = 'png';
  const set = (w, h2) => {
    [width, height] = [w, h2];
    widthField.set(w);
    heightField.set(h2);
  };
  const widthField = numberField({ label: 'Width', min: 1, max: limit, unit: 'px', onInput: (value) => set(Math.round(value), height) });
  const heightField = numberField({ label: 'Height', min: 1, max: limit, unit: 'px', onInput: (value) => set(width, Math.round(value)) });
  set(width, height);
  const formats = segments({
    label: 'Format', options: [['png', 'PNG'], ['webp', 'WebP'], ['jpeg', 'JPEG']], onInput: (value) => {
      format = value;
    },
  });
  formats.set(format);
  let isTransparent = false;
  const transparent = toggle({
    label: 'Transparent background', onInput: (on) => {
      isTransparent = on;
    },
  });
  const sizes = [['This view', size.width, size.height], ['2 ×', size.width * 2, size.height * 2], ['Full HD', 1920, 1080], ['4K', 3840, 2160]]
    .filter(([, w, h2]) => w <= limit && h2 <= limit)
    .map(([text, w, h2]) => button(text, () => set(w, h2), { class: 'button quiet' }));
  return openDialog('Save picture', (close) => {
    const submit = primary('Save');
    return [h('form', {
      class: 'stack', onsubmit: async (event) => {
        event.preventDefault();
        submit.disabled = true;
        submit.textContent = 'Drawing…';
        const rendering = isTransparent
          ? { ...scene.rendering, background: `${(scene.rendering.background ?? '#000000').slice(0, 7)}00` }
          : scene.rendering;
        try {
          download(await api.render({ scene: { ...scene, rendering }, width, height, format }), `${name}.${format}`);
          close();
        } catch (error) {
          toastError(error);
          submit.disabled = false;
          submit.textContent = 'Save';
        }
      },
    }, h('div', { class: 'row' }, ...sizes), h('div', { class: 'row' }, widthField.element, heightField.element),
    formats.element, transparent.element, footer(submit))];
  });
}

/** @param {Blob} blob @param {string} name */
function download(blob, name) {
  const url = URL.createObjectURL(blob);
  const link = h('a', { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
  toast(`Saved ${name}.`);
}

/**
 * What a file without a header holds.
 * @param {File} file
 * @returns {Promise<Record<string, string> | null>} query of the upload; null: cancelled
 */
export async function describeRawFile(file) {
  const cube = Math.max(1, Math.round(Math.cbrt(file.size)));
  const dims = h('input', { type: 'text', value: `${cube},${cube},${cube}`, 'aria-label': 'Voxels along x, y, z', pattern: '\\s*\\d+\\s*,\\s*\\d+\\s*,\\s*\\d+\\s*', required: true, autofocus: true });
  const spacing = h('input', { type: 'text', value: '1,1,1', 'aria-label': 'Spacing along x, y, z', required: true });
  const type = h('select', { 'aria-label': 'Voxel type' },
    ...['u8', 'i8', 'u16', 'i16', 'u32', 'i32', 'u64', 'i64', 'f32', 'f64'].map((name) => h('option', {}, name)));
  const endian = h('select', { 'aria-label': 'Byte order' }, h('option', {}, 'little'), h('option', {}, 'big'));
  let query = null;
  const labelled = (text, input) => h('label', { class: 'control field' }, h('span', {}, text), input);
  await openDialog(`What is in ${file.name}?`, (close) => [
    h('p', {}, `${file.size.toLocaleString()} bytes without a header.`),
    h('form', {
      class: 'stack', onsubmit: (event) => {
        event.preventDefault();
        const clean = (text) => text.replaceAll(/\s/g, '');
        query = {
          format: 'raw', dims: clean(dims.value), type: type.value, endian: endian.value, spacing: clean(spacing.value),
        };
        close();
      },
    }, labelled('Voxels x, y, z', dims), labelled('Type', type), labelled('Byte order', endian), labelled('Spacing', spacing),
    footer(primary('Upload'))),
  ]);
  return query;
}

const KEYS = [
  ['Drag, one finger', 'orbit'], ['Shift or right drag, two fingers', 'pan'], ['Wheel, pinch', 'zoom'],
  ['Arrow keys', 'orbit; with Shift pan'], ['+  −', 'zoom'], ['F, Home', 'show the whole volume'],
  ['1 … 6', 'front, back, left, right, top, bottom'], ['O (hold)', 'without ambient occlusion'],
  ['S', 'slices'], ['I', 'about this volume'], ['Ctrl Z, Ctrl Shift Z', 'undo, redo'], ['H', 'hide or show the panel'], ['?', 'this list'],
];

/** What the mouse and the keys do. */
export function helpDialog() {
  return openDialog('Mouse, touch and keys', () => [
    h('dl', { class: 'keys' }, ...KEYS.flatMap(([key, meaning]) => [h('dt', {}, key), h('dd', {}, meaning)])),
  ]);
}
