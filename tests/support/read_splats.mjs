// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Prints the splats of a file as JSON, one object per splat, in the axes right, down, forward: .spz read by the format's
// reference library, .ply and .glb by three.js.
import { readFile } from 'node:fs/promises';
import createSpz from '@adobe/spz';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { PLYLoader } from 'three/addons/loaders/PLYLoader.js';

async function readSpz(bytes) {
  const spz = await createSpz({ print() {} });  // it prints a summary
  const cloud = spz.loadSpzFromBuffer(bytes, { to: spz.CoordinateSystem.RDF });
  const perSplat = cloud.sh.length / cloud.numPoints;
  return Array.from({ length: cloud.numPoints }, (_, i) => {
    const [x, y, z, w] = cloud.rotations.slice(4 * i, 4 * i + 4);
    return {
      position: [...cloud.positions.slice(3 * i, 3 * i + 3)], log_scale: [...cloud.scales.slice(3 * i, 3 * i + 3)],
      rotation: [w, x, y, z], opacity: cloud.alphas[i], color: [...cloud.colors.slice(3 * i, 3 * i + 3)],
      harmonics: [...cloud.sh.slice(perSplat * i, perSplat * (i + 1))],
    };
  });
}

function readPly(bytes) {
  const rest = new TextDecoder().decode(bytes.subarray(0, 4096)).match(/ f_rest_\d+\n/g)?.length ?? 0;
  const loader = new PLYLoader();
  const names = (prefix, count) => Array.from({ length: count }, (_, k) => `${prefix}_${k}`);
  loader.setCustomPropertyNameMapping({
    log_scale: names('scale', 3), rotation: names('rot', 4), opacity: ['opacity'], color_: names('f_dc', 3),
    harmonics: names('f_rest', rest),
  });
  const { attributes } = loader.parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
  const at = (name, i) => {
    const attribute = attributes[name];
    return attribute ? [...attribute.array.slice(attribute.itemSize * i, attribute.itemSize * (i + 1))] : [];
  };
  return Array.from({ length: attributes.position.count }, (_, i) => {
    const byChannel = at('harmonics', i), count = rest / 3;
    return {
      position: at('position', i), log_scale: at('log_scale', i), rotation: at('rotation', i),
      opacity: at('opacity', i)[0], color: at('color_', i),
      harmonics: byChannel.map((_value, k) => byChannel[(k % 3) * count + Math.floor(k / 3)]),
    };
  });
}

/** Points with attributes of KHR_gaussian_splatting; their axes are right, up, back. */
async function readGlb(bytes) {
  const gltf = await new GLTFLoader().parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), '');
  const { extensions, attributes: names, mode } = gltf.parser.json.meshes[0].primitives[0];
  if (mode !== 0 || extensions.KHR_gaussian_splatting.kernel !== 'ellipse' || extensions.KHR_gaussian_splatting.colorSpace !== 'srgb_rec709_display')
    throw new Error('not Gaussian splats');
  let points;
  gltf.scene.traverse((node) => { if (node.isPoints) points = node.geometry.attributes; });
  const at = (name, i) => {
    const { array, itemSize } = points[`khr_gaussian_splatting:${name}`];
    return [...array.slice(itemSize * i, itemSize * (i + 1))];
  };
  const harmonics = [1, 2, 3].flatMap((degree) => Array.from({ length: 2 * degree + 1 }, (_, n) => `SH_DEGREE_${degree}_COEF_${n}`))
      .filter((name) => `KHR_gaussian_splatting:${name}` in names).map((name) => name.toLowerCase());
  const turned = [-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1];  // signs of harmonics after the rotation about x
  return Array.from({ length: points.position.count }, (_, i) => {
    const [x, y, z, w] = at('rotation', i), [opacity] = at('opacity', i);
    return {
      position: [points.position.getX(i), -points.position.getY(i), -points.position.getZ(i)], log_scale: at('scale', i).map(Math.log),
      rotation: [w, x, -y, -z], opacity: Math.log(opacity / (1 - opacity)), color: at('sh_degree_0_coef_0', i),
      harmonics: harmonics.flatMap((name, k) => at(name, i).map((value) => turned[k] * value)),
    };
  });
}

const file = process.argv[2];
const readers = { '.spz': readSpz, '.ply': readPly, '.glb': readGlb };
const bytes = new Uint8Array(await readFile(file));
console.log(JSON.stringify(await readers[file.slice(-4)](bytes)));
