//! Runs drawn from a seed: what a check says that a run may be off by contains what it is off by, whatever a configuration says.

#![allow(
    clippy::panic,
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::too_many_lines,
    reason = "a test; a kind stands in one place; what was found is for who looks with --nocapture"
)]

use consumers::determination::{Determination, Outcome, TOLERANCE};
use consumers::energies::default_split_bead;
use experiments::compare::compare;
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::RunConfig;
use schemas::frame::Frame;
use schemas::manifest::{Origin, Physics, RunManifest};
use schemas::philox::uniform;
use std::fmt::Write as _;
use std::sync::atomic::AtomicBool;

mod exact;
mod prediction;
mod roundings;
mod windows;

/// Numbers in a fixed order, from a seed and a stream.
struct Random {
    seed: u64,
    stream: u32,
    index: u64,
}

impl Random {
    /// From 0 to below 1.
    fn unit(&mut self) -> f64 {
        self.index += 1;
        uniform(self.seed, self.stream, self.index)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// As likely in each decade.
    fn ratio(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    fn below(&mut self, count: u64) -> u64 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a small positive number"
        )]
        let below = (self.unit() * count as f64) as u64;
        below
    }
}

/// The kinds of runs, which decide what is drawn beside beads, masses and times.
const KINDS: [&str; 18] = [
    "free",
    "wall",
    "walls",
    "loaded",
    "gaps",
    "heavy",
    "dashpots",
    "restitution",
    "restitution in walls",
    "viscoelastic",
    "drag",
    "shaken",
    "pushed",
    "ring",
    "bonds",
    "resonators",
    "exponents",
    "disorder",
];

/// A configuration of a kind: 1 g, 1e7 N·m^−α and 5 m/s but for what is drawn, over 10 to 60 collision times.
fn drawn(kind: &str, random: &mut Random) -> RunConfig {
    let beads = 5 + random.below(20);
    drawn_of(kind, beads, random)
}

