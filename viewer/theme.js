/** Light, dark, or as the system likes it. */

import { preference, setPreference } from './preferences.js';

const THEMES = ['auto', 'light', 'dark'];
const NAMES = { auto: 'as the system', light: 'light', dark: 'dark' };

/** @param {HTMLButtonElement} button goes through the themes */
export function attachTheme(button) {
  let theme = preference('theme', 'auto');
  const apply = () => {
    document.documentElement.dataset.theme = theme;
    button.title = `Colours: ${NAMES[theme] ?? NAMES.auto}`;
    button.setAttribute('aria-label', `${button.title}. Change`);
    document.dispatchEvent(new Event('themechange'));
  };
  button.addEventListener('click', () => {
    theme = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length];
    setPreference('theme', theme);
    apply();
  });
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', apply);
  apply();
}
