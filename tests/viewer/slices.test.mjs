// Slices, directions in the 3D view, and what is known of a volume.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import {
  changing, difference, freshScene, readPicture, running, sceneOf, section, settled, smallNrrd, useServer, withViewer,
} from './harness.mjs';

useServer(['--data-dir', new URL('../data', import.meta.url).pathname]);

const json = async (path, options) => (await fetch(`${running.url}/v1/${path}`, options)).json();
const head = async () => (await json('volumes')).volumes[0];
const slice = (page, name) => page.locator('#slices .slice', { has: page.locator(`h3:text-is("${name}")`) });

async function openSlices(page) {
  await settled(page);
  await page.click('#open-slices');
  await page.waitForFunction(() => [...document.querySelectorAll('#slices .slice img')].filter((image) => image.naturalWidth > 0).length === 3);
}

/** Grey values of a slice, in coarse steps, at its own size. */
const pixels = (page, name) => slice(page, name).locator('img').evaluate(async (image) => {
  await image.decode();
  const canvas = document.createElement('canvas');
  Object.assign(canvas, { width: image.naturalWidth, height: image.naturalHeight });
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0);
  const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
  return { coarse: [...data].filter((_, i) => i % 148 === 0), width: canvas.width, height: canvas.height };
});

const arrived = (page, query) => page.waitForResponse((response) => response.url().includes('/slice?') && response.url().includes(query));

test('slices have names, edges and the shape of the patient', async () => {
  const { dims, spacing } = await head();
  await withViewer(async (page) => {
    await openSlices(page);
    assert.deepEqual(await page.locator('#slices h3').allTextContents(), ['Axial', 'Coronal', 'Sagittal']);
    const edges = { Axial: 'RLAP', Coronal: 'RLSI', Sagittal: 'APSI' };
    for (const [name, letters] of Object.entries(edges)) {
      assert.equal((await slice(page, name).locator('.edge').allTextContents()).join(''), letters);
    }
    const extent = dims.map((count, axis) => count * spacing[axis]);
    for (const [name, across, down] of [['Axial', 0, 1], ['Coronal', 0, 2], ['Sagittal', 1, 2]]) {
      const box = await slice(page, name).locator('img').boundingBox();
      assert.ok(Math.abs(box.width / box.height - extent[across] / extent[down]) < 0.02, `${name} is distorted`);
      const picture = await pixels(page, name);
      assert.ok(Math.abs(picture.width - box.width) <= 1, 'the picture is not as large as its place');
      assert.ok(picture.coarse.some((grey) => grey > 100), `${name} is dark`);
    }
  }, { hash: await freshScene(), viewport: { width: 1440, height: 900 } });
});

test('the slider goes through the volume with one request at a time, and arrives', async () => {
  await withViewer(async (page) => {
    await openSlices(page);
    const before = await pixels(page, 'Axial');
    let [now, most, count] = [0, 0, 0];
    await page.route(/\/slice\?axis=z/, async (route) => {
      now += 1;
      count += 1;
      most = Math.max(most, now);
      await new Promise((resolve) => setTimeout(resolve, 80));
      now -= 1;
      await route.continue();
    });
    const last = arrived(page, 'axis=z&index=21&');
    await page.getByLabel('Axial slice').evaluate((slider) => {
      for (let index = 90; index > 20; index -= 1) {
        slider.value = String(index);
        slider.dispatchEvent(new Event('input'));
      }
    });
    await last;
    await page.waitForTimeout(300);
    assert.equal(most, 1, 'several requests of one slice were under way');
    assert.ok(count <= 3, `${count} requests for what is seen only at its end`);
    assert.ok(difference(before, await pixels(page, 'Axial')) > 2, 'the picture is the same');
    assert.equal(await slice(page, 'Axial').locator('output').textContent(), '21 / 104');
    const after = await pixels(page, 'Axial');
    assert.equal(difference(after, await pixels(page, 'Axial')), 0);
  }, { hash: await freshScene() });
});

test('the value under the pointer is the voxel\'s', async () => {
  const volume = await head();
  const npy = Buffer.from(await (await fetch(`${running.url}/v1/volumes/${volume.id}/data?format=npy`)).arrayBuffer());
  const first = 10 + npy.readUInt16LE(8);
  const [nx, ny] = volume.dims;
  const voxel = (x, y, z) => npy.readInt16LE(first + 2 * (x + nx * (y + ny * z)));
  await withViewer(async (page) => {
    await openSlices(page);
    const said = page.locator('#slices .slice-tools output').last();
    for (const [name, shareX, shareY, index] of [
      ['Axial', 0.505, 0.255, [64, 32, 52]], ['Coronal', 0.3, 0.2, [38, 64, 84]], ['Sagittal', 0.82, 0.9, [64, 104, 10]],
    ]) {
      const box = await slice(page, name).locator('img').boundingBox();
      await page.mouse.move(box.x + box.width * shareX, box.y + box.height * shareY);
      await said.filter({ hasText: `voxel ${index.join(', ')} · at` }).waitFor();
      assert.equal(Number((await said.textContent()).split(' ')[0]), voxel(...index), name);
    }
    assert.match(await said.textContent(), / · at [\d., ]+$/);
  }, { hash: await freshScene(), viewport: { width: 1440, height: 900 } });
});

