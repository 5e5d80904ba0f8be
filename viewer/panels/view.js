/** Where from and how large: this page's own view, not part of what is shared with others who look at the scene. */

import { button, segments, slider, toggle } from '../controls.js';
import { h } from '../dom.js';
import { setOrientationShown } from '../orientation.js';
import { preference, setPreference } from '../preferences.js';
import { section } from './section.js';

/** Azimuth and elevation. */
const DIRECTIONS = {
  Front: [0, 0], Back: [180, 0], Left: [90, 0], Right: [-90, 0], Top: [0, 90], Bottom: [0, -90],
};

/** @param {import('../app.js').Context} context */
export function viewPanel({ camera, picture, session }) {
  const directions = h('div', { class: 'directions', role: 'group', 'aria-label': 'Look from' },
    ...Object.entries(DIRECTIONS).map(([name, angles]) => button(name, () => camera.lookFrom(...angles))));
  const projection = segments({
    label: 'Projection', options: [['perspective', 'Perspective'], ['orthographic', 'Orthographic']],
    onInput: (value) => camera.setProjection(/** @type {any} */ (value)),
  });
  const fov = slider({
    label: 'Field of view', min: 5, max: 110, step: 1, unit: '°', onInput: (value) => camera.setFov(value),
  });
  const quality = segments({
    label: 'Resolution', options: [['economy', 'Economy'], ['standard', 'Standard'], ['full', 'Full']],
    onInput: (value) => {
      setPreference('quality', value);
      picture.setQuality(value);
    },
  });
  const initial = preference('quality', 'standard');
  quality.set(initial);
  picture.setQuality(initial);

  const orientation = toggle({
    label: 'Orientation marker', hint: 'Which way is left, posterior and superior, in the corner of the picture',
    onInput: setOrientationShown,
  });
  orientation.set(preference('orientation', 'yes') === 'yes');

  const refresh = () => {
    projection.set(camera.projection);
    fov.set(camera.fov);
    fov.element.hidden = camera.projection !== 'perspective';
  };
  camera.on('change', refresh);
  session.on('status', refresh);
  return section('view', 'View', {}, h('div', { class: 'stack' }, directions, projection.element, fov.element, quality.element,
    orientation.element));
}
