// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// View of a growing map: connects to the program over a WebSocket, reconnects after failures, and finally shows the
// finished map.
import { Alerts } from './alerts.js';
import { coverageMaterial, kCoverageCss } from './coverage.js';
import { element, facts, setStatus } from './dom.js';
import { showFinished } from './finished.js';
import { icon } from './icons.js';
import { readMessage } from './messages.js';
import { Toolbar } from './toolbar.js';
import { count } from './words.js';

const kReconnectDelay = 1000;  // milliseconds

/** Fills the side panel. */
function makePanel() {
  const color = element('img', { alt: 'What the color camera sees' }),
        depth = element('img', { alt: 'What the depth camera sees, near red, far blue' });
  const numbers = element('div'), details = element('div'), loops = element('ul', { className: 'loops' });
  document.getElementById('panel').replaceChildren(
      element('div', { className: 'images' }, element('figure', {}, color, element('figcaption', {}, 'Color')),
              element('figure', {}, depth, element('figcaption', {}, 'Depth, near red'))),
      element('h2', {}, 'Now'), numbers,
      element('details', {}, element('summary', {}, 'Tracking in numbers'), details), element('h2', {}, 'Loops'), loops);
  return { color, depth, numbers, details, loops };
}

/** Creates the overlay: a flash, the turn direction, and the legend of the coverage colors. */
function makeOverlay() {
  const flash = element('div', { id: 'flash' }), picture = element('img', { alt: 'What the camera saw last' });
  const arrow = icon('arrow'), words = element('strong');
  const back = element('div', { id: 'back', hidden: true }, arrow, element('div', {}, words), picture);
  const bar = element('div');
  bar.style.background = kCoverageCss;
  const legend = element('div', { id: 'legend', hidden: true }, bar, element('span', {}, element('span', {}, 'seen once'), element('span', {}, 'seen well')));
  document.getElementById('scene').append(legend, back);
  document.body.append(flash);
  return { back, arrow, words, picture, legend, remove: () => { for (const one of [flash, back, legend]) one.remove(); } };
}

/** Text of the reset confirmation: the frames to be deleted and kept. */
function aboutReset({ frames = {}, frames_before: before = 0 }) {
  const mapped = count(frames.fused ?? 0);
  return before > 0 ?
      `Reset deletes the ${mapped} frames added by this run, also on disk. The map of earlier runs with ${count(before)} frames is kept, and this run continues from it. Reset?` :
      `Reset deletes the map of this run with ${mapped} frames, also on disk, and starts an empty map. Reset?`;
}

/** `ask` sends a command to the program; `last` returns the newest state. */
function makeButtons(scene, toolbar, overlay, alerts, ask, last) {
  const pause = element('button', { onclick: () => ask(pause.dataset.paused ? 'start' : 'pause') }, 'Pause');
  const reset = element('button', { onclick: () => confirm(aboutReset(last())) && ask('reset') }, 'Reset');
  const finish = element('button', { onclick: () => ask('finish') }, 'Finish');
  const bar = element('progress', { max: 1, hidden: true });
  const skip = element('button', { hidden: true, onclick: () => { skip.disabled = true; ask('skip'); } }, 'Skip');
  document.getElementById('buttons').replaceChildren(pause, reset, finish, bar, skip);
  const pressed = (button, on) => button.setAttribute('aria-pressed', on);
  const follow = toolbar.add({ name: 'Follow the sensor', label: 'Follow', key: 'f', symbol: 'follow', press: () => scene.setFollow(!scene.follow) });
  scene.onFollow = (on) => pressed(follow, on);
  toolbar.add({ name: 'Show all of the map', label: 'All', key: '0', symbol: 'all', press: () => { scene.setFollow(false); scene.lookAtAll(); } });
  const looks = { coverage: null, shape: null };
  const look = (name) => {
    scene.setLook(scene.look === name ? 'color' : name);
    for (const [of, button] of Object.entries(looks)) pressed(button, scene.look === of);
    overlay.legend.hidden = scene.look !== 'coverage';
  };
  looks.coverage = toolbar.add({ name: 'Coverage: how well it was seen', label: 'Coverage', key: 'c', symbol: 'coverage', press: () => look('coverage') });
  looks.shape = toolbar.add({ name: 'Shape without colors', label: 'Shape', key: 's', symbol: 'shape', press: () => look('shape') });
  for (const button of Object.values(looks)) pressed(button, false);
  const sound = toolbar.add({ name: 'Sound and vibration when the camera is lost', label: 'Sound', key: 'a', symbol: 'sound', press: () => { alerts.set(!alerts.isOn); pressed(sound, alerts.isOn); } });
  pressed(sound, alerts.isOn);
  // A focused button handles the space bar itself.
  const press = () => pause.disabled || pause.click();
  toolbar.buttons.push({ key: 'Space', name: 'Pause and resume', press });
  document.addEventListener('keydown', (event) => {
    if (event.key !== ' ' || event.repeat || event.target.closest('button, input, select, summary, a, dialog')) return;
    event.preventDefault();
    press();
  }, { signal: toolbar.life.signal });
  toolbar.addHelp();
  scene.setFollow(true);
  return { pause, reset, finish, bar, skip };
}

