// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// View of a finished map: its mesh, the tools, and the tracking quality.
import { element, setStatus } from './dom.js';
import { readFields } from './fields.js';
import { kPhone } from './layout.js';
import { loadModel } from './model.js';
import { fillPanel, framesInWords, kLevels, levelOf } from './panel.js';
import { readSpz, Splats } from './splats.js';
import { Tiles } from './tiles.js';
import { addTools } from './tools.js';

const kPollInterval = 30;  // milliseconds
const kPhoneSplats = 150_000;  // drawn on a small screen: the most important

function decoded(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

/** Bytes of a file in this page: elements with base64, added by the browser while it parses the page. */
async function embedded(name, progress) {
  const chunks = [];
  let bytes = 0;
  for (let isComplete = false; !isComplete;) {
    isComplete = document.readyState !== 'loading';
    for (const part of document.querySelectorAll(`script[data-of="${name}"]`)) {
      const next = part.nextElementSibling;
      if (!next && !isComplete) break;  // the end of the element is not parsed
      isComplete ||= next.dataset.of !== name;
      chunks.push(decoded(part.textContent));
      bytes += chunks.at(-1).byteLength;
      part.remove();
    }
    progress?.(bytes);
    if (!isComplete) await new Promise((resolve) => setTimeout(resolve, kPollInterval));
  }
  return new Blob(chunks).arrayBuffer();
}

/** Bytes of a file of the server, or of this page ("#name"). `progress(bytes)` is called with the bytes so far. */
async function fetched(url, progress) {
  if (url.startsWith('#')) return embedded(url.slice(1), progress);
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`${url} cannot be fetched: ${answer.status} ${answer.statusText}`);
  if (!progress) return answer.arrayBuffer();
  const chunks = [], reader = answer.body.getReader();
  let bytes = 0;
  for (let { done, value } = await reader.read(); !done; { done, value } = await reader.read()) {
    chunks.push(value);
    progress(bytes += value.length);
  }
  return new Blob(chunks).arrayBuffer();
}

/** Note on the scene with the loaded bytes of the mesh: an element with `show(bytes)`. */
function loadingNote({ mesh_bytes: embeddedBytes, files }) {
  const total = embeddedBytes ?? files?.find(({ name }) => name === 'mesh.glb')?.bytes, mb = (bytes) => (bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0);
  const note = element('div', { id: 'loading', aria: { role: 'progressbar', label: 'Loading the mesh' } });
  const show = (bytes) => {
    note.textContent = `Loading ${mb(bytes)}${total ? ` of ${mb(total)}` : ''} MB`;
    if (!total) return;
    note.style.setProperty('--share', bytes / total);
    note.setAttribute('aria-valuenow', Math.round(100 * bytes / total));
  };
  show(0);
  document.getElementById('scene').append(note);
  return Object.assign(note, { show });
}

/** Returns a function that loads the map's fields on its first call. */
function fieldsOf({ fields }) {
  let made;
  return async () => {
    made ??= readFields(await fetched(fields));
    return made;
  };
}

/**
 * Shows a coarser mesh or the untextured mesh, depending on availability, then the textured mesh. `seen(model)`
 * resolves when a model is on the screen.
 */
async function showMesh(scene, data, seen) {
  const isEmpty = scene.triangles === 0;  // a live map is already visible
  const note = loadingNote(data);
  try {
    const coarse = data.first && isEmpty ? await fetched(data.first).catch(() => null) : null;
    if (coarse) await seen((await loadModel(coarse)).model);
    const { model, textured } = await loadModel(await fetched(data.mesh, note.show));
    if (isEmpty && !coarse) await seen(model);
    await textured;
    if (scene.model === model) scene.setLook(scene.look);
    else if (coarse) scene.setModel(model);
    else await seen(model);
  } finally {
    note.remove();
  }
}

/** Shows the tiles of a building, starting with a complete coarse view. */
async function showTiles(scene, { tileset }, panel) {
  const tiles = new Tiles(tileset, { adopt: (mesh) => scene.adopt(mesh), show: (mesh) => { mesh.material = scene.materialOf(mesh); } });
  tiles.onFailed = () => {
    tiles.onFailed = null;  // reports only the first failure
    panel.prepend(element('div', { className: 'warning' }, `Some tiles are not shown: ${tiles.failed[0]}`));
  };
  tiles.update(scene.camera, scene.renderer);
  await tiles.known;
  scene.setTiles(tiles);
  scene.lookAtAll();
  scene.begin();
  while (!tiles.isComplete) await new Promise(requestAnimationFrame);
}

export async function showFinished(scene, data, fold) {
  const { report, trajectory } = data, panel = document.getElementById('panel'), begin = trajectory[0]?.[0] ?? 0;
  document.title = `${data.name} – Cairn`;
  if (report) setStatus(levelOf(report), framesInWords(report));
  else if (data.verdict) setStatus(kLevels[data.verdict.level] ?? 'weak', data.verdict.words);
  else setStatus('good', data.tileset ? 'A building in tiles' : data.mesh ? 'A mesh without a report' : 'Gaussian splats');
  const showPath = () => {
    scene.setPath(new Float32Array(trajectory.flatMap(([t, x, y, z]) => [t - begin, x, y, z])));
    scene.setLoops((report?.loops ?? []).filter((loop) => loop.inlier).map((loop) => [loop.from - begin, loop.to - begin]));
  };
  let isSeen = false;
  const seen = async (model) => {
    if (model) scene.setModel(model);
    else showPath();
    if (model && trajectory.length > 0) scene.lookFrom(trajectory[0]);
    else if (!scene.tiles) scene.lookAtAll();
    scene.begin();
    await scene.shown();
    performance.mark('picture');
    isSeen = true;
    // After the map is visible: software compiles a shader for lines in 0.1 s.
    showPath();
    fillPanel(panel, data);
  };
  if (data.mesh) {
    try {
      await showMesh(scene, data, seen);
    } catch (error) {  // Draco's decoder is not part of this page
      panel.prepend(element('div', { className: 'warning' }, `The mesh is not shown here: ${error.message}`));
    }
  }
  if (data.tileset) await showTiles(scene, data, panel);
  const loadSplats = data.splats && (async () => new Splats(await readSpz(await fetched(data.splats), kPhone.matches ? kPhoneSplats : Infinity)));
  if (!isSeen) {
    if (loadSplats && !data.tileset) scene.setSplats(await loadSplats());
    await seen();
    if (!data.tileset && !scene.splats) {
      document.getElementById('scene').append(element('div', { id: 'empty' }, 'No surface'));
      fold.show(true);  // with the reasons
    }
  }
  addTools(scene, data, fieldsOf(data), fold, loadSplats);
  await scene.shown();
  performance.mark('complete');
}
