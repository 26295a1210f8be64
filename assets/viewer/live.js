// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A map that grows: follows the program over a WebSocket, and comes back when the connection breaks.
import { element, facts, setStatus, viewButtons } from './dom.js';
import { readMessage } from './messages.js';

const kAgainAfter = 1000;  // milliseconds

export function showLive(scene) {
  const colour = element('img', { alt: 'What the colour camera sees' }),
        depth = element('img', { alt: 'What the depth camera sees, near red, far blue' });
  const numbers = element('div'), loops = element('ul', { className: 'loops' });
  document.getElementById('panel').append(
      element('div', { className: 'images' }, element('figure', {}, colour, element('figcaption', {}, 'Colour')),
              element('figure', {}, depth, element('figcaption', {}, 'Depth, near red'))),
      element('h2', {}, 'Now'), numbers, element('h2', {}, 'Loops'), loops);

  let socket, finished = false, epoch = 0;
  const ask = (what) => socket?.readyState === WebSocket.OPEN && socket.send(JSON.stringify({ do: what }));
  const pause = element('button', { onclick: () => ask(pause.dataset.paused ? 'start' : 'pause') }, 'Pause');
  const reset = element('button', { onclick: () => confirm('Throw this map away and begin again?') && ask('reset') }, 'Reset');
  const finish = element('button', { onclick: () => ask('finish') }, 'Finish');
  const follow = element('button', { onclick: () => scene.setFollow(!scene.follow) }, 'Follow');
  scene.onFollow = (on) => follow.setAttribute('aria-pressed', on);
  document.getElementById('buttons').append(pause, reset, finish, follow, ...viewButtons(scene));
  scene.setFollow(true);

  const isNew = (message) => {
    if (message.epoch > epoch) {
      epoch = message.epoch;
      scene.clear();
    }
    return message.epoch === epoch;
  };

  const onState = (state) => {
    if (!isNew(state)) return;
    finished = state.status === 'finished';
    setStatus(state.status, state.words);
    pause.textContent = state.status === 'paused' ? 'Start' : 'Pause';
    pause.dataset.paused = state.status === 'paused' ? 'yes' : '';
    for (const button of [pause, reset, finish]) button.disabled = ['finishing', 'finished'].includes(state.status);
    if (state.camera) scene.setCamera(state.camera, state.view);
    scene.setLoops(state.loops.filter(([, , believed]) => believed));
    const frames = { fused: 0, lost: 0, skipped: 0, ...state.frames };
    numbers.replaceChildren(facts([
      ['Frames a second', state.frames_per_second?.toFixed(1) ?? '–'],
      ['Frame to pose', state.latency_ms ? `${state.latency_ms.toFixed(0)} ms` : '–'],
      ['Fused', frames.fused], ['Lost', frames.lost], ['Unusable', frames.skipped],
      ['Skipped to keep up', state.skipped_to_keep_up],
      ['Triangles', scene.triangles.toLocaleString('en')],
      ['Keyframes', state.keyframes ?? 0], ['Submaps', state.submaps ?? 1],
      ['Memory', `${state.memory_mb.toFixed(0)} MB`],
    ]));
    if (loops.childElementCount !== state.loops.length)
      loops.replaceChildren(...state.loops.map(([from, to, believed]) => element(
          'li', { className: believed ? '' : 'refused' }, `${from.toFixed(1)} s ↔ ${to.toFixed(1)} s`)));
  };

  const show = (image, blob) => {
    URL.revokeObjectURL(image.src);
    image.src = URL.createObjectURL(blob);
  };

  const connect = () => {
    socket = new WebSocket(new URL('live', location.href.replace(/^http/, 'ws')));
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => { epoch = 0; };  // all of it comes again
    socket.onmessage = ({ data }) => {
      if (typeof data === 'string') {
        const message = JSON.parse(data);
        if ('status' in message) onState(message);
        else if (isNew(message)) scene.setSubmaps(message.submaps);
        return;
      }
      const message = readMessage(data);
      if (message.kind === 'image') show(message.of === 'colour' ? colour : depth, message.jpeg);
      else if (!isNew(message)) return;
      else if (message.kind === 'part') scene.setPart(message);
      else scene.setPath(message.points);
    };
    socket.onclose = () => {
      if (finished) return;
      setStatus('gone', 'The program has ended or cannot be reached; trying again');
      setTimeout(connect, kAgainAfter);
    };
  };
  connect();
}
