// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Live page with various messages of the program, on screens of three sizes.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test from 'node:test';
import { Program, inFolder, isAccessible, pictures, triangles, until, withBrowser } from './browser.mjs';
import { going, livePage, pixels } from './live_page.mjs';

const kSizes = [{ width: 1400, height: 900 }, { width: 768, height: 1024 }, { width: 390, height: 844 }];
const kIdentity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const lost = { status: 'lost', words: 'Lost: turn back left', guidance: { level: 'back', words: 'Lost: turn back left', turn: [-1, 0] } };
const overflows = (page) => page.evaluate(() => document.documentElement.scrollWidth > innerWidth || document.documentElement.scrollHeight > innerHeight);
const boxes = async (locator) => Promise.all((await locator.all()).map((one) => one.boundingBox()));
const shown = (page, name) => page.screenshot({ path: join(pictures, `${name}-${page.viewportSize().width}.png`) });

/** Page as served by the program. */
let served;
async function html() {
  if (served) return served;
  await inFolder(async (folder) => {
    const program = new Program('live', 'synthetic:room', '-o', join(folder, 'map'), '--view', '--port', '0');
    served = await (await fetch(await program.url())).text();
    program.kill('SIGKILL');
    await program.ended;
  });
  return served;
}

/** Calls `look` with the page on each screen. */
const onEachScreen = (look, files) => withBrowser(async (open) => {
  for (const size of kSizes) {
    const live = await livePage(open, await html(), size, files);
    await live.receive();
    await look(live, size);
    await live.page.close();
    live.close();
  }
});

test('buttons do not move with the status, and cover nothing', () => onEachScreen(async ({ page, receive }, size) => {
  const buttons = page.locator('#bar button:visible, #tools button'), before = await boxes(buttons), scene = await page.locator('#scene').boundingBox();
  for (const words of ['Lost', 'The program says something that is very much longer than what it usually says, and goes on and on, for a while']) {
    await receive({ status: 'weak', words });
    await until(async () => (await page.locator('#status').textContent()) === words);
    assert.deepEqual(await boxes(buttons), before);
    assert.deepEqual(await page.locator('#scene').boundingBox(), scene);
    assert.ok(!(await overflows(page)), `${size.width}: ${words}`);
  }
  for (const box of before) {
    assert.ok(box.height >= 38, 'too small for a finger');
    assert.ok(box.x + box.width <= scene.x + 1 || box.x >= scene.x + scene.width - 1 || box.y + box.height <= scene.y + 1 || box.y >= scene.y + scene.height - 1, 'a button covers the map');
  }
}));

test('the panel folds away and leaves its place to the map', () => onEachScreen(async ({ page }, size) => {
  const area = async () => { const { width, height } = await page.locator('#scene').boundingBox(); return width * height; };
  const fold = page.locator('#fold'), isOpen = () => page.locator('#panel').isVisible();
  assert.equal(await isOpen(), size.width >= 1000);
  if (!(await isOpen())) await fold.click();
  const open = await area();
  await fold.click();
  assert.ok(!(await isOpen()));
  await until(async () => (await area()) > 1.2 * open);
  assert.ok(!(await overflows(page)));
}));

test('the map fills the picture while the sensor is followed', () => onEachScreen(async ({ page, receive, sendPlane }, size) => {
  await sendPlane(1 / 0.82);  // the width of the sensor's view
  await page.evaluate((pose) => window.live.receive({ epoch: 1, submaps: [pose] }), kIdentity);
  await until(async () => (await pixels(page)).covered > 0.45, () => `${size.width}: little of the picture`, 20);
  await shown(page, 'live-follow');
  const before = await page.evaluate(() => window.cairn.camera.position.toArray());
  const moved = kIdentity.with(12, 1);  // one meter to the right
  await receive({ camera: moved });
  const path = [];
  await until(async () => {
    path.push(await page.evaluate(() => window.cairn.camera.position.x));
    return path.at(-1) > before[0] + 0.95;
  }, () => `it does not follow: ${path.slice(-3)}`, 20);
  assert.ok(path.every((x, i) => i === 0 || x >= path[i - 1] - 1e-6), 'it goes to and fro');
  await page.keyboard.press('f');
  assert.equal(await page.evaluate(() => window.cairn.follow), false);
}));

