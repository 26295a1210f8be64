// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Layout on phones, and light and dark colors, of a finished map and of the live page.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test from 'node:test';
import { pathToFileURL } from 'node:url';
import { Program, inFolder, isAccessible, pictures, run, timeline, until, withBrowser } from './browser.mjs';
import { livePage } from './live_page.mjs';

const kFinger = 44;  // pixels: minimum size of a control (WCAG 2.2, 2.5.5)
const kPhones = [
  { width: 390, height: 844, insets: { top: 47, bottom: 34 } }, { width: 360, height: 640, insets: {} },
  { width: 844, height: 390, insets: { left: 47, right: 47, bottom: 21 } }, { width: 640, height: 360, insets: {} },
];
const kPhone = { isMobile: true, hasTouch: true };

/** Sets the display areas covered by a notch or a home indicator. */
async function setInsets(page, insets) {
  const session = await page.context().newCDPSession(page);
  await session.send('Emulation.setSafeAreaInsetsOverride', { insets });
}

/** Controls that are too small, outside of the safe area, or under another element. */
const faults = (page, insets) => page.evaluate(([finger, { top = 0, right = 0, bottom = 0, left = 0 }]) => {
  const found = [];
  for (const control of document.querySelectorAll('button, select, input, summary, a[href]')) {
    if (!control.checkVisibility()) continue;
    if (control.closest('#panel, #card, #help')) control.scrollIntoView({ block: 'center' });
    const target = control.closest('label') ?? control, box = target.getBoundingClientRect();
    const name = control.getAttribute('aria-label') ?? target.textContent, at = [box.left, box.top, box.right, box.bottom].map(Math.round).join(' ');
    if (box.width < finger || box.height < finger) found.push(`${name} is too small: ${box.width} x ${box.height}`);
    if (box.left < left || box.top < top || box.right > innerWidth - right || box.bottom > innerHeight - bottom) found.push(`${name} is outside: ${at}`);
    const hit = document.elementFromPoint((box.left + box.right) / 2, (box.top + box.bottom) / 2);
    if (!target.contains(hit)) found.push(`${name} at ${at} is under ${hit?.outerHTML.slice(0, 80)}`);
  }
  if (document.documentElement.scrollWidth > innerWidth || document.documentElement.scrollHeight > innerHeight) found.push('the page scrolls');
  return found;
}, [kFinger, insets]);

const screen = ({ width, height }) => `${width}x${height}`;

/** Calls `test(folder)` with a small finished map. */
const withMap = (test) => inFolder(async (folder) => {
  run('reconstruct', 'synthetic:room', '-o', join(folder, 'map'), '--frames', '0:20', '--voxel-size', '0.04');
  await test(join(folder, 'map'));
});

async function openReport(open, map, viewport, options) {
  const page = await open(pathToFileURL(join(map, 'report.html')).href, viewport, undefined, options);
  await until(async () => 'complete' in (await timeline(page)));
  return page;
}

async function liveHtml() {
  let html;
  await inFolder(async (folder) => {
    const program = new Program('live', 'synthetic:room', '-o', join(folder, 'map'), '--view', '--port', '0');
    html = await (await fetch(await program.url())).text();
    program.kill('SIGKILL');
    await program.ended;
  });
  return html;
}

test('every control of a finished map is within reach on a phone', () => withMap((map) => withBrowser(async (open) => {
  for (const phone of kPhones) {
    const page = await openReport(open, map, phone, kPhone);
    await setInsets(page, phone.insets);
    const check = async (what) => assert.deepEqual(await faults(page, phone.insets), [], `${what} at ${screen(phone)}`);
    await check('the toolbar');
    const scene = await page.locator('#scene').boundingBox();
    assert.ok(scene.width * scene.height > 0.4 * phone.width * phone.height, `a small picture at ${screen(phone)}`);
    await page.screenshot({ path: join(pictures, `phone-${screen(phone)}.png`) });
    for (const name of ['Floor plan', 'Measure', 'Section box', 'Walk', 'Play the path', 'Colors']) {
      await page.getByRole('button', { name, exact: true }).tap();
      assert.ok(await page.locator('#card').isVisible());
      await check(name);
      const { width, height } = await page.locator('#scene').boundingBox();
      assert.ok(width >= 150 && height >= 120, `${name} at ${screen(phone)} leaves ${width} x ${height} of the picture`);
    }
    await page.screenshot({ path: join(pictures, `phone-tool-${screen(phone)}.png`) });
    // The panel takes the place of the card, and a tool takes that of the panel.
    await page.locator('#fold').tap();
    assert.ok(!(await page.locator('#card').isVisible()));
    await check('the panel');
    await page.screenshot({ path: join(pictures, `phone-panel-${screen(phone)}.png`) });
    await page.getByRole('button', { name: 'Measure', exact: true }).tap();
    assert.ok(!(await page.locator('#panel').isVisible()));
    await page.getByRole('button', { name: 'Show the keys' }).tap();
    await page.getByRole('button', { name: 'Close the keys' }).tap();
    await page.close();
  }
})));

