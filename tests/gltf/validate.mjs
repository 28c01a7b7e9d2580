// SPDX-License-Identifier: MIT
// Checks glTF files by the Khronos validator: node validate.mjs FILE.glb...  Once before: npm ci
// Ends with 1 at an error or a warning, and with 77 where the validator is not installed.
import { readFileSync } from 'node:fs';

let validator;
try {
  validator = await import('gltf-validator');
} catch {
  console.log('gltf-validator is not installed; run npm ci in tests/gltf');
  process.exit(77);
}
let failed = process.argv.length < 3;
for (const path of process.argv.slice(2)) {
  const { issues } = await validator.default.validateBytes(new Uint8Array(readFileSync(path)));
  console.log(`${path}: ${issues.numErrors} errors, ${issues.numWarnings} warnings, ${issues.numInfos} notes`);
  for (const issue of issues.messages) console.log(`  ${issue.code} at ${issue.pointer}: ${issue.message}`);
  failed ||= issues.numErrors + issues.numWarnings > 0;
}
process.exit(failed ? 1 : 0);
