// Reads zip archives, by the central directory and with every check that a reader can make.

import assert from 'node:assert/strict';
import { crc32, inflateRawSync } from 'node:zlib';

/**
 * @param {Buffer} zip
 * @returns {{name: string, bytes: Buffer}[]}
 */
export function unzip(zip) {
  const end = zip.lastIndexOf(Buffer.from('PK\x05\x06'));
  assert.ok(end >= 0, 'no end of the directory');
  let at = zip.readUInt32LE(end + 16);
  assert.equal(at + zip.readUInt32LE(end + 12), end, 'the directory has another length');
  return Array.from({ length: zip.readUInt16LE(end + 10) }, () => {
    assert.equal(zip.readUInt32LE(at), 0x02014b50, 'no directory entry');
    const [method, crc, packed, size] = [zip.readUInt16LE(at + 10), ...[16, 20, 24].map((offset) => zip.readUInt32LE(at + offset))];
    const [named, extra, comment] = [28, 30, 32].map((offset) => zip.readUInt16LE(at + offset));
    const name = zip.toString('utf8', at + 46, at + 46 + named);
    const local = zip.readUInt32LE(at + 42);
    assert.equal(zip.readUInt32LE(local), 0x04034b50, `no header of ${name}`);
    assert.equal(zip.toString('utf8', local + 30, local + 30 + zip.readUInt16LE(local + 26)), name);
    const begin = local + 30 + zip.readUInt16LE(local + 26) + zip.readUInt16LE(local + 28);
    const data = zip.subarray(begin, begin + packed);
    const bytes = method === 8 ? inflateRawSync(data) : data;
    assert.equal(bytes.length, size, `${name} has another size`);
    assert.equal(crc32(bytes), crc, `${name} has another checksum`);
    at += 46 + named + extra + comment;
    return { name, bytes };
  });
}
