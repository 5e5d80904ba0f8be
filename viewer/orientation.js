/** A small cross of axes in the corner of the picture: which way a patient, or else the world, lies. */

import { byId, s, setAttributes } from './dom.js';
import { nearestWorldAxis } from './grid.js';
import { hasPatientAxes } from './patient.js';
import { preference, setPreference } from './preferences.js';

/** Of the world's x, y and z: what they lead to, and what they come from. */
const PATIENT = [['L', 'R'], ['P', 'A'], ['S', 'I']];
const WORDS = { L: 'left', R: 'right', P: 'back', A: 'front', S: 'head', I: 'feet' };
const WORLD = [['x', ''], ['y', ''], ['z', '']];
const NAMES = ['x', 'y', 'z'];
/** In units of the drawing, which is 100 wide. */
const ARM = 33;
const BALL = 11;

/** @param {boolean} isShown */
export function setOrientationShown(isShown) {
  setPreference('orientation', isShown ? 'yes' : 'no');
  byId('orientation').dispatchEvent(new Event('shown'));
}

/**
 * @param {import('./app.js').Context} context
 * @param {HTMLElement} element
 */
export function attachOrientation({ camera, session }, element) {
  let isPatient = false;
  const ends = NAMES.flatMap((name, axis) => [1, -1].map((sign) => {
    const line = s('line', {});
    const ball = s('circle', { r: sign > 0 ? BALL : BALL * 0.8 });
    const text = s('text', {});
    const end = s('g', { class: `axis-${name} ${sign > 0 ? 'to' : 'from'}` }, line, ball, text);
    return { axis, sign, line, ball, text, end };
  }));
  const drawing = s('svg', { viewBox: '-50 -50 100 100', role: 'img' });
  element.append(drawing);

  const draw = () => {
    if (element.hidden) return;
    const { right, up, back } = camera.axes;
    for (const one of ends) {
      const along = (vector) => one.sign * vector[one.axis];
      const [x, y] = [ARM * along(right), -ARM * along(up)];
      one.depth = along(back);
      setAttributes(one.line, { x2: x, y2: y });
      setAttributes(one.ball, { cx: x, cy: y });
      setAttributes(one.text, { x, y });
      one.text.textContent = (isPatient ? PATIENT : WORLD)[one.axis][one.sign > 0 ? 0 : 1];
      one.end.setAttribute('opacity', String(0.72 + 0.28 * one.depth));
    }
    // What is nearer is drawn over what is farther.
    drawing.append(...[...ends].sort((a, b) => a.depth - b.depth).map(({ end }) => end));
    drawing.setAttribute('aria-label', describe(back, isPatient));
  };
  const refresh = () => {
    element.hidden = !session.volume || preference('orientation', 'yes') !== 'yes';
    draw();
  };
  camera.on('change', draw);
  // A scene brings a camera without a person moving it.
  for (const event of ['status', 'settled']) session.on(event, refresh);
  element.addEventListener('shown', refresh);
  session.on('volume', async (volume) => {
    isPatient = false;
    refresh();
    if (!volume) return;
    const answer = await hasPatientAxes(volume);
    if (session.volume !== volume) return;
    isPatient = answer;
    refresh();
  });
}

/** Where the viewer is, in words. */
function describe(back, isPatient) {
  const axis = nearestWorldAxis(back);
  if (!isPatient) return `Seen from ${back[axis] > 0 ? '+' : '−'}${NAMES[axis]}`;
  return `Seen from the ${WORDS[PATIENT[axis][back[axis] > 0 ? 0 : 1]]}`;
}
