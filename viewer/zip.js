/** Zip archives (APPNOTE 6.3) of files as they are: how many slices travel as one upload. */

/** Names are UTF-8. */
const FLAGS = 0x0800;
/** 1 January 1980, as a date of DOS: when a file was changed is nobody's business. */
const DATE = 0x0021;
const VERSION = 20;
/** Beyond these an archive needs Zip64, which is not written here. */
const MOST_FILES = 0xfffe;
const MOST_BYTES = 0xfffffffe;

const TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let rest = byte;
  for (let bit = 0; bit < 8; bit += 1) rest = rest & 1 ? (rest >>> 1) ^ 0xedb88320 : rest >>> 1;
  return rest >>> 0;
});

/**
 * An archive of files that are stored, not compressed. Only one file at a time is in memory.
 * @param {{path: string, file: Blob}[]} entries
 * @param {(fraction: number) => void} [onProgress]
 * @param {AbortSignal} [signal]
 * @returns {Promise<Blob>}
 */
export async function zipOf(entries, onProgress, signal) {
  const total = entries.reduce((sum, { path, file }) => sum + file.size + 2 * path.length + 128, 0);
  if (entries.length > MOST_FILES || total > MOST_BYTES) {
    throw new RangeError('these are too many files for one archive; choose fewer, or pack them yourself');
  }
  const parts = [];
  const directory = [];
  let offset = 0;
  for (const [done, { path, file }] of entries.entries()) {
    signal?.throwIfAborted();
    onProgress?.(done / entries.length);
    const name = new TextEncoder().encode(path);
    const about = { name, crc: await crcOf(file), size: file.size, offset };
    const header = localHeader(about);
    parts.push(header, file);
    directory.push(directoryEntry(about));
    offset += header.length + file.size;
  }
  const length = directory.reduce((sum, entry) => sum + entry.length, 0);
  return new Blob([...parts, ...directory, endOfDirectory(directory.length, length, offset)], { type: 'application/zip' });
}

/** CRC-32 of a file. @param {Blob} file */
async function crcOf(file) {
  let crc = 0xffffffff;
  const reader = file.stream().getReader();
  for (let chunk = await reader.read(); !chunk.done; chunk = await reader.read()) {
    for (const byte of chunk.value) crc = TABLE[(crc ^ byte) & 0xff] ^ (crc >>> 8);
  }
  return (crc ^ 0xffffffff) >>> 0;
}

/** What the local header and the directory both say. */
const common = ({ name, crc, size }) => [
  [2, VERSION], [2, FLAGS], [2, 0], [2, 0], [2, DATE], [4, crc], [4, size], [4, size], [2, name.length], [2, 0],
];

const localHeader = (about) => record([[4, 0x04034b50], ...common(about)], about.name);

const directoryEntry = (about) => record(
  [[4, 0x02014b50], [2, VERSION], ...common(about), [2, 0], [2, 0], [2, 0], [4, 0], [4, about.offset]], about.name,
);

const endOfDirectory = (count, length, offset) =>
  record([[4, 0x06054b50], [2, 0], [2, 0], [2, count], [2, count], [4, length], [4, offset], [2, 0]], new Uint8Array());

/**
 * Little-endian numbers of 2 or 4 bytes, then text.
 * @param {[number, number][]} fields bytes and value
 * @param {Uint8Array} text
 */
function record(fields, text) {
  const length = fields.reduce((sum, [bytes]) => sum + bytes, 0);
  const out = new Uint8Array(length + text.length);
  const view = new DataView(out.buffer);
  let at = 0;
  for (const [bytes, value] of fields) {
    if (bytes === 2) view.setUint16(at, value, true);
    else view.setUint32(at, value, true);
    at += bytes;
  }
  out.set(text, length);
  return out;
}
