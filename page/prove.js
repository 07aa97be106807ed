// Prove it: every stored state is recomputed from the one before, and its bits are compared.

/** @typedef {import("./types.d.ts").Proof} Proof */

/** Things that this page does not prove. */
const NOT_KNOWN = [
  "`/chain`, which is taken as it is: nothing here makes it from the manifest",
  "summaries, rows of results, indexes and `run.toml`: `beadline verify` compares them",
  "who made it, where and when: name, run id, program, host and start",
  "whose it is: author, ORCID, licence and DOI",
];

/**
 * Result of a proof, in the words of `beadline verify`.
 * @param {Proof} proof
 */
export function verdict({ states, compared, steps, missing, lacks, isDone, first, whyNot, believed }) {
  if (whyNot) {
    return whyNot;
  }
  if (first) {
    const { step, bead, array, stored, computed } = first;
    return `Not proven: at step ${step}, bead ${bead}, ${array} is ${stored} in the recording, ${computed} computed.`;
  }
  if (!isDone) {
    return `Recomputing: ${compared} of ${states} states …`;
  }
  const isBegun = believed === undefined;
  const how =
    missing > 0
      ? `Not proven: states are missing at ${missing} ${missing === 1 ? "place" : "places"}, and of the others`
      : lacks !== ""
        ? `Proven as far as it goes, but it is NOT WHOLE (${lacks})`
        : `Proven${isBegun ? "" : " from its first state on, but its BEGINNING IS NOT PROVEN"}`;
  const start = isBegun ? " The first state is the manifest's initial condition." : "";
  const begin = `how the chain came to the first state, of step ${believed}: it is taken as it is`;
  const unknown = isBegun ? NOT_KNOWN : [begin, ...NOT_KNOWN];
  const what = `${compared} states, ${steps} steps recomputed here, each bit the same: each is what the one before leads to.`;
  return `${how}: ${what}${start} Not known: ${unknown.join("; ")}.`;
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
    const isWrong = first || (isDone && proof.missing > 0);
    show(verdict(proof), states > 0 ? compared / states : 0, isWrong ? "bad" : isDone && !whyNot ? "good" : "");
  };
  show("Recomputing …", 0, "");
  const proof = await engine.prove(tell);
  tell(proof);
  return proof;
}
