//! The runs that the figures need.

use schemas::config::{
    ChainConfig, Impurity, IntegratorConfig, RunConfig, StreamConfig, StrikerConfig, TimeConfig,
};
use schemas::manifest::Physics;

/// A run, and what to look at in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Its configuration; the name is unique among all runs of the paper.
    pub config: RunConfig,
    /// What to look at.
    pub watch: Watch,
}

/// What to look at in a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Watch {
    /// Times (s) at which to keep the whole state: that of the first frame at or after each.
    pub snapshots_s: Vec<f64>,
    /// Beads at which to measure the pulses that pass.
    pub probes: Vec<u64>,
    /// Beads to follow.
    pub followed: Vec<u64>,
    /// Until when (s) to map the contacts, if at all.
    pub map_until_s: Option<f64>,
}

/// The paper's parameters.
const BEAD_MASS_KG: f64 = 1e-3;
const STIFFNESS: f64 = 1e7;
const VELOCITY_M_S: f64 = 5.0;

impl Run {
    /// A chain of the paper: beads of 1 g, k = 1e7 N·m^−α, bead 0 at 5 m/s; the default step, recorded every
    /// `record_every` steps.
    pub(super) fn new(name: &str, alpha: f64, beads: u64, duration_s: f64, record_every: u64) -> Self {
        let config = RunConfig {
            name: Some(name.to_owned()),
            chain: ChainConfig {
                beads,
                bead_mass_kg: BEAD_MASS_KG,
                alpha,
                stiffness: STIFFNESS,
                impurities: Vec::new(),
            },
            striker: StrikerConfig { bead: 0, velocity_m_s: VELOCITY_M_S },
            time: TimeConfig { duration_s, dt_s: None },
            integrator: IntegratorConfig::default(),
            stream: StreamConfig { publish_every_steps: record_every, record_every_steps: record_every },
        };
        Self { config, watch: Watch::default() }
    }

    /// With one bead of another mass (kg).
    pub(super) fn impurity(mut self, bead: u64, mass_kg: f64) -> Self {
        self.config.chain.impurities.push(Impurity { bead, mass_kg });
        self
    }

    /// For this many collision times T.
    fn lasting_collision_times(mut self, times: f64) -> Self {
        if let Ok(physics) = Physics::resolve(&self.config) {
            self.config.time.duration_s = times * physics.scales().time_s;
        }
        self
    }

    /// Looks at this.
    pub(super) fn watch(mut self, watch: Watch) -> Self {
        self.watch = watch;
        self
    }

    /// The same run with `factor` times its step, recorded every so many steps as before: what differs
    /// between the two shows what the step and the interpolation between frames cost.
    pub(super) fn with_step_times(mut self, factor: u32) -> Self {
        // a configuration of ours that cannot be used is refused when the run is prepared
        if let Ok(physics) = Physics::resolve(&self.config) {
            self.config.time.dt_s = Some(f64::from(factor) * physics.dt_s);
        }
        self.config.name = Some(format!("{}-step-x{factor}", self.name()));
        self
    }

    /// Its name.
    pub fn name(&self) -> &str {
        self.config.name.as_deref().unwrap_or_default()
    }
}

/// 1000 beads, bead 500 of 0.6 g, α = 1.5, until the last of the reference's pulses has passed bead 700.
pub(super) fn light() -> Run {
    let watch = Watch {
        snapshots_s: vec![0.05, 0.06, 0.07, 0.08],
        probes: vec![300, 520, 600, 700, 850],
        followed: vec![500],
        map_until_s: Some(0.08),
    };
    Run::new("light-impurity", 1.5, 1000, 0.12, 5).impurity(500, 0.6e-3).watch(watch)
}

/// The same chain with 10 g at bead 500.
pub(super) fn heavy() -> Run {
    let watch = Watch {
        snapshots_s: vec![0.06, 0.08],
        probes: vec![300, 700],
        followed: vec![500],
        map_until_s: Some(0.08),
    };
    Run::new("heavy-impurity", 1.5, 1000, 0.12, 5).impurity(500, 10e-3).watch(watch)
}

/// 300 beads, bead 150 of `mass_g` grams, for another mass or exponent than the paper's figures have. It lasts
/// until the transmitted pulse is about to reach the end.
pub(super) fn short(mass_g: f64, alpha: f64) -> Run {
    let watch = Watch { probes: vec![75, 225], followed: vec![150], ..Watch::default() };
    // 300 beads in T each are a little more than the shock needs
    let name = format!("impurity-{}g-alpha-{}", word(mass_g), word(alpha));
    let run = Run::new(&name, alpha, 300, 1.0, 5).impurity(150, mass_g * 1e-3).watch(watch);
    run.lasting_collision_times(550.0)
}

/// The chain of 100 beads of the paper's figures, the first of `mass_g` grams.
pub(super) fn striker(mass_g: f64) -> Run {
    let watch = Watch { snapshots_s: vec![0.007], ..Watch::default() };
    Run::new(&format!("striker-{}g", word(mass_g)), 1.5, 100, 0.0071, 5)
        .impurity(0, mass_g * 1e-3)
        .watch(watch)
}

/// A longer chain with that striker, for its pulses to part.
pub(super) fn striker_long(mass_g: f64) -> Run {
    let watch = Watch { probes: vec![450], ..Watch::default() };
    let run = Run::new(&format!("striker-{}g-long", word(mass_g)), 1.5, 500, 0.12, 5);
    run.impurity(0, mass_g * 1e-3).watch(watch)
}

/// A number as part of a name: `1.5` is `1p5`.
fn word(value: f64) -> String {
    value.to_string().replace('.', "p")
}
