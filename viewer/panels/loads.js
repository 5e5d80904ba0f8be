/** Volumes on their way as rows: how far each is, a way to stop it, what went wrong, and what there is to choose. */

import { button } from '../controls.js';
import { h } from '../dom.js';
import { icon } from '../icons.js';

/** @param {import('../loads.js').Loads} loads */
export function loadsList(loads) {
  const list = h('div', { class: 'uploads' });
  const rows = new Map();
  const add = (load) => {
    const element = row(load, loads);
    rows.set(load, element);
    list.append(element);
  };
  loads.all.forEach(add);
  loads.on('add', add);
  loads.on('remove', (load) => {
    const element = rows.get(load);
    // Who pressed the button that goes away is not thrown back to the beginning of the page.
    if (element?.contains(document.activeElement)) list.closest('details')?.querySelector('summary')?.focus();
    element?.remove();
    rows.delete(load);
  });
  return list;
}

function row(load, loads) {
  const text = h('span', { class: 'facts-line' });
  const bar = h('progress', { max: 1, 'aria-label': `Loading ${load.name}` });
  const choices = h('div', { class: 'choices', role: 'group', hidden: true });
  const close = h('button', { type: 'button', class: 'icon-button', onclick: () => loads.dismiss(load) }, icon('close'));
  const element = h('div', { class: 'upload' }, h('span', { class: 'name', title: load.name }, load.name), text, bar, choices, close);

  const show = () => {
    const { error, choice, fraction } = load;
    bar.hidden = Boolean(error);
    element.classList.toggle('failed', Boolean(error) && !choice);
    close.setAttribute('aria-label', `${error ? 'Dismiss' : 'Cancel'} ${load.name}`);
    close.title = error ? 'Dismiss' : 'Cancel';
    // Percents are in the bar's own role, and failures in a toast; a question interrupts by itself.
    if (choice) text.setAttribute('role', 'alert');
    else text.removeAttribute('role');
    choices.hidden = !choice;
    if (error) {
      text.textContent = choice?.question ? `${capitalized(choice.question)}:` : error.message ?? String(error);
      text.title = [error.code, error.requestId && `request ${error.requestId}`].filter(Boolean).join(' · ');
      choices.setAttribute('aria-label', choice?.question ?? '');
      choices.replaceChildren(...(choice?.options ?? []).map(({ value, label }) =>
        button(label, () => loads.choose(load, value), { title: `${choice.parameter} ${value}` })));
      return;
    }
    text.title = '';
    text.textContent = fraction === null ? `${capitalized(load.words)}…` : `${capitalized(load.words)} ${Math.floor(fraction * 100)} %`;
    if (fraction === null) bar.removeAttribute('value');
    else bar.value = fraction;
  };
  load.on('change', show);
  show();
  return element;
}

const capitalized = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1)}`;
