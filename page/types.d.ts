// The shapes that modules of the page hand each other. Units are SI; steps, beads and contacts count from 0.

/** `physics` of the manifest; docs/FORMAT.md has its keys. */
export interface Physics {
  kernel_version: number;
  beads: number;
  bead_mass_kg: number;
  alpha: number;
  stiffness: number;
  impurities: { bead: number; mass_kg: number }[];
  striker: { bead: number; velocity_m_s: number };
  /** Further ones. */
  strikers?: { bead: number; velocity_m_s: number }[];
  /** The state of step 0 is another one than strikers and drives make. */
  initial?: unknown;
  spheres?: Sphere | Sphere[];
  odd_spheres?: ({ bead: number } & Sphere)[];
  disorder?: { of: string }[];
  drives?: DriveEntry[];
  baths?: BathEntry[];
  /** Of disorder, thermal velocities and baths. */
  seed?: number;
  bonds?: unknown;
  second?: unknown;
  resonators?: unknown;
  method: string;
  dt_s: number;
  step_count: number;
  ends?: { left?: string; right?: string; left_stiffness?: number; right_stiffness?: number; absorbing_drag_n_s_per_m?: number };
  load?: { gravity_m_s2?: number; precompression_n?: number };
  damping?: {
    viscous_n_s_per_m?: number;
    restitution?: { coefficient: number; damping_ratio: number };
    kuwabara_kono_s?: number;
    power?: { coefficient: number; exponent: number };
  };
  masses?: unknown;
  stiffnesses?: unknown;
  contacts?: { contact: number; stiffness: number }[];
}

export interface Sphere {
  radius_m: number;
  density_kg_m3: number;
}

/** What moves a wall or a bead, or pulls at a bead: one of the three, over time. */
export interface DriveEntry {
  wall?: "left" | "right";
  bead?: number;
  force_n?: Shape;
  displacement_m?: Shape;
  velocity_m_s?: Shape;
}

/** A heat bath at the beads "first..end", or at the pairs of neighbours among them; with one of the temperatures. */
export interface BathEntry {
  beads: string;
  temperature_j?: Shape;
  temperature_k?: Shape;
  friction_per_s: number;
  seed?: number;
  pairs?: boolean;
}

/** A number over time, one of them. Amplitudes are in the unit of what is driven. */
export interface Shape {
  constant?: number;
  sine?: {
    amplitude: number;
    frequency_hz: number;
    phase_rad?: number;
    ramp_s?: number;
    until_s?: number;
    ramp_down_s?: number;
  };
  chirp?: {
    amplitude: number;
    from_hz: number;
    to_hz: number;
    duration_s: number;
    ramp_s?: number;
    ramp_down_s?: number;
  };
  step?: { amplitude: number; at_s?: number; rise_s?: number };
  ramp?: { amplitude: number; from_s?: number; to_s: number };
  half_sine?: { amplitude: number; duration_s: number; at_s?: number };
  gaussian?: { amplitude: number; at_s: number; width_s: number; frequency_hz?: number };
  table?: { times_s: number[]; values: number[]; interpolation: "linear" | "cubic" };
}

export interface Provenance {
  name: string;
  run_id: string;
  program: string;
  host: string;
  started_unix_ns: number;
  publish_every_steps: number;
  record_every_steps: number;
  author?: string;
  orcid?: string;
  licence?: string;
  doi?: string;
}

export interface Manifest {
  schema_version: string;
  physics: Physics;
  provenance: Provenance;
}

export interface Wall {
  stiffness: number;
  restOverlap: number;
  restForce: number;
  damping: number;
}

/** A further term of the force of every contact: "power" of an exponent, "spring" of δ, δ² or δ³, "toda" of a steepness (1/m). */
export interface Term {
  kind: string;
  parameter: number;
  /** N − 1 numbers, and those of the contacts at the ends; 0 where a contact has no such term. */
  stiffness: Float64Array;
  leftWall?: number;
  rightWall?: number;
  ring?: number;
}

/**
 * `/chain`: what was resolved from `physics`. N masses, N − 1 of the other arrays before the walls; `damping` may be empty.
 * Arrays of springs, drag and resonators have N numbers, or are not there, or empty.
 */
export interface Chain {
  mass: Float64Array;
  stiffness: Float64Array;
  restOverlap: Float64Array;
  restForce: Float64Array;
  damping: Float64Array;
  leftWall?: Wall;
  rightWall?: Wall;
  /** The contact of the last bead and bead 0. */
  ring?: Wall;
  terms?: Term[];
  /** N/m, N/m³ and N·s/m. */
  onSite?: Float64Array;
  onSiteCubic?: Float64Array;
  drag?: Float64Array;
  /** kg, N/m. */
  resonatorMass?: Float64Array;
  resonatorStiffness?: Float64Array;
  /** p + 1 of damping by a power p of the overlap; 0 or not there of other kinds. */
  dampingPower?: number;
}

export interface State {
  step: number;
  time_s: number;
  /** Displacements (m) and velocities (m/s), N each. */
  u: Float64Array;
  v: Float64Array;
  /** What the method needs besides, see docs/FORMAT.md. */
  extra: Float64Array;
}

/** A file, whichever way its bytes come. */
export interface Bytes {
  size: number;
  /** Exactly these bytes; rejects if they cannot be had. */
  read(offset: number, length: number): Promise<Uint8Array>;
}

/** How a recording ended: `beadline.end`. */
export interface End {
  reason: string;
  firstStep: number | undefined;
  lastStep: number | undefined;
}

