// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reads an IFC file with web-ifc; prints a line `type name x y z width depth height area openings` per element: its
// bounds in meters, z up, its floor area if given, and its number of openings.
import { readFile } from 'node:fs/promises';
import * as WebIFC from 'web-ifc';

const api = new WebIFC.IfcAPI();
await api.Init();
const model = api.OpenModel(new Uint8Array(await readFile(process.argv[2])), { COORDINATE_TO_ORIGIN: false });
if (model < 0 || api.GetModelSchema(model) !== 'IFC4') throw new Error('no IFC4 model');
const all = (type) => [...api.GetLineIDsWithType(model, type)];
const bounds = {};
const collect = (mesh) => {
  const box = (bounds[mesh.expressID] ??= { low: [1e9, 1e9, 1e9], high: [-1e9, -1e9, -1e9] });
  for (let g = 0; g < mesh.geometries.size(); ++g) {
    const { geometryExpressID, flatTransformation: m } = mesh.geometries.get(g);
    const geometry = api.GetGeometry(model, geometryExpressID);
    const vertices = api.GetVertexArray(geometry.GetVertexData(), geometry.GetVertexDataSize());
    for (let v = 0; v < vertices.length; v += 6) {
      const [x, y, z] = vertices.slice(v, v + 3);
      // web-ifc turns the model to y up.
      const p = [0, 1, 2].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);
      for (const [i, value] of [p[0], -p[2], p[1]].entries()) {
        box.low[i] = Math.min(box.low[i], value);
        box.high[i] = Math.max(box.high[i], value);
      }
    }
  }
};
api.StreamAllMeshes(model, collect);
api.StreamAllMeshesWithTypes(model, [WebIFC.IFCSPACE], collect);
const openings = {};
for (const id of all(WebIFC.IFCRELVOIDSELEMENT)) {
  const wall = api.GetLine(model, id).RelatingBuildingElement.value;
  openings[wall] = (openings[wall] ?? 0) + 1;
}
const areas = {};
for (const id of all(WebIFC.IFCRELDEFINESBYPROPERTIES)) {
  const relation = api.GetLine(model, id, true);
  for (const object of relation.RelatedObjects)
    areas[object.expressID] = relation.RelatingPropertyDefinition.Quantities[0].AreaValue.value;
}
const types = { wall: WebIFC.IFCWALL, slab: WebIFC.IFCSLAB, door: WebIFC.IFCDOOR, space: WebIFC.IFCSPACE };
const ids = new Set();
for (const [type, code] of Object.entries(types))
  for (const id of all(code)) {
    const line = api.GetLine(model, id), box = bounds[id];
    if (!box) throw new Error(`${type} ${id} has no geometry`);
    if (!/^[0-3][0-9A-Za-z_$]{21}$/.test(line.GlobalId.value) || ids.has(line.GlobalId.value))
      throw new Error(`wrong or repeated identifier ${line.GlobalId.value}`);
    ids.add(line.GlobalId.value);
    console.log([type, line.Name.value.replaceAll(' ', '_'), ...box.low.map((v) => v.toFixed(4)),
      ...box.high.map((v, i) => (v - box.low[i]).toFixed(4)), (areas[id] ?? 0).toFixed(4), openings[id] ?? 0].join(' '));
  }
for (const id of all(WebIFC.IFCBUILDINGSTOREY))
  console.log(['storey', '-', 0, 0, api.GetLine(model, id).Elevation.value.toFixed(4), 0, 0, 0, 0, 0].join(' '));
