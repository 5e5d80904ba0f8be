/** Mouse, touch, wheel and keys on the picture, turned into camera moves. */

/** Degrees for a drag over the whole height of the picture. */
const DEGREES_PER_HEIGHT = 200;
/** Per second while a key is held. */
const KEY_DEGREES = 75;
const KEY_PAN = 0.45;
const KEY_ZOOM = 1.9;
const WHEEL_RATE = 0.0015;
const MOVES = new Set(['ArrowLeft', 'ArrowRight', 'ArrowUp', 'ArrowDown', '+', '=', '-', '_']);

/**
 * @param {HTMLElement} element the picture; must be focusable
 * @param {import('./camera.js').OrbitCamera} camera
 */
export function attachCameraInput(element, camera) {
  attachPointers(element, camera);
  attachWheel(element, camera);
  attachKeys(element, camera);
}

function attachPointers(element, camera) {
  /** @type {Map<number, {x: number, y: number}>} */
  const pointers = new Map();
  let panning = false;

  element.addEventListener('pointerdown', (event) => {
    if (pointers.size === 2) return;
    element.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    panning = event.button === 1 || event.button === 2 || event.shiftKey || event.ctrlKey || event.metaKey;
    element.classList.toggle('panning', panning);
    element.classList.add('dragging');
  });
  element.addEventListener('pointermove', (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const after = { x: event.clientX, y: event.clientY };
    const height = element.clientHeight || 1;
    const [dx, dy] = [(after.x - before.x) / height, (after.y - before.y) / height];
    if (pointers.size === 2) {
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      pinch(element, camera, before, after, other);
      camera.pan(dx / 2, dy / 2);
    } else if (panning) {
      camera.pan(dx, dy);
    } else {
      camera.orbit(-dx * DEGREES_PER_HEIGHT, dy * DEGREES_PER_HEIGHT);
    }
    pointers.set(event.pointerId, after);
  });
  const release = (event) => {
    pointers.delete(event.pointerId);
    if (pointers.size === 0) element.classList.remove('dragging', 'panning');
  };
  element.addEventListener('pointerup', release);
  element.addEventListener('pointercancel', release);
  element.addEventListener('contextmenu', (event) => event.preventDefault());
}

/** Two fingers: their distance zooms about the middle between them. */
function pinch(element, camera, before, after, other) {
  const distance = (point) => Math.max(20, Math.hypot(point.x - other.x, point.y - other.y));
  const middle = { clientX: (after.x + other.x) / 2, clientY: (after.y + other.y) / 2 };
  camera.zoom(distance(before) / distance(after), ...fromMiddle(element, middle));
}

/** Distance from the middle of the picture, in picture heights: right, down. */
function fromMiddle(element, { clientX, clientY }) {
  const box = element.getBoundingClientRect();
  const height = box.height || 1;
  return [(clientX - box.left - box.width / 2) / height, (clientY - box.top - box.height / 2) / height];
}

function attachWheel(element, camera) {
  const zoom = (event) => {
    event.preventDefault();
    // Lines and pages, as some browsers count, become pixels.
    const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
    const delta = Math.max(-240, Math.min(240, event.ctrlKey ? pixels * 4 : pixels));
    camera.zoom(Math.exp(delta * WHEEL_RATE), ...fromMiddle(element, event));
  };
  element.addEventListener('wheel', zoom, { passive: false });
}

function attachKeys(element, camera) {
  const held = new Set();
  let shift = false;
  let last = 0;

  const step = (now) => {
    if (held.size === 0) return;
    const seconds = Math.min(0.1, (now - last) / 1000);
    last = now;
    const has = (...keys) => (keys.some((key) => held.has(key)) ? 1 : 0);
    const right = has('ArrowRight') - has('ArrowLeft');
    const up = has('ArrowUp') - has('ArrowDown');
    if (shift && (right || up)) camera.pan(-right * KEY_PAN * seconds, up * KEY_PAN * seconds);
    else if (right || up) camera.orbit(right * KEY_DEGREES * seconds, up * KEY_DEGREES * seconds);
    const nearer = has('+', '=') - has('-', '_');
    if (nearer) camera.zoom(KEY_ZOOM ** (-nearer * seconds));
    requestAnimationFrame(step);
  };
  element.addEventListener('keydown', (event) => {
    shift = event.shiftKey;
    if (!MOVES.has(event.key) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const isFirst = held.size === 0;
    held.add(event.key);
    if (isFirst) {
      // A tap counts as a thirtieth of a second at least, and may be over before the next picture.
      last = performance.now() - 33;
      step(performance.now());
    }
  });
  element.addEventListener('keyup', (event) => {
    shift = event.shiftKey;
    held.delete(event.key);
    // Letting go of shift turns `+` into `=`, whose release is the one that is seen.
    if (event.key === 'Shift') for (const key of ['+', '_']) held.delete(key);
  });
  element.addEventListener('blur', () => held.clear());
}
