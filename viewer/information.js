/** The dialog with what is known of a volume: sizes, units, where it came from, what its file says. */

import { api } from './api.js';
import { choiceIn, chosen, isElsewhere } from './choice.js';
import { button } from './controls.js';
import { openDialog } from './dialogs.js';
import { formatBytes, formatNumber, h } from './dom.js';
import { regionOfBox } from './grid.js';

const TIMES = ' × ';

/**
 * @param {import('./store.js').Volume} listed as the list shows it
 * @param {import('./app.js').Context} context
 */
export async function informationDialog(listed, { library, session, store }) {
  const asked = Promise.all([api.volume(listed.id), api.metadata(listed.id)]);
  const place = h('div', { class: 'stack' }, h('p', { role: 'status' }, 'Asking the server…'));
  const clipBox = session.volume?.id === listed.id ? store.scene?.rendering?.clip_box ?? null : null;
  await openDialog(listed.name, (close) => {
    const openSource = (name, source) => {
      close();
      library.openSource(name, source);
    };
    asked.then(
      ([volume, metadata]) => place.replaceChildren(...content(volume, metadata, clipBox, openSource)),
      (error) => place.replaceChildren(h('p', { class: 'fault', role: 'alert' }, error.message)),
    );
    return [place];
  }, 'information');
}

function content(volume, metadata, clipBox, openSource) {
  return [
    reduction(volume, clipBox, openSource),
    notes(volume, metadata, openSource),
    facts(volume, metadata),
    header(metadata),
  ].filter(Boolean);
}

/** Whether voxels of the file were put together, because they are too many. */
export const isAveraged = ({ resolution }) => Boolean(resolution?.factor.some((factor) => factor > 1));

/** What people should know; where the file has other channels, they are a click away. */
function notes(volume, metadata, openSource) {
  const sentences = new Set([...(volume.notes ?? []), ...metadata.notes]);
  // The box above says it, with what to do about it.
  for (const sentence of sentences) if (isAveraged(volume) && / are averaged/.test(sentence)) sentences.delete(sentence);
  if (sentences.size === 0) return null;
  const again = (sentence) => {
    const choice = isElsewhere(volume.source) ? choiceIn(sentence) : null;
    if (!choice) return null;
    return h('div', { class: 'choices' }, ...choice.options.map(({ value, label }) =>
      button(label, () => openSource(`${volume.name}, ${label}`, { ...volume.source, ...chosen(choice, value) }),
        { title: `Load ${choice.parameter} ${value}` })));
  };
  return h('ul', { class: 'notes', 'aria-label': 'Notes' },
    ...[...sentences].map((sentence) => h('li', {}, sentence.replaceAll('`', ''), again(sentence))));
}

/** Of a volume that was averaged: by how much, and a way to see a part as it is. */
function reduction(volume, clipBox, openSource) {
  const { resolution } = volume;
  if (!isAveraged(volume)) return null;
  const sentence = h('p', {}, `Too large as a whole: of ${resolution.full_dims.join(TIMES)} voxels, blocks of ${resolution.factor.join(TIMES)} are averaged.`);
  if (!isElsewhere(volume.source)) {
    return h('div', { class: 'reduced stack' }, sentence, h('p', {}, 'A part at full resolution can be loaded of a file that the server has, or of an address.'));
  }
  const region = clipBox ? regionOfBox(volume, clipBox) : null;
  const size = region && region[1].map((end, axis) => end - region[0][axis]);
  const load = button('Load this part at full resolution', () =>
    openSource(`${volume.name} (part)`, { ...volume.source, region }), { class: 'button primary', disabled: !region });
  const what = region ? `The clip box holds ${size.join(TIMES)} voxels of it.`
    : 'Set a clip box around a part, under “Clipping & background”, to load it at full resolution.';
  return h('div', { class: 'reduced stack' }, sentence, h('p', {}, what), h('div', { class: 'row' }, load));
}

function facts(volume, metadata) {
  const unit = metadata.patient_axes ? ' mm' : '';
  const { dims, spacing, origin, resolution } = volume;
  const numbers = (list, digits = 4) => list.map((value) => formatNumber(value, digits)).join(TIMES);
  const region = resolution?.region;
  const rows = [
    ['Voxels', dims.join(TIMES)],
    ['Spacing', numbers(spacing) + unit],
    ['Size', numbers(dims.map((count, axis) => count * spacing[axis])) + unit],
    ['First voxel at', origin.map((value) => formatNumber(value, 5)).join(', ') + unit],
    ['World axes', metadata.patient_axes ? 'the patient’s: left, posterior, superior' : 'the file’s'],
    ['Type', volume.voxel_type],
    ['Values', volume.value_range.map((value) => formatNumber(value)).join(' … ')],
    metadata.nan_count > 0 && ['Not a number', `${metadata.nan_count} voxels`],
    region && ['Part of the file', `${region[0].join(', ')} to ${region[1].join(', ')}, of ${resolution.full_dims.join(TIMES)}`],
    ['GPU memory', volume.state === 'evicted' ? 'none now: it made room' : formatBytes(volume.gpu_bytes)],
    ['Host memory', formatBytes(volume.host_bytes)],
    ['Source', sourceText(volume.source)],
    ['Loaded', new Date(volume.created_at).toLocaleString()],
    ['SHA-256', h('code', {}, volume.sha256)],
  ];
  return h('dl', { class: 'facts' }, ...rows.filter(Boolean).map(([name, value]) =>
    h('div', {}, h('dt', {}, name), h('dd', {}, value))));
}

function sourceText(source) {
  if (source?.upload) return `uploaded, ${source.upload.format}, ${formatBytes(source.upload.bytes)}`;
  if (source?.procedural) return `computed: ${String(source.procedural.kind).replaceAll('_', ' ')}`;
  const text = source?.path ?? source?.url ?? '–';
  const choice = ['series', 'channel'].filter((name) => source?.[name] !== undefined && source[name] !== null);
  return [text, ...choice.map((name) => `${name} ${source[name]}`)].join(', ');
}

/** The fields of the file's header, folded away: there may be hundreds. */
function header({ header: fields, withheld }) {
  const hidden = withheld > 0 ? `${withheld} more may name a patient and are not shown.` : '';
  if (fields.length === 0) return hidden ? h('p', {}, hidden) : null;
  return h('details', { class: 'header-fields' },
    h('summary', {}, `Header of the file, ${fields.length} field${fields.length === 1 ? '' : 's'}`),
    h('table', {}, h('tbody', {}, ...fields.map(({ name, value }) => h('tr', {}, h('th', { scope: 'row' }, name), h('td', {}, value))))),
    hidden ? h('p', {}, hidden) : null);
}
