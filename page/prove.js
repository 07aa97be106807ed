// Prove it: every stored state is recomputed from the one before, and its bits are compared.

/** @typedef {import("./types.d.ts").Proof} Proof */

/**
 * What a proof says, in a sentence.
 * @param {Proof} proof
 */
export function verdict({ states, compared, steps, isDone, first, whyNot, believed }) {
  if (whyNot) {
    return whyNot;
  }
  if (first) {
    const { step, bead, array, stored, computed } = first;
    return `Not proven: at step ${step}, bead ${bead}, ${array} is ${stored} in the recording, ${computed} computed.`;
  }
  const from = believed === undefined ? "" : ` The state of step ${believed} is taken as it is stored.`;
  return isDone
    ? `Proven: ${compared} states, ${steps} steps recomputed here, each bit the same.${from}`
    : `Recomputing: ${compared} of ${states} states …`;
}

/**
 * Proves a run and shows how far it is.
 * @param {import("./engine.js").Engine} engine
 * @param {(text: string, share: number, kind: string) => void} show kind: "", "good", "bad"
 * @returns {Promise<Proof>}
 */
export async function prove(engine, show) {
  const tell = (/** @type {Proof} */ proof) => {
    const { isDone, first, whyNot, compared, states } = proof;
    show(verdict(proof), states > 0 ? compared / states : 0, first ? "bad" : isDone && !whyNot ? "good" : "");
  };
  show("Recomputing …", 0, "");
  const proof = await engine.prove(tell);
  tell(proof);
  return proof;
}
