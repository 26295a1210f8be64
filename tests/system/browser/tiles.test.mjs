// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Tiles of a building in Chromium: a plan with all of its cells, with cairn view.
import assert from 'node:assert/strict';
import { mkdirSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { Program, inFolder, pictures, run, timeline, triangles, until, withBrowser } from './browser.mjs';
import { pixels } from './live_page.mjs';
import { gaps, levels, look, setError, settled, widestGap } from './tiles_page.mjs';

/** Room in two segments and in several cells, since cells meet at the start of its recording. */
function tiledPlan(folder) {
  const plan = join(folder, 'plan'), of = (name) => join(plan, name);
  run('synth', 'room', '-o', join(folder, 'recording'), '--frames', '60', '--width', '320');
  run('plan', join(folder, 'recording'), '-o', plan, '--frames-per-part', '35', '--overlap', '15');
  for (const part of ['000', '001']) run('reconstruct', of(`parts/${part}`), '-o', of(`maps/${part}`), '--no-mesh', '--voxel-size', '0.02');
  mkdirSync(of('loops'));
  run('match', of('maps/000'), of('maps/001'), '-o', of('loops/000-001.json'));
  run('optimize', plan);
  for (const cell of readdirSync(of('cells')).map((name) => name.replace('.json', ''))) run('tile', plan, `--cell=${cell}`, '-o', of(`tiles/${cell}`));
  run('tileset', plan, '-o', of('tileset.json'));
  return plan;
}

/** A wall where four cells meet, and the range of the picture's height, from above, filled by the wall alone. */
const kWall = { eye: [0.1, 0.1, -1.2], target: [0, 0.1, -3], from: 0.38, to: 0.68 };

/** Widest gap in this part of the wall. */
const gapOfWall = async (page) => {
  const rows = (await gaps(page)).reverse();
  return widestGap(rows.slice(kWall.from * rows.length, kWall.to * rows.length));
};

test('tiles have the resolution of the view, without cracks between levels', () => inFolder(async (folder) => {
  const plan = tiledPlan(folder), program = new Program('view', plan, '--port', '0'), url = await program.url();
  await withBrowser(async (open) => {
    const page = await open(url, { width: 900, height: 700 });
    await until(async () => 'complete' in (await timeline(page)));
    await settled(page);
    const far = await triangles(page), { covered } = await pixels(page);
    assert.ok(covered > 0.1, `${covered} of the picture is drawn`);
    assert.equal(await page.locator('.warning').count(), 0);
    assert.deepEqual(await page.locator('#tools button').evaluateAll((all) => all.map(({ innerText }) => innerText)),
                     ['Start', 'All', 'Plan', 'Measure', 'Section', 'Walk', 'Shape', 'Grid', 'Picture', 'Full', 'Keys']);
    await page.screenshot({ path: join(pictures, 'tiles-all.png') });

    await look(page, kWall.eye, kWall.target);
    const near = await triangles(page);
    assert.ok(near > 2 * far, `${near} triangles near, ${far} from afar`);
    assert.ok(await page.evaluate(() => window.cairn.tiles.tiles.visibleTiles.size > 0 &&
      [...window.cairn.tiles.tiles.visibleTiles].every(({ engineData: { scene } }) => {
        let textured = true;
        scene.traverse(({ isMesh, material }) => { textured &&= !isMesh || Boolean(material.map?.image); });
        return textured;
      })), 'it has no texture');
    assert.equal(await gapOfWall(page), 0, 'this wall is closed');
    await page.screenshot({ path: join(pictures, 'tiles-near.png') });

    await setError(page, 200);
    const mixed = (await levels(page)).filter((count) => count > 0);
    assert.ok(mixed.length > 1, `levels ${mixed}`);
    const widest = await gapOfWall(page);
    assert.ok(widest <= 1, `a crack of ${widest} pixels`);
    await page.screenshot({ path: join(pictures, 'tiles-levels.png') });
    await page.evaluate(() => {
      const { box } = window.cairn;
      for (const { engineData: { scene, boundingVolume } } of window.cairn.tiles.tiles.visibleTiles) {
        boundingVolume.getAABB(box);
        scene.position.x += 0.01 * Math.sign(box.min.x + box.max.x);
        scene.updateMatrixWorld(true);
      }
    });
    const torn = await gapOfWall(page);
    assert.ok(torn > 1, `tiles displaced by 1 cm leave ${torn} pixels`);
    await setError(page, 6);

    await page.getByRole('button', { name: 'Show all' }).click();
    await page.waitForTimeout(100);
    await settled(page);
    assert.equal(await triangles(page), far);

    // Tiles out of view for long are evicted if memory is short.
    const bytes = () => page.evaluate(() => window.cairn.tiles.bytes), kept = await bytes();
    await page.evaluate((most) => {
      const { tiles } = window.cairn;
      Object.assign(tiles.tiles.lruCache, { minBytesSize: 0.5 * most, maxBytesSize: most });
      tiles.isWaiting = true;
    }, kept / 2);
    await until(async () => (await bytes()) <= kept / 2, async () => `${await bytes()} of ${kept} bytes are kept`, 20);
    await settled(page);
    assert.equal(await triangles(page), far);
  }).finally(async () => { program.kill('SIGINT'); await program.ended; });
}));
