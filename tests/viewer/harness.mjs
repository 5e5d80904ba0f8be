// The viewer in a real browser against the real server: what the tests share.
//
//   SPAO_SERVER  path of the server binary (default: target/debug/spao-server)
//   SPAO_URL     instead: a running server; the tests that restart it are left out
//   CHROMIUM     path of the browser (default: /usr/bin/chromium)

import assert from 'node:assert/strict';
import { after, before } from 'node:test';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { startServer } from './server.mjs';

export const BINARY = process.env.SPAO_SERVER ?? fileURLToPath(new URL('../../target/debug/spao-server', import.meta.url));
const BROWSER = process.env.CHROMIUM ?? '/usr/bin/chromium';
const BROWSER_ARGS = [
  '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
  '--disable-component-update', '--disable-sync',
];
/** Software rendering on a small machine needs patience. */
export const PATIENCE = { timeout: 60_000 };

/** What is running: the server may be another one in the course of a test file. */
export const running = { browser: null, server: null, url: '' };

/**
 * Starts browser and server before the tests of a file, and stops them after.
 * @param {string[]} [more] arguments of the server
 */
export function useServer(more = []) {
  before(async () => {
    if (process.env.SPAO_URL) running.url = process.env.SPAO_URL;
    else await restartServer(more);
    running.browser = await chromium.launch({ executablePath: BROWSER, args: BROWSER_ARGS });
  });
  after(async () => {
    await running.browser?.close();
    await running.server?.stop();
  });
}

/** The next server has the address of the one before. */
export async function restartServer(more = []) {
  running.server = await startServer(BINARY, running.url ? new URL(running.url).host : '127.0.0.1:0', more);
  running.url = running.server.url;
}

/**
 * Opens the viewer, runs `body`, and fails on console errors, uncaught errors and requests to anywhere else.
 * `tolerated` are console errors that the test provokes: a server that is away.
 */
export async function withViewer(body, { hash = '', tolerated = null, address = running.url, ...options } = {}) {
  const context = await running.browser.newContext({ viewport: { width: 900, height: 600 }, ...options });
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
    // Requests that a test answers itself may still be under way.
    await page.unrouteAll({ behavior: 'ignoreErrors' });
    await context.close();
  }
}

/** Waits for the still, exact picture of the newest state. */
export async function settled(page) {
  await page.locator('#stage[aria-busy=false]').waitFor(PATIENCE);
}

/** Does something that changes the picture, and waits until the change has come to rest. */
export async function changing(page, action) {
  await page.evaluate(() => document.getElementById('stage').setAttribute('aria-busy', 'true'));
  await action();
  // The last input of an action is still on its way to the next animation frame.
  await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
  await settled(page);
}

/** Mean of red, green and blue over the canvas, and its pixels in coarse steps, for comparisons. */
export function readPicture(page) {
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
export function difference(a, b) {
  assert.equal(a.coarse.length, b.coarse.length);
  return a.coarse.reduce((sum, value, i) => sum + Math.abs(value - b.coarse[i]), 0) / a.coarse.length;
}

/** The page's scene, as the link in the address bar names it. */
export async function sceneOf(page) {
  const id = new URLSearchParams(new URL(page.url()).hash.slice(1)).get('s');
  const response = await page.request.get(`${new URL(page.url()).origin}/v1/scenes/${id}`);
  assert.equal(response.status(), 200);
  return response.json();
}

export const section = async (page, id) => {
  if (!(await page.locator(`#section-${id}`).getAttribute('open').then((open) => open !== null))) {
    await page.click(`#section-${id} > summary h2`);
  }
};

/** A fresh scene of the first volume, so that tests do not meet each other's edits. */
export async function freshScene(more = {}) {
  const json = async (response) => {
    assert.ok(response.ok, await response.clone().text());
    return response.json();
  };
  const { volumes } = await json(await fetch(`${running.url}/v1/volumes`));
  const body = JSON.stringify({ volume: volumes[0].id, ...more });
  const scene = await json(await fetch(`${running.url}/v1/scenes`, { method: 'POST', headers: { 'content-type': 'application/json' }, body }));
  return `#s=${scene.id}`;
}

/** A ball of bright voxels in the dark, as an NRRD file. */
export function smallNrrd(size = 24) {
  const header = `NRRD0004\ntype: uint8\ndimension: 3\nsizes: ${size} ${size} ${size}\nencoding: raw\nspacings: 1 1 1\n\n`;
  const voxels = Buffer.alloc(size ** 3);
  for (let i = 0; i < voxels.length; i += 1) {
    const [x, y, z] = [i % size, Math.floor(i / size) % size, Math.floor(i / size ** 2)].map((at) => at - (size - 1) / 2);
    voxels[i] = Math.hypot(x, y, z) < size * 0.4 ? 200 : 5;
  }
  return Buffer.concat([Buffer.from(header), voxels]);
}

