//! The runs that the figures need.

use schemas::config::{Impurity, RunConfig, StreamConfig};
use schemas::manifest::Physics;
use schemas::presets::PRESETS;

/// A run, and the things to observe in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Its configuration; the name is unique among all runs of the paper.
    pub config: RunConfig,
    /// The things to observe.
    pub watch: Watch,
    /// True if it only serves for comparison with another run.
    pub is_partner: bool,
}

/// Things to observe in a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Watch {
    /// Times (s) at which to keep the whole state: that of the first frame at or after each.
    pub kept_frames_s: Vec<f64>,
    /// Beads at which to measure the pulses that pass.
    pub probes: Vec<u64>,
    /// Contacts whose deformation to compare with theory.
    pub deformed: Vec<u64>,
    /// Beads to follow.
    pub followed: Vec<u64>,
    /// End (s) of the map of the contacts, if there is one.
    pub map_until_s: Option<f64>,
    /// Method of measuring the leading pulse, if any.
    pub front: FrontBy,
}

/// Method of measuring the leading pulse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FrontBy {
    /// Not at all.
    #[default]
    Nothing,
    /// Over the beads of one frame: for a pulse many beads long, in frames however sparse.
    Space,
    /// Over the frames at each bead: for a short pulse, in dense frames.
    Time,
}

impl Run {
    /// A chain of the paper: beads of 1 g, k = 1e7 N·m^−α, bead 0 at 5 m/s; the default step, recorded every
    /// `record_every` steps.
    pub(super) fn new(name: &str, alpha: f64, beads: u64, duration_s: f64, record_every: u64) -> Self {
        // every preset is a chain of the paper
        let mut config = PRESETS[0].config();
        config.name = Some(name.to_owned());
        config.chain.alpha = Some(alpha);
        config.chain.beads = beads;
        config.chain.impurities.clear();
        config.time.duration_s = duration_s;
        config.stream = StreamConfig { publish_every_steps: record_every, record_every_steps: record_every };
        Self { config, watch: Watch::default(), is_partner: false }
    }

    /// Gives one bead another mass (kg).
    pub(super) fn impurity(mut self, bead: u64, mass_kg: f64) -> Self {
        self.config.chain.impurities.push(Impurity { bead, mass_kg });
        self
    }

    /// Until the shock has come to `bead`, by the speed of a continuum wave of half the striker's velocity; near
    /// α = 1 the speed hardly depends on that.
    fn until_bead(mut self, bead: u64) -> Self {
        // a chain of the paper has them
        let Ok([mass_kg, alpha, stiffness]) = self.config.chain.scales() else { return self };
        let coefficient = (2.0 / (alpha + 1.0)).powf(1.0 / (alpha + 1.0));
        let stiffness = (stiffness / mass_kg).powf(1.0 / (alpha + 1.0));
        let speed = coefficient
            * stiffness
            * (0.5 * self.config.striker.velocity_m_s).powf((alpha - 1.0) / (alpha + 1.0));
        self.config.time.duration_s = bead as f64 / speed;
        self
    }

