/** The frame of a panel: a heading that folds its content away, remembered per browser. */

import { h } from '../dom.js';
import { icon } from '../icons.js';
import { preference, setPreference } from '../preferences.js';

/**
 * @param {string} id
 * @param {string} title
 * @param {{open?: boolean, extra?: Node}} options `extra` stands at the right of the heading
 * @param {...Node} children
 */
export function section(id, title, { open = false, extra } = {}, ...children) {
  const isOpen = preference(`open.${id}`, open ? 'yes' : 'no') === 'yes';
  const element = h('details', { class: 'section', id: `section-${id}`, open: isOpen },
    h('summary', {}, icon('chevron'), h('h2', {}, title), extra ?? null),
    h('div', { class: 'section-body' }, ...children));
  element.addEventListener('toggle', () => setPreference(`open.${id}`, element.open ? 'yes' : 'no'));
  return element;
}

/** A control in the heading must not fold the section. @param {HTMLElement} element */
export function inHeading(element) {
  element.addEventListener('click', (event) => event.stopPropagation());
  return element;
}
