// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reads a log as Foxglove does, with MCAP's own readers, one along the file and one by its index, and protobufjs;
// prints the results for a test as JSON.
import { open, readFile } from 'node:fs/promises';
import { McapIndexedReader, McapStreamReader } from '@mcap/core';
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from '@mcap/support';

const name = process.argv[2];
const decompressHandlers = await loadDecompressHandlers();

// Along the file: every record, with the checksums of chunks and of all data.
const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true, includeChunks: true });
stream.append(new Uint8Array(await readFile(name)));
const records = {};
for (let record; (record = stream.nextRecord()); ) records[record.type] = (records[record.type] ?? 0) + 1;
if (!stream.done()) throw new Error('the file goes on behind its end, or has none');

// By index.
const file = await open(name);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (at, length) => {
    const bytes = new Uint8Array(Number(length));
    await file.read(bytes, 0, bytes.length, Number(at));
    return bytes;
  },
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const types = new Map();
for (const [id, schema] of reader.schemasById)
  types.set(id, protobufFromBinaryDescriptor(schema.data).lookupType(schema.name));
const topics = {}, entities = new Map(), frames = {}, texts = [], states = [];
let last = 0n, trajectory;
for await (const message of reader.readMessages({ validateCrcs: true })) {
  if (message.logTime < last) throw new Error('messages do not come in the order of their times');
  last = message.logTime;
  const channel = reader.channelsById.get(message.channelId);
  const type = types.get(channel.schemaId);
  const value = type.toObject(type.decode(message.data), { defaults: true, longs: Number, enums: String });
  const topic = (topics[channel.topic] ??= { schema: reader.schemasById.get(channel.schemaId).name, count: 0, first: Number(message.logTime) });
  ++topic.count;
  topic.last = Number(message.logTime);
  for (const t of value.transforms ?? []) frames[t.child_frame_id] = { parent: t.parent_frame_id, ...t.translation, q: t.rotation };
  if (channel.topic === '/diagnostics') texts.push(`${value.level} ${value.message}`);
  if (channel.topic === '/cairn/frame') states.push(value.state);
  if (channel.topic === '/trajectory') trajectory = { frame: value.frame_id, poses: value.poses.map((p) => [p.position.x, p.position.y, p.position.z]) };
  if (channel.topic === '/points') topic.bytes = value.data.length / value.point_stride;
  if (channel.topic === '/camera/depth/image') topic.bytes = value.data.length;
  if (channel.topic === '/camera/color/image') topic.bytes = value.data.length;
  if (channel.topic !== '/mesh') continue;
  for (const d of value.deletions)
    if (d.type === 'ALL') entities.clear();
    else entities.delete(d.id);
  for (const e of value.entities) entities.set(e.id, { frame: e.frame_id, ...e.triangles[0] });
}
await file.close();
const mesh = { entities: entities.size, triangles: 0, sum: [0, 0, 0], color: 0 };
for (const e of entities.values()) {
  mesh.triangles += e.indices.length / 3;
  if (e.colors.length !== e.points.length) throw new Error('a vertex has no color');
  for (const i of e.indices) ['x', 'y', 'z'].forEach((axis, k) => (mesh.sum[k] += e.points[i][axis]));
  for (const c of e.colors) mesh.color = Math.max(mesh.color, c.r, c.g, c.b);
}
console.log(JSON.stringify({ records, topics, mesh, frames, texts, states, trajectory }));
