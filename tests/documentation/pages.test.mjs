// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The pages themselves: what a link of theirs leads to is there, and the README stays short.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { existsSync, readFileSync, readdirSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';
import test from 'node:test';
import { fileURLToPath } from 'node:url';

const source = fileURLToPath(new URL('../../', import.meta.url));
const pages = ['README.md', 'CONTRIBUTING.md', 'CHANGELOG.md',
  ...readdirSync(join(source, 'docs')).filter((name) => name.endsWith('.md')).map((name) => `docs/${name}`)];

/** A page without its code blocks. */
const text_of = (file) => readFileSync(file, 'utf8').replace(/^```[^]*?^```/gm, '');

/** The anchors that a page's headings get where repositories are shown. */
function anchors(file) {
  return [...text_of(file).matchAll(/^#+ (.*)$/gm)].map(([, heading]) =>
    heading.trim().toLowerCase().replace(/\[([^\]]*)\]\([^)]*\)/g, '$1').replace(/[^\p{L}\p{N}\s_-]/gu, '').replace(/ /g, '-'));
}

for (const page of pages)
  test(`${page}: what its links lead to is there`, () => {
    const file = join(source, page);
    for (const [, target] of text_of(file).matchAll(/\]\(([^)\s]+)\)/g)) {
      if (/^https?:/.test(target)) continue;
      const [path, anchor] = target.split('#');
      const to = path ? resolve(dirname(file), path) : file;
      assert.ok(existsSync(to), `${target} is not there`);
      if (anchor) assert.ok(anchors(to).includes(anchor), `${target}: no heading has this anchor`);
    }
  });

test('every page of docs/ is reached from the README', () => {
  const readme = text_of(join(source, 'README.md'));
  for (const page of pages.slice(1)) assert.ok(readme.includes(`](${page})`), page);
});

test('the README has 150 lines at most', () => {
  assert.ok(readFileSync(join(source, 'README.md'), 'utf8').trimEnd().split('\n').length <= 150);
});

test('the list of options is the code\'s', () => {
  const checked = spawnSync(join(source, 'scripts/options-page'), ['--check'], { encoding: 'utf8' });
  assert.equal(checked.status, 0, checked.stderr);
});