test('every control of the live page is within reach on a phone', () => withBrowser(async (open) => {
  const html = await liveHtml();
  for (const phone of kPhones) {
    const { page, receive, close } = await livePage(open, html, phone, {}, kPhone);
    await setInsets(page, phone.insets);
    await receive();
    assert.deepEqual(await faults(page, phone.insets), [], screen(phone));
    await page.screenshot({ path: join(pictures, `phone-live-${screen(phone)}.png`) });
    await page.locator('#fold').tap();
    assert.deepEqual(await faults(page, phone.insets), [], `the panel at ${screen(phone)}`);
    await page.close();
    close();
  }
}));

/** Contrast of two variables of style.css (WCAG 2.2, 1.4.3). */
const contrasts = (page, pairs) => page.evaluate((pairs) => {
  const luminance = (name) => {
    const [series, k] = name.split(' '), values = getComputedStyle(document.documentElement).getPropertyValue(`--${series}`).trim().split(' ');
    const rgb = values[k ?? 0].match(/[0-9a-f]{2}/gi).map((byte) => parseInt(byte, 16) / 255);
    const [r, g, b] = rgb.map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  return pairs.map(([a, b]) => {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return [a, b, (high + 0.05) / (low + 0.05)];
  });
}, pairs);

const kText = ['card', 'raised'].flatMap((ground) => [['ink', ground], ['dim', ground]])
    .concat([['link', 'card'], ['good-mark', 'card'], ['weak-mark', 'card'], ['lost-mark', 'card'], ['ink', 'pressed'], ['axis', 'card']]);
const kLines = ['path', 'loop', 'mark', 'lost-mark', 'outline', 'grid'].map((line) => [line, 'ground'])
    .concat(['series', ...[1, 2, 3, 4, 5, 6, 7].map((k) => `series ${k}`)].map((line) => [line, 'card']), [['accent', 'card'], ['accent', 'pressed']]);

test('the pages are light or dark as the browser prefers, with enough contrast', () => withMap((map) => withBrowser(async (open) => {
  const html = await liveHtml(), size = { width: 1280, height: 800 }, grounds = new Set();
  for (const colorScheme of ['light', 'dark']) {
    const page = await openReport(open, map, size, { colorScheme });
    for (const [a, b, contrast] of await contrasts(page, kText)) assert.ok(contrast >= 4.5, `${colorScheme}: ${a} on ${b} ${contrast}`);
    for (const [a, b, contrast] of await contrasts(page, kLines)) assert.ok(contrast >= 3, `${colorScheme}: ${a} on ${b} ${contrast}`);
    const ground = () => page.evaluate(() => [`#${window.cairn.scene.background.getHexString()}`, getComputedStyle(document.documentElement).getPropertyValue('--ground')]);
    const [drawn, styled] = await ground();
    assert.equal(drawn, styled);
    grounds.add(drawn);
    await isAccessible(page, `report, ${colorScheme}`);
    for (const name of ['Measure', 'Play the path', 'Colors']) {
      await page.getByRole('button', { name, exact: true }).click();
      await isAccessible(page, `${name}, ${colorScheme}`);
    }
    await page.screenshot({ path: join(pictures, `report-${colorScheme}.png`) });
    // A change of the preference applies without a reload, to the scene and the charts, too.
    const charts = await page.locator('.uplot').count(), chart = page.locator('.uplot canvas').first(), before = await chart.evaluate((canvas) => canvas.toDataURL());
    await page.emulateMedia({ colorScheme: colorScheme === 'light' ? 'dark' : 'light' });
    await until(async () => (await ground())[0] !== drawn);
    assert.equal(await page.locator('.uplot').count(), charts);
    assert.notEqual(await chart.evaluate((canvas) => canvas.toDataURL()), before);
    await page.close();

    const live = await livePage(open, html, size, {}, { colorScheme });
    for (const [status, words] of [['good', 'Tracking well'], ['weak', 'Too fast: move slower'], ['lost', 'Lost: turn back left'], ['paused', 'Paused']]) {
      await live.receive({ status, words });
      await until(async () => (await live.page.locator('#status').textContent()) === words);
      await live.page.waitForTimeout(1300);  // after the end of a flash
      await isAccessible(live.page, `live, ${status}, ${colorScheme}`);
    }
    await live.page.screenshot({ path: join(pictures, `live-${colorScheme}.png`) });
    await live.page.close();
    live.close();
  }
  assert.equal(grounds.size, 2);
})));
