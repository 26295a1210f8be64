// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A finished map: its mesh, the tools to look at it, and how well it was tracked.
import { element, setStatus } from './dom.js';
import { readFields } from './fields.js';
import { loadModel } from './model.js';
import { fillPanel, framesInWords, levelOf } from './panel.js';
import { addTools } from './tools.js';

function decoded(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

async function fetched(url) {
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`${url} cannot be fetched: ${answer.status} ${answer.statusText}`);
  return answer.arrayBuffer();
}

/** Promises the map's fields when they are asked for first. */
function fieldsOf({ fields, fields_base64: inline }) {
  let made;
  return async () => {
    made ??= inline ? readFields(decoded(inline)) : readFields(await fetched(fields));
    return made;
  };
}

async function showMesh(scene, data, panel) {
  try {
    const bytes = data.mesh_base64 ? decoded(data.mesh_base64) : data.mesh ? await fetched(data.mesh) : null;
    if (bytes) scene.setModel(await loadModel(bytes));
  } catch (error) {  // Draco's decoder is not in this page
    panel.prepend(element('div', { className: 'warning' }, `The mesh is not shown here: ${error.message}`));
  }
}

export async function showFinished(scene, data, fold) {
  const { report, trajectory } = data, panel = document.getElementById('panel'), begin = trajectory[0]?.[0] ?? 0;
  document.title = `${data.name} – Cairn`;
  if (report) setStatus(levelOf(report), framesInWords(report));
  else setStatus('good', 'A mesh without a report');
  scene.setPath(new Float32Array(trajectory.flatMap(([t, x, y, z]) => [t - begin, x, y, z])));
  scene.setLoops((report?.loops ?? []).filter((loop) => loop.inlier).map((loop) => [loop.from - begin, loop.to - begin]));
  await showMesh(scene, data, panel);
  if (trajectory.length > 0 && scene.model) scene.lookFrom(trajectory[0]);
  else scene.lookAtAll();
  // The map first; what stands around it comes when it has been drawn.
  await scene.drawn();
  fillPanel(panel, data);
  addTools(scene, data, fieldsOf(data), fold);
}