/** Shows the progress of a stage after the last frame, with its Skip button, in place of the buttons of the frames. */
function showStage({ stage, words, has_reset: hasReset = true }, { pause, reset, finish, bar, skip }) {
  for (const button of [pause, finish]) button.hidden = Boolean(stage);
  reset.hidden = Boolean(stage) || !hasReset;
  for (const shown of [bar, skip]) shown.hidden = !stage;
  if (!stage) return;
  bar.value = stage.fraction;
  bar.setAttribute('aria-label', words);
}

const percent = (share) => `${(100 * share).toFixed(0)} %`;

function showNumbers(panel, state, triangles) {
  const frames = { fused: 0, lost: 0, skipped: 0, ...state.frames }, last = state.last_frame ?? {};
  panel.numbers.replaceChildren(
      facts([
        ['Frames in the map', count(frames.fused)], ['Frames lost', count(frames.lost)], ['Frames unusable', count(frames.skipped)],
        ['Skipped to keep up', count(state.skipped_to_keep_up)],
        ['Speed', state.frames_per_second ? `${state.frames_per_second.toFixed(1)} frames/s` : '–'],
        ['Frame to pose', state.latency_ms ? `${state.latency_ms.toFixed(0)} ms` : '–'],
        ['Surface', `${count(triangles)} triangles`], ['Keyframes', count(state.keyframes ?? 0)], ['Submaps', count(state.submaps ?? 1)],
        ['Memory', `${state.memory_mb.toFixed(0)} MB`],
      ]),
      ...(state.skipped_to_keep_up > 0 ? [element('p', { className: 'hint' }, 'Skipped to keep up: frames that arrived while the computer was busy. The map does not lag behind.')] : []));
  panel.details.replaceChildren(facts([
    ...(last.inlier_share == null ? [] : [['Inliers', percent(last.inlier_share)], ['Error of inliers', `${last.rmse.toFixed(1)} sigma`]]),
    ...(last.near == null ? [] : [['Too near', percent(last.near)], ['Too far', percent(last.far)], ['Without depth', percent(last.empty)]]),
    ...(last.brightness == null ? [] : [['Brightness', percent(last.brightness)]]),
    ...(last.reason ? [['Last frame', last.reason]] : []),
  ]));
}

/** Shows the turn direction while the camera is lost. */
function showBack(overlay, { status, words, guidance }) {
  const isLost = status === 'lost';
  overlay.back.hidden = !isLost;
  if (!isLost) return;
  overlay.picture.hidden = !overlay.picture.src;
  overlay.words.textContent = overlay.picture.src ? 'Come back to this view' : words;
  overlay.arrow.toggleAttribute('hidden', !guidance?.turn);
  if (guidance?.turn) overlay.arrow.style.transform = `rotate(${Math.atan2(guidance.turn[1], guidance.turn[0])}rad)`;
}

