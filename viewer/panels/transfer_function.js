/** Colours and opacities: presets, the editor over the histogram, and the selected point in numbers. */

import { api } from '../api.js';
import { button, colorField, numberField } from '../controls.js';
import { h } from '../dom.js';
import { histogramOf } from '../histogram.js';
import { icon } from '../icons.js';
import { toastError } from '../toast.js';
import { TransferFunctionEditor } from '../transfer_function_editor.js';
import { section } from './section.js';

/** @param {import('../app.js').Context} context */
export function transferFunctionPanel({ store, session }) {
  const editor = new TransferFunctionEditor();
  const presets = h('div', { class: 'presets', role: 'group', 'aria-label': 'Presets' });
  const point = selectedPoint(editor);
  const fit = button('Whole range', () => editor.showAll(), { class: 'button quiet', hidden: true });
  const add = button('', () => editor.addAnywhere(), { class: 'button quiet' });
  add.append(icon('plus'), 'Add point');
  const hint = h('p', { class: 'note' }, 'Double-click to add or remove a point. Ctrl and scroll zoom in on values.');

  editor.on('edit', (points) => store.edit({ transfer_function: { points } }));
  editor.on('zoom', () => {
    fit.hidden = !editor.isZoomed;
  });
  store.on('scene', (scene) => {
    const points = scene?.transfer_function?.points;
    if (!points) return;
    editor.set(points);
    point.refresh();
    markPreset(presets, scene.transfer_function);
  });
  session.on('volume', async (volume) => {
    presets.replaceChildren();
    editor.select(-1);
    if (!volume) return;
    try {
      const [histogram, list] = await Promise.all([histogramOf(volume.id), api.presets(volume.id)]);
      if (session.volume?.id !== volume.id) return;
      editor.setHistogram(histogram, volume.voxel_type);
      presets.replaceChildren(...sorted(list, volume).map((preset) => presetButton(preset, store)));
      if (store.scene) markPreset(presets, store.scene.transfer_function);
    } catch (error) {
      toastError(error);
    }
  });
  return section('colours', 'Transfer function', { open: true },
    h('div', { class: 'stack' }, presets, editor.element, h('div', { class: 'row' }, add, fit), point.element, hint));
}

/** The selected point in numbers. */
function selectedPoint(editor) {
  const value = numberField({ label: 'Value', step: 'any', onInput: (number) => editor.change({ value: number }) });
  const opacity = numberField({
    label: 'Opacity', step: 0.1, min: 0, max: 100, unit: '%', onInput: (number) => editor.change({ opacity: number / 100 }),
  });
  const color = colorField({ label: 'Colour', onInput: (hex) => editor.change({ color: hex }) });
  const remove = h('button', {
    type: 'button', class: 'icon-button', 'aria-label': 'Remove point', title: 'Remove point (Delete)',
    onclick: () => editor.removeSelected(),
  }, icon('trash'));
  const element = h('div', { class: 'point', hidden: true }, value.element, opacity.element, color.element, remove);
  const refresh = () => {
    const selected = editor.points[editor.selected];
    element.hidden = !selected;
    if (!selected) return;
    value.set(selected.value);
    opacity.set(Number((selected.opacity * 100).toFixed(2)));
    color.set(selected.color);
    remove.disabled = editor.points.length < 2;
  };
  editor.on('select', refresh);
  return { element, refresh };
}

/** Those for the volume's kind of values first, without those that show nothing. */
function sorted(presets, volume) {
  // Hounsfield units go down to air.
  const isCt = volume.value_range[0] < -200;
  const fits = ({ modality }) => Number((modality === 'CT') === isCt);
  return presets.filter((preset) => overlaps(preset, volume)).sort((a, b) => fits(b) - fits(a));
}

/** Whether a preset shows anything of a volume: one for Hounsfield units is nothing to values from 0 to 1. */
function overlaps({ points }, { value_range: [low, high] }) {
  const visible = points.filter((point) => point.opacity > 0).map((point) => point.value);
  return Math.max(...visible) > low && Math.min(...visible) < high;
}

function presetButton(preset, store) {
  const swatch = h('span', { class: 'swatch', 'aria-hidden': 'true' });
  const [first, last] = [preset.points[0].value, preset.points.at(-1).value];
  const stops = preset.points.map(({ value, color }) => `${color} ${(((value - first) / (last - first || 1)) * 100).toFixed(1)}%`);
  swatch.style.background = `linear-gradient(90deg, ${stops.join(', ')})`;
  const { points, opacity_unit_distance } = preset;
  const element = h('button', {
    type: 'button', class: 'preset', title: preset.description, 'aria-pressed': 'false',
    onclick: () => store.edit({ transfer_function: { points, opacity_unit_distance } }),
  }, swatch, preset.name);
  element.dataset.points = JSON.stringify(points);
  return element;
}

/** Shows which preset the transfer function is, if it is one. */
function markPreset(presets, { points }) {
  const text = JSON.stringify(points);
  for (const element of presets.children) element.setAttribute('aria-pressed', String(element.dataset.points === text));
}