/// The same of so many beads.
fn drawn_of(kind: &str, mut beads: u64, random: &mut Random) -> RunConfig {
    let mut chain = String::new();
    let mut rest = String::new();
    let mut striker = (0, 5.0);
    let mut alpha = if random.unit() < 0.5 { 1.5 } else { random.ratio(1.2, 4.0) };
    let impurity = random.below(beads);
    let mass = random.ratio(0.1e-3, 10e-3);
    if random.unit() < 0.5 && !matches!(kind, "heavy" | "bonds") {
        let _ = writeln!(chain, "impurities = [{{ bead = {impurity}, mass_kg = {mass:e} }}]");
    }
    let walls = "[ends]\nleft = \"fixed\"\nright = \"fixed\"\n";
    match kind {
        "free" => {}
        "wall" => rest += "[ends]\nright = \"fixed\"\n",
        "walls" => rest += walls,
        "loaded" => {
            let force = random.ratio(1.0, 300.0);
            let _ = write!(rest, "{walls}[load]\nprecompression_n = {force:e}\n");
        }
        "gaps" => {
            let gaps: Vec<String> = (1..beads).map(|_| format!("{:e}", random.ratio(1e-7, 1e-4))).collect();
            let _ = writeln!(chain, "gaps_m = {{ list = [{}] }}", gaps.join(", "));
            if random.unit() < 0.5 {
                rest += walls;
            }
        }
        "heavy" => {
            let bead = 1 + random.below(beads - 2);
            let heavy = random.ratio(5e-3, 50e-3);
            let _ = writeln!(chain, "impurities = [{{ bead = {bead}, mass_kg = {heavy:e} }}]");
            striker = (0, random.ratio(0.5, 50.0));
        }
        "dashpots" => {
            let _ = writeln!(rest, "[damping]\nviscous_n_s_per_m = {:e}", random.ratio(0.05, 10.0));
        }
        "restitution" | "restitution in walls" => {
            let _ = writeln!(rest, "[damping]\nrestitution = {:e}", random.between(0.3, 0.99));
            if kind.ends_with("walls") {
                rest += walls;
            }
        }
        "viscoelastic" => {
            let _ = writeln!(rest, "[damping]\nkuwabara_kono_s = {:e}", random.ratio(1e-7, 1e-5));
        }
        "drag" => {
            let _ = writeln!(rest, "[on_site]\ndrag_n_s_per_m = {:e}", random.ratio(1e-3, 1.0));
        }
        "shaken" => {
            let (micron, hz) = (random.ratio(0.1e-6, 20e-6), random.ratio(500.0, 5000.0));
            let _ = write!(
                rest,
                "{walls}[load]\nprecompression_n = {:e}\n[[drive]]\nwall = \"left\"\n\
                 displacement_m = {{ sine = {{ amplitude = {micron:e}, frequency_hz = {hz:e}, ramp_s = 5e-4 }} }}\n",
                random.ratio(1.0, 100.0)
            );
            striker.1 = 0.0;
        }
        "pushed" => {
            let (newton, width_s) = (random.ratio(1.0, 100.0), random.ratio(5e-5, 5e-4));
            let _ = write!(
                rest,
                "[[drive]]\nbead = {}\nforce_n = {{ gaussian = {{ amplitude = {newton:e}, at_s = 1e-3, width_s = {width_s:e} }} }}\n",
                random.below(beads)
            );
            striker.1 = if random.unit() < 0.5 { 0.0 } else { 1.0 };
        }
        "ring" => {
            beads += 5;
            rest += "[ends]\nleft = \"periodic\"\nright = \"periodic\"\n";
            if random.unit() < 0.5 {
                let _ = write!(rest, "[load]\nprecompression_n = {:e}\n", random.ratio(1.0, 100.0));
            }
        }
        "bonds" => {
            let _ = writeln!(
                chain,
                "bonds = {{ linear = 1e5, quadratic = {:e}, cubic = {:e} }}",
                random.ratio(1e6, 1e8),
                random.ratio(1e12, 1e14)
            );
            striker = (0, random.ratio(0.1, 5.0));
        }
        "resonators" => {
            let _ = write!(
                rest,
                "[resonators]\nmass_kg = {:e}\nstiffness_n_per_m = {:e}\n",
                random.ratio(0.1e-3, 2e-3),
                random.ratio(1e3, 1e6)
            );
        }
        "exponents" => {
            let other = random.ratio(1.3, 3.0);
            let _ = writeln!(chain, "alphas = {{ pattern = [1.5, {other:e}] }}");
            alpha = 1.5;
        }
        "disorder" => {
            let _ = write!(
                rest,
                "seed = {}\n[[disorder]]\nof = \"masses\"\nuniform = {:e}\n",
                random.below(1000),
                random.between(0.1, 0.9)
            );
        }
        other => panic!("{other} is no kind"),
    }
    let law = if kind == "bonds" { String::new() } else { format!("alpha = {alpha:e}\nstiffness = 1e7\n") };
    let time_s = (1e-3 * 25.0 / 1e7_f64).powf(1.0 / (alpha + 1.0)) / 5.0 * random.ratio(10.0, 60.0);
    let (seed, rest) = rest.strip_prefix("seed").map_or((String::new(), rest.clone()), |rest| {
        let (seed, rest) = rest.split_once('\n').unwrap();
        (format!("seed{seed}\n"), rest.to_owned())
    });
    let text = format!(
        "{seed}[chain]\nbeads = {beads}\nbead_mass_kg = 1e-3\n{law}{chain}{rest}\
         [striker]\nbead = {}\nvelocity_m_s = {:e}\n[time]\nduration_s = {time_s:e}\n",
        striker.0, striker.1
    );
    RunConfig::from_toml(&text).unwrap_or_else(|error| panic!("{kind}: {error}\n{text}"))
}

/// A run with a part of the step.
struct Finer {
    integrator: Integrator,
    state: ChainState,
    parts: u64,
}

