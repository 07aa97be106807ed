// Opens recordings whose manifests somebody has changed, and recomputes their first steps, with the modules of page/.
//
//     node tests/node/check_manifests.mjs LIST.json
//
// LIST.json has pairs of a path and whether the command refuses its manifest. The page refuses it then, too; and it refuses with a
// sentence, not with what a language says of a mistake of ours. Exit code 0 if all is so.

import fs from "node:fs";

import { stepperOf } from "../../page/chains.js";
import { bytesOfArray } from "../../page/mcap.js";
import { Recording } from "../../page/recording.js";

/** What the page says of a file: nothing if it reads it. */
async function said(path) {
  try {
    const recording = await Recording.open(bytesOfArray(new Uint8Array(fs.readFileSync(path))));
    const { physics } = recording.manifest;
    if (physics.beads <= 200 && recording.chain !== undefined) {
      const stepper = stepperOf(physics, recording.chain);
      const first = await recording.before(physics.step_count);
      if (first !== undefined) {
        const { step, u, v, extra } = first;
        for (const state = { step, u: u.slice(), v: v.slice(), extra: extra.slice() }; state.step < Math.min(step + 3, physics.step_count); state.step += 1) {
          stepper.step(state);
        }
      }
    }
    return undefined;
  } catch (error) {
    return error;
  }
}

const wrong = [];
let refused = 0;
const pairs = JSON.parse(fs.readFileSync(process.argv[2], "utf8"));
for (const [path, isRefused] of pairs) {
  const error = await said(path);
  refused += error === undefined ? 0 : 1;
  if (error !== undefined && error.constructor !== Error) {
    wrong.push(`${path}: ${error.stack ?? error}`);
  } else if (error === undefined && isRefused) {
    wrong.push(`${path}: the command refuses it, the page does not`);
  }
}
console.log(`${pairs.length} files, ${refused} refused by the page`);
if (wrong.length > 0) {
  console.error(wrong.join("\n"));
  process.exit(1);
}
