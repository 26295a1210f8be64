// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Prints the errors and warnings of Khronos' validator for a glTF file, one per line.
import { readFile } from 'node:fs/promises';
import { dirname, join } from 'node:path';
import validator from 'gltf-validator';

const file = process.argv[2];
const report = await validator.validateBytes(new Uint8Array(await readFile(file)), {
  uri: file,
  maxIssues: 20,
  externalResourceFunction: (uri) => readFile(join(dirname(file), decodeURIComponent(uri))).then((data) => new Uint8Array(data)),
});
for (const message of report.issues.messages.filter((m) => m.severity < 2)) console.log(`${message.code}: ${message.message}`);
