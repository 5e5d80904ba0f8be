/** Files that a person chose or dropped, sorted into volumes: slices of a series, or a header and its data, belong together. */

/** A folder may hold many; more than this at once is a mistake, not a wish. */
const MOST_VOLUMES = 20;
/** Endings of files that hold a volume each. */
const VOLUME = /\.(nrrd|nhdr|nii|mha|mhd|npy|npz|vti|tiff?|zip|tar|tgz|gz|zst|raw)$/i;
const SLICE = /\.(dcm|dicom|ima)$/i;
/** A header, of which the data may be in other files, and the first bytes of it, which name them. */
const HEADER = /\.(nhdr|mhd)$/i;
const HEADER_BYTES = 1 << 16;
/** No ending, or the last number of a unique identifier. */
const NAMELESS = /^[^.]+$|\.\d+$/;

/**
 * @typedef {{path: string, file: File}} Found `path` begins with the folder that was chosen
 * @typedef {{name: string, file: File} | {name: string, files: Found[], format?: string}} Group one volume; several
 *   files of it are sent in a zip
 */

/** @param {Iterable<File>} files of an input */
export const found = (files) => [...files].map((file) => ({ path: file.webkitRelativePath || file.name, file }));

/**
 * What was dropped, with everything in folders.
 * @param {DataTransfer} transfer read at once: it is empty after the event
 * @returns {Promise<Found[]>}
 */
export async function foundInDrop(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.() ?? null);
  if (!entries.some((entry) => entry?.isDirectory)) return found(transfer.files);
  const all = [];
  for (const entry of entries) if (entry) await walk(entry, all);
  return all;
}

/** @param {any} entry a FileSystemEntry @param {Found[]} all */
async function walk(entry, all) {
  const ask = (method, owner) => new Promise((resolve, reject) => owner[method](resolve, reject));
  if (entry.isFile) {
    all.push({ path: entry.fullPath.replace(/^\//, ''), file: await ask('file', entry) });
    return;
  }
  const reader = entry.createReader();
  // A reader tells a hundred at a time, and nothing at the end.
  for (let some = await ask('readEntries', reader); some.length > 0; some = await ask('readEntries', reader)) {
    for (const inner of some) await walk(inner, all);
  }
}

/**
 * One group for each volume. Of a folder, files of other kinds are passed over.
 * @param {Found[]} files
 * @returns {Promise<{groups: Group[], passedOver: number}>}
 * @throws {RangeError} if there are more volumes than one can mean
 */
export async function groupFiles(files) {
  const visible = files.filter(({ path }) => !path.split('/').some((part) => part.startsWith('.')));
  const packed = [];
  for (const header of visible.filter(({ file }) => HEADER.test(file.name))) {
    const data = await dataOf(header, visible);
    if (data.length > 0) packed.push([header, ...data]);
  }
  const inPacked = new Set(packed.flat());
  const isSlice = ({ file }) => SLICE.test(file.name) || (NAMELESS.test(file.name) && !VOLUME.test(file.name));
  const rest = visible.filter((one) => !inPacked.has(one));
  const slices = rest.filter(isSlice);
  const isMeant = ({ path, file }) => VOLUME.test(file.name) || !path.includes('/');
  const alone = rest.filter((one) => !isSlice(one) && isMeant(one));
  const count = alone.length + packed.length;
  if (count > MOST_VOLUMES) {
    throw new RangeError(`these are ${count} volumes; choose at most ${MOST_VOLUMES} at once, or pack the slices of one into a zip file`);
  }
  /** @type {Group[]} */
  const groups = alone.map(({ file }) => ({ name: file.name, file }));
  if (slices.length === 1) groups.push({ name: slices[0].file.name, file: slices[0].file });
  else if (slices.length > 1) groups.push({ name: nameOf(slices), files: slices, format: 'dicom' });
  for (const files of packed) groups.push({ name: files[0].file.name, files });
  return { groups, passedOver: files.length - alone.length - slices.length - inPacked.size };
}

/**
 * The files that a header says its data are in, as far as they were chosen too.
 * @param {Found} header @param {Found[]} files
 */
async function dataOf(header, files) {
  const folder = header.path.slice(0, header.path.lastIndexOf('/') + 1);
  const isNamed = namesIn(await header.file.slice(0, HEADER_BYTES).text());
  return files.filter((one) => one !== header && one.path.startsWith(folder) && isNamed(one.path.slice(folder.length)));
}

/**
 * Whether a header of NRRD or MetaImage names a file: alone, in a list, or by a pattern with a number.
 * @param {string} text @returns {(name: string) => boolean}
 */
export function namesIn(text) {
  const field = text.match(/^(?:data ?file:|ElementDataFile\s*=)\s*(.+?)\s*$/im);
  const value = field?.[1] ?? '';
  const plain = (name) => name.trim().replace(/^(\.\/)+/, '');
  if (/^LIST\b/.test(value)) {
    const names = new Set(text.slice(field.index).split(/\r?\n/).slice(1).map(plain));
    return (name) => names.has(name);
  }
  const [, before, after] = value.match(/^(.*)%\d*d(\S*)(?:\s+-?\d+)+$/) ?? [];
  if (before === undefined) return (name) => name === plain(value);
  const start = plain(before);
  return (name) => name.startsWith(start) && name.endsWith(after) && /^\d+$/.test(name.slice(start.length, name.length - after.length));
}

/** The folder that slices lie in, else how many they are. @param {Found[]} slices */
function nameOf(slices) {
  const [folder] = slices[0].path.split('/');
  const isFolder = slices.every(({ path }) => path.startsWith(`${folder}/`));
  return isFolder ? folder : `${slices.length} slices`;
}
