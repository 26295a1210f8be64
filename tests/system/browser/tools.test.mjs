// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Tools of a finished map, each through its button and its key, on a wide screen, a tablet and a phone.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { Program, inFolder, isAccessible, pictures, run, triangles, until, withBrowser } from './browser.mjs';

const kSizes = [{ width: 1400, height: 900 }, { width: 768, height: 1024 }, { width: 390, height: 844 }];
const kPicture = `data:image/svg+xml,${encodeURIComponent('<svg xmlns="http://www.w3.org/2000/svg" width="40" height="30"><rect width="40" height="30" fill="teal"/></svg>')}`;

/** Fields of a room with known walls: x to 2.7 m, z to 2.3 m; half of the room is unobserved. */
function fields() {
  const [nx, ny, nz] = [46, 20, 40], spacing = 0.15, origin = [-3.4, -1.4, -3], most = 2, cells = nx * ny * nz;
  const bytes = Buffer.alloc(40 + 3 * cells);
  bytes.write('CFLD');
  [1, nx, ny, nz].forEach((v, i) => bytes.writeUInt32LE(v, 4 + 4 * i));
  [...origin, spacing, most].forEach((v, i) => bytes.writeFloatLE(v, 20 + 4 * i));
  for (let k = 0, at = 40; k < nz; ++k)
    for (let j = 0; j < ny; ++j)
      for (let i = 0; i < nx; ++i, ++at) {
        const x = origin[0] + i * spacing, z = origin[2] + k * spacing;
        const distance = Math.max(-most, Math.min(most, 2.7 - Math.abs(x), 2.3 - Math.abs(z)));
        bytes[at] = z < -1 ? 0 : Math.max(1, Math.round(128 + 127 * distance / most));
        bytes[at + cells] = x < 0 ? 3 : 200;
        bytes[at + 2 * cells] = z < 1.5 ? 10 : 60;
      }
  return bytes;
}

/** Opens a map with optional data of a page: fields, keyframes, files. */
async function openMap(open, url, viewport) {
  const page = await open('about:blank', viewport);
  await page.route('**/data.json', async (route) => {
    const data = await (await route.fetch()).json(), times = data.trajectory.map(([time]) => time);
    data.fields = 'fields.bin';
    data.keyframes = [5, 20, 35, 50].map((i) => ({ time: times[i], picture: `${kPicture}#${i}` }));
    data.files = [{ name: 'mesh.glb', url: 'mesh.glb', bytes: 1234567, what: 'textured mesh, for Blender and viewers' }];
    await route.fulfill({ json: data });
  });
  await page.route('**/fields.bin', (route) => route.fulfill({ body: fields(), contentType: 'application/octet-stream' }));
  await page.goto(url);
  await until(async () => (await triangles(page)) > 0 && (await page.locator('#tools button').count()) > 8);
  await quiet(page);
  return page;
}

/** Waits until all requested tiles are drawn. */
const quiet = async (page) => {
  await page.waitForTimeout(50);
  await page.waitForFunction(() => !window.cairn.isStale && !window.cairn.fence, null, { timeout: 60000 });
};

/** Activation by button and by key from the picture; both must have the same effect. */
const ways = (page, name, key) => [
  () => page.getByRole('button', { name, exact: true }).click(),
  async () => {
    await page.locator('#scene canvas').focus();
    await page.keyboard.press(key);
  },
];

const pressed = (page, name) => page.getByRole('button', { name, exact: true }).getAttribute('aria-pressed');
const card = (page) => page.locator('#card');
const inScene = (page, work, value) => page.evaluate(work, value);

async function middle(page, dx = 0, dy = 0) {
  const box = await page.locator('#scene').boundingBox();
  return [box.x + box.width * (0.5 + dx), box.y + box.height * (0.5 + dy)];
}

