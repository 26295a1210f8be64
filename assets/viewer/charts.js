// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Charts of tracking quality and time per frame, with marks at lost frames.
import uPlot from 'uplot';
import { element } from './dom.js';
import { onTheme, themeColor } from './theme.js';

const kHeight = 160;  // pixels
const kStages = ['preprocess', 'raycast', 'track', 'fuse', 'keyframe', 'esdf', 'esdf to host'];

/** Marks at frames, over the full height. */
function drawMarks(chart, frames) {
  const { ctx, bbox: { top, height } } = chart;
  ctx.save();
  ctx.fillStyle = `${themeColor('lost-mark')}99`;
  for (const frame of frames) ctx.fillRect(chart.valToPos(frame - 0.5, 'x', true), top, Math.max(2, chart.valToPos(frame + 0.5, 'x', true) - chart.valToPos(frame - 0.5, 'x', true)), height);
  ctx.restore();
}

function chart(title, words, frames, series, unit, lost = []) {
  const holder = element('div', { className: 'chart', aria: { role: 'img', label: words } });
  const number = (v) => (v == null ? '' : `${v.toFixed(v < 10 ? 1 : 0)} ${unit}`);
  const options = (axis, colors) => ({
    width: holder.clientWidth || 320, height: kHeight, padding: [6, 6, 0, 0],
    scales: { x: { time: false }, y: { range: (_, low, high) => [0, Math.max(high, 1) * 1.05] } },
    axes: [axis, { ...axis, size: 68, values: (_, values) => values.map((v) => `${v} ${unit}`) }],
    series: [{ label: 'frame', value: (_, v) => (v == null ? '' : String(v)) }, ...series.map(({ label }, i) => (
      { label, stroke: colors[i % colors.length], width: 1, points: { show: false }, value: (_, v) => number(v) }))],
    hooks: { draw: [(made) => drawMarks(made, lost)] },
  });
  let plot;
  onTheme(() => {
    plot?.destroy();
    const lines = { stroke: themeColor('axis-grid') };
    plot = new uPlot(options({ stroke: themeColor('axis'), grid: lines, ticks: lines }, themeColor('series').split(' ')),
                     [frames, ...series.map(({ values }) => values)], holder);
  });
  new ResizeObserver(() => { if (holder.clientWidth > 0) plot.setSize({ width: holder.clientWidth, height: kHeight }); }).observe(holder);
  const marks = lost.length > 0 ? [element('p', { className: 'hint is-lost' }, `${lost.length === 1 ? '1 lost frame' : `${lost.length} lost frames`}`)] : [];
  return [element('h2', {}, title), holder, ...marks];
}

/** Charts of a report's `per_frame`. */
export function charts(frames) {
  if (frames.length < 2) return [];
  const index = frames.map((f) => f.index), share = (v) => (v == null ? null : 100 * v);
  const lost = frames.filter(({ state }) => state === 'lost').map((f) => f.index);
  const used = kStages.filter((stage) => frames.some((f) => f.ms?.[stage] > 0.1));
  return [
    ...chart('Tracking', 'Inliers and overlap of each frame in per cent; lost frames are marked', index, [
      { label: 'inliers', values: frames.map((f) => share(f.inlier_share)) },
      { label: 'overlap', values: frames.map((f) => share(f.overlap)) },
    ], '%', lost),
    ...chart('Time by stage', 'Milliseconds that each stage took, frame by frame', index,
             used.map((label) => ({ label, values: frames.map((f) => f.ms?.[label] ?? null) })), 'ms'),
  ];
}
