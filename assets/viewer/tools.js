// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// All tools of a finished map, with buttons and shortcuts.
import { Colors } from './colors.js';
import { element, save } from './dom.js';
import { Measure } from './measure.js';
import { Plan } from './plan.js';
import { Playback } from './playback.js';
import { Ruler } from './ruler.js';
import { upright } from './scene.js';
import { Section, wallsTurn } from './section.js';
import { Slice } from './slice.js';
import { Surface } from './surface.js';
import { Toolbar } from './toolbar.js';
import { Walk } from './walk.js';

const kFloorSearch = { lowest: 0.01, reach: 0.25, thick: 0.03 };  // share of the surface below the floor; meters

/** Floor level: the height of most of the surface near its lower end. */
function floorLevel(scene) {
  const heights = [];
  if (scene.model) for (const { y } of scene.placesOf(scene.box)) heights.push(y);
  heights.sort((a, b) => a - b);
  const begin = Math.floor(kFloorSearch.lowest * heights.length);
  let best = { count: 0, level: heights[begin] ?? 0 };
  for (let i = begin, k = begin; i < heights.length && heights[i] < heights[begin] + kFloorSearch.reach; ++i) {
    while (k < heights.length && heights[k] < heights[i] + kFloorSearch.thick) ++k;
    if (k - i > best.count) best = { count: k - i, level: heights[(i + k) >> 1] };
  }
  return best.level;
}

function savePicture(scene, name) {
  scene.render();
  scene.renderer.domElement.toBlob((blob) => {
    const url = URL.createObjectURL(blob);
    save(url, `${name}.png`);
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  });
}

function toggleFullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.documentElement.requestFullscreen();
}

function doubleClicks(scene, surface) {
  scene.renderer.domElement.addEventListener('dblclick', async (event) => {
    if (!scene.controls.enabled || !scene.controls.enableRotate) return;
    await surface.prepare();
    const box = scene.element.getBoundingClientRect(), hit = surface.pick(event.clientX - box.left, event.clientY - box.top);
    if (hit) scene.place(scene.camera.position.clone(), hit.point);
  });
}

/** Adds the button for Gaussian splats, which are loaded at its first press by `load()`. */
function addSplats(scene, bar, load) {
  let isLoading = false;
  const button = bar.add({ name: 'Gaussian splats', label: 'Splats', key: 'v', symbol: 'splats', press: async () => {
    if (isLoading) return;
    if (scene.splats) scene.showSplats(!scene.splats.object.visible);
    else {
      isLoading = true;
      button.setAttribute('aria-busy', 'true');
      try {
        scene.setSplats(await load());
      } catch (error) {
        document.getElementById('panel').prepend(element('div', { className: 'warning' }, `The splats are not shown here: ${error.message}`));
      }
      button.removeAttribute('aria-busy');
      isLoading = false;
    }
    button.setAttribute('aria-pressed', Boolean(scene.splats?.object.visible));
  } });
  button.setAttribute('aria-pressed', 'false');
}

export function addTools(scene, data, fields, fold, loadSplats) {
  const { report, trajectory } = data, bar = new Toolbar();
  const hasMesh = Boolean(scene.model), hasPath = trajectory.length > 1, hasFields = Boolean(data.fields);
  const level = floorLevel(scene), turn = wallsTurn(scene.meshes()), surface = new Surface(scene);
  const ruler = new Ruler(scene, level, turn);
  const begin = () => (trajectory.length > 0 ? scene.lookFrom(trajectory[0]) : scene.lookAtAll());
  let plan, walk, playback;
  /** Switches to free perspective navigation. */
  const free = () => {
    for (const tool of [plan, walk].filter(Boolean)) bar.switchOff(tool);
    playback?.of.ride(false);
  };

  bar.add({ name: 'Start, where the camera began', label: 'Start', key: 'h', symbol: 'start', press: () => { free(); begin(); } });
  bar.add({ name: 'Show all', label: 'All', key: 'a', symbol: 'all', press: () => { free(); scene.lookAtAll(); } });
  if (hasMesh) {
    const tool = (of, rest) => bar.addTool({ ...rest, of, body: of.body, start: () => of.start(), end: () => of.end(), onKey: of.onKey && ((event) => of.onKey(event)) });
    plan = tool(new Plan(scene, surface, level, turn), { name: 'Floor plan', title: 'Floor plan', label: 'Plan', key: 'p', symbol: 'plan', lasting: true, off: 'Back to the room' });
    const measure = new Measure(scene, surface, report?.options?.voxel_size ?? 0.01);
    tool(measure, { name: 'Measure', title: 'Measure', label: 'Measure', key: 'm', symbol: 'measure' });
    tool(new Section(scene, turn), { name: 'Section box', title: 'Section box', label: 'Section', key: 'b', symbol: 'section', lasting: true, off: 'Show all of it' });
    if (hasFields) tool(new Slice(scene, fields, level), { name: 'Distances, a slice', title: 'Distances', label: 'Distances', key: 'd', symbol: 'distance', lasting: true });
    walk = tool(new Walk(scene, surface, level, begin), { name: 'Walk', title: 'Walk', label: 'Walk', key: 'w', symbol: 'walk' });
    const startWalk = walk.start;
    walk.start = () => { bar.switchOff(plan); startWalk(); };
    const startPlan = plan.start;
    plan.start = () => { bar.switchOff(walk); playback?.of.ride(false); startPlan(); };
    if (hasPath) {
      playback = tool(new Playback(scene, data), { name: 'Play the path', title: 'Path of the camera', label: 'Path', key: 't', symbol: 'path' });
      Object.assign(playback.of, { isBlocked: () => measure.isOn || walk.isOn, onOpen: () => { if (bar.shown !== playback) bar.show(playback); } });
    }
    const colors = new Colors(scene, { fields, hasFields, level, path: trajectory.map(([, ...place]) => upright(place)) });
    if (!scene.tiles) tool(colors, { name: 'Colors', title: 'Colors', label: 'Colors', key: 'c', symbol: 'colors', lasting: true, off: 'Original colors' });
    const shape = bar.add({ name: 'Show shape', label: 'Shape', key: 's', symbol: 'shape', press: () => colors.set(colors.shown === 'shape' ? 'color' : 'shape') });
    colors.onSet = (kind) => shape.setAttribute('aria-pressed', kind === 'shape');
    shape.setAttribute('aria-pressed', 'false');
    const grid = bar.add({ name: 'Grid of 1 m on the floor', label: 'Grid', key: 'g', symbol: 'grid', press: () => { ruler.toggleGrid(); grid.setAttribute('aria-pressed', ruler.hasGrid); } });
    grid.setAttribute('aria-pressed', 'false');
    doubleClicks(scene, surface);
  }
  if (loadSplats && hasMesh) addSplats(scene, bar, loadSplats);
  bar.add({ name: 'Save a picture', label: 'Picture', key: 'x', symbol: 'picture', press: () => savePicture(scene, data.name) });
  if (document.fullscreenEnabled) {  // not on an iPhone
    const full = bar.add({ name: 'Full screen', label: 'Full', key: 'f', symbol: 'full', press: toggleFullScreen });
    document.addEventListener('fullscreenchange', () => full.setAttribute('aria-pressed', Boolean(document.fullscreenElement)));
  }
  bar.addKey({ name: 'Fold or open the panel', key: 'i', press: () => fold() });
  bar.addHelp();
  scene.isStale = true;
}
