//! Chains of every kind, one by one, against the loop that a user would write in C.

use super::{Bench, Floor, Rounds};
use crate::dynamics::Moments;
use crate::report::{Report, notice};
use anyhow::{Context as _, Error, bail};
use producer::run::{Conductor, Job, Together};
use pulp::Arch;
use schemas::config::{Bonds, End, RunConfig, StreamConfig};
use schemas::frame::{Frame, FrameSink};
use schemas::manifest::{Origin, Physics, RunManifest};
use schemas::method::Method;
use schemas::presets::PRESETS;
use schemas::simd::vectorized;
use schemas::term::{Spring, TermLaw, Toda};
use std::convert::Infallible;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// Bead-steps of a measurement.
const BEAD_STEPS: u64 = 200_000_000;

/// The flags with which a user who wants a fast loop compiles it.
const FLAGS: [&str; 4] = ["-O3", "-march=native", "-fno-math-errno", "-ffp-contract=off"];

/// A chain that moves all of the time, and the word that the plain loop has for it.
#[derive(Debug, Clone, Copy)]
struct Kind {
    what: &'static str,
    word: &'static str,
    beads: u64,
    alpha: f64,
    floor: Floor,
}

const KINDS: [Kind; 15] = {
    const fn pressed(what: &'static str, beads: u64, floor: f64) -> Kind {
        Kind { what, word: "hertz", beads, alpha: 1.5, floor: Floor::AtLeast(floor) }
    }
    const fn bonds(what: &'static str, word: &'static str, beads: u64) -> Kind {
        Kind { what, word, beads, alpha: 1.0, floor: Floor::AtLeast(1.0) }
    }
    [
        pressed("pressed, N = 10", 10, 1.0),
        pressed("pressed, N = 20", 20, 1.0),
        pressed("pressed, N = 32", 32, 1.2),
        pressed("pressed, N = 64", 64, 1.2),
        pressed("pressed, N = 150", 150, 1.2),
        pressed("pressed, N = 200", 200, 1.4),
        pressed("pressed, N = 1000", 1000, 1.4),
        Kind {
            what: "pressed, α = 1.3, N = 200",
            word: "power",
            beads: 200,
            alpha: 1.3,
            floor: Floor::AtLeast(12.0),
        },
        bonds("ring of FPUT-α bonds, N = 32", "alpha", 32),
        bonds("ring of FPUT-α bonds, N = 1024", "alpha", 1024),
        bonds("ring of FPUT-β bonds, N = 32", "beta", 32),
        bonds("ring of FPUT-β bonds, N = 1024", "beta", 1024),
        bonds("ring of Toda bonds, N = 32", "toda", 32),
        bonds("ring of Toda bonds, N = 1024", "toda", 1024),
        bonds("ring of FPUT-α bonds, N = 100", "alpha", 100),
    ]
};

/// Chains of one shape, computed beside each other by one worker.
const BESIDE: [Kind; 3] = [
    Kind { what: "64 at once, pressed, N = 32", floor: Floor::AtLeast(1.5), ..KINDS[2] },
    Kind { what: "64 at once, FPUT-α, N = 32", floor: Floor::AtLeast(3.0), ..KINDS[8] },
    Kind { what: "64 at once, pressed, N = 150", floor: Floor::AtLeast(1.2), ..KINDS[4] },
];

/// A pressed chain, as that of 200 beads above.
const PRESSED: &str = "\
[chain]\nbeads = 200\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n
[ends]\nleft = \"fixed\"\nright = \"fixed\"\n
[load]\nprecompression_n = 10.0\n
[striker]\nbead = 0\nvelocity_m_s = 0.01\n
[time]\nduration_s = 1.0\n
[integrator]\nmethod = \"velocity-verlet\"\n";

/// Baths at both ends of it.
const BATHS: &str = "\
[[bath]]\nbeads = 0\ntemperature_j = 1e-6\nfriction_per_s = 1e4\n
[[bath]]\nbeads = -1\ntemperature_j = 1e-7\nfriction_per_s = 1e4\n";

