// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Finished map in Chromium: report.html from the disk, and cairn view.
import assert from 'node:assert/strict';
import { readFileSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { join } from 'node:path';
import test from 'node:test';
import { pathToFileURL } from 'node:url';
import { Program, inFolder, pictures, run, timeline, triangles, until, withBrowser } from './browser.mjs';
import { pixels } from './live_page.mjs';

test('report.html and cairn view show the mesh, the charts and the facts', () => inFolder(async (folder) => {
  const out = join(folder, 'map');
  const report = JSON.parse(run('reconstruct', 'synthetic:room', '-o', out, '--frames', '0:30', '--json'));
  await withBrowser(async (open) => {
    const page = await open(pathToFileURL(join(out, 'report.html')).href);
    // Compression rounds positions: a few triangles lose their area.
    await until(async () => Math.abs((await triangles(page)) / report.mesh.triangles - 1) < 5e-3);
    await until(async () => (await page.locator('.uplot canvas').count()) === 2);
    // Same text as on the console, in green since the result is good.
    assert.match(await page.locator('#status').textContent(), /^30 of 30 frames fused \(0 lost, 0 skipped\) in [\d.]+ s$/);
    assert.equal(await page.locator('#status').getAttribute('data-status'), 'good');
    const panel = await page.locator('#panel').innerText();
    assert.match(panel, /Voxel\s+1 cm/);
    assert.doesNotMatch(panel, /voxel_size|--|\d\.\d{7}/);
    await page.waitForTimeout(500);
    await page.screenshot({ path: join(pictures, 'report.png') });

    const program = new Program('view', out, '--port', '0');
    const served = await open('about:blank');
    await served.addInitScript(() => {
      window.notes = [];
      new MutationObserver(() => window.notes.push(document.getElementById('loading')?.textContent ?? ''))
        .observe(document, { subtree: true, childList: true, characterData: true });
    });
    await served.goto(await program.url());
    await until(async () => (await triangles(served)) === report.mesh.triangles);
    assert.ok((await served.evaluate(() => window.notes)).some((note) => /^Loading [\d.]+ of [\d.]+ MB$/.test(note)));
    assert.equal(await served.locator('#loading').count(), 0);
    assert.match(await served.locator('#status').textContent(), /^30 of 30 frames fused/);
    await served.close();
    program.kill('SIGINT');
    assert.equal(await program.ended, 0);
  });
}));

/** Reloads report.html with a changed report and changed data. */
async function changed(page, file, change) {
  await page.route('**/report.html', async (route) => {
    const html = readFileSync(file, 'utf8'), mark = '<script type="application/json" id="data">', at = html.indexOf(mark) + mark.length;
    const end = html.indexOf('</script>', at), data = change(JSON.parse(html.slice(at, end)));
    await route.fulfill({ contentType: 'text/html', body: html.slice(0, at) + JSON.stringify(data).replaceAll('<', '\\u003c') + html.slice(end) });
  });
  await page.goto('http://127.0.0.1/report.html');
  await until(async () => (await page.locator('.uplot canvas').count()) === 2);
}

test('lost frames, warnings and verdicts are shown, and never green', () => inFolder(async (folder) => {
  const out = join(folder, 'map'), file = join(out, 'report.html');
  run('reconstruct', 'synthetic:room', '-o', out, '--frames', '0:20', '--voxel-size', '0.03');
  const lose = (data, count) => {
    delete data.report.verdict;  // verdict of the unchanged run
    data.report.frames = { total: 20, fused: 20 - count, lost: count, skipped: 0 };
    for (const frame of data.report.per_frame.slice(8, 8 + count)) frame.state = 'lost';
    const times = data.report.per_frame.slice(8, 8 + count).map(({ timestamp }) => timestamp);
    data.trajectory = data.trajectory.filter(([time]) => !times.some((lost) => Math.abs(lost - time) < 0.01));
    return data;
  };
  await withBrowser(async (open) => {
    const page = await open('about:blank');
    const status = () => page.locator('#status').getAttribute('data-status');
    await changed(page, file, (data) => lose(data, 2));
    assert.equal(await status(), 'weak');
    assert.match(await page.locator('#status').textContent(), /^18 of 20 frames fused \(2 lost, 0 skipped\)/);
    assert.match(await page.locator('#panel').innerText(), /2 lost frames/);
    await page.getByRole('button', { name: 'Play the path' }).click();
    assert.match(await page.locator('#card').innerText(), /1 stretch without poses/);

    await changed(page, file, (data) => lose(data, 6));
    assert.equal(await status(), 'lost');

    await changed(page, file, (data) => {
      data.report.verdict = { level: 'bad', words: 'Most of it is lost.', reasons: ['The focal length does not fit: give --camera camera.yaml'] };
      data.report.upright = { source: 'structure', known: true, turned_degrees: 29, words: 'Turned by 29°, by floor and walls' };
      return data;
    });
    assert.equal(await status(), 'lost');
    const text = await page.locator('#panel').innerText();
    for (const words of ['Most of it is lost.', 'give --camera camera.yaml', 'Turned by 29°, by floor and walls']) assert.ok(text.includes(words), words);

    await changed(page, file, (data) => { data.report.verdict = { level: 'good', words: 'All is well.', reasons: [] }; return data; });
    assert.equal(await status(), 'good');
    await changed(page, file, (data) => { data.report.warnings = ['something is doubtful']; return data; });
    assert.equal(await status(), 'weak');

    // A missing or unreadable mesh does not affect the rest of the page.
    await changed(page, file, (data) => { data.mesh = '#missing'; return data; });
    assert.match(await page.locator('#panel').innerText(), /The mesh is not shown here/);
    await page.setViewportSize({ width: 390, height: 844 });  // with a folded panel
    await changed(page, file, (data) => { delete data.mesh; data.mesh_left_out = 'map/mesh.glb'; return data; });
    assert.match(await page.locator('#panel').innerText(), /This page has no mesh; cairn view shows map\/mesh\.glb/);
    assert.equal(await page.locator('#empty').textContent(), 'No surface');
  });
}));

/** Server of a page in parts: the first immediately, each other after a call of `next()`. */
async function slowly([first, ...others]) {
  let answer;
  const server = createServer((request, response) => { answer = response.writeHead(200, { 'Content-Type': 'text/html' }); answer.write(first); });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  server.unref();
  const next = () => (others.length > 1 ? answer.write(others.shift()) : answer.end(others.shift()));
  return { url: `http://127.0.0.1:${server.address().port}/`, next, close: () => server.close() };
}

test('a coarser mesh is shown before the full mesh is fetched and its texture decoded', () => inFolder(async (folder) => {
  const out = join(folder, 'map');
  const { mesh } = JSON.parse(run('reconstruct', 'synthetic:room', '-o', out, '--frames', '0:60', '--json'));
  assert.ok(mesh.triangles > 160_000 && mesh.textures > 0, 'a map that is large enough');
  const program = new Program('view', out, '--port', '0'), url = await program.url();
  await withBrowser(async (open) => {
    const page = await open('about:blank');
    let give;
    const asked = new Promise((resolve) => page.route('**/mesh.glb', (route) => { give = () => route.continue(); resolve(); }));
    await page.goto(url);
    await asked;  // requested, but not yet answered
    await until(async () => 'picture' in (await timeline(page)));
    const coarse = await triangles(page);
    assert.ok(coarse > 20_000 && coarse < 0.7 * mesh.triangles, `${coarse} of ${mesh.triangles} triangles`);
    const { covered, row } = await pixels(page);
    assert.ok(row.some(([r, g, b]) => Math.max(r, g, b) - Math.min(r, g, b) > 40), 'it has no colors');
    assert.equal(await page.locator('#tools button').count(), 0);
    await page.screenshot({ path: join(pictures, 'finished-coarse.png') });
    const scene = await page.locator('#scene').boundingBox();
    give();
    await until(async () => 'complete' in (await timeline(page)));
    assert.equal(await triangles(page), mesh.triangles);
    assert.ok(await page.evaluate(() => [...window.cairn.meshes()].every(({ material }) => material.map?.image)), 'it has no texture');
    assert.deepEqual(await page.locator('#scene').boundingBox(), scene, 'the picture moved when the tools came');
    const all = (await pixels(page)).covered;
    assert.ok(all > 0.6 && Math.abs(covered - all) < 0.05, `${covered} of the picture, and then ${all}`);
    await page.screenshot({ path: join(pictures, 'finished-whole.png') });
    const { picture, texture, complete } = await timeline(page);
    assert.ok(picture < texture && texture < complete, `picture ${picture}, texture ${texture}, complete ${complete} s`);
    await page.close();

    // report.html shows the coarse mesh before the rest of the file arrives.
    const html = readFileSync(join(out, 'report.html')), rest = html.indexOf('data-of="mesh"'), middle = html.indexOf('data-of="mesh"', rest + 500_000);
    const slow = await slowly([html.subarray(0, rest), html.subarray(rest, middle), html.subarray(middle)]);
    const report = await open('about:blank'), note = report.locator('#loading');
    await report.goto(slow.url, { waitUntil: 'commit' });
    await until(async () => 'picture' in (await timeline(report)));
    assert.equal(await triangles(report), coarse);
    assert.match(await note.textContent(), /^Loading 0\.0 of [\d.]+ MB$/);
    await report.screenshot({ path: join(pictures, 'report-coarse.png') });
    slow.next();
    await until(async () => /^Loading (?!0\.0)[\d.]+ of [\d.]+ MB$/.test(await note.textContent()));
    assert.equal(await triangles(report), coarse);
    slow.next();
    await until(async () => 'complete' in (await timeline(report)));
    // Compression rounds positions: a few triangles lose their area.
    assert.ok(Math.abs((await triangles(report)) / mesh.triangles - 1) < 5e-3);
    assert.ok(await report.evaluate(() => [...window.cairn.meshes()].every(({ material }) => material.map?.image)), 'it has no texture');
    assert.equal(await note.count(), 0);
    await report.close();
    slow.close();
  }).finally(async () => { program.kill('SIGINT'); await program.ended; });
}));

test('the page is small', () => inFolder(async (folder) => {
  run('synth', 'plane', '-o', join(folder, 'recording'), '--frames', '2');
  run('reconstruct', join(folder, 'recording'), '-o', join(folder, 'map'), '--voxel-size', '0.04');
  const program = new Program('view', join(folder, 'map'), '--port', '0');
  const page = await (await fetch(await program.url())).text();
  program.kill('SIGINT');
  await program.ended;
  assert.ok(page.length <= 1e6, `${page.length} bytes`);
  assert.ok(!/https?:\/\/(?!www\.w3\.org|127\.0\.0\.1)[^"'`\s)]*\.js/.test(page), 'a script comes from elsewhere');
  assert.ok(statSync(join(folder, 'map', 'report.html')).size > page.length);
}));