test('a click brings the other slices to that point', async () => {
  await withViewer(async (page) => {
    await openSlices(page);
    const box = await slice(page, 'Axial').locator('img').boundingBox();
    const other = arrived(page, 'axis=x&index=32&');
    await page.mouse.click(box.x + box.width * 0.252, box.y + box.height * 0.754);
    await other;
    assert.equal(await slice(page, 'Sagittal').locator('output').textContent(), '32 / 127');
    assert.equal(await slice(page, 'Coronal').locator('output').textContent(), '96 / 127');
    assert.equal(await slice(page, 'Axial').locator('output').textContent(), '52 / 104');
  }, { hash: await freshScene(), viewport: { width: 1440, height: 900 } });
});

test('the window is that of the colours until a person sets it', async () => {
  await withViewer(async (page) => {
    const first = arrived(page, 'axis=z');
    await openSlices(page);
    const window = (response) => {
      const query = new URL(response.url()).searchParams;
      return [Number(query.get('low')), Number(query.get('high'))];
    };
    const { points } = (await sceneOf(page)).transfer_function;
    assert.deepEqual(window(await first), [points[0].value, points.at(-1).value]);
    const before = await pixels(page, 'Axial');
    const second = arrived(page, 'low=140&');
    await page.click('.preset:text-is("Bone")');
    await second;
    const third = arrived(page, 'low=-1024&high=2512');
    await page.getByRole('button', { name: 'All values' }).click();
    await third;
    await page.waitForTimeout(200);
    assert.ok(difference(before, await pixels(page, 'Axial')) > 2, 'the window changes nothing');
    await changing(page, () => page.click('.preset:text-is("Skin")'));
    assert.match(await page.locator('#slices .slice-tools output').first().textContent(), /^-1024 … 2512$/);
  }, { hash: await freshScene() });
});

test('the 3D view goes on above the slices, and they close with Escape', async () => {
  await withViewer(async (page) => {
    await openSlices(page);
    // The slices took their place from the picture, which is drawn anew.
    await page.waitForFunction(() => document.getElementById('picture').height < 400);
    await settled(page);
    const before = await readPicture(page);
    await changing(page, () => page.keyboard.press('2'));
    assert.ok(difference(before, await readPicture(page)) > 1, 'nothing turned');
    await page.getByLabel('Axial slice').focus();
    await page.keyboard.press('Escape');
    assert.ok(await page.locator('#slices').isHidden());
    assert.equal(await page.evaluate(() => document.activeElement.id), 'open-slices');
    await page.keyboard.press('s');
    assert.ok(await page.locator('#slices').isVisible());
  }, { hash: await freshScene() });
});

test('without a patient slices and axes have the names of the grid', async () => {
  const volume = await json('volumes?name=plain', { method: 'POST', body: smallNrrd() });
  const scene = await json('scenes', { method: 'POST', headers: { 'content-type': 'application/json' }, body: JSON.stringify({ volume: volume.id }) });
  await withViewer(async (page) => {
    await openSlices(page);
    assert.deepEqual(await page.locator('#slices h3').allTextContents(), ['Across z', 'Across y', 'Across x']);
    assert.equal((await page.locator('#slices .edge').allTextContents()).join(''), '');
    assert.deepEqual((await page.locator('#orientation text').allTextContents()).filter(Boolean).sort(), ['x', 'y', 'z']);
    await changing(page, () => page.keyboard.press('3'));
    assert.equal(await page.locator('#orientation svg').getAttribute('aria-label'), 'Seen from +x');
  }, { hash: `#s=${scene.id}` });
});

test('on a phone there is one slice at a time', async () => {
  const phone = { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 };
  await withViewer(async (page) => {
    await settled(page);
    await page.tap('#open-slices');
    await slice(page, 'Axial').locator('img').waitFor();
    assert.equal(await page.locator('#slices .slice:visible').count(), 1);
    await page.tap('#slices label:has-text("Sagittal")');
    await slice(page, 'Sagittal').waitFor();
    assert.ok(await slice(page, 'Axial').isHidden());
    await page.getByRole('button', { name: 'Close the slices' }).tap();
    assert.ok(await page.locator('#slices').isHidden());
  }, { hash: await freshScene(), ...phone });
});

