// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reads a DXF file with dxf-parser; prints a line `layer width height entities texts...` per layer, sizes in drawing
// units.
import { readFile } from 'node:fs/promises';
import DxfParser from 'dxf-parser';

const dxf = new DxfParser().parseSync(await readFile(process.argv[2], 'ascii'));
if (dxf.header.$ACADVER !== 'AC1009' || dxf.header.$INSUNITS !== 6) throw new Error('wrong version or unit');
const layers = {};
for (const entity of dxf.entities) {
  if (!dxf.tables.layer.layers[entity.layer]) throw new Error(`no layer ${entity.layer} in the table`);
  const layer = (layers[entity.layer] ??= { points: [], texts: [], entities: 0 });
  layer.entities += 1;
  if (entity.type === 'TEXT') layer.texts.push(entity.text.replaceAll(' ', '_'));
  else layer.points.push(...entity.vertices);
}
const extent = (points, axis) => {
  const values = points.map((p) => p[axis]);
  return values.length === 0 ? 0 : Math.max(...values) - Math.min(...values);
};
for (const [name, { points, texts, entities }] of Object.entries(layers))
  console.log([name, extent(points, 'x').toFixed(4), extent(points, 'y').toFixed(4), entities, ...texts].join(' '));