/** Where a run comes from; can be sent to a worker. */
export type Source =
  | { kind: "bytes"; bytes: Uint8Array }
  | { kind: "file"; file: File }
  | { kind: "url"; url: string }
  | { kind: "live"; url: string }
  | { kind: "start"; manifest: Manifest; chain: Chain; lastStep?: number }
  | { kind: "difference"; first: Source; other: Source };

export type Field = "velocity" | "displacement" | "overlap" | "energy" | "contacts" | "force";

/** What is known of a run as soon as it is open. */
export interface Info {
  kind: "recording" | "live" | "start";
  manifest: Manifest;
  chain: Chain;
  /** Lengths and times of the run: L (m) and T (s), as docs/NOTATION.md has them. */
  scales: { length_m: number; time_s: number };
  /** First and last step that can be shown; the last one grows while a run goes. */
  firstStep: number;
  lastStep: number;
  /** States that came with the source. */
  storedCount: number;
  /** Whether steps between stored states can be recomputed, and else why not, as a sentence. */
  recomputes: boolean;
  whyNot: string;
  /** Of a recording. */
  end: End | undefined;
  /** What is wrong with the file, as sentences. */
  notes: string[];
  /** Overlaps and gaps up to this count as touching (m). */
  toleranceM: number;
  /** The bead that divides left from right. */
  splitBead: number;
}

/** What a map, curves and their followed beads need: a row for each of some steps. */
export interface RowsRequest {
  field: Field;
  /** First and last bead (of "overlap", "contacts" and "force": contact). */
  places: [number, number];
  /** Columns at most; there is one for each place where there are fewer places. */
  columns: number;
  /** First and last step; an endless last step follows a live run. */
  steps: [number, number];
  /** Rows at most; there is one for each step where there are fewer steps. */
  rows: number;
  /** Beads whose u and v are wanted. */
  follow: number[];
}

/**
 * Rows in the order of steps. The space up to the next row is its: it shows the state of its step and, up to the step
 * `seen`, the extremes of all steps there.
 */
export interface Rows {
  request: RowsRequest;
  columns: number;
  /** Rows that are there; the arrays may be longer. */
  count: number;
  steps: Float64Array;
  /** `columns` values a row: of the places and steps of a cell the one that is largest in magnitude. */
  cells: Float64Array;
  /** The least and the largest of ENERGY_COUNT energies (J), then of u and v of each followed bead, a row after the other. */
  lows: Float64Array;
  highs: Float64Array;
  /** Steps up to this one were all looked at, or where none is recomputed the states that are there. */
  seen: number;
  /** The first row that may look different from when it was painted. */
  fresh: number;
  /** Whether all rows are there that were asked for, at their steps. */
  isWhole: boolean;
}

/** Something that happened to a bead. */
export interface Event {
  bead: number;
  kind: "left-closes" | "left-opens" | "right-closes" | "right-opens" | "turns";
  step: number;
  time_s: number;
  u_m: number;
}

/** What a recomputation compared. */
export interface Proof {
  /** Stored states, and how many of them were recomputed so far; steps computed for that. */
  states: number;
  compared: number;
  steps: number;
  /** Places at which states of the recording are missing. */
  missing: number;
  /** Why the recording is not whole; "" if it is. */
  lacks: string;
  isDone: boolean;
  /** The first value that differs; `array` is "u", "v" or "extra". */
  first: { step: number; bead: number; array: string; stored: number; computed: number } | undefined;
  /** The step of a first state that is not made here but taken as it is stored. */
  believed: number | undefined;
  /** Why nothing could be compared; "" where something was. */
  whyNot: string;
}

/** A pulse, as `beadline pulses` tells it. */
export interface Pulse {
  pulse: number;
  direction: "forward" | "backward";
  birth: string;
  birth_time_s: number;
  birth_bead: number;
  end_time_s: number;
  end_bead: number;
  fate: string;
  v_peak_m_s: number;
  velocity_beads_per_s: number;
  fwhm_beads: number | null;
  /** Times (s) and beads that it passes, in turns; thinned. */
  track: number[];
}

/** A linear mode, as `beadline modes` tells it. */
export interface Mode {
  mode: number;
  frequency_hz: number;
  participation_beads: number;
  centre_bead: number;
}

/** What comes beside a recording: computed by the command. */
export interface Results {
  pulses: Pulse[];
  /** None of a chain that is not linear about rest, or is too long. */
  modes?: Mode[];
}

/** How a live run is doing, about four times a second. */
export interface LiveStatus {
  state: string;
  step: number;
  steps_per_s: number;
  frames_seen: number;
  frames_skipped: number;
  consumers: { label: string; delivery: string; pid: number | null; lag_frames: number | null; frames_missed: number | null }[];
}

/** A line of the table of a folder, of a sweep, or of live runs. */
export interface Entry {
  id: string;
  name: string;
  kind: "recording" | "live" | "start";
  /** Where it is, relative to the page. */
  url: string;
  /** Where its results are, if the server computes them. */
  results: string | undefined;
  manifest: Manifest | undefined;
  bytes: number | undefined;
  /** Columns of a sweep's results. */
  values: Record<string, number | string | null>;
  /** What is wrong with the file. */
  damage: string | undefined;
  /** Why it cannot be shown. */
  error: string | undefined;
}

/** What the server has. */
export interface Listing {
  title: string;
  kind: "one" | "pair" | "folder" | "sweep";
  /** Columns of what was swept, in their order. */
  keys: string[] | undefined;
  entries: Entry[];
  /** How many more there are. */
  more: number | undefined;
}
