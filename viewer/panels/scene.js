/** Background, clip box and sampling. */

import { button, colorField, rangePair, slider, toggle } from '../controls.js';
import { h } from '../dom.js';
import { volumeBounds } from '../vector.js';
import { section } from './section.js';

const AXES = ['x', 'y', 'z'];

/** @param {import('../app.js').Context} context */
export function scenePanel({ store, session }) {
  const edit = (patch) => store.edit({ rendering: patch });
  let background = '#000000';
  const color = colorField({
    label: 'Background', onInput: (value) => edit({ background: value + (isTransparent() ? '00' : '') }),
  });
  const isTransparent = () => background.length === 9 && background.endsWith('00');
  const transparent = toggle({
    label: 'Transparent', hint: 'Saved pictures then have an alpha channel',
    onInput: (on) => edit({ background: background.slice(0, 7) + (on ? '00' : '') }),
  });
  const sampling = slider({
    label: 'Sampling rate', min: 0.25, max: 4, step: 0.05, log: true, hint: 'Samples per voxel along a ray',
    onInput: (value) => edit({ sampling_rate: value }),
  });

  /** @type {[number[], number[]]} */ let bounds = [[0, 0, 0], [1, 1, 1]];
  /** @type {[number[], number[]]} */ let box = bounds;
  const digits = () => Math.max(0, 3 - Math.floor(Math.log10(Math.max(...bounds[1].map((b, i) => b - bounds[0][i])))));
  const pairs = AXES.map((axis, i) => rangePair({
    label: `Clip ${axis}`,
    onInput: (low, high) => {
      const round = (value) => Number(value.toFixed(digits()));
      box = [box[0].with(i, round(low)), box[1].with(i, round(high))];
      edit({ clip_box: box });
    },
  }));
  const reset = button('Show everything', () => edit({ clip_box: null }), { class: 'button quiet' });

  const refresh = () => {
    const rendering = store.scene?.rendering;
    if (!rendering) return;
    background = rendering.background ?? '#000000';
    color.set(background);
    transparent.set(isTransparent());
    sampling.set(rendering.sampling_rate);
    box = rendering.clip_box ?? bounds;
    pairs.forEach((pair, i) => pair.set([bounds[0][i], bounds[1][i]], box[0][i], box[1][i]));
    reset.disabled = !rendering.clip_box;
  };
  session.on('volume', (volume) => {
    if (!volume) return;
    bounds = volumeBounds(volume);
    refresh();
  });
  store.on('scene', refresh);
  return section('scene', 'Clipping & background', {}, h('div', { class: 'stack' }, ...pairs.map((pair) => pair.element), reset,
    h('hr'), color.element, transparent.element, sampling.element));
}