test('the map is upright once gravity is known', () => onEachScreen(async ({ page, receive }) => {
  const down = () => page.evaluate(() => window.cairn.world.localToWorld(window.cairn.camera.position.clone().set(0, 1, 0)).toArray());
  assert.ok((await down())[1] < -0.999);
  const half = Math.PI / 12;  // 30 degrees about the sensor's x axis
  for (let i = 0; i < 40; ++i) await receive({ upright: [Math.sin(half), 0, 0, Math.cos(half)] });
  await until(async () => Math.abs((await down())[1] + Math.cos(2 * half)) < 0.01, async () => `down is ${await down()}`, 20);
}));

test('the surface is colored by how well it was seen', () => onEachScreen(async ({ page, sendPlane }) => {
  await sendPlane(3);
  await page.evaluate((pose) => window.live.receive({ epoch: 1, submaps: [pose] }), kIdentity);
  await until(async () => (await pixels(page)).covered > 0.9);
  const legend = page.locator('#legend');
  assert.ok(!(await legend.isVisible()));
  await page.getByRole('button', { name: /how well it was seen/ }).click();
  assert.ok(await legend.isVisible());
  assert.match(await legend.textContent(), /seen once.*seen well/);
  const { row } = await pixels(page);
  const once = row[2], well = row.at(-3);
  assert.ok(once[0] > once[2] + 30, `seen less: ${once}`);   // red
  assert.ok(well[2] > well[0] + 30, `seen well: ${well}`);   // blue
  const bluer = row.map(([r, , b]) => b - r);
  assert.ok(bluer.every((v, i) => i < 16 || bluer[i - 16] - v < 12), 'from red to blue all the way');
  await shown(page, 'live-coverage');
  await page.keyboard.press('c');
  assert.ok(!(await legend.isVisible()));
}));

test('a lost operator sees where to turn, and hears it once sound is on', () => onEachScreen(async ({ page, receive }) => {
  const heard = () => page.evaluate(() => window.heard), back = page.locator('#back');
  await receive(lost);
  await until(() => back.isVisible());
  assert.equal(await page.locator('#status').getAttribute('data-status'), 'lost');
  assert.equal(await page.locator('#flash').getAttribute('class'), 'lost');
  assert.match(await back.textContent(), /turn back left/);
  assert.ok(await back.locator('svg').evaluate((arrow) => arrow.style.transform.startsWith('rotate(3.14')), 'the arrow points to the left');
  await page.waitForTimeout(150);
  await shown(page, 'live-lost');
  assert.deepEqual(await heard(), { tones: [], vibrations: [] }, 'nothing sounds before somebody asks for it');
  await receive();
  await until(async () => !(await back.isVisible()));
  assert.equal(await page.locator('#flash').getAttribute('class'), 'found');

  const sound = page.getByRole('button', { name: /Sound and vibration/ });
  await sound.click();
  assert.equal(await sound.getAttribute('aria-pressed'), 'true');
  await page.evaluate(() => { window.heard.tones.length = window.heard.vibrations.length = 0; });
  await receive(lost);
  await receive(lost);
  assert.deepEqual(await heard(), { tones: [660, 440], vibrations: [[250, 100, 250]] }, 'lost: falling tones, once');
  await receive();
  assert.deepEqual(await heard(), { tones: [660, 440, 440, 660], vibrations: [[250, 100, 250], [80]] }, 'found: rising ones');

  await page.reload();
  await until(() => page.evaluate(() => Boolean(window.live?.onmessage)));
  assert.equal(await page.getByRole('button', { name: /Sound and vibration/ }).getAttribute('aria-pressed'), 'true', 'it is remembered');
  await page.getByRole('button', { name: /Sound and vibration/ }).click();
}));

