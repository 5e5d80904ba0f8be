// The viewer in a real browser against the real server.
//
//   SPAO_SERVER  path of the server binary (default: target/debug/spao-server)
//   SPAO_URL     instead: a running server; the tests that restart it are left out
//   CHROMIUM     path of the browser (default: /usr/bin/chromium)

import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { startServer } from './server.mjs';

const BINARY = process.env.SPAO_SERVER ?? fileURLToPath(new URL('../../target/debug/spao-server', import.meta.url));
const BROWSER = process.env.CHROMIUM ?? '/usr/bin/chromium';
const BROWSER_ARGS = [
  '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
  '--disable-component-update', '--disable-sync',
];
/** Software rendering on a small machine needs patience. */
const PATIENCE = { timeout: 60_000 };

let browser;
let server;
let url;

before(async () => {
  if (process.env.SPAO_URL) {
    url = process.env.SPAO_URL;
  } else {
    server = await startServer(BINARY, '127.0.0.1:0');
    url = server.url;
  }
  browser = await chromium.launch({ executablePath: BROWSER, args: BROWSER_ARGS });
});

after(async () => {
  await browser?.close();
  await server?.stop();
});

/**
 * Opens the viewer, runs `body`, and fails on console errors, uncaught errors and requests to anywhere else.
 * `tolerated` are console errors that the test provokes: a server that is away.
 */
async function withViewer(body, { hash = '', tolerated = null, address = url, ...options } = {}) {
  const context = await browser.newContext({ viewport: { width: 900, height: 600 }, ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE.timeout);
  const faults = [];
  page.on('console', (message) => {
    if (message.type() === 'error' && !tolerated?.test(message.text())) faults.push(`console: ${message.text()}`);
  });
  page.on('pageerror', (error) => faults.push(`uncaught: ${error.stack ?? error}`));
  const own = new URL(address).host;
  page.on('request', (request) => {
    const target = new URL(request.url());
    if (!['blob:', 'data:'].includes(target.protocol) && target.host !== own) faults.push(`external: ${target}`);
  });
  page.on('websocket', (socket) => {
    if (new URL(socket.url()).host !== own) faults.push(`external: ${socket.url()}`);
  });
  try {
    await page.goto(`${address}/${hash}`);
    await body(page);
    assert.deepEqual(faults, []);
  } finally {
    await context.close();
  }
}

/** Waits for the still, exact picture of the newest state. */
async function settled(page) {
  await page.locator('#stage[aria-busy=false]').waitFor(PATIENCE);
}

/** Does something that changes the picture, and waits until the change has come to rest. */
async function changing(page, action) {
  await page.evaluate(() => document.getElementById('stage').setAttribute('aria-busy', 'true'));
  await action();
  // The last input of an action is still on its way to the next animation frame.
  await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
  await settled(page);
}

/** Mean of red, green and blue over the canvas, and its pixels in coarse steps, for comparisons. */
function readPicture(page) {
  return page.evaluate(() => {
    const canvas = /** @type {HTMLCanvasElement} */ (document.getElementById('picture'));
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    let sum = 0;
    const coarse = [];
    for (let i = 0; i < data.length; i += 4) {
      sum += data[i] + data[i + 1] + data[i + 2];
      if (i % 388 === 0) coarse.push(data[i]);
    }
    return { mean: sum / (data.length * 0.75), coarse, width: canvas.width, height: canvas.height };
  });
}

/** Mean absolute difference of two pictures of one size. */
function difference(a, b) {
  assert.equal(a.coarse.length, b.coarse.length);
  return a.coarse.reduce((sum, value, i) => sum + Math.abs(value - b.coarse[i]), 0) / a.coarse.length;
}

/** The page's scene, as the link in the address bar names it. */
async function sceneOf(page) {
  const id = new URLSearchParams(new URL(page.url()).hash.slice(1)).get('s');
  const response = await page.request.get(`${new URL(page.url()).origin}/v1/scenes/${id}`);
  assert.equal(response.status(), 200);
  return response.json();
}

const section = async (page, id) => {
  if (!(await page.locator(`#section-${id}`).getAttribute('open').then((open) => open !== null))) {
    await page.click(`#section-${id} > summary h2`);
  }
};

/** A fresh scene of the first volume, so that tests do not meet each other's edits. */
async function freshScene(more = {}) {
  const json = async (response) => {
    assert.ok(response.ok, await response.clone().text());
    return response.json();
  };
  const { volumes } = await json(await fetch(`${url}/v1/volumes`));
  const body = JSON.stringify({ volume: volumes[0].id, ...more });
  const scene = await json(await fetch(`${url}/v1/scenes`, { method: 'POST', headers: { 'content-type': 'application/json' }, body }));
  return `#s=${scene.id}`;
}

/** A ball of bright voxels in the dark, as an NRRD file. */
function smallNrrd(size = 24) {
  const header = `NRRD0004\ntype: uint8\ndimension: 3\nsizes: ${size} ${size} ${size}\nencoding: raw\nspacings: 1 1 1\n\n`;
  const voxels = Buffer.alloc(size ** 3);
  for (let i = 0; i < voxels.length; i += 1) {
    const [x, y, z] = [i % size, Math.floor(i / size) % size, Math.floor(i / size ** 2)].map((at) => at - (size - 1) / 2);
    voxels[i] = Math.hypot(x, y, z) < size * 0.4 ? 200 : 5;
  }
  return Buffer.concat([Buffer.from(header), voxels]);
}

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

test('a file is uploaded and shown, and what is wrong with another is said', async () => {
  await withViewer(async (page) => {
    await settled(page);
    const choose = (name, buffer) =>
      page.locator('#panel input[type=file]').setInputFiles({ name, mimeType: 'application/octet-stream', buffer });
    await changing(page, () => choose('small-ball.nrrd', smallNrrd()));
    await page.waitForSelector('.volumes li.current:has-text("small-ball")');
    assert.ok((await readPicture(page)).mean > 3);
    await choose('not-a-volume.nrrd', Buffer.from('this is no volume'));
    const failure = page.locator('.upload.failed');
    await failure.waitFor();
    assert.match(await failure.textContent(), /not-a-volume\.nrrd.+/);
  }, { hash: await freshScene(), tolerated: /status of 4\d\d/ });
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
  assert.equal((await fetch(`${url}/v1/scenes/${id}`, { method: 'DELETE' })).status, 204);
  await withViewer(async (page) => {
    await settled(page);
    const scene = await sceneOf(page);
    assert.notEqual(scene.id, id);
    assert.equal(scene.transfer_function.points[0].value, -500);
  }, { hash: link, tolerated: /status of 404/ });
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
      await server.stop();
      await page.locator('#banner').waitFor();
      assert.notEqual(await page.locator('#status').getAttribute('data-phase'), 'live');
      // Edited while the server is away: kept, and sent later.
      await section(page, 'scene');
      await page.locator('#section-scene input[type=color]').fill('#203040');
      server = await startServer(BINARY, new URL(url).host);
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
