// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Standard deviation of an adjusted map's surface, in the colors of its page.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { Program, inFolder, pictures, run, triangles, until, withBrowser } from './browser.mjs';

const kLow = 0.001, kHigh = 0.003;  // meters

/** Adds to an uncompressed .glb a `_SIGMA` that increases from left to right. */
function addSigma(file) {
  const glb = readFileSync(file), size = glb.readUInt32LE(12), json = JSON.parse(glb.subarray(20, 20 + size)), added = [];
  const bin = glb.subarray(28 + size, 28 + size + glb.readUInt32LE(20 + size));
  let end = bin.length;
  for (const { attributes } of json.meshes.flatMap(({ primitives }) => primitives)) {
    const { bufferView, count, byteOffset = 0, min: [low], max: [high] } = json.accessors[attributes.POSITION], view = json.bufferViews[bufferView];
    const values = Buffer.alloc(4 * count);
    for (let i = 0; i < count; ++i) {
      const x = bin.readFloatLE((view.byteOffset ?? 0) + byteOffset + i * (view.byteStride ?? 12));
      values.writeFloatLE(kLow + (kHigh - kLow) * (x - low) / (high - low), 4 * i);
    }
    attributes._SIGMA = json.accessors.push({ bufferView: json.bufferViews.length, componentType: 5126, count, type: 'SCALAR' }) - 1;
    json.bufferViews.push({ buffer: 0, byteOffset: end, byteLength: values.length, target: 34962 });
    end += values.length;
    added.push(values);
  }
  json.buffers[0].byteLength = end;
  const text = Buffer.from(JSON.stringify(json)), padded = Buffer.concat([text, Buffer.alloc((4 - text.length % 4) % 4, ' ')]);
  const header = Buffer.alloc(20), middle = Buffer.alloc(8);
  header.write('glTF');
  [2, 28 + padded.length + end, padded.length, 0x4e4f534a].forEach((word, i) => header.writeUInt32LE(word, 4 + 4 * i));
  [end, 0x004e4942].forEach((word, i) => middle.writeUInt32LE(word, 4 * i));
  writeFileSync(file, Buffer.concat([header, padded, middle, bin, ...added]));
}

/** Opens the card of colors, and returns its choices. */
async function openColors(open, url) {
  const page = await open(url, { width: 1000, height: 700 });
  await until(async () => (await triangles(page)) > 0 && (await page.locator('#tools button').count()) > 8);
  await page.getByRole('button', { name: 'Colors', exact: true }).click();
  return { page, choice: page.locator('#card').getByRole('radio', { name: 'Uncertainty, adjusted', exact: true }) };
}

/** Green channel of the left and right half of the surface, which increases with the value. */
const halves = (page) => page.evaluate(() => {
  const sums = { left: [0, 0], right: [0, 0] };
  for (const { geometry: { attributes, boundingBox }, geometry } of window.cairn.meshes()) {
    if (!boundingBox) geometry.computeBoundingBox();
    const middle = (geometry.boundingBox.min.x + geometry.boundingBox.max.x) / 2;
    for (let i = 0; i < attributes.position.count; ++i) {
      const sum = sums[attributes.position.getX(i) < middle ? 'left' : 'right'];
      sum[0] += attributes.color.getY(i);
      sum[1] += 1;
    }
  }
  return Object.values(sums).map(([sum, count]) => sum / count);
});

test('an adjusted map is colored by the uncertainty of its surface', { timeout: 280000 }, () => inFolder(async (folder) => {
  const plain = join(folder, 'plain.glb'), adjusted = join(folder, 'adjusted.glb');
  run('reconstruct', 'synthetic:room', '-o', join(folder, 'map'), '--frames', '0:10', '--voxel-size', '0.03', '--no-texture');
  run('export', join(folder, 'map'), '-o', plain, '--no-texture');
  run('export', join(folder, 'map'), '-o', adjusted, '--no-texture');
  addSigma(adjusted);
  const programs = [plain, adjusted].map((file) => new Program('view', file, '--port', '0'));
  try {
    const urls = await Promise.all(programs.map((program) => program.url()));
    await withBrowser(async (open) => {
      const without = await openColors(open, urls[0]);
      assert.equal(await without.choice.count(), 0);
      await without.page.close();
      const { page, choice } = await openColors(open, urls[1]);
      await choice.check();
      await until(async () => /1\.\d\d mm[^]*2\.\d\d mm/.test(await page.locator('#card').innerText()), () => 'no legend in millimeters');
      const [left, right] = await halves(page);
      assert.ok(right > left + 0.15, `sure ${left}, unsure ${right}`);
      await page.waitForFunction(() => !window.cairn.isStale && !window.cairn.fence);
      await page.screenshot({ path: join(pictures, 'sigma-colors.png') });
    });
  } finally {
    for (const program of programs) program.kill('SIGINT');
    await Promise.all(programs.map(({ ended }) => ended));
  }
}));
