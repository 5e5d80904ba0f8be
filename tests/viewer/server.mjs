// Starts the real server, and stops it the way an operator would.

import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { setTimeout as sleep } from 'node:timers/promises';
import { fileURLToPath } from 'node:url';

export const VOLUME = fileURLToPath(new URL('../data/visible-human-head-128.nrrd', import.meta.url));

const START_TIMEOUT = 60_000;

/**
 * @param {string} binary
 * @param {string} address
 * @param {string[]} [more] arguments
 */
export async function startServer(binary, address, more = []) {
  const child = spawn(binary, ['serve', '--addr', address, '--volume', VOLUME, ...more], {
    stdio: ['ignore', 'pipe', 'pipe'],
  });
  let log = '';
  const url = await new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error(`the server did not start:\n${log}`)), START_TIMEOUT);
    const read = (data) => {
      log += data;
      const found = log.match(/Listening on (http:\/\/\S+)/);
      if (!found) return;
      clearTimeout(timer);
      resolve(found[1]);
    };
    child.stdout.on('data', read);
    child.stderr.on('data', read);
    child.once('exit', (code) => reject(new Error(`the server ended with ${code}:\n${log}`)));
    child.once('error', reject);
  });
  return {
    url,
    async stop() {
      if (child.exitCode !== null || child.signalCode !== null) return;
      child.kill('SIGTERM');
      await Promise.race([once(child, 'exit'), sleep(15_000, undefined, { ref: false })]);
      child.kill('SIGKILL');
    },
  };
}