/// Forces on beads beside their contacts, as a configuration has them.
const MORE: [(&str, &str, Floor); 6] = [
    ("a bath at either end, N = 200", BATHS, Floor::AtMost(1.1)),
    (
        "all beads in a bath, N = 200",
        "[[bath]]\ntemperature_j = 1e-6\nfriction_per_s = 1e4\n",
        Floor::AtMost(16.0),
    ),
    (
        "a force on a bead, N = 200",
        "[[drive]]\nbead = 99\nforce_n = { sine = { amplitude = 1.0, frequency_hz = 1e4 } }\n",
        Floor::AtMost(6.0),
    ),
    (
        "a wall that moves, N = 200",
        "[[drive]]\nwall = \"left\"\ndisplacement_m = { sine = { amplitude = 1e-6, frequency_hz = 1e4 } }\n",
        Floor::AtMost(2.5),
    ),
    (
        "springs at each place, N = 200",
        "[on_site]\nlinear_n_per_m = 1e5\ncubic_n_per_m3 = 1e9\n",
        Floor::AtMost(4.0),
    ),
    ("resonators, N = 200", "[resonators]\nmass_kg = 1e-4\nstiffness_n_per_m = 1e5\n", Floor::AtMost(6.0)),
];

/// The same of forces that depend on velocities, beside the chain without them by the method that takes those.
const SLOWED: [(&str, &str, Floor); 3] = [
    ("dashpots, N = 200", "[damping]\nviscous_n_s_per_m = 0.5\n", Floor::AtMost(2.5)),
    ("a coefficient of restitution, N = 200", "[damping]\nrestitution = 0.9\n", Floor::AtMost(3.2)),
    ("drag on each bead, N = 200", "[on_site]\ndrag_n_s_per_m = 0.1\n", Floor::AtMost(2.0)),
];

/// Tangents beside the state of a chain, and how many.
const TANGENTS: [(Kind, usize); 3] = [
    (Kind { what: "8 tangents, N = 200", floor: Floor::AtMost(4.0), ..KINDS[5] }, 8),
    (Kind { what: "all 200 tangents, N = 100", beads: 100, floor: Floor::AtMost(37.5), ..KINDS[5] }, 200),
    (Kind { what: "8 tangents, ring of FPUT-β bonds, N = 1024", floor: Floor::AtMost(4.0), ..KINDS[11] }, 8),
];

/// Chains in a row of them.
const MANY: u64 = 64;

/// A sink that looks at nothing.
pub(crate) struct Nobody;

impl FrameSink for Nobody {
    type Error = Infallible;

