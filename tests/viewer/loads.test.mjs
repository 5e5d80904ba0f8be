// Data from this device, from the server and from an address; loads with progress, and what goes wrong with them.

import assert from 'node:assert/strict';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { unzip } from './archive.mjs';
import {
  changing, freshScene, readPicture, running, settled, smallNrrd, useServer, withViewer,
} from './harness.mjs';

const dataFile = (name) => fileURLToPath(new URL(`../data/${name}`, import.meta.url));
const slices = unzip(readFileSync(dataFile('dicom/explicit.zip'))).filter(({ name }) => name.startsWith('DICOM/'));
const several = unzip(readFileSync(dataFile('dicom/several.zip')));

/** A data directory: a volume, a folder with a series, an archive with three, and what is no volume. */
const directory = mkdtempSync(join(tmpdir(), 'viewer-'));
mkdirSync(join(directory, 'study'));
for (const { name, bytes } of slices) writeFileSync(join(directory, 'study', name.split('/').pop()), bytes);
writeFileSync(join(directory, 'several.zip'), readFileSync(dataFile('dicom/several.zip')));
writeFileSync(join(directory, 'channels.ome.tif'), readFileSync(dataFile('tiff/ome_channels.ome.tif')));
writeFileSync(join(directory, 'ball.nrrd'), smallNrrd());
writeFileSync(join(directory, 'notes.txt'), 'Nothing to see.');
after(() => rmSync(directory, { recursive: true }));

useServer(['--data-dir', directory]);

const REFUSED = { tolerated: /status of 4\d\d/ };
const octets = (name, buffer) => ({ name, mimeType: 'application/octet-stream', buffer });
const volumes = async () => (await (await fetch(`${running.url}/v1/volumes`)).json()).volumes;

async function openDialog(page, way) {
  await page.click('#section-volumes .add-volume > button');
  await page.locator('dialog.open-data label', { hasText: way }).click();
}

async function chooseFiles(page, files) {
  await openDialog(page, 'This device');
  await page.getByLabel('Volume files').setInputFiles(files);
}

const current = (page, name) => page.waitForSelector(`.volumes li.current:has(.name:text-is("${name}"))`);

test('a file is uploaded and shown, and what is wrong with another is said until it is dismissed', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await changing(page, () => chooseFiles(page, octets('small-ball.nrrd', smallNrrd())));
    await current(page, 'small-ball');
    assert.ok((await readPicture(page)).mean > 3);
    await chooseFiles(page, octets('not-a-volume.nrrd', Buffer.from('this is no volume')));
    const failure = page.locator('.upload.failed');
    await failure.waitFor();
    assert.match(await failure.textContent(), /not-a-volume\.nrrd.+/);
    await page.getByRole('button', { name: 'Dismiss not-a-volume.nrrd' }).click();
    await failure.waitFor({ state: 'detached' });
    assert.ok(!(await volumes()).some(({ state }) => state === 'failed'));
  }, { hash: await freshScene(), ...REFUSED });
});

test('several slices become one volume, whichever order they come in', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await chooseFiles(page, slices.toReversed().map(({ name, bytes }) => octets(name.split('/').pop(), bytes)));
    await current(page, '3 slices');
    const { dims, source } = (await volumes()).find(({ name }) => name === '3 slices');
    assert.deepEqual(dims, [5, 4, 3]);
    assert.equal(source.upload.format, 'dicom');
  }, { hash: await freshScene(), ...REFUSED });
});

test('a header and its data are sent together', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const header = 'NRRD0001\ntype: uint8\ndimension: 3\nsizes: 6 5 4\nencoding: raw\ndata file: pair.raw\n';
    const data = Buffer.from(Array.from({ length: 120 }, (_, i) => i));
    await chooseFiles(page, [octets('pair.raw', data), octets('pair.nhdr', Buffer.from(header))]);
    await current(page, 'pair');
    const { dims, source } = (await volumes()).find(({ name }) => name === 'pair');
    assert.deepEqual([dims, source.upload.format], [[6, 5, 4], 'nrrd']);
  }, { hash: await freshScene(), ...REFUSED });
});

