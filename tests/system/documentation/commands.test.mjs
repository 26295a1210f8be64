// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Runs every command line of the README, of CONTRIBUTING and of docs/ verbatim, in a fresh folder, with small inputs; each
// distinct line once. Lines without a run are listed below with the reason; any other line fails this test.
import assert from 'node:assert/strict';
import { spawn, spawnSync } from 'node:child_process';
import {
  cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, symlinkSync, writeFileSync,
} from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import test, { after, before } from 'node:test';
import { fileURLToPath } from 'node:url';

const source = fileURLToPath(new URL('../../../', import.meta.url));
const cairn = process.env.CAIRN_PROGRAM ?? join(source, 'build/release/cairn');
const build = dirname(cairn);

// Not run here, with the reason.
const elsewhere = {
  './scripts/demo': 'CI runs it by itself',
  './scripts/build': 'scripts/demo runs it',
  'scripts/build': 'scripts/demo runs it',
  'scripts/build cairn_python': 'scripts/test builds it',
  'scripts/install-deps': 'scripts/build runs it',
  './scripts/test': 'it runs this test',
  'scripts/test -L quick': 'the tests run by themselves',
  'scripts/tidy': 'CI runs it by itself',
  'scripts/benchmark': 'minutes',
  'scripts/building/benchmark OUT': 'half an hour',
  'scripts/building/memory OUT': 'an hour',
  'cairn splat OUT -o OUT/splats.spz --recording RECORDING': 'minutes; tests/system/splat_test.cpp runs it',
  'cairn splat OUT -o splats.glb --time 30min --max-splats 200000': 'half an hour',
  'cairn reconstruct RECORDING -o OUT --splat 10min': 'minutes; tests/system/splat_test.cpp runs it',
  'cairn splat MAP -o X.spz': 'minutes',
  'scripts/options-page': 'it writes into the source; Documentation.pages checks it',
  'scripts/check-layers': 'Architecture.layers runs it',
  'scripts/check-language': 'Documentation.language runs it',
  'build/release/tests/cairn_bench': 'minutes',
  '$cairn evaluate mesh out/map/mesh.glb out/flat/groundtruth_mesh.ply --trajectory out/map/trajectory.txt --truth-trajectory out/flat --box -1 -1.5 -3.9 1 1.5 0':
    'the box is where 1400 frames come back to: minutes',
  'scripts/install-deps --peers && scripts/compare RECORDING 200': 'installs other programs',
  'scripts/bundle': 'compiles; it has a test of its own',
  './scripts/bundle OUT': 'compiles; it has a test of its own',
  './scripts/package': 'a test of packages makes and installs them',
  'scripts/try-on SUITE': 'builds and tests everything on another release',
  'scripts/install-deps --clients': 'installs other programs',
  'scripts/test -L clients': 'the tests run by themselves',
  'node tests/system/browser/measure_live.mjs RECORDING OUT reader': 'a whole recording in a browser, with its clock',
  'node tests/system/browser/measure_export.mjs X.glb': 'measures a browser',
  'node tests/system/browser/measure_page.mjs OUT': 'measures a browser',
  'node tests/system/browser/measure_tiles.mjs PLAN': 'measures a browser',
};

