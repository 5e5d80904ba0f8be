/** The page: makes the parts, tells them of each other, and decides what to show first. */

import { api, onKeyNeeded } from './api.js';
import { OrbitCamera } from './camera.js';
import { attachCameraInput } from './camera_input.js';
import { askForKey, helpDialog, saveDialog, shareDialog } from './dialogs.js';
import { byId } from './dom.js';
import { informationDialog } from './information.js';
import { Ledger } from './ledger.js';
import { Library } from './library.js';
import { hashOf, parseHash } from './link.js';
import { openDataDialog } from './open_data.js';
import { attachOrientation } from './orientation.js';
import { attachEmptyState, attachOverlay } from './overlay.js';
import { ambientOcclusionPanel, attachComparison } from './panels/ambient_occlusion.js';
import { lightingPanel } from './panels/lighting.js';
import { performancePanel } from './panels/performance.js';
import { scenePanel } from './panels/scene.js';
import { transferFunctionPanel } from './panels/transfer_function.js';
import { viewPanel } from './panels/view.js';
import { volumesPanel } from './panels/volumes.js';
import { Picture } from './picture.js';
import { findVolume } from './recovery.js';
import { Session } from './session.js';
import { attachSheet } from './sheet.js';
import { Slices } from './slices.js';
import { SceneStore } from './store.js';
import { attachTheme } from './theme.js';
import { toast, toastError } from './toast.js';
import { decorateToolbar } from './toolbar.js';
import { Undo } from './undo.js';
import { attachDrop } from './upload.js';

/**
 * @typedef {Object} Context
 * @property {SceneStore} store
 * @property {Session} session
 * @property {OrbitCamera} camera
 * @property {Picture} picture
 * @property {Ledger} ledger
 * @property {Library} library
 * @property {Undo} undo
 * @property {any} server what `GET /v1/server` answered
 */

/** The hash that this page wrote itself. */
let ownHash = '';

async function start() {
  onKeyNeeded(askForKey);
  attachTheme(byId('theme'));
  const store = new SceneStore();
  const camera = new OrbitCamera();
  const picture = new Picture(byId('stage'), byId('picture'));
  const ledger = new Ledger();
  const session = new Session(store, camera, picture, ledger);
  const library = new Library(session, picture);
  const undo = new Undo(session);
  const server = await waitForServer();
  /** @type {Context} */
  const context = { store, session, camera, picture, ledger, library, undo, server };
  library.maxBytes = server.limits?.max_upload_bytes ?? Infinity;
  picture.setLimit(server.limits?.max_image_axis ?? Infinity);
  build(context);
  await openFirst(context);
}

/** A page that was opened a moment before its server waits for it. */
async function waitForServer() {
  for (let delay = 300; ; delay = Math.min(delay * 1.7, 5000)) {
    try {
      return await api.server();
    } catch (error) {
      if (error.status !== 0 && error.status !== 503) throw error;
      byId('status').textContent = 'Waiting for the server…';
      await new Promise((resolve) => setTimeout(resolve, delay));
    }
  }
}

