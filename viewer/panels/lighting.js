/** The light and how the surface answers it. */

import { colorField, slider, toggle } from '../controls.js';
import { h } from '../dom.js';
import { anglesFromDirection, directionFromAngles } from '../vector.js';
import { section } from './section.js';

/** What the light starts from when it leaves the head. */
const FIRST_ANGLES = { azimuth: 40, elevation: 35 };

/** @param {import('../app.js').Context} context */
export function lightingPanel({ store, camera }) {
  const edit = (patch) => store.edit({ lighting: patch });
  const coefficient = (label, key, max = 2) =>
    slider({ label, min: 0, max, step: 0.01, onInput: (value) => edit({ [key]: value }) });
  const ambient = coefficient('Ambient', 'ambient');
  const diffuse = coefficient('Diffuse', 'diffuse');
  const specular = coefficient('Specular', 'specular');
  const shininess = slider({
    label: 'Shininess', min: 1, max: 1000, step: 1, log: true, onInput: (value) => edit({ shininess: value }),
  });
  const color = colorField({ label: 'Colour', onInput: (value) => edit({ color: value }) });

  let angles = FIRST_ANGLES;
  const setAngles = (change) => {
    angles = { ...angles, ...change };
    const direction = directionFromAngles(angles.azimuth, angles.elevation);
    edit({ direction: direction.map((value) => Number(value.toFixed(5))) });
  };
  const headLight = toggle({
    label: 'Light from the viewer',
    // Starts beside where the viewer is: a light from behind would leave the picture dark.
    onInput: (on) => (on ? edit({ direction: null }) : setAngles({
      azimuth: ((camera.azimuth + FIRST_ANGLES.azimuth + 540) % 360) - 180, elevation: FIRST_ANGLES.elevation,
    })),
  });
  const azimuth = slider({
    label: 'Azimuth', min: -180, max: 180, step: 1, unit: '°', onInput: (value) => setAngles({ azimuth: value }),
  });
  const elevation = slider({
    label: 'Elevation', min: -90, max: 90, step: 1, unit: '°', onInput: (value) => setAngles({ elevation: value }),
  });

  let lastExposure = 1;
  const automatic = toggle({
    label: 'Automatic exposure', hint: 'Makes up for the light that ambient occlusion takes away',
    onInput: (on) => edit({ exposure: on ? null : lastExposure }),
  });
  const exposure = slider({
    label: 'Exposure', min: 0.1, max: 8, step: 0.05, log: true, unit: '×', onInput: (value) => edit({ exposure: value }),
  });

  store.on('scene', (scene) => {
    const lighting = scene?.lighting;
    if (!lighting) return;
    ambient.set(lighting.ambient);
    diffuse.set(lighting.diffuse);
    specular.set(lighting.specular);
    shininess.set(lighting.shininess);
    color.set(lighting.color ?? '#ffffff');
    const fixed = Boolean(lighting.direction);
    headLight.set(!fixed);
    if (fixed) {
      const { azimuth: a, elevation: e } = anglesFromDirection(lighting.direction);
      // At the zenith any azimuth will do: the last one stays.
      angles = { azimuth: Math.abs(e) > 89.9 ? angles.azimuth : Math.round(a), elevation: Math.round(e) };
      azimuth.set(angles.azimuth);
      elevation.set(angles.elevation);
    }
    azimuth.element.hidden = !fixed;
    elevation.element.hidden = !fixed;
    const given = typeof lighting.exposure === 'number';
    automatic.set(!given);
    if (given) {
      lastExposure = lighting.exposure;
      exposure.set(lighting.exposure);
    }
    exposure.element.hidden = !given;
  });
  return section('light', 'Light', {}, h('div', { class: 'stack' }, ambient.element, diffuse.element,
    specular.element, shininess.element, color.element, h('hr'), headLight.element, azimuth.element,
    elevation.element, h('hr'), automatic.element, exposure.element));
}