test('the page has no serious faults of accessibility, whatever it says', () => onEachScreen(async ({ page, receive, sendPlane }, { width }) => {
  await sendPlane(3);
  if (!(await page.locator('#panel').isVisible())) await page.locator('#fold').click();
  await page.getByRole('button', { name: /how well it was seen/ }).click();  // with its legend
  const states = { good: {}, weak: { status: 'weak', words: 'Too fast: move slower' }, lost, paused: { status: 'paused', words: 'Paused' }, over: { status: 'finishing', words: 'Writing the map' } };
  for (const [name, state] of Object.entries(states)) {
    await receive({ ...state, loops: [[1.2, 9.4, true], [2.2, 8.1, false]] });
    await until(async () => (await page.locator('#status').textContent()) === { ...going, ...state }.words);
    await page.waitForTimeout(1300);  // after the end of a flash
    await isAccessible(page, `${name} at ${width}`);
  }
  await receive();
  await page.keyboard.press('?');
  await isAccessible(page, `keys at ${width}`);
  await shown(page, 'live-keys');
}));

test('Pause becomes Resume, the space bar does the same, and numbers have units', () => onEachScreen(async ({ page, receive }) => {
  const asked = () => page.evaluate(() => window.asked);
  await page.keyboard.press(' ');
  assert.deepEqual(await asked(), ['pause']);
  await receive({ status: 'paused', words: 'Paused' });
  await page.getByRole('button', { name: 'Resume' }).click();
  await page.keyboard.press(' ');  // the button has the focus: one press, not two
  assert.deepEqual(await asked(), ['pause', 'start', 'start']);
  await page.locator('#bar button', { hasText: 'Finish' }).focus();
  await page.keyboard.press(' ');
  assert.deepEqual((await asked()).at(-1), 'finish');
  if (!(await page.locator('#panel').isVisible())) await page.locator('#fold').click();
  await receive();
  const panel = page.locator('#panel'), fact = (name) => panel.locator(`dt:text-is("${name}") + dd`).textContent();
  assert.equal(await page.locator('#status').textContent(), 'Tracking well');
  assert.equal(await fact('Frames in the map'), '120');
  assert.equal(await fact('Frames lost'), '3');
  assert.equal(await fact('Skipped to keep up'), '7');
  assert.match(await panel.textContent(), /computer was busy/);
  assert.equal(await fact('Speed'), '24.3 frames/s');
  assert.equal(await fact('Memory'), '412 MB');
  assert.ok(!(await panel.getByText('91 %').isVisible()), 'numbers for experts are folded away');
  await panel.getByText('Tracking in numbers').click();
  assert.ok(await panel.getByText('91 %').isVisible());
  await shown(page, 'live-panel');
}));

test('a stage after the last frame shows its progress, and a button to skip it', () => onEachScreen(async ({ page, receive }) => {
  const button = (name) => page.getByRole('button', { name, exact: true }), bar = page.getByRole('progressbar');
  const isShown = async (...names) => {
    for (const name of ['Pause', 'Reset', 'Finish', 'Skip']) assert.equal(await button(name).isVisible(), names.includes(name), name);
    assert.equal(await bar.isVisible(), names.includes('Skip'));
  };
  await isShown('Pause', 'Reset', 'Finish');
  await receive({ has_reset: false });
  await isShown('Pause', 'Finish');
  const stage = { status: 'finishing', words: 'Adjusting the poses', stage: { fraction: 0.4 } };
  await receive(stage);
  await isShown('Skip');
  assert.equal(await page.locator('#status').textContent(), 'Adjusting the poses');
  assert.equal(await bar.evaluate((element) => element.value), 0.4);
  assert.equal(await bar.getAttribute('aria-label'), 'Adjusting the poses');
  assert.ok((await button('Skip').boundingBox()).height >= 38, 'too small for a finger');
  assert.ok(!(await overflows(page)));
  await isAccessible(page, 'a stage');
  await shown(page, 'live-stage');
  await button('Skip').focus();
  await page.keyboard.press(' ');
  assert.deepEqual(await page.evaluate(() => window.asked), ['skip']);
  await receive(stage);
  assert.ok(await button('Skip').isDisabled(), 'asked twice');
  await receive({ status: 'finishing', words: 'Writing the map' });
  await isShown('Pause', 'Reset', 'Finish');
  for (const name of ['Pause', 'Reset', 'Finish']) assert.ok(await button(name).isDisabled());
}));
