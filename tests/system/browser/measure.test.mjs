// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Measures edges of the synthetic room with the page's own tool, by clicks beside their ends.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { Program, inFolder, run, triangles, until, withBrowser } from './browser.mjs';

const kError = 0.005;  // meters, as promised

/** Corners of a box of furnished_room() in src/synth/rooms.cpp, indexed by bits of x, y, z. */
function corners([x, y, z], size, yaw) {
  return Array.from({ length: 8 }, (_, i) => {
    const [a, b, c] = size.map((length, k) => (i & (4 >> k) ? 0.5 : -0.5) * length);
    return [x + Math.cos(yaw) * a + Math.sin(yaw) * c, y + b, z - Math.sin(yaw) * a + Math.cos(yaw) * c];
  });
}
const kScreen = corners([0.15, 0.24, 2.05], [0.62, 0.38, 0.05], 0);
const kStand = corners([0.15, 0.485, 2.02], [0.24, 0.13, 0.18], 0);
const kBooks = corners([0.75, 0.47, 1.85], [0.24, 0.16, 0.30], -0.4);
/** Edges with both ends seen by the camera; the sides of the screen only at a slant. */
const kEdges = [['top of the screen', kScreen, 0, 4, 0.62], ['width of the books, behind', kBooks, 0, 4, 0.24],
                ['bottom of the screen', kScreen, 2, 6, 0.62], ['right side of the screen', kScreen, 4, 6, 0.38],
                ['left side of the screen', kScreen, 0, 2, 0.38], ['top of the stand', kStand, 0, 4, 0.24],
                ['bottom of the stand', kStand, 2, 6, 0.24], ['left side of the stand', kStand, 0, 2, 0.13],
                ['right side of the stand', kStand, 4, 6, 0.13], ['height of the books, left', kBooks, 0, 2, 0.16],
                ['height of the books, right', kBooks, 4, 6, 0.16], ['bottom of the books', kBooks, 2, 6, 0.24]];
/** Click errors in pixels: to each side in turn, also onto the background. */
const kClickOffsets = [[2, -2], [-2, 2], [3, 3], [-3, -2]];

const turned = ([x, y, z, w], [a, b, c]) => {
  const t = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * t[0] + y * t[2] - z * t[1], b + w * t[1] + z * t[0] - x * t[2], c + w * t[2] + x * t[1] - y * t[0]];
};

/** Transforms from the scene to the map, which agree in the first camera; poses are t x y z qx qy qz qw. */
function mapFromScene(map, scene, point) {
  const [x, y, z, w] = scene.slice(4), inCamera = turned([-x, -y, -z, w], point.map((v, i) => v - scene[1 + i]));
  return turned(map.slice(4), inCamera).map((v, i) => v + map[1 + i]);
}

const inMeters = (words) => Number(words.split(' ')[0]) * { m: 1, cm: 0.01, mm: 0.001 }[words.split(' ')[1]];

test('known edges are measured within 5 mm', { timeout: 280000 }, () => inFolder(async (folder) => {
  const out = join(folder, 'map'), recording = join(folder, 'recording');
  run('synth', 'room', '-o', recording, '--frames', '1');
  run('reconstruct', 'synthetic:room', '-o', out, '--no-texture', '--quality', 'fast');
  const scene = readFileSync(join(recording, 'groundtruth.txt'), 'utf8').trim().split('\n').at(-1).split(' ').map(Number);
  const program = new Program('view', out, '--port', '0'), url = await program.url();
  const end = async () => { program.kill('SIGINT'); await program.ended; };
  await withBrowser(async (open) => {
    const page = await open(url, { width: 900, height: 700 });
    await until(async () => (await triangles(page)) > 0 && (await page.locator('#tools button').count()) > 5);
    const [map] = await page.evaluate(async () => (await (await fetch('data.json')).json()).trajectory);
    await page.getByRole('button', { name: 'Measure', exact: true }).click();
    const rows = page.locator('.measured li b'), status = page.locator('#card .status'), errors = [];
    for (const [i, [name, corner, a, b, length]] of kEdges.entries()) {
      const before = await rows.count();
      // The card below the picture has grown by the last measurement.
      await until(() => page.evaluate(() => {
        const { perspective, element } = window.cairn;
        return Math.abs(perspective.aspect - element.clientWidth / element.clientHeight) < 1e-6;
      }));
      const ends = await page.evaluate((places) => {
        const { cairn } = window, [from, to] = places.map(([x, y, z]) => cairn.controls.target.clone().set(x, -y, -z));
        const middle = from.clone().lerp(to, 0.5), [, x, y, z] = cairn.pathPoints, eye = middle.clone().set(x, -y, -z);
        cairn.place(middle.clone().addScaledVector(eye.sub(middle).normalize(), 0.7), middle);
        cairn.camera.updateMatrixWorld();
        const box = cairn.element.getBoundingClientRect();
        return [from, to].map((point) => {
          const at = point.project(cairn.camera);
          return [box.x + (at.x + 1) * box.width / 2, box.y + (1 - at.y) * box.height / 2];
        });
      }, [corner[a], corner[b]].map((point) => mapFromScene(map, scene, point)));
      const [dx, dy] = kClickOffsets[i % kClickOffsets.length];
      await page.mouse.click(ends[0][0] + dx, ends[0][1] + dy);
      await until(async () => (await status.innerText()) === 'Place 1: on a corner', async () => `${name}: ${await status.innerText()}`, 60);
      await page.mouse.click(ends[1][0] + dx, ends[1][1] + dy);
      await until(async () => (await rows.count()) === before + 1, () => `${name}: nothing was measured`, 60);
      errors.push([name, inMeters(await rows.last().innerText()) - length]);
    }
    const wrong = errors.filter(([, error]) => !(Math.abs(error) < kError));
    assert.deepEqual(wrong, [], `meters off, of ${errors.length} edges`);
  }).finally(end);
}));