impl Finer {
    fn new(physics: &Physics, parts: u64) -> Self {
        let mut physics = physics.clone();
        physics.dt_s /= parts as f64;
        physics.step_count *= parts;
        Self { integrator: Integrator::new(&physics), state: ChainState::initial(&physics), parts }
    }

    /// Its state at step `step` of the run.
    fn frame(&mut self, physics: &Physics, step: u64) -> Frame<'_> {
        let last = step * self.parts;
        while self.state.step < last {
            self.integrator.advance(&mut self.state, last);
        }
        let ChainState { u_m, v_m_s, extra, .. } = &self.state;
        Frame { frame: step, step, time_s: physics.time_s(step), u_m, v_m_s, extra, active: None }
    }
}

/// The differences of `manifest`'s run to one with a part of its step at the end, as a check has them of its moved twin.
fn truth(manifest: &RunManifest) -> Outcome {
    /// A 16th is left of an error that falls as the step itself; of those of contacts that open, a thousandth.
    const PARTS: u64 = 16;
    let physics = &manifest.physics;
    let [mut run, mut finer] = [1, PARTS].map(|parts| Finer::new(physics, parts));
    let mut found = Determination::new(manifest, default_split_bead(manifest), TOLERANCE, f64::EPSILON);
    let every = Determination::look_every_steps(physics);
    let mut step = 0;
    loop {
        let [run, finer] = [&mut run, &mut finer].map(|each| each.frame(physics, step));
        found.look(&run, [&run; 2], &finer, None);
        if step == physics.step_count {
            return found.outcome().expect("looks");
        }
        step = physics.step_count.min(step + every);
    }
}

/// The error of a run at its end over what its check says that it may be, of the quantity where that is most.
fn off(config: &RunConfig) -> (f64, &'static str) {
    /// Rounding of sixteen times as many steps, in units of the scales.
    const ROUNDED: f64 = 1e-11;
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    let manifest = RunManifest::new(config, "run", origin)
        .unwrap_or_else(|error| panic!("{error}\n{}", config.to_toml()));
    let last_step = manifest.physics.step_count;
    let checked = compare(&manifest, None, (last_step, TOLERANCE), &AtomicBool::new(false), |_| {});
    let checked = checked.expect("finite").determination.outcome().expect("looks");
    let truth = truth(&manifest);
    let quantities = checked.quantities.iter().filter(|each| !each.quantity.is_count());
    let off = quantities.filter_map(|each| {
        let off = truth.of(each.quantity)?.rounding.at_end;
        (off > ROUNDED).then_some((off / each.at_end(), each.quantity.as_str()))
    });
    off.fold((0.0, "nothing"), |most, next| if next.0 > most.0 { next } else { most })
}

/// More of them: `BEADLINE_RUNS=200 cargo test -p beadline-experiments --test random_runs -- --nocapture`.
#[test]
fn the_truth_is_within_what_a_check_says() {
    let asked = std::env::var("BEADLINE_RUNS").ok().and_then(|count| count.parse().ok());
    let count = asked.unwrap_or(KINDS.len());
    let (mut outside, mut worst) = (0, 0.0);
    for number in 0..count {
        let kind = number % KINDS.len();
        let stream = u32::try_from(kind).expect("few kinds");
        let mut random = Random { seed: 1, stream, index: ((number / KINDS.len()) as u64) << 32 };
        let config = drawn(KINDS[kind], &mut random);
        let (off, quantity) = off(&config);
        if off > 1.0 {
            outside += 1;
            println!("{}, run {number}: {quantity}, {off:.2}\n{}", KINDS[kind], config.to_toml());
        }
        assert!(off < 3.0, "{}, run {number}: {quantity}, {off}\n{}", KINDS[kind], config.to_toml());
        worst = if off > worst { off } else { worst };
    }
    println!("{count} runs: {outside} are farther off than was said; at most {worst:.2} times as far");
    assert!(20 * outside <= count, "{outside} of {count}");
}
