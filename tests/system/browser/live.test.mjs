// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Live view in Chromium, from a stream that continues during the test.
import assert from 'node:assert/strict';
import { existsSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { Program, inFolder, pictures, triangles, until, withBrowser } from './browser.mjs';

const statusOf = (page) => page.locator('#status').getAttribute('data-status');
const fusedIn = async (page) => Number(await page.locator('dt:text-is("Frames in the map") + dd').textContent().then((text) => text.replaceAll(',', '')));
const skippedIn = async (page) => Number(await page.locator('dt:text-is("Skipped to keep up") + dd').textContent().then((text) => text.replaceAll(',', '')));

test('the mesh grows, the buttons work, and the result is written', () => inFolder(async (folder) => {
  const out = join(folder, 'map');
  const program = new Program('live', 'synthetic:room', '-o', out, '--view', '--port', '0', '--quality', 'fast');
  const url = await program.url();
  await withBrowser(async (open, errors) => {
    const page = await open(url);
    await until(async () => (await triangles(page)) > 1000);
    const first = await triangles(page);
    await until(async () => (await triangles(page)) > 1.2 * first, () => `it stayed at ${first} triangles`);
    for (const name of ['What the color camera sees', 'What the depth camera sees'])
      await until(() => page.getByAltText(name).evaluate((image) => image.naturalWidth === 320));
    await until(async () => /Tracking well|Too fast|Seen well/.test(await page.locator('#status').textContent()));

    await page.getByRole('button', { name: 'Pause' }).click();
    await until(async () => (await statusOf(page)) === 'paused');
    const fused = await fusedIn(page), skipped = await skippedIn(page);
    await page.waitForTimeout(1500);
    assert.equal(await fusedIn(page), fused);
    assert.equal(await skippedIn(page), skipped, 'the recording went on');

    // A second viewer, on a phone, joins late and sees the entire map.
    const phone = await open(url, { width: 390, height: 780 });
    await until(async () => (await triangles(phone)) >= (await triangles(page)));
    await phone.screenshot({ path: join(pictures, 'live-phone.png') });
    assert.ok(await phone.evaluate(() => document.documentElement.scrollWidth <= innerWidth));
    for (const button of await phone.getByRole('button').all()) assert.ok((await button.boundingBox()).height >= 36);
    await phone.close();

    await page.getByRole('button', { name: 'Resume' }).click();
    await until(async () => (await fusedIn(page)) > fused);
    await page.screenshot({ path: join(pictures, 'live.png') });

    let message = '';
    page.on('dialog', (dialog) => { message = dialog.message(); return dialog.accept(); });
    await page.getByRole('button', { name: 'Reset' }).click();
    assert.match(message, /deletes the map of this run with [\d,]+ frames, also on disk/);
    await until(async () => (await fusedIn(page)) < fused, () => 'the map was not thrown away');
    await until(async () => (await triangles(page)) > 1000);
    await page.getByRole('button', { name: 'Finish' }).click();
    // The page changes to the finished map, with the written mesh, while the program waits.
    await until(() => /the page shows the result/.test(program.output), () => program.output);
    const report = JSON.parse(readFileSync(join(out, 'report.json'), 'utf8'));
    await until(async () => (await triangles(page)) === report.mesh.triangles, async () => `${await triangles(page)} of ${report.mesh.triangles} triangles`);
    const { fused: written, total } = report.frames;
    await until(async () => (await page.locator('#status').textContent()).includes(`${written} of ${total}`));
    assert.match(program.output, new RegExp(`${written} of ${total} frames`));
    assert.equal(await page.getByRole('button', { name: 'Finish' }).count(), 0);
    await page.screenshot({ path: join(pictures, 'live-finished.png') });
    await page.reload();  // a reload shows the same
    await until(async () => (await triangles(page)) === report.mesh.triangles);
    await page.close();
    assert.equal(await program.ended, 0, program.output);
    assert.deepEqual(errors, []);
  });
  for (const file of ['mesh.glb', 'map.vdb', 'trajectory.txt', 'report.json', 'report.html'])
    assert.ok(existsSync(join(out, file)), file);
}));

test('the stages after Finish show their progress, and Skip ends them', () => inFolder(async (folder) => {
  const out = join(folder, 'map');
  const program = new Program('live', 'synthetic:room', '-o', out, '--view', '--port', '0', '--quality', 'best', '--voxel-size', '0.03', '--no-texture');
  const url = await program.url();
  await withBrowser(async (open) => {
    const page = await open(url);
    await until(async () => (await triangles(page)) > 100 && (await fusedIn(page)) > 65);
    await page.getByRole('button', { name: 'Finish' }).click();
    const skip = page.getByRole('button', { name: 'Skip', exact: true });
    await skip.waitFor();
    await until(async () => (await page.locator('#status').textContent()) === 'Adjusting the poses');
    assert.ok(await page.getByRole('progressbar').isVisible());
    await page.screenshot({ path: join(pictures, 'live-stage.png') });
    await skip.click();
    await until(() => /the page shows the result/.test(program.output), () => program.output);
    assert.equal(await skip.count(), 0);
    await page.close();
    assert.equal(await program.ended, 0, program.output);
  });
  const { quality, frames } = JSON.parse(readFileSync(join(out, 'report.json'), 'utf8'));
  assert.equal(quality.requested, 'best');
  assert.match(quality.words, /^skipped in the stage (adjust|reintegrate)/);
  assert.ok(frames.total < 300);
}));

test('reconstruct shows the growing map, pauses, finishes with the frames so far, and shows the result', () => inFolder(async (folder) => {
  const out = join(folder, 'map');
  const program = new Program('reconstruct', 'synthetic:room', '-o', out, '--view', '--port', '0', '--voxel-size', '0.03', '--no-texture');
  const url = await program.url();
  await withBrowser(async (open) => {
    const page = await open(url), button = (name) => page.getByRole('button', { name, exact: true });
    await until(async () => (await triangles(page)) > 100);
    await button('Pause').click();
    await until(async () => (await statusOf(page)) === 'paused');
    const fused = await fusedIn(page);
    await page.waitForTimeout(500);
    assert.equal(await fusedIn(page), fused);
    assert.ok(!(await button('Reset').isVisible()));
    await page.screenshot({ path: join(pictures, 'reconstruct-view.png') });
    await button('Resume').click();
    await until(async () => (await fusedIn(page)) > fused);
    await button('Finish').click();
    await until(() => /the page shows the result/.test(program.output), () => program.output);
    await until(async () => (await page.locator('#status').textContent()).includes(' frames'));
    await page.close();
    assert.equal(await program.ended, 0, program.output);
  });
  const { interrupted, mesh } = JSON.parse(readFileSync(join(out, 'report.json'), 'utf8'));
  assert.ok(interrupted.frames_left > 0);
  assert.ok(mesh.triangles > 100);
}));

test('the page reconnects after a lost connection, and reports the end of the program', () => inFolder(async (folder) => {
  const program = new Program('live', 'synthetic:room', '-o', join(folder, 'map'), '--view', '--port', '0');
  const url = await program.url();
  await withBrowser(async (open, errors) => {
    const page = await open(url, undefined, () => {
      window.sockets = [];
      window.WebSocket = class extends WebSocket {
        constructor(...args) { super(...args); window.sockets.push(this); }
      };
    });
    await until(async () => (await triangles(page)) > 1000);
    await page.evaluate(() => window.sockets.at(-1).close());
    await until(async () => (await statusOf(page)) === 'gone');
    await until(async () => (await statusOf(page)) !== 'gone');
    assert.equal(await page.evaluate(() => window.sockets.length), 2);
    const before = await fusedIn(page);
    await until(async () => (await fusedIn(page)) > before);
    program.kill('SIGKILL');
    await until(async () => (await statusOf(page)) === 'gone');
    errors.length = 0;  // the browser itself reports failed connections
  });
}));