/** Command lines of a page: from its code blocks, and text that starts like a command. */
function commands(page) {
  const begins = /^(\$?cairn |(\.\/)?scripts\/|build\/release\/|cairn_(tests|bench) |node )/;
  const lines = [];
  const text = readFileSync(page, 'utf8').replace(/^```(\w*)\n([^]*?)^```/gm, (_, kind, block) => {
    if (['', 'sh', 'bash'].includes(kind))
      for (const line of block.replace(/\\\n\s*/g, '').split('\n')) lines.push(line.replace(/\s+#.*/, '').trim());
    return '';
  });
  for (const [, span] of text.matchAll(/`([^`\n]+)`/g)) lines.push(span);
  return [...new Set(lines)].filter((line) => begins.test(line));
}

const docs = join(source, 'docs');
const pages = [join(source, 'README.md'), join(source, 'CONTRIBUTING.md'),
  ...(existsSync(docs) ? readdirSync(docs).filter((name) => name.endsWith('.md')).sort().map((name) => join(docs, name)) : [])];

const folder = mkdtempSync(join(tmpdir(), 'cairn-commands-'));
const kept = join(folder, 'kept'), work = join(folder, 'work');
const voxel = '0.02';  // meters
const shell = { name: 'phone' };  // variables of its lines
const inputs = {};  // placeholder of the documentation → file or folder

function run(...args) {
  const ran = spawnSync(cairn, args, { encoding: 'utf8' });
  assert.equal(ran.status, 0, `cairn ${args.join(' ')}: ${ran.stderr}`);
}

before(() => {
  mkdirSync(kept);
  mkdirSync(join(work, 'build/release/tests'), { recursive: true });
  cpSync(join(source, 'assets/cameras'), join(work, 'assets/cameras'), { recursive: true });
  const keep = (name) => join(kept, name);
  // Long enough for maps with common places; most lines need less.
  run('synth', 'room', '-o', keep('long'), '--frames', '20', '--width', '320');
  run('reconstruct', keep('long'), '-o', keep('map'), '--voxel-size', voxel);
  run('reconstruct', keep('long'), '-o', keep('other'), '--frames', '3:20', '--voxel-size', voxel);
  run('synth', 'room', '-o', keep('recording'), '--frames', '10', '--width', '320');
  run('reconstruct', keep('recording'), '-o', keep('done'), '--voxel-size', voxel);
  run('export', keep('map'), '-o', keep('x.glb'), '--simplify', '0.1');
  for (const word of ['RECORDING', 'FOLDER']) inputs[word] = keep('recording');
  for (const word of ['MAP', 'OUT', 'A']) inputs[word] = keep('map');
  inputs.B = keep('other');
  inputs.BEFORE = inputs.AFTER = keep('map');
  // Two recordings in parts, their maps, and the map of all.
  inputs.MONDAY = inputs.WEDNESDAY = keep('recording'), inputs.TUESDAY = keep('long');
  run('synth', 'room', '-o', keep('again'), '--frames', '20', '--width', '320');
  run('plan', keep('long'), keep('again'), '-o', keep('plan'), '--frames-per-part', '13', '--overlap', '6');
  const parts = readdirSync(keep('plan/parts')).sort();
  mkdirSync(keep('plan/loops'));
  for (const part of parts) {
    run('reconstruct', keep(`plan/parts/${part}`), '-o', keep(`plan/maps/${part}`), '--voxel-size', voxel, '--no-mesh');
    if (part !== parts[0])
      run('match', keep(`plan/maps/${parts[0]}`), keep(`plan/maps/${part}`), '-o', keep(`plan/loops/${parts[0]}-${part}.json`));
  }
  run('optimize', keep('plan'));
  for (const cell of readdirSync(keep('plan/cells')).map((name) => name.replace('.json', '')))
    run('tile', keep('plan'), `--cell=${cell}`, '-o', keep(`plan/tiles/${cell}`), '--no-texture');
  run('tileset', keep('plan'), '-o', keep('plan/tileset.json'));
  inputs['X.glb'] = keep('x.glb');
  inputs['X.g2o'] = keep('map/graph.g2o');
  // Motion capture has z up. The path through the room, for pictures of the same part of the room.
  const turned = readFileSync(keep('recording/groundtruth.txt'), 'utf8').split('\n').filter((line) => /^\d/.test(line));
  writeFileSync(keep('captured.txt'), turned.map((line) => {
    const [t, x, y, z, a, b, c, w] = line.split(' ').map(Number), h = Math.SQRT1_2;
    // A quarter turn about x, (-h, 0, 0, h), before the pose: y down becomes z up.
    const [i, j, k, r] = [h * a - h * w, h * b + h * c, h * c - h * b, h * w + h * a];
    return [t, x, z, -y, i, j, k, r].join(' ');
  }).join('\n') + '\n');
  for (const word of ['groundtruth.txt', 'rgbd_dataset_freiburg2_desk/groundtruth.txt', 'poses.txt']) inputs[word] = keep('captured.txt');
  // The same as camera_from_world.
  writeFileSync(keep('inverse.txt'), turned.map((line) => {
    const [t, x, y, z, a, b, c, w] = line.split(' ').map(Number), [i, j, k] = [-a, -b, -c];
    // v + 2w (u x v) + 2 u x (u x v) turns v by (u, w).
    const [p, q, r] = [j * z - k * y, k * x - i * z, i * y - j * x];
    const moved = [x + 2 * (w * p + j * r - k * q), y + 2 * (w * q + k * p - i * r), z + 2 * (w * r + i * q - j * p)];
    return [t, ...moved.map((v) => -v), i, j, k, w].join(' ');
  }).join('\n') + '\n');
  inputs['inverse.txt'] = keep('inverse.txt');
  inputs['camera.yaml'] = keep('recording/camera.yaml');
  cpSync(keep('captured.txt'), keep('data/tum_fr1_rpy_400/groundtruth.txt'), { recursive: true });

  // cairn with few and small frames, large voxels and a free port.
  writeFileSync(join(work, 'build/release/cairn'), `#!/usr/bin/env bash
words=("$@") frames=0
for i in "\${!words[@]}"; do
  [[ \${words[i]} != --frames || $1 != synth ]] || { words[i+1]=10; frames=1; }
done
[[ $1 != synth || $frames == 1 ]] || words+=(--frames 10)
[[ $1 != synth || " $* " == *" --width "* ]] || words+=(--width 320)
[[ ! $1 =~ ^(reconstruct|live)$ || " $* " == *" --voxel-size "* ]] || words+=(--voxel-size ${voxel})
[[ $1 != view && " $* " != *" --view "* ]] || words+=(--port 0)
exec '${cairn}' "\${words[@]}"
`, { mode: 0o755 });
  for (const name of ['cairn_tests', 'cairn_bench', 'cairn_picture'])
    symlinkSync(join(build, 'tests', name), join(work, 'build/release/tests', name));
});
after(() => rmSync(folder, { recursive: true }));

/** Puts small inputs where a line reads, and takes away what it is to write: another line may have written it. */
function prepare(line) {
  const words = line.replaceAll('$name', shell.name).split(/\s+/);
  if (words.some((word) => /^PLAN(\/|$)/.test(word))) {
    rmSync(join(work, 'PLAN'), { recursive: true, force: true });
    cpSync(join(kept, 'plan'), join(work, 'PLAN'), { recursive: true });
  }
  words.forEach((word, i) => {
    if (!inputs[word]) {
      if (words[i - 1] === '-o') rmSync(join(work, word), { recursive: true, force: true });
      return;
    }
    rmSync(join(work, word), { recursive: true, force: true });
    if (words[i - 1] === '-o' && !words.includes('--resume')) return;
    mkdirSync(dirname(join(work, word)), { recursive: true });
    cpSync(words[i - 1] === '-o' ? join(kept, 'done') : inputs[word], join(work, word), { recursive: true });
  });
}

/** Runs a line to its end; a server is ended as by Ctrl-C. */
async function execute(line) {
  const process_ = spawn('bash', ['-c', line], {
    cwd: work, detached: true, stdio: ['ignore', 'ignore', 'pipe'],
    env: {
      ...process.env, cairn: 'build/release/cairn', data: join(kept, 'data'), ...shell,
      BROWSER: 'true', XDG_STATE_HOME: join(folder, 'state'),
      PATH: `${join(work, 'build/release')}:${join(work, 'build/release/tests')}:${process.env.PATH}`,
      ...(line.includes('openni:') && { LD_LIBRARY_PATH: join(build, 'tests/openni'), CAIRN_SENSOR: '' }),
    },
  });
  let told = '';
  const goesOn = /^\$?cairn (live|record|view)\b/.test(line);
  const end = (signal) => { try { process.kill(-process_.pid, signal); } catch { /* it has ended by itself */ } };
  const limit = setTimeout(() => end('SIGKILL'), 240000);
  let ended = false;
  process_.stderr.setEncoding('utf8').on('data', (text) => {
    told += text;
    if (!goesOn || ended || !/ frames|Ctrl-C ends/.test(told)) return;
    ended = true;
    end('SIGINT');
  });
  const status = await new Promise((resolve) => process_.on('close', (code, signal) => resolve(code ?? signal)));
  clearTimeout(limit);
  return { status, told };
}

const begun = new Set();
for (const page of pages)
  for (const line of commands(page)) {
    const plain = line.replace(/^\$/, '');
    if (begun.has(plain)) continue;  // also on another page
    begun.add(plain);
    const name = `${page.slice(source.length)}: ${line}`;
    if (line.startsWith('scripts/campaign ')) {
      test(name, { skip: 'hours: docs/reliability.md tells what it found last' }, () => {});
      continue;
    }
    if (elsewhere[line]) {
      test(name, { skip: elsewhere[line] }, () => {});
      continue;
    }
    test(name, async () => {
      let complete = line;
      if (/^cairn \w+$/.test(line) && line !== 'cairn devices') complete += ' --help';  // a name in a sentence
      if (line.startsWith('cairn_tests')) complete += ' --gtest_list_tests | grep -q "^  "';  // run by ctest
      if (line.startsWith('cairn_bench')) complete += ' --benchmark_list_tests | grep -q .';  // minutes
      prepare(complete);
      const { status, told } = await execute(complete);
      assert.equal(status, 0, `${complete}\n${told.slice(-2000)}`);
    });
  }

test('every reason stands for a line that is there', () => {
  const all = pages.flatMap(commands);
  for (const line of Object.keys(elsewhere)) assert.ok(all.includes(line), line);
});

test('every option that is named is one', () => {
  const help = (...args) => spawnSync(cairn, [...args, '--help'], { encoding: 'utf8' }).stdout;
  const subcommands = ['reconstruct', 'export', 'localize', 'splat', 'live', 'record', 'view', 'synth', 'esdf', 'merge', 'plan', 'match',
    'optimize', 'tile', 'tileset', 'change', 'devices',
    'evaluate', 'graph', 'info', 'calibrate', 'convert', 'demo', 'doctor', 'help', 'completion'].map((name) => [name]);
  for (const name of ['trajectory', 'mesh', 'views', 'topology', 'distances', 'loops']) subcommands.push(['evaluate', name]);
  subcommands.push(['graph', 'optimize']);
  const known = new Set([...help(), ...subcommands.map((words) => help(...words))].join('').match(/--[a-z][a-z-]*/g));
  const scripts = [join(source, 'scripts'), join(source, 'scripts/campaigns'), join(source, 'scripts/building')]
    .flatMap((folder) => readdirSync(folder, { withFileTypes: true }).filter((entry) => entry.isFile())
      .map((entry) => readFileSync(join(folder, entry.name), 'utf8'))).join('');
  const of_scripts = new Set(scripts.match(/--[a-z][a-z-]*/g));
  for (const page of pages)
    for (const [, span] of readFileSync(page, 'utf8').matchAll(/`(--[a-z][^`\n]*)`/g))
      for (const option of span.match(/--[a-z][a-z-]*/g))
        assert.ok(known.has(option) || of_scripts.has(option), `${page}: ${option}`);
});
