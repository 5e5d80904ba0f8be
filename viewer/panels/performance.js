/** The last frames as stacked bars, and what the newest one was. */

import { formatBytes, formatNumber, h } from '../dom.js';
import { STAGES } from '../ledger.js';
import { section } from './section.js';

const NAMES = {
  queue: 'Queue', ao: 'Occlusion', raycast: 'Ray cast', readback: 'Read back', encode: 'Encode', decode: 'Decode',
};
const HEIGHT = 84;
const BARS = 48;

/** @param {import('../app.js').Context} context */
export function performancePanel({ ledger, server }) {
  const canvas = h('canvas', { class: 'bars-chart', height: HEIGHT, role: 'img', 'aria-label': 'Milliseconds per stage of the last frames' });
  const cells = {};
  const legend = h('dl', { class: 'legend' }, ...STAGES.map((stage) => {
    cells[stage] = h('dd', {}, '–');
    return h('div', {}, h('dt', {}, h('i', { class: `stage-${stage}` }), NAMES[stage]), cells[stage]);
  }));
  const facts = {};
  const fact = (key, label) => {
    facts[key] = h('dd', {}, '–');
    return h('div', {}, h('dt', {}, label), facts[key]);
  };
  const table = h('dl', { class: 'facts' }, fact('fps', 'Frames per second'), fact('latency', 'Input to picture'),
    fact('phase', 'Phase'), fact('size', 'Resolution'), fact('bytes', 'Transfer'), fact('dropped', 'Dropped'),
    fact('bricks', 'Occlusion bricks'), fact('state', 'Occlusion'));
  const element = section('performance', 'Performance', {}, h('div', { class: 'stack' }, canvas, legend, table,
    server ? h('p', { class: 'note' }, `${server.adapter}${server.software ? ' (software)' : ''} · ${server.backend} · ${server.name ?? 'spao-server'} ${server.version}`) : null));

  let asked = false;
  const refresh = () => {
    asked = false;
    if (!element.open || ledger.records.length === 0) return;
    drawBars(canvas, ledger.records);
    showNumbers(ledger, cells, facts);
  };
  const ask = () => {
    if (!asked) requestAnimationFrame(refresh);
    asked = true;
  };
  ledger.on('frame', ask);
  element.addEventListener('toggle', ask);
  document.addEventListener('themechange', ask);
  return element;
}

function showNumbers(ledger, cells, facts) {
  const { header, stages } = ledger.records.at(-1);
  STAGES.forEach((stage, i) => {
    cells[stage].textContent = `${stages[i].toFixed(stages[i] < 10 ? 1 : 0)} ms`;
  });
  const ao = header.ao ?? {};
  const set = (key, text) => {
    facts[key].textContent = text;
  };
  set('fps', ledger.fps === null ? '–' : formatNumber(ledger.fps, 3));
  set('latency', ledger.latency === null ? '–' : `${Math.round(ledger.latency)} ms`);
  set('phase', header.exact ? `${header.phase}, exact` : header.phase);
  set('size', `${header.width} × ${header.height} ${header.encoding}`);
  set('bytes', formatBytes(header.bytes ?? 0));
  set('dropped', String(header.dropped ?? 0));
  set('bricks', ao.bricks ? `${ao.bricks_recomputed} of ${ao.bricks}` : '–');
  set('state', [ao.state, ao.update].filter(Boolean).join(', ') || '–');
}

/** @param {HTMLCanvasElement} canvas @param {import('../ledger.js').FrameRecord[]} records */
function drawBars(canvas, records) {
  const density = devicePixelRatio || 1;
  const width = canvas.clientWidth || 280;
  canvas.width = Math.round(width * density);
  canvas.height = Math.round(HEIGHT * density);
  const context = canvas.getContext('2d');
  context.scale(density, density);
  const style = getComputedStyle(canvas);
  const colors = STAGES.map((stage) => style.getPropertyValue(`--stage-${stage}`));
  const shown = records.slice(-BARS);
  const totals = shown.map(({ stages }) => stages.reduce((sum, ms) => sum + ms, 0));
  const top = niceCeiling(Math.max(...totals, 4));
  const bar = width / BARS;
  shown.forEach(({ stages }, i) => {
    let y = HEIGHT;
    stages.forEach((ms, stage) => {
      const height = (ms / top) * (HEIGHT - 12);
      context.fillStyle = colors[stage];
      context.fillRect(width - (shown.length - i) * bar + 0.75, y - height, bar - 1.5, height);
      y -= height;
    });
  });
  context.fillStyle = style.getPropertyValue('--muted');
  context.font = '10px system-ui, sans-serif';
  context.fillText(`${top} ms`, 0, 9);
}

function niceCeiling(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].find((factor) => factor * power >= value) * power;
}