test('of several series one is chosen, and the files are sent again with it', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await chooseFiles(page, several.map(({ name, bytes }) => octets(name.replace('/', '-'), bytes)));
    const group = page.getByRole('group', { name: '3 series are here; choose one' });
    await group.waitFor();
    assert.equal(await group.getByRole('button').count(), 3);
    await group.getByRole('button', { name: /Series 5.*4 slices/ }).click();
    await current(page, '8 slices');
    assert.deepEqual((await volumes()).find(({ name }) => name === '8 slices').dims, [5, 4, 4]);
  }, { hash: await freshScene(), ...REFUSED });
});

test('the server\'s files are browsed, loaded with one click, and a folder as a series', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await openDialog(page, 'Server');
    const list = page.locator('dialog .files');
    const ball = list.getByRole('button', { name: 'ball.nrrd' });
    assert.match(await ball.textContent(), /nrrd · 24 × 24 × 24 · u8 · 13\.\d KiB/);
    assert.ok(await list.getByRole('button', { name: 'notes.txt' }).isDisabled());
    assert.match(await list.getByRole('button', { name: 'several.zip' }).textContent(), /dicom · 3 series/);
    await list.getByRole('button', { name: 'study' }).click();
    await page.getByRole('button', { name: 'Load “study” as one DICOM series' }).waitFor();
    await page.getByRole('button', { name: 'Data', exact: true }).click();
    await ball.click();
    await page.waitForSelector('dialog', { state: 'detached' });
    await current(page, 'ball');
    await openDialog(page, 'Server');
    await page.locator('dialog .files').getByRole('button', { name: 'study' }).click();
    await page.getByRole('button', { name: 'Load “study” as one DICOM series' }).click();
    await current(page, 'study');
    assert.deepEqual((await volumes()).find(({ name }) => name === 'study').dims, [5, 4, 3]);
  }, { hash: await freshScene(), ...REFUSED });
});

test('an address is asked for, and the server\'s refusal is shown as it is', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await openDialog(page, 'Address');
    await page.getByRole('textbox', { name: 'Address' }).fill('https://example.org/brain.nii.gz');
    await page.keyboard.press('Enter');
    const failure = page.locator('.upload.failed');
    await failure.waitFor();
    assert.match(await failure.textContent(), /brain\.nii\.gz.*this server fetches nothing: it runs without --allow-source/);
  }, { hash: await freshScene(), ...REFUSED });
});

test('a file that is too long for the server is not sent', async () => {
  await withViewer(async (page) => {
    await page.route(/\/v1\/server$/, async (route) => {
      const server = await (await route.fetch()).json();
      return route.fulfill({ json: { ...server, limits: { ...server.limits, max_upload_bytes: 2048 } } });
    });
    await page.reload();
    await settled(page);
    let sent = 0;
    page.on('request', (request) => {
      if (request.method() === 'POST') sent += 1;
    });
    await chooseFiles(page, octets('long.nrrd', smallNrrd()));
    await row(page, 'long.nrrd').getByText('it has 13.6 KiB, and this server takes 2 KiB at most').waitFor();
    assert.equal(sent, 0);
  }, { hash: await freshScene() });
});

