// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// View of a finished map: its mesh, the tools, and the tracking quality.
import { element, setStatus } from './dom.js';
import { readFields } from './fields.js';
import { loadModel } from './model.js';
import { fillPanel, framesInWords, kLevels, levelOf } from './panel.js';
import { Tiles } from './tiles.js';
import { addTools } from './tools.js';

function decoded(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

/** Fetches a file. `progress(bytes)` is called with the bytes so far. */
async function fetched(url, progress) {
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

/** Fetches the mesh; a note on the scene states the progress. */
async function fetchedMesh({ mesh, files }) {
  const note = element('div', { id: 'loading', role: 'status' }), mb = (bytes) => (bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0);
  const total = files?.find((file) => file.name === 'mesh.glb')?.bytes;
  document.getElementById('scene').append(note);
  try {
    return await fetched(mesh, (bytes) => { note.textContent = `Loading ${mb(bytes)}${total ? ` of ${mb(total)}` : ''} MB`; });
  } finally {
    note.remove();
  }
}

/** Returns a function that loads the map's fields on its first call. */
function fieldsOf({ fields, fields_base64: inline }) {
  let made;
  return async () => {
    made ??= inline ? readFields(decoded(inline)) : readFields(await fetched(fields));
    return made;
  };
}

/**
 * Shows a coarser mesh or the untextured mesh, depending on availability, then the textured mesh. `seen(model)`
 * resolves when a model is on the screen.
 */
async function showMesh(scene, data, seen) {
  const isEmpty = scene.triangles === 0;  // a live map is already visible
  const coarse = data.first && isEmpty ? await fetched(data.first).catch(() => null) : null;
  if (coarse) await seen((await loadModel(coarse)).model);
  const { model, textured } = await loadModel(data.mesh_base64 ? decoded(data.mesh_base64) : await fetchedMesh(data));
  if (isEmpty && !coarse) await seen(model);
  await textured;
  if (scene.model === model) scene.setLook(scene.look);
  else if (coarse) scene.setModel(model);
  else await seen(model);
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
  else setStatus('good', data.tileset ? 'A building in tiles' : 'A mesh without a report');
  scene.setPath(new Float32Array(trajectory.flatMap(([t, x, y, z]) => [t - begin, x, y, z])));
  scene.setLoops((report?.loops ?? []).filter((loop) => loop.inlier).map((loop) => [loop.from - begin, loop.to - begin]));
  let isSeen = false;
  const seen = async (model) => {
    if (model) scene.setModel(model);
    if (model && trajectory.length > 0) scene.lookFrom(trajectory[0]);
    else if (!scene.tiles) scene.lookAtAll();
    scene.begin();
    await scene.shown();
    performance.mark('picture');
    isSeen = true;
    fillPanel(panel, data);  // after the map is visible
  };
  if (data.mesh || data.mesh_base64) {
    try {
      await showMesh(scene, data, seen);
    } catch (error) {  // Draco's decoder is not part of this page
      panel.prepend(element('div', { className: 'warning' }, `The mesh is not shown here: ${error.message}`));
    }
  }
  if (data.tileset) await showTiles(scene, data, panel);
  if (!isSeen) await seen();
  addTools(scene, data, fieldsOf(data), fold);
  await scene.shown();
  performance.mark('complete');
}
