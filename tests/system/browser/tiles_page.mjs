// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Queries of tests and measurements to a page with tiles.
import { until } from './browser.mjs';

/** Waits until all visible tiles are loaded and drawn. */
export const settled = (page, seconds = 120) => until(() => page.evaluate(() => {
  const { tiles, isStale, fence } = window.cairn;
  return Boolean(tiles?.isSettled) && !isStale && !fence;
}), () => page.evaluate(() => `tiles are still on their offset: ${JSON.stringify(window.cairn.tiles?.tiles.stats)}`), seconds);

/** Moves the view from `eye` to `target`, in three.js' world, and waits for the visible tiles. */
export async function look(page, eye, target, seconds) {
  await page.evaluate(([from, to]) => {
    const { scene, camera } = window.cairn, place = ([x, y, z]) => camera.position.clone().set(x, y, z);
    window.cairn.place(place(from), place(to));
    scene.updateMatrixWorld();
  }, [eye, target]);
  await page.waitForTimeout(100);
  await settled(page, seconds);
}

/** Updates the set of tiles to load, and waits for them. */
async function update(page, seconds) {
  await page.evaluate(() => { window.cairn.tiles.isWaiting = true; });
  await page.waitForTimeout(100);
  await settled(page, seconds);
}

/** Sets the screen-space error of the surface in pixels. */
export const setError = async (page, pixels, seconds) => {
  await page.evaluate((error) => { window.cairn.tiles.tiles.errorTarget = window.cairn.tiles.error = error; }, pixels);
  await update(page, seconds);
};

/** Level of detail of a file, 0 is the finest: cells have three, followed by the levels above cells. */
function levelOf(file) {
  const [, above, level] = /(above_)?(\d+)_[^/]*\.glb$/.exec(file) ?? [];
  return Number(level) + (above ? 2 : 0);
}
const defineLevelOf = (page) => page.evaluate(`window.levelOf = ${levelOf}`);

/** Shows one level of detail, and the coarsest level of cells without it; undefined: by the error target. */
export async function setLevel(page, level, seconds) {
  await defineLevelOf(page);
  await page.evaluate((wanted) => {
    const { tiles } = window.cairn.tiles;
    delete tiles.calculateTileViewError;
    const { calculateTileViewError } = tiles;
    if (wanted !== undefined) tiles.calculateTileViewError = (tile, target) => {
      calculateTileViewError.call(tiles, tile, target);
      target.error = window.levelOf(tile.content?.uri) > wanted ? Infinity : 0;
    };
  }, level);
  await update(page, seconds);
}

/** Number of visible tiles of each level, the finest first. */
export async function levels(page) {
  const files = await page.evaluate(() => [...window.cairn.tiles.tiles.visibleTiles].map(({ content }) => content.uri)), count = [];
  for (const level of files.map(levelOf)) count[level] = (count[level] ?? 0) + 1;
  return Array.from(count, (tiles) => tiles ?? 0);
}

/** Initial script of a page for `surfaces`: turns off antialiasing, so that no pixel mixes surfaces. */
export const unmixed = () => {
  const { getContext } = HTMLCanvasElement.prototype;
  HTMLCanvasElement.prototype.getContext = function (kind, options) { return getContext.call(this, kind, { ...options, antialias: false }); };
};

/**
 * Contents of the picture: rows, from below, of levels of detail and of distances in meters; -1 and Infinity for the
 * background. `aside`: meters of displacement of each level, each in its own direction.
 */
export async function surfaces(page, aside = 0) {
  await defineLevelOf(page);
  const { width, height, text } = await page.evaluate((far) => {
    const { materials, renderer, camera, tiles: { tiles } } = window.cairn, before = new Map();
    const move = ({ scene }, level, offset) => {
      scene.position['xyz'[level % 3]] += level < 3 ? offset : -offset;
      scene.updateMatrixWorld(true);
    };
    for (const { content, engineData } of tiles.visibleTiles) {
      const level = window.levelOf(content.uri), material = new materials.color.constructor();
      material.color.r = (level + 1) / 255;
      material.onBeforeCompile = (shader) => {
        shader.fragmentShader = shader.fragmentShader.replace('#include <dithering_fragment>', `
            float mm = min(1000.0 / gl_FragCoord.w, 65535.0);
            gl_FragColor = vec4(diffuse.r, floor(mm / 256.0) / 255.0, floor(mod(mm, 256.0)) / 255.0, 1.0);`);
      };
      engineData.scene.traverse((mesh) => { if (mesh.isMesh) before.set(mesh, mesh.material), mesh.material = material; });
      move(engineData, level, far);
    }
    renderer.render(tiles.group, camera);
    const gl = renderer.getContext(), width = gl.drawingBufferWidth, height = gl.drawingBufferHeight, bytes = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    for (const { content, engineData } of tiles.visibleTiles) move(engineData, window.levelOf(content.uri), -far);
    for (const [mesh, material] of before) mesh.material.dispose(), mesh.material = material;
    window.cairn.isStale = true;
    let text = '';
    for (let i = 0; i < bytes.length; i += 2 ** 15) text += String.fromCharCode(...bytes.subarray(i, i + 2 ** 15));
    return { width, height, text: btoa(text) };
  }, aside);
  const bytes = Buffer.from(text, 'base64');
  const rows = (of) => Array.from({ length: height }, (_, y) => Float32Array.from({ length: width }, (__, x) => of(4 * (y * width + x))));
  return { levels: rows((i) => bytes[i] - 1), distances: rows((i) => bytes[i] ? (256 * bytes[i + 1] + bytes[i + 2]) / 1000 : Infinity) };
}

/** Draws with a bright background, and returns its visible pixels: rows of the picture, from below, of 0 and 1. */
export const gaps = (page) => page.evaluate(() => {
  const { scene, renderer } = window.cairn, before = scene.background;
  scene.background = before.clone().setRGB(1, 0, 1);
  window.cairn.render();
  const gl = renderer.getContext(), width = gl.drawingBufferWidth, height = gl.drawingBufferHeight, pixels = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  scene.background = before;
  window.cairn.isStale = true;
  return Array.from({ length: height }, (_, y) => Array.from({ length: width }, (__, x) => {
    const i = 4 * (y * width + x);
    return Number(pixels[i] > 200 && pixels[i + 1] < 60 && pixels[i + 2] > 200);
  }));
});

/** Width of a gap at each of its pixels, in pixels: the shorter of the runs along its row and its column. */
export function widths(rows) {
  const height = rows.length, width = rows[0].length, across = rows.map((row) => new Int32Array(row.length));
  for (let y = 0; y < height; ++y)
    for (let x = 0, end = 0; x < width; x = end + 1) {
      for (end = x; end < width && rows[y][end]; ++end);
      across[y].fill(end - x, x, end);
    }
  for (let x = 0; x < width; ++x)
    for (let y = 0, end = 0; y < height; y = end + 1) {
      for (end = y; end < height && rows[end][x]; ++end);
      for (let i = y; i < end; ++i) across[i][x] = Math.min(end - y, across[i][x]);
    }
  return across;
}

export const widestGap = (rows) => widths(rows).reduce((widest, row) => row.reduce((a, b) => Math.max(a, b), widest), 0);
