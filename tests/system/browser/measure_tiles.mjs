// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Tiles of a building with `cairn view` in headless Chromium: the time to the first picture, which contains the entire
// building; the memory of the page; and cracks between levels of detail, seen from places along the recordings. Usage:
// node measure_tiles.mjs PLAN [places]
import { readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import { isDeepStrictEqual } from 'node:util';
import { Program, pictures, timeline, triangles, until, withBrowser } from './browser.mjs';
import { levels, look, setError, setLevel, settled, surfaces, unmixed, widths } from './tiles_page.mjs';

const [plan, count = 6] = process.argv.slice(2), kMegabyte = 2 ** 20;
const kErrors = [6, 20, 50, 200];  // pixels: the first is the viewer's
const kMaxDistance = 0.1;                // meters: a surface farther behind is another surface
const kDisplacement = 0.01;               // meters of displacement of each level, to verify that cracks are found

/** Private memory of a browser's processes, by kind, in MB. */
function memory() {
  const megabytes = {};
  for (const pid of readdirSync('/proc').filter((name) => /^\d+$/.test(name))) {
    try {
      const kind = /--type=(renderer|gpu-process)/.exec(readFileSync(`/proc/${pid}/cmdline`, 'utf8'))?.[1];
      if (!kind) continue;
      const pss = Number(/^Pss:\s+(\d+)/m.exec(readFileSync(`/proc/${pid}/smaps_rollup`, 'utf8'))[1]) / 1024;
      megabytes[kind] = Math.max(megabytes[kind] ?? 0, Math.round(pss));
    } catch { /* process ended */ }
  }
  return megabytes;
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

/** Viewpoints and targets, spread over a trajectory, in three.js' world. */
function places() {
  const poses = readFileSync(join(plan, 'trajectory.txt'), 'utf8').split('\n').filter((line) => /^[\d.]/.test(line)).map((line) => line.split(/\s+/).map(Number));
  return Array.from({ length: count }, (_, i) => {
    const [, x, y, z, a, b, c, w] = poses[Math.floor((i + 0.5) * poses.length / count)];
    const ahead = [2 * (a * c + b * w), 2 * (b * c - a * w), 1 - 2 * (a * a + b * b)];
    return [[x, -y, -z], [x + ahead[0], -(y + ahead[1]), -(z + ahead[2])]];
  });
}

/**
 * Pixels where a surface is missing only because levels mix: each level alone has a surface there, but the mixed
 * picture shows the background. The rim of a hole moved by a coarser level is open in the level alone as well. Past the
 * rim of one surface, through a hole in the next, single levels show either surface.
 */
const cracks = (mixed, alone) => mixed.distances.map((row, y) => row.map((seen, x) => {
  const distances = alone.map((level) => level.distances[y][x]), farthest = Math.max(...distances);
  return farthest - Math.min(...distances) < kMaxDistance && seen > farthest + kMaxDistance;
}));

/** Number of pixels in gaps of each width. */
const byWidth = (rows) => widths(rows).reduce((count, row) => {
  for (const width of row) if (width > 0) count[width] = (count[width] ?? 0) + 1;
  return count;
}, {});

/**
 * Pixels with a neighbor where the same surface continues in another level. Hidden pixels also have a border in a
 * single level, for a cell without a tile of this level: a crack would be in both pictures.
 */
function borders(mixed, alone) {
  const count = { all: 0, hidden: 0 };
  const goesOn = ({ levels: level, distances }, y, x, v, u) => level[y][x] !== level[v][u] && Math.abs(distances[y][x] - distances[v][u]) < kMaxDistance;
  for (let y = 0; y + 1 < mixed.levels.length; ++y)
    for (let x = 0; x + 1 < mixed.levels[y].length; ++x) {
      const isBorder = (picture) => goesOn(picture, y, x, y, x + 1) || goesOn(picture, y, x, y + 1, x);
      if (!isBorder(mixed)) continue;
      ++count.all;
      count.hidden += alone.some(isBorder);
    }
  return count;
}

/** The picture as displayed, and with displaced levels. */
const both = async (page) => [await surfaces(page), await surfaces(page, kDisplacement)];

/** Different pictures of mixed levels from the page's viewpoint, and each of their levels alone. */
async function mixtures(page) {
  const found = [], alone = [];
  for (const error of kErrors) {
    await setError(page, error, 300);
    const mixed = await both(page), same = found.find((picture) => isDeepStrictEqual(picture.mixed[0], mixed[0]));
    const shown = [...new Set(mixed[0].levels.flatMap((row) => [...new Set(row)]))].filter((level) => level >= 0).sort();
    if (same) same.errors.push(error);
    else found.push({ errors: [error], shown, mixed });
  }
  for (const level of new Set(found.flatMap(({ shown }) => shown))) {
    await setLevel(page, level, 300);
    if ((await levels(page)).length > level + 1) throw new Error(`level ${level} of all in sight is more than the page may keep`);
    alone[level] = await both(page);
  }
  await setLevel(page, undefined, 300);
  return found.map((picture) => ({ ...picture, alone: picture.shown.map((level) => alone[level]) }));
}

const program = new Program('view', plan, '--port', '0'), url = await program.url();
await withBrowser(async (open) => {
  const warm = await open('about:blank');
  await warm.evaluate(() => document.createElement('canvas').getContext('webgl2').clear(0));
  await warm.waitForTimeout(3000);
  await warm.close();
  for (let i = 0; i < 3; ++i) {
    const page = await open(url, { width: 1400, height: 900 });
    await until(async () => 'complete' in (await timeline(page)), () => program.output, 300);
    const { picture, complete } = await timeline(page);
    console.log(`first picture ${picture.toFixed(2)} s, with all tools ${complete.toFixed(2)} s`);
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
  const page = await open(url, { width: 1400, height: 900 }, unmixed), aside = `with levels ${100 * kDisplacement} cm aside`, met = [];
  await until(async () => 'complete' in (await timeline(page)), () => program.output, 300);
  await page.evaluate(() => { window.cairn.tiles.tiles.lruCache.maxBytesSize = 2 ** 31; });
  for (const [k, [eye, target]] of places().entries()) {
    await look(page, eye, target, 300);
    for (const { errors, shown, mixed, alone } of await mixtures(page)) {
      const [found, torn] = mixed.map((picture, i) => byWidth(cracks(picture, alone.map((level) => level[i]))));
      const { all, hidden } = borders(mixed[0], alone.map(([level]) => level));
      console.log(`place ${k}, ${errors.join(', ')} pixels of error: levels ${shown.join(' + ')}, ${all} pixels at borders of levels (${hidden} hidden); ` +
                  `pixels of cracks by width ${JSON.stringify(found)}, ${aside} ${JSON.stringify(torn)}`);
      if (all > 0) met.push([found, torn].map((count) => Math.max(0, ...Object.keys(count))));
    }
  }
  const wide = (i) => `${met.filter((widest) => widest[i] > 1).length}, up to ${Math.max(...met.map((widest) => widest[i]))} pixels`;
  console.log(`${met.length} different pictures in which levels meet; cracks wider than a pixel in ${wide(0)}; ${aside} in ${wide(1)}`);
}).finally(() => program.kill('SIGINT'));
await program.ended;