test('a dropped folder is read to its ground', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const found = await page.evaluate(async () => {
      const { foundInDrop } = await import('/viewer/file_groups.js');
      const file = (fullPath) => ({ isFile: true, fullPath, file: (done) => done(new File(['x'], fullPath.split('/').pop())) });
      // As browsers do: some at a time, then none.
      const folder = (fullPath, ...batches) => ({
        isDirectory: true, fullPath, createReader: () => ({ readEntries: (done) => done(batches.shift() ?? []) }),
      });
      const inner = folder('/study/b', [file('/study/b/2.dcm')]);
      const items = [folder('/study', [file('/study/0.dcm'), inner], [file('/study/1.dcm')])].map((entry) => ({ webkitGetAsEntry: () => entry }));
      return (await foundInDrop({ items, files: [] })).map(({ path }) => path);
    });
    assert.deepEqual(found, ['study/0.dcm', 'study/b/2.dcm', 'study/1.dcm']);
  });
});

/**
 * Makes loads as slow as the test wants: volumes are announced as loading, and are there when `finish` is called.
 * What is asked of the server itself is true.
 */
async function withSlowLoads(page) {
  const coming = new Map();
  const nothing = { dims: null, spacing: null, origin: null, direction: null, voxel_type: null, value_range: null, sha256: null, gpu_bytes: 0, host_bytes: 0 };
  const announced = (volume) => {
    const state = coming.get(volume.id);
    if (!state) return volume;
    return state.error ? { ...volume, ...nothing, state: 'failed', error: state.error } : { ...volume, ...nothing, state: 'loading', progress: state.progress };
  };
  await page.route(/\/v1\/volumes(\/v_[^/]*)?(\?.*)?$/, async (route) => {
    const request = route.request();
    const url = new URL(request.url());
    if (request.method() === 'POST') {
      assert.equal(url.searchParams.get('wait'), 'false');
      url.searchParams.delete('wait');
      const response = await route.fetch({ url: url.href });
      const volume = await response.json();
      if (response.status() !== 201) return route.fulfill({ response });
      coming.set(volume.id, { progress: { what: 'reading', fraction: 0 }, name: volume.name });
      return route.fulfill({ status: 202, json: announced(volume) });
    }
    if (request.method() === 'DELETE') {
      coming.delete(url.pathname.split('/').pop());
      return route.continue();
    }
    const response = await route.fetch();
    const body = await response.json();
    if (body.volumes) return route.fulfill({ json: { volumes: body.volumes.map(announced) } });
    return route.fulfill({ response, json: body.id ? announced(body) : body });
  });
  const named = (name) => [...coming].find(([, state]) => state.name === name);
  return {
    progress: (name, what, fraction) => Object.assign(named(name)[1], { progress: { what, fraction } }),
    fail: (name, error) => Object.assign(named(name)[1], { error }),
    finish: (name) => coming.delete(named(name)[0]),
  };
}

const row = (page, name) => page.locator('.upload', { hasText: name });

test('several loads say how far they are, while the picture goes on; each is shown when it is there', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const slow = await withSlowLoads(page);
    const shown = await page.locator('.volumes li.current .name').textContent();
    await chooseFiles(page, [octets('one.nrrd', smallNrrd(20)), octets('two.nrrd', smallNrrd(22))]);
    await row(page, 'one.nrrd').getByText('Reading 0 %').waitFor();
    slow.progress('one', 'reading', 0.42);
    slow.progress('two', 'uploading', 0.9);
    await row(page, 'one.nrrd').getByText('Reading 42 %').waitFor();
    await row(page, 'two.nrrd').getByText('Copying to the GPU 90 %').waitFor();
    const value = await row(page, 'one.nrrd').locator('progress').evaluate((bar) => bar.value);
    assert.ok(Math.abs(value - 0.42) < 1e-6);
    assert.equal(await page.locator('.volumes li').filter({ hasText: /^one/ }).count(), 0, 'it is listed before it is there');
    await changing(page, () => page.keyboard.press('2'));
    assert.equal(await page.locator('.volumes li.current .name').textContent(), shown);
    slow.finish('two');
    await current(page, 'two');
    slow.finish('one');
    await page.waitForSelector('.volumes .name:text-is("one")');
    assert.equal(await row(page, 'one.nrrd').count(), 0);
    await current(page, 'two');
  }, { hash: await freshScene() });
});