function showState(state, scene, panel, overlay, buttons) {
  const { pause, reset, finish } = buttons;
  setStatus(state.status, state.words);
  const isPaused = state.status === 'paused', isOver = ['finishing', 'finished'].includes(state.status);
  pause.textContent = isPaused ? 'Resume' : 'Pause';
  pause.dataset.paused = isPaused ? 'yes' : '';
  for (const button of [pause, reset, finish]) button.disabled = isOver;
  showStage(state, buttons);
  if (state.upright) scene.setUpright(state.upright);
  if (state.camera) scene.setCamera(state.camera, state.view);
  scene.setLoops(state.loops.filter(([, , inlier]) => inlier));
  showBack(overlay, state);
  showNumbers(panel, state, scene.triangles);
  if (panel.loops.childElementCount !== state.loops.length)
    panel.loops.replaceChildren(...state.loops.map(([from, to, inlier]) => element(
        'li', { className: inlier ? '' : 'refused' }, `${from.toFixed(1)} s ↔ ${to.toFixed(1)} s`)));
}

function showImage(image, blob) {
  URL.revokeObjectURL(image.src);
  image.src = URL.createObjectURL(blob);
}

/** Shows a growing map, then the finished map in its place. `fold` opens the panel. */
export function showLive(scene, fold) {
  let socket, isOver = false, epoch = 0, wasLost = false, newest = {};
  const ask = (what) => socket?.readyState === WebSocket.OPEN && socket.send(JSON.stringify({ do: what }));
  scene.begin();
  scene.materials.coverage = coverageMaterial({ clippingPlanes: scene.clipping });
  const alerts = new Alerts(), toolbar = new Toolbar(), panel = makePanel(), overlay = makeOverlay();
  const buttons = makeButtons(scene, toolbar, overlay, alerts, ask, () => newest);

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
    toolbar.end();
    overlay.remove();
    document.getElementById('buttons').replaceChildren();
    document.getElementById('panel').replaceChildren();
    scene.endFollowing();
    scene.setUpright([0, 0, 0, 1], 1);  // the finished files are already upright
    await showFinished(scene, data, fold);
    ask('shown');
  };

  const onText = (message) => {
    if (isOver || !isNew(message)) return;
    if (!('status' in message)) return scene.setSubmaps(message.submaps);
    newest = message;
    showState(message, scene, panel, overlay, buttons);
    const isLost = message.status === 'lost';
    if (isLost !== wasLost && (isLost || message.status !== 'paused')) alerts.notify(isLost ? 'lost' : 'found');
    wasLost = isLost;
    if (message.data) finish(message.data).catch((error) => setStatus('gone', `The finished map cannot be shown: ${error.message}`));
  };

  const onBytes = (message) => {
    if (isOver) return;
    if (message.kind === 'image') {
      showImage(panel[message.of], message.jpeg);
      if (message.of === 'color' && !wasLost) showImage(overlay.picture, message.jpeg);  // reference view while lost
    } else if (!isNew(message)) return;
    else if (message.kind === 'part') scene.setPart(message);
    else scene.setPath(message.points);
  };

  const connect = () => {
    socket = new WebSocket(new URL('live', location.href.replace(/^http/, 'ws')));
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => { epoch = 0; };  // the server resends everything
    socket.onmessage = ({ data }) => typeof data === 'string' ? onText(JSON.parse(data)) : onBytes(readMessage(data));
    socket.onclose = () => {
      if (isOver) return;
      setStatus('gone', 'The program has ended or cannot be reached; trying again');
      setTimeout(connect, kReconnectDelay);
    };
  };
  connect();
}
