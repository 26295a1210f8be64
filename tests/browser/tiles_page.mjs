// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What tests and measurements ask a page that shows tiles.
import { until } from './browser.mjs';

/** Until all that is to be seen is loaded and drawn. */
export const settled = (page, seconds = 120) => until(() => page.evaluate(() => {
  const { tiles, isStale, fence } = window.cairn;
  return Boolean(tiles?.isSettled) && !isStale && !fence;
}), () => page.evaluate(() => `tiles are still on their way: ${JSON.stringify(window.cairn.tiles?.tiles.stats)}`), seconds);

/** Looks from `eye` to `target`, in three.js' world, and waits for what is to be seen from there. */
export async function look(page, eye, target, seconds) {
  await page.evaluate(([from, to]) => {
    const { scene, camera } = window.cairn, place = ([x, y, z]) => camera.position.clone().set(x, y, z);
    window.cairn.place(place(from), place(to));
    scene.updateMatrixWorld();
  }, [eye, target]);
  await page.waitForTimeout(100);
  await settled(page, seconds);
}

/** How many pixels the surface may lie beside where it is. */
export const setError = async (page, pixels, seconds) => {
  await page.evaluate((error) => Object.assign(window.cairn.tiles, { isWaiting: true }).tiles.errorTarget = error, pixels);
  await page.waitForTimeout(100);
  await settled(page, seconds);
};

/** How many tiles of each level are in the picture, the finest first. */
export const levels = (page) => page.evaluate(() => {
  const count = [];
  for (const { content } of window.cairn.tiles.tiles.visibleTiles) {
    const level = Number(/(\d+)_[^/]*\.glb$/.exec(content.uri)[1]);
    count[level] = (count[level] ?? 0) + 1;
  }
  return Array.from(count, (tiles) => tiles ?? 0);
});

/** Draws before a loud background, and returns where that is seen: rows of the picture, from below, of 0 and 1. */
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

/** The longest way across a gap, in pixels: of each of its pixels the shorter of the runs along its row and its column. */
export function widestGap(rows) {
  const height = rows.length, width = rows[0].length, across = rows.map((row) => new Int32Array(row.length));
  let widest = 0;
  for (let y = 0; y < height; ++y)
    for (let x = 0, end = 0; x < width; x = end + 1) {
      for (end = x; end < width && rows[y][end]; ++end);
      across[y].fill(end - x, x, end);
    }
  for (let x = 0; x < width; ++x)
    for (let y = 0, end = 0; y < height; y = end + 1) {
      for (end = y; end < height && rows[end][x]; ++end);
      for (let i = y; i < end; ++i) widest = Math.max(widest, Math.min(end - y, across[i][x]));
    }
  return widest;
}
