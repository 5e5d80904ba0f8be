// What is seen, edited, shared and saved, and what survives a restart.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import {
  BINARY, changing, difference, freshScene, readPicture, restartServer, running, sceneOf, section, settled, useServer, withViewer,
} from './harness.mjs';
import { startServer } from './server.mjs';

useServer();

test('the page shows the volume without errors and without asking anyone else', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const picture = await readPicture(page);
    assert.ok(picture.mean > 3, `the picture is dark: ${picture.mean}`);
    assert.equal(await page.locator('#status').textContent(), 'Live');
    assert.equal(await page.locator('.volumes .name').first().textContent(), 'visible-human-head-128');
  });
});

test('dragging turns the picture, and the same picture compares as equal', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const first = await readPicture(page);
    assert.equal(difference(first, await readPicture(page)), 0);
    await changing(page, async () => {
      await page.mouse.move(200, 300);
      await page.mouse.down();
      await page.mouse.move(320, 330, { steps: 12 });
      await page.mouse.up();
    });
    const turned = await readPicture(page);
    assert.ok(difference(first, turned) > 1, 'nothing moved');
    await changing(page, () => page.keyboard.press('f'));
  }, { hash: await freshScene() });
});

test('keys turn and zoom the picture', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await page.focus('#picture');
    for (const key of ['ArrowLeft', '+', '3']) {
      const before = await readPicture(page);
      await changing(page, () => page.keyboard.press(key, { delay: 150 }));
      assert.ok(difference(before, await readPicture(page)) > 0.3, `${key} did nothing`);
    }
  }, { hash: await freshScene() });
});

test('dragging a point of the transfer function changes the picture, and undo takes it back', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const [before, sceneBefore] = [await readPicture(page), await sceneOf(page)];
    const box = await page.locator('.tf-editor circle').nth(7).boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    await changing(page, async () => {
      await page.mouse.move(x, y);
      await page.mouse.down();
      await page.mouse.move(x - 8, y + 70, { steps: 10 });
      await page.mouse.up();
    });
    const after = await readPicture(page);
    assert.ok(difference(before, after) > 0.5, 'the picture is the same');
    const sceneAfter = await sceneOf(page);
    assert.ok(sceneAfter.transfer_function.points[7].opacity < sceneBefore.transfer_function.points[7].opacity);
    await changing(page, () => page.keyboard.press('Control+z'));
    assert.deepEqual((await sceneOf(page)).transfer_function, sceneBefore.transfer_function);
    assert.ok(difference(before, await readPicture(page)) < 0.05, 'undo did not bring the picture back');
    await changing(page, () => page.keyboard.press('Control+Shift+z'));
    assert.deepEqual((await sceneOf(page)).transfer_function, sceneAfter.transfer_function);
  }, { hash: await freshScene() });
});

test('points are added by a double click, set in numbers, and removed by Delete', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const count = () => page.locator('.tf-editor circle').count();
    const points = await count();
    const editor = await page.locator('.tf-editor').boundingBox();
    await changing(page, () => page.mouse.dblclick(editor.x + editor.width * 0.8, editor.y + editor.height * 0.5));
    assert.equal(await count(), points + 1);
    await changing(page, async () => {
      await page.getByLabel('Value', { exact: true }).fill('1000');
      await page.keyboard.press('Enter');
    });
    assert.ok((await sceneOf(page)).transfer_function.points.some(({ value }) => value === 1000));
    await page.locator('.tf-editor circle.selected').focus();
    await changing(page, () => page.keyboard.press('Delete'));
    assert.equal(await count(), points);
  }, { hash: await freshScene() });
});

test('a preset replaces the transfer function', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await changing(page, () => page.click('.preset:text-is("Bone")'));
    const { points } = (await sceneOf(page)).transfer_function;
    assert.equal(points[0].value, 140);
    assert.equal(await page.locator('.preset[aria-pressed=true]').textContent(), 'Bone');
  }, { hash: await freshScene() });
});

