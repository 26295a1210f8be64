// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Bundles the page, its style and its scripts into one HTML file. Usage: node build.mjs OUT.html
import { build } from 'esbuild';
import { readFile, writeFile } from 'node:fs/promises';

const bundled = async (entry) => {
  const result = await build({
    entryPoints: [entry], bundle: true, minify: true, write: false, format: 'iife', target: 'es2022',
    legalComments: 'eof', logLevel: 'warning', charset: 'utf8',
  });
  return result.outputFiles[0].text;
};
const script = (await bundled('main.js')).replaceAll('</script', '<\\/script');
const style = await bundled('style.css');
const page = await readFile('index.html', 'utf8');
const place = (text, mark, content) => {
  const at = text.indexOf(mark);
  if (at < 0) throw new Error(`index.html has no ${mark}`);
  return text.slice(0, at) + content + text.slice(at + mark.length);
};
await writeFile(process.argv[2],
                place(place(page, '/* style */', style), '/* script */', script));
