/** The dialog that opens data: from this device, from the server's data directory, or from an address. */

import { button, segments } from './controls.js';
import { openDialog } from './dialogs.js';
import { h } from './dom.js';
import { found } from './file_groups.js';
import { icon } from './icons.js';
import { serverFiles } from './server_files.js';

/** What is chosen again next time. */
let lastWay = 'device';

/** @param {import('./library.js').Library} library */
export function openDataDialog(library) {
  return openDialog('Open data', (close) => {
    const openSource = (name, source) => {
      close();
      library.openSource(name, source);
    };
    const openFiles = (files) => {
      close();
      library.openFiles(files);
    };
    const ways = {
      device: () => fromDevice(openFiles),
      server: () => serverFiles(openSource),
      address: () => fromAddress(openSource),
    };
    // Made when they are looked at: the server's files are asked for.
    const made = {};
    const place = h('div', { class: 'way' });
    const show = (way) => {
      lastWay = way;
      made[way] ??= ways[way]();
      place.replaceChildren(made[way]);
    };
    const choice = segments({
      label: 'From', options: [['device', 'This device'], ['server', 'Server'], ['address', 'Address']], onInput: show,
    });
    choice.set(lastWay);
    show(lastWay);
    return [choice.element, place];
  }, 'open-data');
}

function fromDevice(openFiles) {
  const picker = (props) => {
    const input = h('input', {
      type: 'file', multiple: true, hidden: true, ...props, onchange: () => input.files.length > 0 && openFiles(found(input.files)),
    });
    return input;
  };
  const files = picker({ 'aria-label': 'Volume files' });
  const folder = picker({ 'aria-label': 'Folder of slices', webkitdirectory: true });
  const chooseFiles = button('', () => files.click(), { class: 'button primary', autofocus: true });
  chooseFiles.append(icon('file'), 'Choose files');
  const chooseFolder = button('', () => folder.click());
  chooseFolder.append(icon('folder'), 'Choose a folder');
  return h('div', { class: 'stack' },
    h('p', {}, 'NRRD, NIfTI, MetaImage, NumPy, VTK, TIFF, DICOM, Zarr (as a zip). Several DICOM slices, or a folder of them, become one volume, and so do a header (.nhdr, .mhd) and its data. Files can also be dropped anywhere on the page.'),
    h('div', { class: 'row' }, files, folder, chooseFiles, chooseFolder));
}

function fromAddress(openSource) {
  const input = h('input', {
    type: 'text', inputmode: 'url', autocomplete: 'off', spellcheck: 'false', required: true, 'aria-label': 'Address',
    placeholder: 'https://… or s3://…',
  });
  return h('form', {
    class: 'stack', onsubmit: (event) => {
      event.preventDefault();
      const url = input.value.trim();
      if (url) openSource(nameOfAddress(url), { url });
    },
  }, h('p', {}, 'The server fetches the file, from where its operator allows by ', h('code', {}, '--allow-source'), '.'),
  h('div', { class: 'row' }, input, h('button', { type: 'submit', class: 'button primary' }, 'Load')));
}

/** The last part of a path, without what says the format. @param {string} url */
function nameOfAddress(url) {
  const last = url.replace(/[?#].*$/, '').split('/').filter(Boolean).pop() ?? url;
  return last.slice(0, 200);
}