/** @param {Context} context */
function build(context) {
  const { session, library, undo, store, picture, server } = context;
  const actions = {
    choose: (volume) => library.choose(volume),
    open: () => openDataDialog(library),
    about: (volume) => informationDialog(volume, context),
    makeProcedural: (kind, size) => library.makeProcedural(kind, size),
    remove: (volume) => library.remove(volume),
  };
  attachOverlay(context);
  attachEmptyState(context, actions);
  byId('panels').append(
    volumesPanel(context, actions), transferFunctionPanel(context), ambientOcclusionPanel(context),
    lightingPanel(context), scenePanel(context), viewPanel(context), performancePanel(context),
  );
  const sheet = attachSheet();
  library.loads.on('add', (load) => load.order > 0 && sheet.open('volumes'));
  library.loads.on('failed', (load) => load.order > 0 && !load.choice && toastError(load.error, `${load.name}: `));
  attachDrop(byId('drop'), (found) => library.openFiles(found));
  attachCameraInput(byId('picture'), context.camera);
  attachComparison(context, byId('compare'));
  attachOrientation(context, byId('orientation'));
  const slices = new Slices(context);
  decorateToolbar(context, {
    slices: () => slices.toggle(),
    about: () => session.volume && actions.about(session.volume),
    share: () => share(context),
    save: () => store.scene && saveDialog(session.documentOfView(), picture.size, server.limits?.max_image_axis ?? 4096, session.volume?.name ?? 'picture'),
    help: helpDialog,
  });
  session.on('notice', ({ kind, message, code }) => (kind === 'error' ? toastError({ message, code }) : toast(message)));
  undo.on('error', (error) => (error.code === 'nothing_to_undo' ? toast(`${error.message}.`) : toastError(error)));
  session.on('settled', () => writeHash(context));
  session.on('lost', () => {
    library.refresh();
    clearHash();
  });
  session.on('status', ({ phase }) => phase === 'idle' && clearHash());
  window.addEventListener('hashchange', () => location.hash !== ownHash && openFirst(context));
}

/**
 * The scene of the link, else the first one that has its volume, else a scene of the first volume, else the empty page.
 * @param {Context} context
 */
async function openFirst({ session, library, picture }) {
  const { sceneId, linked } = await parseHash(location.hash);
  try {
    const volumes = await library.refresh();
    if (sceneId || linked) {
      const answer = sceneId ? await api.scene(sceneId).catch(onlyMissing) : null;
      if (answer && isLinked(answer, linked, volumes)) return await session.open(answer, linked?.scene.camera);
      const volume = linked && findVolume(volumes, linked.volume);
      if (volume) {
        const scene = { ...linked.scene, volume: volume.id };
        await session.open(await api.createScene(scene), linked.scene.camera);
        return toast('The linked scene was gone; it was made again.');
      }
      const name = linked ? `the volume “${linked.volume.name}”` : 'the scene';
      toast(`The link leads to a scene that is gone, and this server does not have ${name}.`, 'error');
    }
    // A scene may be left of a volume that was deleted.
    const scene = (await api.scenes()).find((one) => volumes.some(({ id }) => id === one.volume));
    if (scene) return await session.open(scene);
    if (volumes[0]) {
      return await session.open(await api.createScene({ volume: volumes[0].id, viewport: { ...picture.size } }));
    }
    return session.close();
  } catch (error) {
    session.close();
    return toastError(error);
  }
}

/**
 * Whether a scene is the one of a link, and not another that has the same id since a restart or on another server.
 * @param {any} answer
 * @param {import('./link.js').LinkedScene | null} linked
 * @param {any[]} volumes
 */
function isLinked(answer, linked, volumes) {
  if (!linked) return true;
  const volume = volumes.find(({ id }) => id === answer.volume);
  return answer.revision >= (linked.revision ?? 0) && Boolean(volume && findVolume([volume], linked.volume));
}

function onlyMissing(error) {
  if (error.status === 404) return null;
  throw error;
}

/** @param {Context} context */
function linkOf({ session, store }) {
  const { name, sha256 } = session.volume ?? {};
  return hashOf(store.id, { volume: { name, sha256 }, revision: store.revision, scene: session.documentOfView() });
}

/** The address bar always holds the link to what is seen. @param {Context} context */
async function writeHash(context) {
  if (!context.store.scene || !context.session.volume) return;
  const hash = await linkOf(context);
  if (hash === ownHash) return;
  ownHash = hash;
  history.replaceState(null, '', hash);
}

function clearHash() {
  ownHash = '';
  history.replaceState(null, '', location.pathname + location.search);
}

/** @param {Context} context */
async function share(context) {
  if (!context.store.scene) return;
  const link = new URL(await linkOf(context), location.href).href;
  await shareDialog(link, context.session.documentOfView());
}

start().catch((error) => toastError(error));