    /// Sets the step to this part of the collision time T, and records every so many T.
    fn steps(mut self, part_of_t: f64, recorded_t: f64) -> Self {
        if let Ok(physics) = Physics::resolve(&self.config) {
            self.config.time.dt_s = Some(part_of_t * physics.scales().time_s);
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small whole numbers")]
        let every = (recorded_t / part_of_t).round() as u64;
        self.config.stream = StreamConfig { publish_every_steps: every, record_every_steps: every };
        self
    }

    /// Looks at this.
    pub(super) fn watch(mut self, watch: Watch) -> Self {
        self.watch = watch;
        self
    }

    /// The same run with `factor` times its step, recorded every so many steps as before: the difference of the two
    /// shows the error of the step and of the interpolation between frames.
    pub(super) fn with_step_times(mut self, factor: u32) -> Self {
        // a configuration of ours that cannot be used is refused when the run is prepared
        if let Ok(physics) = Physics::resolve(&self.config) {
            self.config.time.dt_s = Some(f64::from(factor) * physics.dt_s);
        }
        self.config.name = Some(format!("{}-step-x{factor}", self.name()));
        self.is_partner = true;
        self
    }

    /// The same run with a striker that is one unit in the last place faster: the start does not determine a quantity
    /// that differs more than that.
    pub(super) fn twin(mut self) -> Self {
        self.config.striker.velocity_m_s = self.config.striker.velocity_m_s.next_up();
        self.config.name = Some(format!("{}-twin", self.name()));
        self.is_partner = true;
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
        kept_frames_s: vec![0.05, 0.06, 0.07, 0.08],
        probes: vec![300, 520, 600, 700, 850],
        followed: vec![500],
        map_until_s: Some(0.08),
        ..Watch::default()
    };
    Run::new("light-impurity", 1.5, 1000, 0.12, 5).impurity(500, 0.6e-3).watch(watch)
}

/// The same chain with 10 g at bead 500.
pub(super) fn heavy() -> Run {
    let watch = Watch {
        kept_frames_s: vec![0.06, 0.08],
        probes: vec![300, 700],
        followed: vec![500],
        map_until_s: Some(0.08),
        ..Watch::default()
    };
    Run::new("heavy-impurity", 1.5, 1000, 0.12, 5).impurity(500, 10e-3).watch(watch)
}

/// 200 equal beads, until the pulse has passed contact 100 (α > 1).
pub(super) fn homogeneous(alpha: f64) -> Run {
    let run = Run::new(&format!("homogeneous-alpha-{}", word(alpha)), alpha, 200, 1.0, 2).until_bead(150);
    let last_s = 0.999 * run.config.time.duration_s;
    let watch = Watch {
        deformed: vec![100, 94, 105],
        probes: vec![100],
        kept_frames_s: vec![last_s],
        ..Watch::default()
    };
    run.watch(watch)
}

/// The paper's chain of 3000 beads at α = 1.01, with a step of 0.04 T, until the pulse has passed contact 2000.
pub(super) fn homogeneous_long() -> Run {
    let run = Run::new("homogeneous-alpha-1p01-3000", 1.01, 3000, 1.0, 1).until_bead(2100).steps(0.04, 0.4);
    run.watch(Watch { deformed: vec![2000], ..Watch::default() })
}

/// 300 beads, bead 150 of `mass_g` grams, for another mass or exponent than the paper's figures have. It lasts
/// until the transmitted pulse is about to reach the end.
pub(super) fn short(mass_g: f64, alpha: f64) -> Run {
    let watch = Watch { probes: vec![75, 225], followed: vec![150], ..Watch::default() };
    let name = format!("impurity-{}g-alpha-{}", word(mass_g), word(alpha));
    Run::new(&name, alpha, 300, 1.0, 5).impurity(150, mass_g * 1e-3).until_bead(290).watch(watch)
}

/// A chain of equal beads, long enough for the pulse of an exponent near 1 to become stationary.
///
/// Up to α = 1.03 its length is measured in the beads of at most 400 frames; the step is 0.04 T, for which the energy
/// drifts by less than 1e-5. Above, it is measured over time.
pub(super) fn long(alpha: f64) -> Run {
    let beads = long_chain_beads(alpha);
    let name = format!("front-alpha-{}", word(alpha));
    let run = Run::new(&name, alpha, beads, 1.0, 1).until_bead(beads - beads / 50);
    let (front, run) = if alpha <= 1.03 {
        (FrontBy::Space, run.steps(0.04, (beads as f64 / 400.0).max(2.0).floor()))
    } else {
        (FrontBy::Time, run.steps(0.02, 0.1))
    };
    let last_s = 0.99 * run.config.time.duration_s;
    run.watch(Watch { front, kept_frames_s: vec![last_s], ..Watch::default() })
}

/// The time (s) after which the shock of a chain of 1000 beads has reached its end.
pub(super) fn until_end(alpha: f64) -> f64 {
    Run::new("end", alpha, 1000, 1.0, 1).until_bead(1000).config.time.duration_s
}

/// Beads over which a pulse becomes stationary to about 1e-6 (1e-5 at α = 1.004): 5000·(0.01/(α−1))^1.4, as
/// measured. For α = 1 there is no such number; then a chain in which its laws show.
fn long_chain_beads(alpha: f64) -> u64 {
    if alpha == 1.0 {
        return 6000;
    }
    if alpha < 1.005 {
        // the paper's 15000, and as many more as the pulse is long
        return 16_000;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "hundreds to thousands")]
    let beads = (5000.0 * (0.01 / (alpha - 1.0)).powf(1.4)).round() as u64;
    beads.max(500) / 100 * 100 + 200
}

/// The chain of 100 beads of the paper's figures, the first of `mass_g` grams.
pub(super) fn striker(mass_g: f64) -> Run {
    let watch = Watch { kept_frames_s: vec![0.007], ..Watch::default() };
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