const checks = {
  /** View from the camera's start, level; or from above, into the room. */
  async 'first picture'(page, { width }) {
    const start = () => inScene(page, () => {
      const { camera, controls } = window.cairn, ahead = controls.target.clone().sub(camera.position).normalize();
      return { eye: camera.position.toArray(), ahead: ahead.toArray(), up: camera.up.toArray(), fov: camera.fov, aspect: camera.aspect };
    });
    const first = await start();
    const [, x, y, z, qx, qy, qz, qw] = await page.evaluate(async () => (await (await fetch('data.json')).json()).trajectory[0]);
    [x, -y, -z].forEach((v, i) => assert.ok(Math.abs(v - first.eye[i]) < 1e-3, `eye ${first.eye}`));
    const forward = [2 * (qx * qz + qw * qy), -2 * (qy * qz - qw * qx), -(1 - 2 * (qx * qx + qy * qy))];
    forward.forEach((v, i) => assert.ok(Math.abs(v - first.ahead[i]) < 1e-3, `ahead ${first.ahead}, not ${forward}`));
    assert.deepEqual(first.up, [0, 1, 0]);
    const across = 2 * Math.atan(Math.tan(first.fov * Math.PI / 360) * first.aspect) * 180 / Math.PI;
    assert.ok(across > 50, `${across} degrees across at ${width} pixels`);
    assert.ok((await inScene(page, () => [...window.cairn.meshes()].every(({ material }) => material.side === 0))), 'back faces are drawn');
    for (const way of ways(page, 'Show all', 'a')) {
      await inScene(page, () => { window.cairn.place(window.cairn.camera.position.clone().setScalar(9), window.cairn.controls.target); });
      await way();
      const { outside, width: across, height, middle } = await inScene(page, () => {
        const { camera, box } = window.cairn, low = [1, 1], high = [-1, -1], place = camera.position.clone();
        camera.updateMatrixWorld();
        let outside = box.containsPoint(camera.position) ? 1 : 0;
        for (const { geometry: { attributes: { position } }, matrixWorld } of window.cairn.meshes())
          for (let i = 0; i < position.count; ++i) {
            const { x, y, z } = place.fromBufferAttribute(position, i).applyMatrix4(matrixWorld).project(camera);
            outside += Math.abs(x) > 1 || Math.abs(y) > 1 || z > 1;
            [x, y].forEach((v, k) => { low[k] = Math.min(low[k], v); high[k] = Math.max(high[k], v); });
          }
        return { outside, width: (high[0] - low[0]) / 2, height: (high[1] - low[1]) / 2, middle: [0, 1].map((k) => Math.abs(low[k] + high[k]) / 2) };
      });
      assert.equal(outside, 0, 'a part of the map is out of the picture');
      assert.ok(Math.max(across, height) > 0.85 && Math.max(...middle) < 0.2, `the map fills ${across} by ${height} of the picture, ${middle} beside its middle`);
    }
    await quiet(page);
    await page.screenshot({ path: join(pictures, `tools-all-${width}.png`) });
    for (const way of ways(page, 'Start, where the camera began', 'h')) {
      await inScene(page, () => window.cairn.lookAtAll());
      await way();
      const again = await start();
      again.eye.forEach((v, i) => assert.ok(Math.abs(v - first.eye[i]) < 1e-3));
    }
  },

  async measure(page, { width }) {
    for (const way of ways(page, 'Measure', 'm')) {
      await way();
      assert.equal(await pressed(page, 'Measure'), 'true');
      assert.equal(await card(page).isVisible(), true);
      await way();
      assert.equal(await card(page).isVisible(), false);
    }
    await page.getByRole('button', { name: 'Measure', exact: true }).click();
    const click = async (dx, dy) => {
      await quiet(page);
      await page.mouse.click(...await middle(page, dx, dy));
      await page.waitForTimeout(100);
    };
    const rows = () => card(page).locator('.measured li').allInnerTexts();
    const measure = async (kind, places) => {
      await card(page).getByRole('radio', { name: kind }).check();
      const before = (await rows()).length;
      for (const place of places) await click(...place);
      if (kind === 'Area') await card(page).getByRole('button', { name: 'Close the area' }).click();
      await until(async () => (await rows()).length === before + 1);
      return (await rows()).at(-1).replaceAll('\n', ' ');
    };
    // On the table in front: the tool's result must match the program's own ray cast.
    assert.match(await measure('Distance', [[-0.1, 0.1], [0.1, 0.1]]), /^Distance \d+\.\d (c|m)?m$/);
    assert.match(await measure('Height', [[0, -0.1], [0, 0.15]]), /^Height [\d.]+ (c|m)?m$/);
    assert.match(await measure('Area', [[-0.1, 0.1], [0.1, 0.1], [0.1, 0.16]]), /^Area [\d.]+ (cm²|m²)$/);
    assert.match(await measure('Point', [[0, 0.1]]), /^Point -?\d\.\d{3}, -?\d\.\d{3}, -?\d\.\d{3}$/);
    assert.equal(await page.locator('#labels .label').count(), 4);
    await quiet(page);
    await page.screenshot({ path: join(pictures, `tools-measure-${width}.png`) });
    // By keyboard, in the middle of the picture.
    await card(page).getByRole('radio', { name: 'Point' }).check();
    await page.locator('#scene canvas').focus();
    await page.keyboard.press('Enter');
    await until(async () => (await rows()).length === 5);
    await card(page).getByRole('button', { name: /^Remove Point/ }).first().click();
    assert.equal((await rows()).length, 4);
    await card(page).getByRole('button', { name: 'Remove all' }).click();
    assert.equal(await page.locator('#labels .label').count(), 0);
    await page.keyboard.press('Escape');
    assert.equal(await pressed(page, 'Measure'), 'false');
  },

  async 'section and plan'(page, { width }) {
    const planes = () => inScene(page, () => window.cairn.clipping.length);
    for (const way of ways(page, 'Section box', 'b')) {
      await way();
      assert.equal(await planes(), 6);
      await way();
      assert.equal(await planes(), 0);
    }
    await page.getByRole('button', { name: 'Show all', exact: true }).click();
    await page.getByRole('button', { name: 'Section box', exact: true }).click();
    const top = card(page).getByRole('slider', { name: 'Top' });
    const before = await inScene(page, () => Math.min(...window.cairn.clipping.filter(({ normal }) => normal.y < -0.9).map(({ constant }) => constant)));
    await top.focus();
    for (let i = 0; i < 40; ++i) await page.keyboard.press('ArrowLeft');
    const after = await inScene(page, () => Math.min(...window.cairn.clipping.filter(({ normal }) => normal.y < -0.9).map(({ constant }) => constant)));
    assert.ok(Math.abs(before - after - 0.4) < 0.02, `the top went from ${before} to ${after}`);
    await quiet(page);
    await page.screenshot({ path: join(pictures, `tools-section-${width}.png`) });
    await card(page).getByRole('button', { name: 'Show all of it' }).click();
    assert.equal(await planes(), 0);

    for (const way of ways(page, 'Floor plan', 'p')) {
      await way();
      assert.equal(await inScene(page, () => window.cairn.camera.isOrthographicCamera), true);
      await way();
      assert.equal(await inScene(page, () => Boolean(window.cairn.camera.isOrthographicCamera)), false);
    }
    await page.getByRole('button', { name: 'Floor plan', exact: true }).click();
    const down = await inScene(page, () => window.cairn.camera.getWorldDirection(window.cairn.controls.target.clone()).y);
    assert.ok(down < -0.999, `it looks along ${down}`);
    const cutAt = () => inScene(page, () => window.cairn.clipping[0].constant);
    const high = await cutAt();
    await card(page).getByRole('slider', { name: 'Cut above the floor' }).fill('0.6');
    assert.ok(await cutAt() < high - 0.3);
    await quiet(page);
    await page.screenshot({ path: join(pictures, `tools-plan-${width}.png`) });
    await card(page).getByRole('button', { name: 'Back to the room' }).click();
  },

  async distances(page, { width }) {
    const planes = () => inScene(page, () => window.cairn.world.children.filter((child) => child.isMesh).length);
    for (const way of ways(page, 'Distances, a slice', 'd')) {
      await way();
      await until(async () => (await planes()) === 1);
      await way();
      assert.equal(await planes(), 0);
    }
    await page.getByRole('button', { name: 'Distances, a slice', exact: true }).click();
    await until(async () => (await planes()) === 1);
    const seen = () => inScene(page, () => {
      const { image: { data, width: nx } } = window.cairn.world.children.find((child) => child.isMesh).material.map;
      const at = (x, z) => [...data.slice(4 * (Math.round((x + 3.4) / 0.15) + nx * Math.round((z + 3) / 0.15))).slice(0, 4)];
      return { free: at(0, 0.5), wall: at(2.6, 0.5), behind: at(3.2, 0.5), unseen: at(0, -2), height: window.cairn.world.children.find((child) => child.isMesh).position.y };
    });
    const first = await seen();
    assert.ok(first.wall[0] > 200 && first.wall[2] > 150, `the wall is ${first.wall}`);
    assert.ok(first.behind[0] > 150 && first.behind[1] < 100, `behind it is ${first.behind}`);
    assert.ok(first.free[2] > first.free[0], `free space is ${first.free}`);
    assert.equal(first.unseen[3], 0);
    await card(page).getByRole('slider', { name: 'Above the floor' }).focus();
    await page.keyboard.press('ArrowRight');
    await page.keyboard.press('ArrowRight');
    assert.ok(Math.abs((await seen()).height - (first.height - 0.3)) < 0.16, 'two steps of the slider are two layers up');
    await quiet(page);
    await page.screenshot({ path: join(pictures, `tools-distances-${width}.png`) });
    await card(page).getByRole('button', { name: 'Switch off' }).click();
  },

  async walk(page, { width }) {
    const place = () => inScene(page, () => window.cairn.camera.position.toArray());
    for (const way of ways(page, 'Walk', 'w')) {
      await way();
      assert.equal(await inScene(page, () => window.cairn.controls.enabled), false);
      await page.keyboard.press('Escape');
      assert.equal(await inScene(page, () => window.cairn.controls.enabled), true);
    }
    await page.getByRole('button', { name: 'Start, where the camera began', exact: true }).click();
    await page.getByRole('button', { name: 'Walk', exact: true }).click();
    await until(async () => {  // until the eye height above the floor is stable
      const at = await place();
      await page.waitForTimeout(200);
      return Math.abs((await place())[1] - at[1]) < 0.002;
    });
    const begin = await place();
    await page.locator('#scene canvas').focus();
    await page.keyboard.down('s');
    await until(async () => Math.hypot((await place())[0] - begin[0], (await place())[2] - begin[2]) > 0.3);
    await page.keyboard.up('s');
    const back = await place();
    assert.ok(Math.abs(back[1] - begin[1]) < 0.6, 'walking does not fly');
    const stick = await page.locator('.stick').boundingBox();
    const box = await page.locator('#scene').boundingBox();
    assert.ok(stick.x >= box.x && stick.y + stick.height <= box.y + box.height + 1, 'the stick is in the picture');
    await page.mouse.move(stick.x + stick.width / 2, stick.y + stick.height / 2);
    await page.mouse.down();
    await page.mouse.move(stick.x + stick.width / 2, stick.y + 5);
    await until(async () => Math.hypot((await place())[0] - back[0], (await place())[2] - back[2]) > 0.2);
    await page.mouse.up();
    const turn = await inScene(page, () => window.cairn.camera.getWorldDirection(window.cairn.controls.target.clone()).toArray());
    await page.mouse.move(...await middle(page));
    await page.mouse.down();
    await page.mouse.move(...await middle(page, 0.25, 0), { steps: 4 });
    await page.mouse.up();
    await page.waitForTimeout(300);
    const turned = await inScene(page, () => window.cairn.camera.getWorldDirection(window.cairn.controls.target.clone()).toArray());
    assert.ok(Math.hypot(...turn.map((v, i) => v - turned[i])) > 0.1, 'dragging looks around');
    await page.screenshot({ path: join(pictures, `tools-walk-${width}.png`) });
    await page.keyboard.press('Escape');
    assert.equal(await page.locator('.stick').isVisible(), false);
  },

  async path(page, { width }) {
    const time = () => card(page).getByRole('slider', { name: 'Time' }).inputValue().then(Number);
    for (const way of ways(page, 'Play the path', 't')) {
      await way();
      assert.equal(await inScene(page, () => window.cairn.frustum.visible), true);
      await way();
      assert.equal(await inScene(page, () => window.cairn.frustum.visible), false);
    }
    await page.getByRole('button', { name: 'Play the path', exact: true }).click();
    const image = card(page).getByAltText('What the camera saw here');
    await until(() => image.evaluate((made) => made.naturalWidth === 40));
    assert.match(await image.getAttribute('src'), /#5$/);
    await card(page).getByRole('slider', { name: 'Time' }).fill('1.1');
    assert.match(await image.getAttribute('src'), /#35$/);
    assert.match(await card(page).innerText(), /Keyframe 3 of 4/);
    await page.keyboard.press('.');
    assert.match(await image.getAttribute('src'), /#50$/);
    await card(page).getByRole('slider', { name: 'Time' }).fill('0');
    await card(page).getByRole('button', { name: 'Play', exact: true }).click();
    await until(async () => (await time()) > 0.2);
    await card(page).getByRole('button', { name: 'Pause', exact: true }).click();
    await card(page).getByLabel('Look through the camera').check();
    await card(page).getByRole('slider', { name: 'Time' }).fill('1.5');
    const off = await page.evaluate(async () => {
      const { trajectory } = await (await fetch('data.json')).json(), at = trajectory.reduce((a, b) => (Math.abs(b[0] - trajectory[0][0] - 1.5) < Math.abs(a[0] - trajectory[0][0] - 1.5) ? b : a));
      return Math.hypot(...window.cairn.camera.position.toArray().map((v, i) => v - [at[1], -at[2], -at[3]][i]));
    });
    assert.ok(off < 0.02, `${off} m from where the camera was`);
    await card(page).getByLabel('Look through the camera').uncheck();
    // A click on a keyframe in the picture moves the view there, from any viewpoint.
    await page.getByRole('button', { name: 'Show all', exact: true }).click();
    await quiet(page);
    const [x, y] = await page.evaluate(async () => {
      const { trajectory, keyframes } = await (await fetch('data.json')).json(), { camera, element } = window.cairn;
      const [, px, py, pz] = trajectory.find(([t]) => t === keyframes[2].time), at = camera.position.clone().set(px, -py, -pz).project(camera);
      const box = element.getBoundingClientRect();
      return [box.x + (at.x + 1) * box.width / 2, box.y + (1 - at.y) * box.height / 2];
    });
    const cardBox = await card(page).boundingBox();
    const isHidden = x > cardBox.x && x < cardBox.x + cardBox.width && y > cardBox.y && y < cardBox.y + cardBox.height;
    assert.equal(isHidden, false, 'the card hides the path');
    await page.mouse.click(x, y);
    await until(async () => /#(20|35|50)$/.test(await image.getAttribute('src')));
    await page.screenshot({ path: join(pictures, `tools-path-${width}.png`) });
    await page.keyboard.press('Escape');
  },

  async colors(page, { width }) {
    for (const way of ways(page, 'Colors', 'c')) {
      await way();
      assert.equal(await card(page).isVisible(), true);
      await way();
      assert.equal(await card(page).isVisible(), false);
    }
    await page.getByRole('button', { name: 'Colors', exact: true }).click();
    const colorOf = () => inScene(page, () => {
      const { geometry: { attributes }, material, matrixWorld } = [...window.cairn.meshes()][0], sums = {}, place = window.cairn.controls.target.clone();
      for (let i = 0; i < attributes.position.count; i += 5) {
        place.fromBufferAttribute(attributes.position, i).applyMatrix4(matrixWorld);
        const [kind] = [place.x < -0.1 ? 'left' : place.x > 0.1 ? 'right' : 'middle'];
        (sums[kind] ??= [0, 0]);
        sums[kind][0] += attributes.color?.getY(i) ?? 0;
        sums[kind][1] += 1;
      }
      return { left: sums.left[0] / sums.left[1], right: sums.right[0] / sums.right[1], textured: Boolean(material.map), has: Boolean(attributes.color) };
    });
    assert.equal((await colorOf()).textured, true);
    for (const [kind, legend] of [['Height', /m/], ['Distance', /m/], ['Observations', /1[^]*200/], ['Uncertainty', /0\.0 mm[^]*6\.0 mm/], ['Direction', /green up/]]) {
      await card(page).getByRole('radio', { name: kind, exact: true }).check();
      await until(async () => legend.test(await card(page).innerText()), () => `no legend of ${kind}`);
      const seen = await colorOf();
      assert.ok(seen.has && !seen.textured, kind);
      if (kind === 'Observations') assert.ok(seen.right > seen.left + 0.2, `seen often ${seen.right}, seldom ${seen.left}`);
      await quiet(page);
      if (kind === 'Height' || kind === 'Observations') await page.screenshot({ path: join(pictures, `tools-colors-${kind.split(' ')[0].toLowerCase()}-${width}.png`) });
    }
    await card(page).getByRole('button', { name: 'Original colors' }).click();
    assert.deepEqual([(await colorOf()).textured, (await colorOf()).has], [true, false]);
    for (const way of ways(page, 'Show shape', 's')) {
      await way();
      assert.deepEqual([(await colorOf()).textured, await pressed(page, 'Show shape')], [false, 'true']);
      await way();
      assert.deepEqual([(await colorOf()).textured, await pressed(page, 'Show shape')], [true, 'false']);
    }
  },

  async 'the rest'(page, { width }) {
    const grids = () => inScene(page, () => window.cairn.scene.children.filter(({ type, visible }) => type === 'GridHelper' && visible).length);
    for (const way of ways(page, 'Grid of 1 m on the floor', 'g')) {
      await way();
      assert.equal(await grids(), 1);
      await way();
      assert.equal(await grids(), 0);
    }
    // The bar matches its label: two points at this distance, across the picture at its middle.
    const bar = await page.locator('#scale').boundingBox(), [, value, unit] = (await page.locator('#scale').innerText()).match(/([\d.]+) (\w+)/);
    const pixels = await inScene(page, (far) => {
      const { camera, controls, element } = window.cairn, right = controls.target.clone().set(1, 0, 0).applyQuaternion(camera.quaternion);
      const a = controls.target.clone().project(camera), b = controls.target.clone().addScaledVector(right, far).project(camera);
      return Math.abs(b.x - a.x) * element.clientWidth / 2;
    }, Number(value) * { m: 1, cm: 0.01, mm: 0.001 }[unit]);
    assert.ok(Math.abs(pixels - bar.width) < 2, `${value} ${unit} are ${pixels} pixels, the bar has ${bar.width}`);

    for (const way of ways(page, 'Save a picture', 'x')) {
      const [download] = await Promise.all([page.waitForEvent('download'), way()]);
      assert.match(download.suggestedFilename(), /\.png$/);
      const png = readFileSync(await download.path());
      assert.equal(png.subarray(1, 4).toString(), 'PNG');
      assert.ok(png.length > 20000, `the picture is empty: ${png.length} bytes`);
    }
    for (const way of ways(page, 'Full screen', 'f')) {
      await way();
      await until(() => page.evaluate(() => Boolean(document.fullscreenElement)));
      await page.evaluate(() => document.exitFullscreen());
      await until(() => page.evaluate(() => !document.fullscreenElement));
    }
    for (const way of ways(page, 'Show the keys', '?')) {
      await way();
      const sheet = page.getByRole('dialog');
      for (const words of ['Floor plan', 'Measure', 'Walk', 'Drag']) assert.ok((await sheet.innerText()).includes(words), words);
      await isAccessible(page, 'keys');
      await page.screenshot({ path: join(pictures, `tools-keys-${width}.png`) });
      await page.keyboard.press('Escape');
      assert.equal(await sheet.isVisible(), false);
    }
    if (width > 760) {
      await page.getByRole('button', { name: 'Measure', exact: true }).hover();
      assert.equal(await page.locator('#tip').innerText(), 'Measure (M)');
      await page.mouse.move(...await middle(page));
    }
    // The panel folds, and the next page remembers; its downloads have their sizes.
    const panel = page.locator('#panel'), isOpen = await panel.isVisible();
    await page.locator('#fold').click();
    assert.equal(await panel.isVisible(), !isOpen);
    await page.locator('#scene canvas').focus();
    await page.keyboard.press('i');
    assert.equal(await panel.isVisible(), isOpen);
    if (!isOpen) await page.locator('#fold').click();
    assert.match(await panel.getByRole('link', { name: /mesh\.glb/ }).innerText(), /1\.2 MB/);
    await quiet(page);
    await isAccessible(page, 'with the panel');
    await page.screenshot({ path: join(pictures, `tools-panel-${width}.png`) });
  },
};

test('every tool works by button and by key, at three widths, without faults of accessibility', { timeout: 580000 }, () => inFolder(async (folder) => {
  const out = join(folder, 'map');
  run('reconstruct', 'synthetic:room', '-o', out, '--frames', '0:60', '--voxel-size', '0.02', '--texture', '--simplify', '0.3');
  const program = new Program('view', out, '--port', '0'), url = await program.url();
  try {
    await withBrowser(async (open) => {
      for (const size of kSizes) {
        const page = await openMap(open, url, size);
        await page.screenshot({ path: join(pictures, `tools-first-${size.width}.png`) });
        const buttons = async () => Promise.all((await page.locator('#tools button').all()).map((button) => button.boundingBox()));
        const before = await buttons(), scene = await page.locator('#scene').boundingBox();
        for (const { x, y, width, height } of before)
          assert.ok(x + width <= scene.x + 1 || y + height <= scene.y + 1 || y >= scene.y + scene.height - 1, 'a button lies on the map');
        await page.evaluate(() => {
          const status = document.getElementById('status');
          status.dataset.was = status.textContent;
          status.textContent = 'Much has been said about this map, and all of it is repeated here, '.repeat(4);
        });
        assert.deepEqual(await buttons(), before, 'the buttons move with the status');
        await page.evaluate(() => { const status = document.getElementById('status'); status.textContent = status.dataset.was; });
        await isAccessible(page, `at ${size.width}`);
        for (const [name, check] of Object.entries(checks)) {
          try {
            await check(page, size);
          } catch (error) {
            await page.screenshot({ path: join(pictures, `tools-failed-${size.width}.png`) });
            error.message = `${name} at ${size.width} pixels: ${error.message}`;
            throw error;
          }
          assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `${name}: wider than ${size.width}`);
        }
        await page.close();
      }
    });
  } finally {
    program.kill('SIGINT');
    await program.ended;
  }
}));
