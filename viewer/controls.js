/**
 * Form controls of the panel. Each is `{element, set}`: `set` shows a value without reporting it, and leaves a field
 * alone in which a person is typing.
 */

import { formatNumber, freshId, h } from './dom.js';

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

/**
 * A slider with a number field beside it.
 * @param {{label: string, min: number, max: number, step: number, unit?: string, log?: boolean, hint?: string,
 *   onInput: (value: number) => void}} options `log`: equal steps are equal factors
 */
export function slider({ label, min, max, step, unit, log, hint, onInput }) {
  const id = freshId();
  const steps = log ? 200 : Math.round((max - min) / step);
  const toPosition = (value) =>
    (log ? (Math.log(value / min) / Math.log(max / min)) * steps : ((value - min) / (max - min)) * steps);
  const rounded = (value) => Number((Math.round(value / step) * step).toPrecision(9));
  const fromPosition = (at) => rounded(log ? min * (max / min) ** (at / steps) : min + (at / steps) * (max - min));

  const range = h('input', { type: 'range', id, min: 0, max: steps, step: 1, title: hint });
  const field = h('input', {
    type: 'number', min, max, step, inputmode: 'decimal', 'aria-label': `${label}${unit ? `, ${unit}` : ''}`,
  });
  const show = (value) => {
    range.value = String(toPosition(value));
    range.style.setProperty('--filled', String(clamp(toPosition(value) / steps, 0, 1)));
    range.setAttribute('aria-valuetext', `${formatNumber(value)}${unit ? ` ${unit}` : ''}`);
    if (document.activeElement !== field) field.value = String(rounded(value));
  };
  range.addEventListener('input', () => {
    const value = fromPosition(Number(range.value));
    show(value);
    onInput(value);
  });
  field.addEventListener('change', () => {
    const value = field.valueAsNumber;
    if (Number.isFinite(value)) onInput(clamp(value, min, max));
  });
  const element = h('div', { class: 'control slider' },
    h('label', { for: id, title: hint }, label),
    h('span', { class: 'number' }, field, unit ? h('span', { class: 'unit' }, unit) : null),
    range);
  return { element, set: show };
}

/**
 * A number alone.
 * @param {{label: string, step?: number, min?: number, max?: number, unit?: string,
 *   onInput: (value: number) => void}} options
 */
export function numberField({ label, step = 1, min, max, unit, onInput }) {
  const id = freshId();
  const field = h('input', { type: 'number', id, step, min, max, inputmode: 'decimal' });
  field.addEventListener('change', () => {
    const value = field.valueAsNumber;
    if (Number.isFinite(value)) onInput(clamp(value, min ?? -Infinity, max ?? Infinity));
  });
  const element = h('div', { class: 'control field' }, h('label', { for: id }, label),
    h('span', { class: 'number' }, field, unit ? h('span', { class: 'unit' }, unit) : null));
  const set = (value) => {
    if (document.activeElement !== field) field.value = String(value);
  };
  return { element, set, field };
}

/**
 * One of a few words, side by side.
 * @param {{label: string, options: [string, string][], onInput: (value: string) => void}} options value and word
 */
export function segments({ label, options, onInput }) {
  const name = freshId();
  const group = h('div', { class: 'segments', role: 'radiogroup', 'aria-label': label });
  let value = null;
  const setOptions = (list) => {
    group.replaceChildren(...list.map(([key, word]) => {
      const input = h('input', { type: 'radio', name, value: key, onchange: () => onInput(key) });
      input.checked = key === value;
      return h('label', {}, input, h('span', {}, word));
    }));
  };
  setOptions(options);
  const set = (wanted) => {
    value = wanted;
    for (const input of group.querySelectorAll('input')) input.checked = input.value === wanted;
  };
  const element = h('div', { class: 'control stacked' }, h('span', { class: 'label' }, label), group);
  return { element, set, setOptions };
}

/**
 * On or off.
 * @param {{label: string, hint?: string, onInput: (on: boolean) => void}} options
 */
export function toggle({ label, hint, onInput }) {
  const input = h('input', { type: 'checkbox', role: 'switch', onchange: () => onInput(input.checked) });
  const element = h('label', { class: 'control toggle', title: hint }, h('span', {}, label), input);
  const set = (on) => {
    input.checked = on;
  };
  return { element, set };
}

/**
 * A colour, `#rrggbb`.
 * @param {{label: string, onInput: (color: string) => void}} options
 */
export function colorField({ label, onInput }) {
  const id = freshId();
  const input = h('input', { type: 'color', id, oninput: () => onInput(input.value) });
  const element = h('div', { class: 'control color' }, h('label', { for: id }, label), input);
  const set = (color) => {
    input.value = color.slice(0, 7);
  };
  return { element, set };
}

/**
 * Both ends of an interval on one track.
 * @param {{label: string, onInput: (low: number, high: number) => void}} options
 */
export function rangePair({ label, onInput }) {
  const STEPS = 500;
  let bounds = [0, 1];
  const make = (end) => h('input', { type: 'range', min: 0, max: STEPS, 'aria-label': `${label}, ${end}` });
  const [low, high] = [make('from'), make('to')];
  const text = h('output', {});
  const track = h('div', { class: 'pair' }, low, high);
  const valueAt = (input) => bounds[0] + (Number(input.value) / STEPS) * (bounds[1] - bounds[0]);
  const describe = () => {
    text.textContent = `${formatNumber(valueAt(low))} … ${formatNumber(valueAt(high))}`;
    track.style.setProperty('--from', String(Number(low.value) / STEPS));
    track.style.setProperty('--to', String(Number(high.value) / STEPS));
    for (const input of [low, high]) input.setAttribute('aria-valuetext', formatNumber(valueAt(input)));
    // Where both are at the upper end, the lower one must be within reach.
    low.style.zIndex = Number(low.value) > STEPS / 2 ? '2' : '1';
  };
  const changed = (moved) => {
    if (Number(low.value) >= Number(high.value)) {
      if (moved === low) low.value = String(Number(high.value) - 1);
      else high.value = String(Number(low.value) + 1);
    }
    describe();
    onInput(valueAt(low), valueAt(high));
  };
  low.addEventListener('input', () => changed(low));
  high.addEventListener('input', () => changed(high));
  const element = h('div', { class: 'control slider' }, h('span', { class: 'label' }, label), text, track);
  /** @param {[number, number]} newBounds @param {number} from @param {number} to */
  const set = (newBounds, from, to) => {
    bounds = newBounds;
    const position = (value) => String(Math.round(((value - bounds[0]) / (bounds[1] - bounds[0])) * STEPS));
    low.value = position(from);
    high.value = position(to);
    describe();
  };
  return { element, set };
}

/**
 * @param {string} text
 * @param {() => void} onClick
 * @param {Record<string, any>} [props]
 */
export const button = (text, onClick, props = {}) =>
  h('button', { type: 'button', class: 'button', ...props, onclick: onClick }, text);

/** Copies text, also where the page is not served securely. @param {string} text */
export async function copyText(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = h('textarea', { class: 'offscreen', readonly: true }, text);
    (document.querySelector('dialog[open]') ?? document.body).append(area);
    area.select();
    document.execCommand('copy');
    area.remove();
  }
}