    fn accept(&mut self, _: &Frame<'_>) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Lets a run go on. Somebody hears every frame, or nobody does.
#[derive(Clone, Copy)]
pub(crate) struct GoOn {
    pub(crate) is_heard: bool,
}

impl<P: FrameSink> Conductor<P, Nobody> for GoOn {
    fn after_frame(&mut self, _: &Frame<'_>, _: &mut P, _: Option<&mut Nobody>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn hears_every_frame(&self, _: &P) -> bool {
        self.is_heard
    }
}

impl Kind {
    fn config(&self) -> RunConfig {
        let mut config = PRESETS[0].config();
        config.chain.impurities.clear();
        (config.chain.beads, config.chain.alpha) = (self.beads, Some(self.alpha));
        config.integrator.method = Method::VelocityVerlet;
        let bent = |bend| vec![(TermLaw::Spring(Spring(1)), 1.0), (TermLaw::Spring(bend), 0.25)];
        let laws = match self.word {
            "alpha" => bent(Spring(2)),
            "beta" => bent(Spring(3)),
            "toda" => vec![(TermLaw::Toda(Toda(1.0)), 1.0)],
            _ => Vec::new(),
        };
        let end = if laws.is_empty() {
            config.load.precompression_n = 10.0;
            End::Fixed
        } else {
            (config.chain.bead_mass_kg, config.chain.stiffness) = (Some(1.0), Some(1.0));
            config.chain.bonds = Some(Bonds::from_iter(laws));
            config.time.dt_s = Some(0.05);
            config.time.duration_s = 1e6;
            End::Periodic
        };
        (config.ends.left, config.ends.right) = (end, end);
        config.striker.velocity_m_s = 0.01;
        config
    }

    fn steps(&self) -> u64 {
        BEAD_STEPS / self.beads
    }
}

/// Each kind against the plain loop, if there is a C compiler.
pub(super) fn rows(bench: &Bench, report: &mut Report) -> Result<(), Error> {
    let plain = match compiled(bench.directory.path()) {
        Ok(plain) => plain,
        Err(error) => {
            notice(&format!("chains are not measured: {error:#}"));
            return Ok(());
        }
    };
    for kind in KINDS {
        let moments = Moments::all_moving(&kind.config(), kind.steps())?;
        let rounds =
            Rounds::alternate(bench.rounds, || Ok(moments.ours(Arch::new())), || kind.theirs(&plain))?;
        let per_bead_step = |time_s: f64| time_s / moments.bead_steps() * 1e9;
        let figure = format!("{:.2} ns a bead-step", per_bead_step(rounds.ours_s()));
        report.row(rounds.row(kind.what, "a plain loop in C", kind.floor, figure))?;
    }
    limits(bench, report)?;
    let times = |moments: &Moments| Ok(moments.ours(Arch::new()));
    let moments = |method: Method, more: &str| {
        let mut config = RunConfig::from_toml(&format!("{PRESSED}{more}"))?;
        config.integrator.method = method;
        Moments::all_moving(&config, KINDS[5].steps() / 20)
    };
    let [plain_method, for_velocities] = [Method::VelocityVerlet, Method::Rk5];
    let more = MORE.map(|row| (plain_method, row)).into_iter().chain(SLOWED.map(|row| (for_velocities, row)));
    for (method, (what, more, floor)) in more {
        let (with, without) = (moments(method, more)?, moments(method, "")?);
        let rounds = Rounds::alternate(bench.rounds, || times(&with), || times(&without))?;
        let figure = format!("{:.2} ns a bead-step", rounds.ours_s() / with.bead_steps() * 1e9);
        report.row(rounds.row(what, "without it", floor, figure))?;
    }
    let (with, without) = (moments(for_velocities, "")?, moments(Method::Rkn4, "")?);
    let rounds = Rounds::alternate(bench.rounds, || times(&with), || times(&without))?;
    let figure = format!("{:.2} ns a bead-step", rounds.ours_s() / with.bead_steps() * 1e9);
    report.row(rounds.row("rk5, pressed, N = 200", "rkn4, as many forces", Floor::AtMost(6.0), figure))?;
    for (kind, count) in TANGENTS {
        let moments = Moments::all_moving(&kind.config(), kind.steps() / 10 / count.div_ceil(8) as u64)?;
        let rounds = Rounds::alternate(
            bench.rounds,
            || moments.with_tangents(count),
            || Ok(moments.ours(Arch::new())),
        )?;
        let figure = format!("{:.2} ns a bead-step", rounds.ours_s() / moments.bead_steps() * 1e9);
        report.row(rounds.row(kind.what, "the steps alone", kind.floor, figure))?;
    }
    for kind in BESIDE {
        let rounds = Rounds::alternate(bench.rounds, || kind.ours_beside(), || kind.theirs(&plain))?;
        let figure =
            format!("{:.2} ns a bead-step", rounds.ours_s() / (kind.beads * kind.steps()) as f64 * 1e9);
        report.row(rounds.row(kind.what, "64 times the loop in C", kind.floor, figure))?;
    }
    Ok(())
}

/// The machine's own limits beside steps that they bound: roots alone, and loads and stores alone.
fn limits(bench: &Bench, report: &mut Report) -> Result<(), Error> {
    const COUNT: usize = 1024;
    let (from, mut to) = (vec![2.0_f64; COUNT], vec![0.0; COUNT]);
    let mut row = |what, against, kind: Kind, work: &mut dyn FnMut(&[f64], &mut [f64])| {
        let steps = kind.steps() / 10;
        let moments = Moments::all_moving(&kind.config(), steps)?;
        let numbers = moments.bead_steps();
        let mut alone = || {
            let began = Instant::now();
            for _ in 0..(kind.beads * steps) / COUNT as u64 {
                work(black_box(&from), black_box(&mut to));
            }
            Ok(began.elapsed())
        };
        let rounds = Rounds::alternate(bench.rounds, &mut alone, || Ok(moments.ours(Arch::new())))?;
        let figure = format!("{:.2} ns a bead", rounds.ours_s() / numbers * 1e9);
        report.row(rounds.row(what, against, Floor::Any, figure))
    };
    let arch = Arch::new();
    row("a root for each contact, and no more", "pressed, N = 1000", KINDS[6], &mut |from, to| {
        vectorized(
            arch,
            #[inline(always)]
            || to.iter_mut().zip(from).for_each(|(to, from)| *to = from.sqrt()),
        );
    })?;
    row("6 loads and 3 stores for each bead", "ring of FPUT-α bonds, N = 1024", KINDS[9], &mut |from, to| {
        vectorized(
            arch,
            #[inline(always)]
            || {
                for part in 0..3 {
                    to.iter_mut().zip(&from[part..]).for_each(|(to, more)| *to += more);
                }
            },
        );
    })
}

impl Kind {
    /// The time that [`MANY`] runs take, each with a part of the steps and a motion of its own.
    fn ours_beside(&self) -> Result<Duration, Error> {
        let manifest = |number: u64| {
            let mut config = self.config();
            config.striker.velocity_m_s *= 1.0 + number as f64 / MANY as f64;
            let (dt_s, steps) = (Physics::resolve(&config)?.dt_s, self.steps() / MANY);
            (config.time.dt_s, config.time.duration_s) = (Some(dt_s), dt_s * steps as f64);
            config.stream = StreamConfig { publish_every_steps: steps, record_every_steps: steps };
            let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
            Ok(RunManifest::new(&config, "bench", origin)?)
        };
        let manifests = (0..MANY).map(manifest).collect::<Result<Vec<_>, Error>>()?;
        let (mut failed, began) = (Ok(()), Instant::now());
        for together in Together::of(&manifests) {
            let mut sinks: Vec<_> =
                together.numbers().iter().map(|_| (Nobody, GoOn { is_heard: true })).collect();
            let jobs = together.numbers().iter().zip(&mut sinks).map(|(number, (publisher, conductor))| {
                Job { manifest: &manifests[*number], publisher, recorder: None, conductor }
            });
            let jobs: Vec<_> = jobs.collect();
            together.run(jobs, |_, _, ended| {
                failed = ended.map(|_| ());
                if failed.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            });
        }
        failed?;
        Ok(began.elapsed())
    }

    /// The time that the plain loop takes by its own clock.
    fn theirs(&self, plain: &Path) -> Result<Duration, Error> {
        let (beads, steps, alpha) =
            (self.beads.to_string(), self.steps().to_string(), self.alpha.to_string());
        let ended = Command::new(plain).args([self.word, &beads, &steps, &alpha]).output()?;
        let printed = String::from_utf8_lossy(&ended.stdout);
        let time = printed.split_whitespace().next().and_then(|word| word.parse().ok());
        match time {
            Some(time_s) if ended.status.success() => Ok(Duration::from_secs_f64(time_s)),
            _ => bail!("the plain loop of {} ended with {}: {printed}", self.what, ended.status),
        }
    }
}

/// The plain loop, compiled for this machine.
fn compiled(directory: &Path) -> Result<PathBuf, Error> {
    let (source, program) = (directory.join("plain.c"), directory.join("plain"));
    std::fs::write(&source, include_str!("../plain.c"))?;
    let ended = Command::new("cc").args(FLAGS).arg("-o").args([&program, &source]).arg("-lm").output();
    let ended = ended.context("a C compiler is needed, and `cc` cannot be started")?;
    if !ended.status.success() {
        bail!("`cc` says: {}", String::from_utf8_lossy(&ended.stderr));
    }
    Ok(program)
}
