// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Side panel of a finished map: verdict, files, facts, charts and parameters.
import { charts } from './charts.js';
import { element, facts } from './dom.js';
import { bytes, count, millimeters, option, seconds as said } from './words.js';

export const kLevels = { good: 'good', weak: 'weak', bad: 'lost' };

const heldOut = ({ held_out: count = 0 }) => (count > 0 ? `, ${count} held out` : '');

/** Frame counts in the wording of the console. */
export function framesInWords({ frames, seconds }) {
  return `${frames.fused} of ${frames.total} frames fused (${frames.lost} lost, ${frames.skipped} skipped${heldOut(frames)})` +
         (seconds == null ? '' : ` in ${seconds.toFixed(1)} s`);
}

/** Level of the verdict; good only without lost frames and warnings. */
export function levelOf({ frames, verdict, warnings = [] }) {
  const share = frames.fused / Math.max(1, frames.total - (frames.held_out ?? 0));
  const level = verdict ? kLevels[verdict.level] ?? 'weak' : share < 0.8 ? 'lost' : 'good';
  return level === 'good' && (frames.lost > 0 || warnings.length > 0) ? 'weak' : level;
}

/** Text with each option, --name, unbroken. */
const withOptions = (text) => text.split(/(--[a-z][a-z-]*)/).map((part, i) => (i % 2 ? element('code', {}, part) : part));

/** The verdict's reasons include the warnings, with remedies; remaining warnings are appended. */
function verdictLines({ verdict, warnings = [] }) {
  const reasons = verdict?.reasons ?? [], lines = [...reasons, ...warnings.filter((warning) => !reasons.some((reason) => reason.includes(warning)))];
  const words = verdict?.words ? [element('p', { className: `verdict ${kLevels[verdict.level] ?? 'weak'}` }, ...withOptions(verdict.words))] : [];
  return [...words, ...lines.map((line) => element('div', { className: 'warning' }, ...withOptions(line)))];
}

/** Evidence of the verdict, weak items first. */
function evidenceOf({ verdict }) {
  const all = verdict?.evidence ?? [], weak = all.filter((item) => item.verdict !== 'good'), rest = all.filter((item) => item.verdict === 'good');
  if (all.length === 0) return [];
  return [element('h2', {}, 'Evidence'), element('ul', { className: 'evidence' }, ...[...weak, ...rest].map(({ text, verdict: level }) => element('li', { className: kLevels[level] ?? 'weak' }, text)))];
}

function downloads(files) {
  if (!files?.length) return [];
  return [element('h2', {}, 'Files'), element('ul', { className: 'files' }, ...files.map(({ name, url, bytes: size, what }) => element('li', {},
      element('a', { href: url, download: name.split('/').at(-1) }, element('b', {}, name), ...(size == null ? [] : [element('span', {}, bytes(size))]),
              ...(what ? [element('small', {}, what)] : [])))))];
}

const kSources = { accelerometer: 'by the accelerometer', structure: 'by floor and walls', option: 'as given', poses: 'from the poses', unknown: 'not known' };

function factsOf(report) {
  const { frames, mesh, options } = report, megabytes = (mb) => `${count(Math.round(mb))} MB`;
  const list = [['Recording', report.sequence?.split('/').filter(Boolean).at(-1)], ['Frames', `${frames.fused} of ${frames.total} fused, ${frames.lost} lost, ${frames.skipped} skipped${heldOut(frames)}`]];
  if (report.seconds != null) list.push(['Time', `${report.seconds.toFixed(1)} s, ${report.frames_per_second.toFixed(1)} frames/s`]);
  if (options?.voxel_size) list.push(option(['voxel_size', options.voxel_size]));
  list.push(['Triangles', mesh ? count(mesh.triangles) : 'not written'], ['Keyframes', report.keyframes], ['Loops', report.loops.filter((loop) => loop.inlier).length]);
  if (mesh?.textures) list.push(['Texture', `${mesh.textures === 1 ? '1 image' : `${mesh.textures} images`}, ${Math.round(100 * mesh.textured_share)} % from keyframes`]);
  if (report.splats) list.push(['Splats', `${count(report.splats.splats)}${report.splats.held_out ? `, PSNR ${report.splats.held_out.psnr_db.toFixed(1)} dB` : ''}`]);
  if (report.upright) list.push(['Upright', report.upright.words ?? kSources[report.upright.source] ?? report.upright.source]);
  else if (report.tilt_degrees != null) list.push(['Tilt against gravity', `${report.tilt_degrees.toFixed(2)}°`]);
  if (report.quality) list.push(['Quality', `${report.quality.requested}: ${report.quality.words}`]);
  if (report.surface_sigma) list.push(['Uncertainty', `${millimeters(report.surface_sigma.median_m)}, 95 % of the surface below ${millimeters(report.surface_sigma.p95_m)}`]);
  if (report.live)
    list.push(['Skipped to keep up', report.live.skipped_to_keep_up], ['Frame to pose, 95 %', `${report.live.latency_ms.p95.toFixed(0)} ms`]);
  list.push(['Peak memory', megabytes(report.peak_memory_mb)], ['Device', report.device]);
  if (report.device_memory_peak_mb != null) list.push(['Its memory', megabytes(report.device_memory_peak_mb)]);
  return facts(list.filter(([, value]) => value != null));
}

function loopsOf({ loops }, begin) {
  if (loops.length === 0) return [];
  return [element('h2', {}, 'Loops'), element('ul', { className: 'loops' }, ...loops.map((loop) => element(
      'li', { className: loop.inlier ? '' : 'refused', title: loop.inlier ? '' : 'Found and rejected' },
      `${said(loop.from - begin)} ↔ ${said(loop.to - begin)}, ${loop.corners} corners`)))];
}

export function fillPanel(panel, { name, report, verdict, files, mesh_left_out: leftOut, trajectory }) {
  if (!report) return panel.append(element('h1', {}, name), ...verdictLines({ verdict }), ...downloads(files));  // a single file, or a plan
  panel.append(element('h1', {}, name), ...verdictLines(report));
  if (leftOut) panel.append(element('div', { className: 'warning' }, `This page has no mesh; cairn view shows ${leftOut}`));
  panel.append(...downloads(files), element('h2', {}, 'Facts'), factsOf(report), ...evidenceOf(report), ...charts(report.per_frame ?? []),
               ...loopsOf(report, trajectory[0]?.[0] ?? 0), element('h2', {}, 'Parameters'), facts(Object.entries(report.options ?? {}).map(option)));
}
