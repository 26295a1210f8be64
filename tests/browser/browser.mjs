// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What the browser tests share: the program, Debian's Chromium, and pages that must not complain.
import { spawn, spawnSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';

const require = createRequire(new URL('../support/package.json', import.meta.url));
const { chromium } = require('playwright-core');

const build = fileURLToPath(new URL('../../build/release/', import.meta.url));
export const cairn = process.env.CAIRN_PROGRAM ?? join(build, 'cairn');
export const pictures = process.env.CAIRN_PICTURES ?? join(build, 'pictures');
mkdirSync(pictures, { recursive: true });

/** Runs `test(folder)` in a new folder that goes away. */
export async function inFolder(test) {
  const folder = mkdtempSync(join(tmpdir(), 'cairn-browser-'));
  try {
    await test(folder);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

export function run(...args) {
  const ran = spawnSync(cairn, args, { encoding: 'utf8' });
  if (ran.status !== 0) throw new Error(`cairn ${args.join(' ')}: ${ran.stderr}`);
  return ran.stdout;
}

/** A program that runs on: its output so far, and its end. */
export class Program {
  constructor(...args) {
    this.output = '';
    this.process = spawn(cairn, args);
    for (const stream of [this.process.stdout, this.process.stderr])
      stream.setEncoding('utf8').on('data', (text) => { this.output += text; });
    this.ended = new Promise((resolve) => this.process.on('close', (code, signal) => resolve(code ?? signal)));
  }
  /** The address that it serves. */
  async url() {
    await until(() => /http:\S+/.test(this.output), () => `no address was printed: ${this.output}`);
    return this.output.match(/http:\S+/)[0];
  }
  kill(signal) { this.process.kill(signal); }
}

export async function until(condition, what = () => 'it did not happen', seconds = 60) {
  const end = Date.now() + 1000 * seconds;
  while (!(await condition())) {
    if (Date.now() > end) throw new Error(what());
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

/** Calls `test(open)`; `open(url, size, script that runs first)` gives a page. Fails when a page wrote an error to its console. */
export async function withBrowser(test) {
  const executablePath = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
  if (!executablePath) throw new Error('Chromium is missing: run scripts/install-deps --tests');
  const browser = await chromium.launch({
    executablePath, args: ['--no-sandbox', '--enable-unsafe-swiftshader', '--use-angle=swiftshader'],
  });
  const errors = [];
  try {
    await test(async (url, viewport = { width: 1280, height: 800 }, beforehand = () => {}) => {
      const page = await browser.newPage({ viewport });
      await page.addInitScript(beforehand);
      page.on('console', (message) => { if (message.type() === 'error') errors.push(message.text()); });
      page.on('pageerror', (error) => errors.push(String(error)));
      await page.goto(url);
      return page;
    }, errors);
  } finally {
    await browser.close();
  }
  if (errors.length > 0) throw new Error(`the page complained: ${errors.join('\n')}`);
}

export const triangles = (page) => page.evaluate(() => window.cairn?.triangles ?? 0);