test('ambient occlusion darkens the creases at a fixed exposure', async () => {
  const hash = await freshScene({ lighting: { exposure: 1 } });
  await withViewer(async (page) => {
    await settled(page);
    await section(page, 'occlusion');
    const withIt = await readPicture(page);
    await changing(page, () => page.locator('#ao-switch input').uncheck());
    const without = await readPicture(page);
    assert.equal((await sceneOf(page)).ambient_occlusion.method, 'off');
    assert.ok(withIt.mean < without.mean * 0.97, `${withIt.mean} with, ${without.mean} without`);
    await changing(page, () => page.locator('#ao-switch input').check());
    const again = await readPicture(page);
    assert.ok(Math.abs(again.mean - withIt.mean) < 0.5, `${again.mean} after ${withIt.mean}`);
    await changing(page, () => page.keyboard.down('o'));
    assert.ok((await readPicture(page)).mean > again.mean * 1.03, 'holding O shows no difference');
    await changing(page, () => page.keyboard.up('o'));
    assert.equal((await sceneOf(page)).ambient_occlusion.strength, 1);
  }, { hash });
});

test('a server without files of its own says so', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await page.click('#section-volumes .add-volume > button');
    await page.locator('dialog label', { hasText: 'Server' }).click();
    await page.locator('dialog').getByText('the server has no --data-dir').waitFor();
  }, { hash: await freshScene(), tolerated: /status of 422/ });
});

test('a link brings its view to another browser', async () => {
  let link = '';
  let shared;
  await withViewer(async (page) => {
    await settled(page);
    await changing(page, () => page.keyboard.press('2'));
    await page.waitForTimeout(300);
    shared = await readPicture(page);
    link = new URL(page.url()).hash;
  }, { hash: await freshScene() });
  await withViewer(async (page) => {
    await settled(page);
    assert.ok(difference(shared, await readPicture(page)) < 0.05, 'the linked view is another');
  }, { hash: link });
});

test('a link to a scene that is gone makes it again', async () => {
  let link = '';
  await withViewer(async (page) => {
    await settled(page);
    await changing(page, () => page.click('.preset:text-is("Skin")'));
    await page.waitForTimeout(300);
    link = new URL(page.url()).hash;
  }, { hash: await freshScene() });
  const [, id] = link.match(/s=([^&]+)/);
  assert.equal((await fetch(`${running.url}/v1/scenes/${id}`, { method: 'DELETE' })).status, 204);
  await withViewer(async (page) => {
    await settled(page);
    const scene = await sceneOf(page);
    assert.notEqual(scene.id, id);
    assert.equal(scene.transfer_function.points[0].value, -500);
  }, { hash: link, tolerated: /status of 404/ });
});

test('a scene whose volume was deleted is passed over', async () => {
  const left = { id: 'left', revision: 1, volume: 'v_deleted' };
  await withViewer(async (page) => {
    await page.route(/\/v1\/scenes$/, async (route) => {
      if (route.request().method() !== 'GET') return route.continue();
      const { scenes } = await (await route.fetch()).json();
      return route.fulfill({ json: { scenes: [left, ...scenes] } });
    });
    await page.goto('about:blank');
    await page.goto(`${running.url}/`);
    await settled(page);
    assert.equal((await sceneOf(page)).id, 'default');
  });
});

test('a link keeps its look where another scene has the same id', async () => {
  const id = (await freshScene()).slice(3);
  let link = '';
  await withViewer(async (page) => {
    await settled(page);
    await changing(page, () => page.click('.preset:text-is("Skin")'));
    await page.waitForTimeout(300);
    link = new URL(page.url()).hash;
  }, { hash: await freshScene() });
  await withViewer(async (page) => {
    await settled(page);
    const scene = await sceneOf(page);
    assert.notEqual(scene.id, id);
    assert.equal(scene.transfer_function.points[0].value, -500);
  }, { hash: link.replace(/s=[^&]+/, `s=${id}`) });
});

