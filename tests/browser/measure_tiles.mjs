// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// How `cairn view` shows a building's tiles in headless Chromium: the time to the first picture, which has all of the
// building in it; what the page takes; and cracks, seen from places along the recordings: pixels of background, of which
// some lie between two pixels of surface, in the tiles as they are chosen and in the finest ones, where what is open was
// never seen. Usage: node measure_tiles.mjs PLAN [places]
import { readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import { Program, pictures, timeline, triangles, until, withBrowser } from './browser.mjs';
import { gaps, levels, look, setError, settled } from './tiles_page.mjs';

const [plan, count = 6] = process.argv.slice(2), kMegabyte = 2 ** 20;

/** Memory that a browser's processes have for themselves, by their kinds, in MB. */
function memory() {
  const told = {};
  for (const pid of readdirSync('/proc').filter((name) => /^\d+$/.test(name))) {
    try {
      const kind = /--type=(renderer|gpu-process)/.exec(readFileSync(`/proc/${pid}/cmdline`, 'utf8'))?.[1];
      if (!kind) continue;
      const pss = Number(/^Pss:\s+(\d+)/m.exec(readFileSync(`/proc/${pid}/smaps_rollup`, 'utf8'))[1]) / 1024;
      told[kind] = Math.max(told[kind] ?? 0, Math.round(pss));
    } catch { /* it has ended */ }
  }
  return told;
}

const taken = async (page) => {
  const { heap, bytes, tiles } = await page.evaluate(async () => {
    const { lruCache, visibleTiles } = window.cairn.tiles.tiles;
    return { heap: performance.memory.usedJSHeapSize, bytes: lruCache.cachedBytes, tiles: visibleTiles.size };
  });
  const { renderer, 'gpu-process': gpu } = memory();
  return `${tiles} tiles of levels ${(await levels(page)).join(' + ')}, ${await triangles(page)} triangles; tiles ${Math.round(bytes / kMegabyte)} MB, ` +
         `heap ${Math.round(heap / kMegabyte)} MB, page's process ${renderer} MB, process that draws ${gpu} MB`;
};

/** Places and where they look, spread over a trajectory, in three.js' world. */
function places() {
  const poses = readFileSync(join(plan, 'trajectory.txt'), 'utf8').split('\n').filter((line) => /^[\d.]/.test(line)).map((line) => line.split(/\s+/).map(Number));
  return Array.from({ length: count }, (_, i) => {
    const [, x, y, z, a, b, c, w] = poses[Math.floor((i + 0.5) * poses.length / count)];
    const ahead = [2 * (a * c + b * w), 2 * (b * c - a * w), 1 - 2 * (a * a + b * b)];
    return [[x, -y, -z], [x + ahead[0], -(y + ahead[1]), -(z + ahead[2])]];
  });
}

/** Pixels of `seen` that are no background in `truth`, in runs along rows that surface ends on both sides: how many are as wide. */
function cracks(seen, truth) {
  const wide = {};
  seen.forEach((row, y) => {
    for (let x = 0, end = 0; x < row.length; x = end + 1) {
      for (end = x; end < row.length && row[end] && !truth[y][end]; ++end);
      if (end > x && x > 0 && end < row.length && !row[x - 1] && !row[end]) wide[end - x] = (wide[end - x] ?? 0) + 1;
    }
  });
  return wide;
}

const program = new Program('view', plan, '--port', '0'), url = await program.url();
await withBrowser(async (open) => {
  const warm = await open('about:blank');
  await warm.evaluate(() => document.createElement('canvas').getContext('webgl2').clear(0));
  await warm.waitForTimeout(3000);
  await warm.close();
  for (let i = 0; i < 3; ++i) {
    const page = await open(url, { width: 1400, height: 900 });
    await until(async () => 'whole' in (await timeline(page)), () => program.output, 300);
    const { picture, whole } = await timeline(page);
    console.log(`first picture ${picture.toFixed(2)} s, with all tools ${whole.toFixed(2)} s`);
    if (i < 2) { await page.close(); continue; }
    await settled(page, 300);
    console.log(`from afar: ${await taken(page)}`);
    await page.screenshot({ path: join(pictures, 'measure-tiles-all.png') });
    for (const [k, [eye, target]] of places().entries()) {
      await look(page, eye, target);
      console.log(`place ${k}: ${await taken(page)}`);
      await page.screenshot({ path: join(pictures, `measure-tiles-${k}.png`) });
    }
    await page.close();
  }
  // Every tile that is in sight, and coarser and coarser ones.
  const page = await open(url, { width: 1400, height: 900 });
  await until(async () => 'whole' in (await timeline(page)), () => program.output, 300);
  await page.evaluate(() => { window.cairn.tiles.tiles.lruCache.maxBytesSize = 2 ** 31; });
  for (const [k, [eye, target]] of places().entries()) {
    await setError(page, 0.01, 300);
    await look(page, eye, target);
    const finest = await gaps(page);
    for (const error of [6, 50]) {
      await setError(page, error, 300);
      const seen = cracks(await gaps(page), finest);
      console.log(`place ${k}, ${error} pixels of error: levels ${(await levels(page)).join(' + ')}; new gaps by width in pixels ${JSON.stringify(seen)}`);
    }
  }
}).finally(() => program.kill('SIGINT'));
await program.ended;
