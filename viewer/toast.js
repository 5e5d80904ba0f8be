/** Short messages above the picture. */

import { byId, h } from './dom.js';
import { icon } from './icons.js';

const SHORT = 5000;
const LONG = 12_000;
/** More would cover the picture. */
const MOST = 3;

/**
 * @param {string} message
 * @param {'info' | 'error'} [kind]
 * @param {string} [detail] for reports: an error's code and request
 */
export function toast(message, kind = 'info', detail = '') {
  const box = byId('toasts');
  // The same complaint for every update of a drag is one complaint.
  const same = [...box.children].find((child) => child.dataset.message === message);
  same?.remove();
  const close = h('button', { type: 'button', class: 'icon-button', 'aria-label': 'Dismiss' }, icon('close'));
  const element = h('div', { class: `toast ${kind}`, role: kind === 'error' ? 'alert' : 'status', 'data-message': message },
    h('p', {}, message, detail ? h('small', {}, detail) : null), close);
  close.addEventListener('click', () => element.remove());
  box.append(element);
  while (box.children.length > MOST) box.firstChild.remove();
  setTimeout(() => element.remove(), kind === 'error' ? LONG : SHORT);
}

/** @param {any} error an ApiError, or anything thrown */
export function toastError(error, prefix = '') {
  if (error?.code === 'cancelled' || error?.name === 'AbortError') return;
  const detail = [error?.code, error?.requestId && `request ${error.requestId}`].filter(Boolean).join(' · ');
  const message = String(error?.message ?? error);
  toast(`${prefix}${message.charAt(0).toUpperCase()}${message.slice(1)}`, 'error', detail);
}
