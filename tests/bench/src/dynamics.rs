//! The dynamics: against a plain loop, and along the length of the chain.

use super::{Bench, Floor, Rounds, Row};
use crate::baseline::ScalarLoop;
use crate::report::Report;
use anyhow::Error;
use producer::integrator::Integrator;
use producer::state::ChainState;
use pulp::Arch;
use schemas::config::RunConfig;
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::presets::PRESETS;
use std::time::{Duration, Instant};

/// Moments of a run from which steps are measured, spread over all of it.
const MOMENTS: u64 = 10;

/// Steps measured from each moment, together: nobody looks at the states between.
const STEPS: u64 = 400;

/// Steps of the long chain, which one sweep makes.
const LONG_STEPS: u64 = 16;

/// States of a run, from the first to the last, from which a number of steps can be made.
pub(super) struct Moments {
    physics: Physics,
    states: Vec<ChainState>,
    steps: u64,
}

impl Moments {
    fn of(config: &RunConfig, steps: u64) -> Result<Self, Error> {
        let physics = Physics::resolve(config)?;
        let (mut state, mut integrator) = (ChainState::initial(&physics), Integrator::new(&physics));
        let mut states = Vec::new();
        for moment in 0..MOMENTS {
            while state.step < moment * (physics.step_count - steps) / (MOMENTS - 1) {
                integrator.step(&mut state);
            }
            states.push(state.clone());
        }
        Ok(Self { physics, states, steps })
    }

    /// One state in which every contact is closed and every bead moves: all of the work, all of the time.
    fn all_closed(config: &RunConfig, steps: u64) -> Result<Self, Error> {
        let physics = Physics::resolve(config)?;
        let overlap_m = 0.1 * physics.scales().length_m;
        let u_m: Vec<f64> = (0..physics.beads).rev().map(|i| i as f64 * overlap_m).collect();
        let v_m_s: Vec<f64> = (0..physics.beads).map(|i| 1e-3 * (i % 7) as f64).collect();
        let states = vec![ChainState::starting_at(&physics, &u_m, &v_m_s)];
        Ok(Self { physics, states, steps })
    }

    /// One state in which every bead moves a little.
    pub(super) fn all_moving(config: &RunConfig, steps: u64) -> Result<Self, Error> {
        let physics = Physics::resolve(config)?;
        let v_m_s: Vec<f64> = (0..physics.beads).map(|i| 1e-3 * ((i * i) % 7) as f64).collect();
        let u_m = vec![0.0; v_m_s.len()];
        Ok(Self { states: vec![ChainState::starting_at(&physics, &u_m, &v_m_s)], physics, steps })
    }

    pub(super) fn bead_steps(&self) -> f64 {
        (self.physics.beads * self.steps) as f64 * self.states.len() as f64
    }

    /// Time of all steps, without the preparations.
    fn time(&self, mut advance: impl FnMut(&ChainState) -> Duration) -> Duration {
        self.states.iter().map(&mut advance).sum()
    }

    pub(super) fn ours(&self, arch: Arch) -> Duration {
        self.by(&Integrator::with_arch(&self.physics, arch))
    }

    /// The same, with `count` tangents beside the state.
    pub(super) fn with_tangents(&self, count: usize) -> Result<Duration, Error> {
        let mut integrator = Integrator::with_tangents(&self.physics, count)?;
        if let Some(tangents) = integrator.tangents() {
            tangents.spread(&tangents.weights(self.physics.scales().time_s));
        }
        Ok(self.by(&integrator))
    }

    fn by(&self, fresh: &Integrator) -> Duration {
        let mut integrator = fresh.clone();
        self.time(|start| {
            let mut state = start.clone();
            // the first step from a new state looks at all beads, which a run does once
            integrator.clone_from(fresh);
            integrator.step(&mut state);
            let began = Instant::now();
            let last = state.step + self.steps;
            while state.step < last {
                integrator.advance(&mut state, last);
            }
            began.elapsed()
        })
    }

    fn plain(&self) -> Duration {
        self.time(|start| {
            let mut state = start.clone();
            let mut scalar = ScalarLoop::new(&self.physics, &state);
            let began = Instant::now();
            for _ in 0..self.steps {
                scalar.step(&mut state);
            }
            std::hint::black_box(&state);
            began.elapsed()
        })
    }

    fn against_plain(&self, what: &'static str, arch: Arch, floor: f64, rounds: u32) -> Result<Row, Error> {
        let rounds = Rounds::alternate(rounds, || Ok(self.ours(arch)), || Ok(self.plain()))?;
        let figure = format!("{:.2} ns a bead-step", rounds.ours_s() / self.bead_steps() * 1e9);
        Ok(rounds.row(what, "a plain scalar loop with powf", Floor::AtLeast(floor), figure))
    }
}

/// A step against a plain loop, for two exponents, and along the length of the chain.
pub(super) fn rows(bench: &Bench, report: &mut Report) -> Result<(), Error> {
    let rounds = bench.rounds;
    let run = Moments::of(&light_impurity(), STEPS)?;
    report.row(run.against_plain("velocity-Verlet step, no output", Arch::new(), 12.3, rounds)?)?;
    let closed = |method: Method, alpha: f64| {
        let mut config = light_impurity();
        (config.integrator.method, config.chain.alpha) = (method, Some(alpha));
        Moments::all_closed(&config, STEPS)
    };
    let general = closed(Method::VelocityVerlet, 1.3)?;
    let widest = "the same, α = 1.3, all contacts closed";
    report.row(general.against_plain(widest, Arch::new(), 10.0, rounds)?)?;
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(avx2) = pulp::x86::V3::try_new() {
            report.row(general.against_plain("with AVX2", Arch::V3(avx2), 7.0, rounds)?)?;
        }
        report.row(general.against_plain("with SSE2", Arch::Scalar, 3.5, rounds)?)?;
    }
    let (general, hertz) = (closed(Method::Rkn4, 1.3)?, closed(Method::Rkn4, 1.5)?);
    let times = |moments: &Moments| Ok(moments.ours(Arch::new()));
    let turns = Rounds::alternate(rounds, || times(&general), || times(&hertz))?;
    let figure = format!("{:.2} ns a bead-step", turns.ours_s() / general.bead_steps() * 1e9);
    report.row(turns.row("rkn4, α = 1.3, all contacts closed", "α = 1.5", Floor::AtMost(2.6), figure))?;
    report.row(length(rounds)?)
}

/// The light-impurity run by velocity-Verlet.
pub(super) fn light_impurity() -> RunConfig {
    let mut config = PRESETS[0].config();
    config.integrator.method = Method::VelocityVerlet;
    config
}

/// Cost of a bead-step in a chain of a million beads against one of a thousand.
fn length(rounds: u32) -> Result<Row, Error> {
    let moments = |beads: u64, steps: u64| {
        let mut config = light_impurity();
        (config.chain.beads, config.chain.impurities[0].bead) = (beads, beads / 2);
        Moments::all_closed(&config, steps)
    };
    let (long, short) = (moments(1_000_000, LONG_STEPS)?, moments(1000, STEPS)?);
    let per_bead_step = |moments: &Moments| moments.ours(Arch::new()).div_f64(moments.bead_steps() / 1e6);
    let rounds = Rounds::alternate(rounds, || Ok(per_bead_step(&long)), || Ok(per_bead_step(&short)))?;
    let figure = format!("{:.2} ns a bead-step", rounds.ours_s() * 1e3);
    Ok(rounds.row("cost of a bead-step, N = 1,000,000", "N = 1000", Floor::AtMost(2.5), figure))
}