test('the marker shows where the patient\'s left and head are, and can be switched off', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const marker = page.locator('#orientation svg');
    const place = async (letter) => {
      const [x, y] = await marker.locator('text', { hasText: letter }).evaluate((text) => ['x', 'y'].map((name) => Number(text.getAttribute(name))));
      return { x, y };
    };
    for (const [key, label, left] of [['1', 'front', 1], ['2', 'back', -1]]) {
      await changing(page, () => page.keyboard.press(key));
      assert.equal(await marker.getAttribute('aria-label'), `Seen from the ${label}`);
      const [l, s] = [await place('L'), await place('S')];
      assert.ok(Math.abs(l.x - 33 * left) < 1 && Math.abs(l.y) < 1, JSON.stringify(l));
      assert.ok(s.y < -30 && Math.abs(s.x) < 1, JSON.stringify(s));
    }
    assert.deepEqual((await marker.locator('text').allTextContents()).sort(), ['A', 'I', 'L', 'P', 'R', 'S']);
    await section(page, 'view');
    await page.getByLabel('Orientation marker').uncheck();
    assert.ok(await marker.isHidden());
    await page.reload();
    await settled(page);
    assert.ok(await marker.isHidden());
  }, { hash: await freshScene() });
});

test('the dialog of a volume says what is known of it', async () => {
  const volume = await head();
  await withViewer(async (page) => {
    await settled(page);
    await page.keyboard.press('i');
    const dialog = page.getByRole('dialog', { name: volume.name });
    await dialog.locator('dl').waitFor();
    const facts = Object.fromEntries(await dialog.locator('dl div').evaluateAll((rows) => rows.map((row) => [...row.children].map((cell) => cell.textContent))));
    assert.equal(facts.Voxels, '128 × 128 × 105');
    assert.equal(facts.Spacing, '2 × 2 × 2 mm');
    assert.equal(facts.Type, 'i16');
    assert.equal(facts.Values, '-1024 … 2512');
    assert.equal(facts['SHA-256'], volume.sha256);
    assert.match(facts.Source, /visible-human-head-128/);
    assert.match(facts['GPU memory'], /^9\.84 MiB$/);
    await dialog.locator('summary').click();
    assert.match(await dialog.locator('table').textContent(), /sizes.*128 128 105/);
    await page.keyboard.press('Escape');
    await dialog.waitFor({ state: 'detached' });
  }, { hash: await freshScene() });
});

test('another channel of a file is a click away', async () => {
  const body = JSON.stringify({ name: 'cells', source: { path: 'tiff/ome_channels.ome.tif' } });
  const volume = await json('volumes', { method: 'POST', headers: { 'content-type': 'application/json' }, body });
  assert.ok(volume.id, JSON.stringify(volume));
  await withViewer(async (page) => {
    await settled(page);
    await page.getByRole('button', { name: 'About cells' }).click();
    await page.getByRole('dialog').getByRole('button', { name: 'GFP' }).click();
    await page.waitForSelector('.volumes li.current:has(.name:text-is("cells, GFP"))');
    const { volumes } = await json('volumes');
    assert.equal(volumes.find(({ name }) => name === 'cells, GFP').source.channel, 1);
  }, { hash: await freshScene(), tolerated: /status of 422/ });
});

test('of a volume that was averaged a part is loaded at full resolution', async () => {
  const volume = await head();
  const { dims, origin } = volume;
  const source = { path: 'large.nrrd' };
  const resolution = { full_dims: dims.map((count) => 4 * count), factor: [4, 4, 4], region: null };
  await withViewer(async (page) => {
    await page.route(new RegExp(`/v1/volumes/${volume.id}$`), (route) => route.fulfill({ json: { ...volume, source, resolution, notes: ['It is averaged.'] } }));
    await settled(page);
    await page.keyboard.press('i');
    const load = page.getByRole('button', { name: 'Load this part at full resolution' });
    await load.waitFor();
    assert.ok(await load.isDisabled(), 'there is no part yet');
    assert.match(await page.getByRole('list', { name: 'Notes' }).textContent(), /It is averaged\./);
    await page.keyboard.press('Escape');
    // The cells of voxels 10 to 19, which are 2 mm wide, along every axis.
    const box = [[0, 1, 2].map((axis) => origin[axis] + 2 * 9.5), [0, 1, 2].map((axis) => origin[axis] + 2 * 19.5)];
    const scene = await sceneOf(page);
    await changing(page, () => fetch(`${running.url}/v1/scenes/${scene.id}`, {
      method: 'PATCH', headers: { 'content-type': 'application/json' }, body: JSON.stringify({ rendering: { clip_box: box } }),
    }));
    await page.keyboard.press('i');
    await page.getByText('The clip box holds 40 × 40 × 40 voxels of it.').waitFor();
    let asked;
    await page.route(/\/v1\/volumes\?/, (route) => {
      asked = route.request().postDataJSON();
      return route.fulfill({ status: 422, json: { error: { code: 'invalid', message: 'source.path: there is no such file', details: { path: 'source.path' } } } });
    });
    await load.click();
    await page.locator('.upload.failed').waitFor();
    assert.deepEqual(asked.source, { ...source, region: [[40, 40, 40], [80, 80, 80]] });
  }, { hash: await freshScene(), tolerated: /status of 422/ });
});