test('a load is cancelled, and nothing of it remains', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await withSlowLoads(page);
    await chooseFiles(page, octets('unwanted.nrrd', smallNrrd(21)));
    await row(page, 'unwanted.nrrd').getByText('Reading 0 %').waitFor();
    const gone = page.waitForResponse((response) => response.request().method() === 'DELETE');
    await page.getByRole('button', { name: 'Cancel unwanted.nrrd' }).click();
    assert.equal((await gone).status(), 204);
    await row(page, 'unwanted.nrrd').waitFor({ state: 'detached' });
    assert.ok(!(await volumes()).some(({ name }) => name === 'unwanted'));
  }, { hash: await freshScene() });
});

test('a load that fails on the server says why, also after the page was opened again', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const slow = await withSlowLoads(page);
    await chooseFiles(page, octets('broken.nrrd', smallNrrd(23)));
    await row(page, 'broken.nrrd').getByText('Reading 0 %').waitFor();
    slow.fail('broken', { code: 'malformed', message: 'data: 12 bytes are missing' });
    await row(page, 'broken.nrrd').getByText('data: 12 bytes are missing').waitFor();
    await page.reload();
    await settled(page);
    const failed = page.locator('.upload.failed');
    await failed.waitFor();
    assert.match(await failed.textContent(), /broken.*12 bytes are missing/);
    await page.getByRole('button', { name: 'Dismiss broken' }).click();
    await failed.waitFor({ state: 'detached' });
    assert.ok(!(await volumes()).some(({ name }) => name === 'broken'));
  }, { hash: await freshScene() });
});

test('what others load is shown with its progress, and is there when it is done', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const slow = await withSlowLoads(page);
    await chooseFiles(page, octets('theirs.nrrd', smallNrrd(19)));
    await row(page, 'theirs.nrrd').getByText('Reading 0 %').waitFor();
    // The page that comes next did not begin it.
    await page.reload();
    await settled(page);
    slow.progress('theirs', 'preparing', 0.5);
    await row(page, 'theirs').getByText('Preparing 50 %').waitFor();
    slow.finish('theirs');
    await page.waitForSelector('.volumes .name:text-is("theirs")');
    assert.equal(await page.locator('.volumes li.current .name').textContent(), 'visible-human-head-128');
  }, { hash: await freshScene() });
});

test('a volume that somebody else deletes is lost with the next touch, and leaves the list', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await changing(page, () => chooseFiles(page, octets('doomed.nrrd', smallNrrd(25))));
    await current(page, 'doomed');
    await settled(page);
    const { id } = (await volumes()).find(({ name }) => name === 'doomed');
    assert.equal((await fetch(`${running.url}/v1/volumes/${id}?force=true`, { method: 'DELETE' })).status, 204);
    await page.locator('#picture').focus();
    await page.keyboard.press('ArrowLeft');
    await page.getByRole('alert').getByText('The volume “doomed” of this scene was deleted from the server.').waitFor();
    await page.waitForFunction(() => ![...document.querySelectorAll('.volumes .name')].some(({ textContent }) => textContent === 'doomed'));
  }, { hash: await freshScene(), ...REFUSED });
});

test('on an empty server data are opened from the middle of the page', async () => {
  const kept = await volumes();
  await withViewer(async (page) => {
    await page.route(/\/v1\/(volumes|scenes)$/, (route) => (route.request().method() === 'GET'
      ? route.fulfill({ json: { volumes: [], scenes: [] } }) : route.continue()));
    await page.goto(`${running.url}/#`);
    await page.reload();
    await page.locator('#empty button', { hasText: 'Open data' }).click();
    await page.keyboard.press('Escape');
    await page.waitForSelector('dialog', { state: 'detached' });
    assert.equal(await page.evaluate(() => document.activeElement.textContent), 'Open data…');
  });
  assert.equal((await volumes()).length, kept.length);
});
