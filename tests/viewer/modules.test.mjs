// Parts of the viewer that need no picture, as the browser runs them.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { unzip } from './archive.mjs';
import { useServer, withViewer } from './harness.mjs';

useServer();

/** Runs `body` in the page with a module of the viewer. */
const withModule = (name, body, argument) => {
  let answer;
  return withViewer(async (page) => {
    answer = await page.evaluate(`(async () => (${body})(await import('/viewer/${name}.js'), ${JSON.stringify(argument)}))()`);
  }).then(() => answer);
};

test('an archive that the page makes has every file, unchanged', async () => {
  const base64 = await withModule('zip', async ({ zipOf }) => {
    const file = (bytes) => new Blob([Uint8Array.from(bytes)]);
    const long = Uint8Array.from({ length: 200_000 }, (_, i) => (i * 7919) >> 3);
    const archive = await zipOf([
      { path: 'Schädel/0.dcm', file: file([1, 2, 3]) }, { path: 'empty', file: file([]) }, { path: 'long', file: new Blob([long]) },
    ]);
    return new Promise((resolve) => {
      const reader = new FileReader();
      reader.onload = () => resolve(String(reader.result).split(',')[1]);
      reader.readAsDataURL(archive);
    });
  });
  const zip = Buffer.from(base64, 'base64');
  const files = unzip(zip);
  assert.deepEqual(files.map(({ name }) => name), ['Schädel/0.dcm', 'empty', 'long']);
  assert.deepEqual([...files[0].bytes], [1, 2, 3]);
  assert.equal(files[1].bytes.length, 0);
  assert.ok(files[2].bytes.every((byte, i) => byte === (((i * 7919) >> 3) & 0xff)));
  const damaged = Buffer.from(zip);
  damaged[zip.indexOf(Buffer.from([1, 2, 3]))] ^= 1;
  assert.throws(() => unzip(damaged), /another checksum/);
});

test('the reader of these tests reads an archive of another program', () => {
  const archive = readFileSync(fileURLToPath(new URL('../data/dicom/explicit.zip', import.meta.url)));
  assert.deepEqual(unzip(archive).map(({ name }) => name), ['README.TXT', 'DICOM/IM0', 'DICOM/IM1', 'DICOM/IM2']);
});

test('chosen files are sorted into volumes, and slices of a series belong together', async () => {
  const sort = (paths) => withModule('file_groups', async ({ groupFiles }, list) => {
    const found = list.map((one) => [one].flat()).map(([path, text]) => ({ path, file: new File([text ?? 'x'], path.split('/').pop()) }));
    try {
      const { groups, passedOver } = await groupFiles(found);
      return { groups: groups.map(({ name, files }) => [name, files ? files.length : 0]), passedOver };
    } catch (error) {
      return error.message;
    }
  }, paths);
  assert.deepEqual(await sort(['a.nrrd', 'b.nii.gz', 'c.xyz']), { groups: [['a.nrrd', 0], ['b.nii.gz', 0], ['c.xyz', 0]], passedOver: 0 });
  assert.deepEqual(await sort(['0.dcm', '1.dcm', '2.dcm']), { groups: [['3 slices', 3]], passedOver: 0 });
  assert.deepEqual(await sort(['one.dcm']), { groups: [['one.dcm', 0]], passedOver: 0 });
  const study = ['study/.DS_Store', 'study/readme.txt', 'study/a/IM0', 'study/a/IM1', 'study/b/1.2.840.17'];
  assert.deepEqual(await sort(study), { groups: [['study', 3]], passedOver: 2 });
  // A header takes what it names, in its folder or below, and nothing else.
  const one = ['a/ct.mhd', 'ObjectType = Image\nElementDataFile = ct_data.raw\n'];
  const list = ['a/v.nhdr', 'NRRD0001\nencoding: raw\ndata file: LIST\ns.0\n./deeper/s.1\n'];
  const pattern = ['a/p.nhdr', 'NRRD0001\ndatafile: p%02d.raw 0 1 1\nencoding: raw\n'];
  const others = ['a/ct_data.raw', 'a/s.0', 'a/deeper/s.1', 'a/p00.raw', 'a/p01.raw', 'a/px.raw', 'ct_data.raw', 'a/notes.txt'];
  assert.deepEqual(await sort([one, list, pattern, ...others]), {
    groups: [['px.raw', 0], ['ct_data.raw', 0], ['ct.mhd', 2], ['v.nhdr', 3], ['p.nhdr', 3]], passedOver: 1,
  });
  const local = ['l.mhd', 'ElementDataFile = LOCAL\n'];
  assert.deepEqual(await sort([local, 'l.raw', ['alone.nhdr', 'data file: gone.raw']]), {
    groups: [['l.mhd', 0], ['l.raw', 0], ['alone.nhdr', 0]], passedOver: 0,
  });
  assert.match(await sort(Array.from({ length: 21 }, (_, i) => `stack/${i}.tif`)), /21 volumes; choose at most 20/);
});