test('two pages of one scene see each other\'s edits but keep their own cameras', async () => {
  const hash = await freshScene();
  await withViewer(async (one) => {
    await settled(one);
    await withViewer(async (two) => {
      await settled(two);
      await changing(two, () => one.click('.preset:text-is("Bone")'));
      assert.equal(await two.locator('.preset[aria-pressed=true]').textContent(), 'Bone');
      const before = await readPicture(two);
      await changing(one, () => one.keyboard.press('2'));
      assert.ok(difference(before, await readPicture(two)) < 0.05, 'the other camera moved too');
    }, { hash });
  }, { hash });
});

test('the picture is saved in the size that is asked for', async () => {
  await withViewer(async (page) => {
    await settled(page);
    await page.click('#save');
    await page.getByLabel('Width').fill('320');
    await page.getByLabel('Height').fill('200');
    const download = page.waitForEvent('download');
    await page.click('dialog button[type=submit]');
    const stream = await (await download).createReadStream();
    const png = Buffer.concat(await stream.toArray());
    assert.deepEqual([png.readUInt32BE(16), png.readUInt32BE(20)], [320, 200]);
  }, { hash: await freshScene() });
});

test('on a phone the sheet opens with a section, fingers turn and pinch', async () => {
  const phone = { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 };
  await withViewer(async (page) => {
    await settled(page);
    await changing(page, () => page.tap('#tabs [data-section=colours]'));
    assert.ok(await page.locator('.tf-editor').isVisible());
    await changing(page, () => page.tap('#tabs [data-section=colours]'));
    await page.waitForSelector('.tf-editor', { state: 'hidden' });
    const touch = await page.context().newCDPSession(page);
    const fingers = (type, ...points) =>
      touch.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
    for (const path of [
      [[[150, 300]], [[220, 310]]],
      [[[150, 300], [220, 400]], [[110, 240], [270, 470]]],
    ]) {
      const before = await readPicture(page);
      await changing(page, async () => {
        await fingers('touchStart', ...path[0]);
        await fingers('touchMove', ...path[1]);
        await fingers('touchEnd');
      });
      assert.ok(difference(before, await readPicture(page)) > 0.3, `${path[0].length} fingers did nothing`);
    }
  }, { hash: await freshScene(), ...phone });
});

test('a server with a key asks for it once', { skip: process.env.SPAO_URL ? 'needs its own server' : false }, async () => {
  const guarded = await startServer(BINARY, '127.0.0.1:0', ['--api-key', 'open-sesame']);
  try {
    await withViewer(async (page) => {
      await page.getByRole('textbox', { name: 'API key' }).fill('wrong');
      await page.keyboard.press('Enter');
      await page.getByText('The last key was not accepted.').waitFor();
      await page.getByRole('textbox', { name: 'API key' }).fill('open-sesame');
      await page.keyboard.press('Enter');
      await settled(page);
      await page.reload();
      await settled(page);
    }, { address: guarded.url, tolerated: /status of 401/ });
  } finally {
    await guarded.stop();
  }
});

// The last ones: they leave a server without the scenes of the tests before.
for (const [kind, hashOfScene] of [['a scene of its own', freshScene], ['the default scene', async () => '']]) {
  test(`the page survives a restart of the server with ${kind}`, { skip: process.env.SPAO_URL ? 'cannot restart it' : false }, async () => {
    await withViewer(async (page) => {
      await settled(page);
      await changing(page, () => page.click('.preset:text-is("Bone")'));
      const before = await sceneOf(page);
      await running.server.stop();
      await page.locator('#banner').waitFor();
      assert.notEqual(await page.locator('#status').getAttribute('data-phase'), 'live');
      // Edited while the server is away: kept, and sent later.
      await section(page, 'scene');
      await page.locator('#section-scene input[type=color]').fill('#203040');
      await restartServer();
      await settled(page);
      assert.equal(await page.locator('#status').textContent(), 'Live');
      await page.getByText(/made again|as it was here/).waitFor();
      const after = await sceneOf(page);
      assert.deepEqual(after.transfer_function, before.transfer_function);
      assert.equal(after.rendering.background, '#203040');
      assert.equal(await page.locator('.preset[aria-pressed=true]').textContent(), 'Bone');
    }, { hash: await hashOfScene(), tolerated: /ERR_CONNECTION|status of (404|502|503)|WebSocket/ });
  });
}
