// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A map that grows: follows the program over a WebSocket, comes back when the connection breaks, and shows what was
// written at the end.
import { element, facts, setStatus, viewButtons } from './dom.js';
import { showFinished } from './finished.js';
import { readMessage } from './messages.js';

const kAgainAfter = 1000;  // milliseconds

/** What stands beside the picture. */
function makePanel() {
  const colour = element('img', { alt: 'What the colour camera sees' }),
        depth = element('img', { alt: 'What the depth camera sees, near red, far blue' });
  const numbers = element('div'), loops = element('ul', { className: 'loops' });
  document.getElementById('panel').append(
      element('div', { className: 'images' }, element('figure', {}, colour, element('figcaption', {}, 'Colour')),
              element('figure', {}, depth, element('figcaption', {}, 'Depth, near red'))),
      element('h2', {}, 'Now'), numbers, element('h2', {}, 'Loops'), loops);
  return { colour, depth, numbers, loops };
}

/** `ask` sends the program what to do. */
function makeButtons(scene, ask) {
  const pause = element('button', { onclick: () => ask(pause.dataset.paused ? 'start' : 'pause') }, 'Pause');
  const reset = element('button', { onclick: () => confirm('Throw this map away and begin again?') && ask('reset') }, 'Reset');
  const finish = element('button', { onclick: () => ask('finish') }, 'Finish');
  const follow = element('button', { onclick: () => scene.setFollow(!scene.follow) }, 'Follow');
  scene.onFollow = (on) => follow.setAttribute('aria-pressed', on);
  document.getElementById('buttons').append(pause, reset, finish, follow, ...viewButtons(scene));
  scene.setFollow(true);
  return { pause, reset, finish };
}

function showNumbers(numbers, state, triangles) {
  const frames = { fused: 0, lost: 0, skipped: 0, ...state.frames };
  numbers.replaceChildren(facts([
    ['Frames a second', state.frames_per_second?.toFixed(1) ?? '–'],
    ['Frame to pose', state.latency_ms ? `${state.latency_ms.toFixed(0)} ms` : '–'],
    ['Frames in the map', frames.fused], ['Frames lost', frames.lost], ['Frames unusable', frames.skipped],
    ['Skipped to keep up', state.skipped_to_keep_up],
    ['Triangles', triangles.toLocaleString('en')],
    ['Keyframes', state.keyframes ?? 0], ['Submaps', state.submaps ?? 1],
    ['Memory', `${state.memory_mb.toFixed(0)} MB`],
  ]));
}

function showState(state, scene, panel, { pause, reset, finish }) {
  setStatus(state.status, state.words);
  pause.textContent = state.status === 'paused' ? 'Resume' : 'Pause';
  pause.dataset.paused = state.status === 'paused' ? 'yes' : '';
  for (const button of [pause, reset, finish]) button.disabled = ['finishing', 'finished'].includes(state.status);
  if (state.camera) scene.setCamera(state.camera, state.view);
  scene.setLoops(state.loops.filter(([, , inlier]) => inlier));
  showNumbers(panel.numbers, state, scene.triangles);
  if (panel.loops.childElementCount !== state.loops.length)
    panel.loops.replaceChildren(...state.loops.map(([from, to, inlier]) => element(
        'li', { className: inlier ? '' : 'refused' }, `${from.toFixed(1)} s ↔ ${to.toFixed(1)} s`)));
}

function showImage(image, blob) {
  URL.revokeObjectURL(image.src);
  image.src = URL.createObjectURL(blob);
}

export function showLive(scene) {
  let socket, isOver = false, epoch = 0;
  const ask = (what) => socket?.readyState === WebSocket.OPEN && socket.send(JSON.stringify({ do: what }));
  const panel = makePanel(), buttons = makeButtons(scene, ask);

  const isNew = (message) => {
    if (message.epoch > epoch) {
      epoch = message.epoch;
      scene.clear();
    }
    return message.epoch === epoch;
  };

  const finish = async (url) => {
    isOver = true;
    const data = await (await fetch(url)).json();
    for (const id of ['buttons', 'panel']) document.getElementById(id).replaceChildren();
    scene.endFollowing();
    await showFinished(scene, data);
    ask('shown');
  };

  const onText = (message) => {
    if (isOver || !isNew(message)) return;
    if (!('status' in message)) return scene.setSubmaps(message.submaps);
    showState(message, scene, panel, buttons);
    if (message.data) finish(message.data).catch((error) => setStatus('gone', `The finished map cannot be shown: ${error.message}`));
  };

  const onBytes = (message) => {
    if (isOver) return;
    if (message.kind === 'image') showImage(panel[message.of], message.jpeg);
    else if (!isNew(message)) return;
    else if (message.kind === 'part') scene.setPart(message);
    else scene.setPath(message.points);
  };

  const connect = () => {
    socket = new WebSocket(new URL('live', location.href.replace(/^http/, 'ws')));
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => { epoch = 0; };  // all of it comes again
    socket.onmessage = ({ data }) => typeof data === 'string' ? onText(JSON.parse(data)) : onBytes(readMessage(data));
    socket.onclose = () => {
      if (isOver) return;
      setStatus('gone', 'The program has ended or cannot be reached; trying again');
      setTimeout(connect, kAgainAfter);
    };
  };
  connect();
}