test('an error that lists series or channels becomes a question, and no other error does', async () => {
  const choice = (path, message) => withModule('choice', ({ choiceOf }, error) => choiceOf(error), { message, details: { path } });
  const series = 'source.series: 3 series are here; choose one: series=1 (CT `a, b (c)`, 1 slice), series=4 (MR, 3 slices), series=9.7 (no modality, 4 slices, not readable), and 2 more';
  assert.deepEqual(await choice('source.series', series), {
    question: '3 series are here; choose one',
    parameter: 'series',
    options: [
      { value: '1', label: 'CT a, b (c), 1 slice' }, { value: '4', label: 'MR, 3 slices' },
      { value: '9.7', label: 'no modality, 4 slices, not readable' },
    ],
  });
  const channel = 'channel: 9 is not a channel of this file; it has channel=0 (`DAPI`), channel=1, ...';
  assert.deepEqual((await choice('channel', channel)).options, [{ value: '0', label: 'DAPI' }, { value: '1', label: 'channel 1' }]);
  assert.equal(await choice('dims', series), null);
  assert.equal(await choice('series', 'series: none'), null);
});

test('a place in the world and its index are each other\'s inverse, and a box becomes the voxels it touches', async () => {
  const answer = await withModule('grid', ({ indexFromWorld, worldFromIndex, regionOfBox }) => {
    const turned = {
      spacing: [0.5, 2, 3], origin: [10, -20, 30], direction: [[0, 1, 0], [-0.6, 0, 0.8], [0.8, 0, 0.6]],
    };
    const world = worldFromIndex(turned, [3, 4, 5]);
    // Half of 100 x 60 x 41 voxels of 1 mm: blocks of two reach from -0.5 to 99.5.
    const averaged = {
      spacing: [2, 2, 2], origin: [0.5, 0.5, 0.5], direction: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
      resolution: { full_dims: [100, 60, 41], factor: [2, 2, 2], region: null },
    };
    const part = { ...averaged, resolution: { full_dims: [900, 900, 900], factor: [2, 2, 2], region: [[300, 0, 0], [400, 60, 41]] } };
    return {
      world, back: indexFromWorld(turned, world),
      region: regionOfBox(averaged, [[9.5, 0.2, -40], [19.5, 1.7, 90]]),
      inPart: regionOfBox(part, [[9.5, 0.2, -40], [19.5, 1.7, 90]]),
      outside: regionOfBox(averaged, [[200, 0, 0], [300, 10, 10]]),
    };
  });
  assert.deepEqual(answer.world.map((x) => Number(x.toFixed(9))), [10 - 4.8 + 12, -20 + 1.5, 30 + 6.4 + 9]);
  answer.back.forEach((x, i) => assert.ok(Math.abs(x - [3, 4, 5][i]) < 1e-9, String(answer.back)));
  assert.deepEqual(answer.region, [[10, 0, 0], [20, 3, 41]]);
  assert.deepEqual(answer.inPart, [[310, 0, 0], [320, 3, 41]]);
  assert.equal(answer.outside, null);
});

test('of many requests one is under way, and the last one is made', async () => {
  const { made, most } = await withModule('latest', async ({ Latest }) => {
    const made = [];
    let now = 0;
    let most = 0;
    const latest = new Latest(async (value) => {
      now += 1;
      most = Math.max(most, now);
      await new Promise((resolve) => setTimeout(resolve, 20));
      now -= 1;
      made.push(value);
    });
    const all = [];
    for (let i = 0; i < 50; i += 1) all.push(latest.ask(i));
    await Promise.all(all);
    return { made, most };
  });
  assert.deepEqual(made, [0, 49]);
  assert.equal(most, 1);
});
