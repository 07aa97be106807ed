//! The default time step keeps the promised energy error whatever a configuration says: chains drawn from a seed.

mod beyond;

use producer::energy_error::energy_error;
use schemas::config::{DampingConfig, End, Impurity, MassRule, OddContact, RunConfig, StiffnessRule};
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::presets::Preset;

/// Numbers in a fixed order, from a seed (`SplitMix64`).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From 0 to below 1.
    fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn below(&mut self, count: u64) -> u64 {
        self.bits() % count
    }

    pub(crate) fn happens(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// As likely in each decade.
    pub(crate) fn ratio(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    fn among(&mut self, values: &[f64]) -> f64 {
        let count = values.len() as u64;
        values[usize::try_from(self.below(count)).unwrap()]
    }
}

/// What is drawn, beside masses, stiffnesses and strikers of any kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Nothing beyond the ends, no load.
    Free,
    /// A wall at one end.
    OneWall,
    /// Walls at both ends.
    TwoWalls,
    /// A load: weight, pressure or both.
    Loaded,
    /// A dashpot in each contact.
    Dashpot,
    /// A coefficient of restitution.
    Restitution,
    /// Masses or stiffnesses from a seed.
    Disorder,
    /// Spheres of one or two materials and radii.
    Spheres,
    /// Springs with quadratic and cubic parts.
    Bonds,
    /// Toda's bonds, from nearly linear to nearly hard.
    Toda,
    /// Two exponents in turn.
    Alphas,
    /// A second power in each contact.
    Second,
    /// A ring.
    Ring,
    /// Resonators in the beads.
    Resonators,
    /// Springs at the beads' places.
    OnSite,
    /// Gaps between the beads.
    Gaps,
    /// Displacements or velocities of many beads at first.
    Initial,
    /// An absorbing end, and drag.
    Absorbing,
    /// A wall that a smooth displacement moves.
    DrivenWall,
    /// A bead that a smooth velocity moves.
    DrivenBead,
    /// A bead that a smooth force pushes.
    Pushed,
    Jumps,
}

impl Kind {
    pub(crate) const ALL: [Self; 6] =
        [Self::Free, Self::OneWall, Self::TwoWalls, Self::Loaded, Self::Dashpot, Self::Restitution];

    /// The kinds that go beyond one struck bead and one power law.
    const BEYOND: [Self; 16] = [
        Self::Disorder,
        Self::Spheres,
        Self::Bonds,
        Self::Toda,
        Self::Alphas,
        Self::Second,
        Self::Ring,
        Self::Resonators,
        Self::OnSite,
        Self::Gaps,
        Self::Initial,
        Self::Absorbing,
        Self::DrivenWall,
        Self::DrivenBead,
        Self::Pushed,
        Self::Jumps,
    ];

    /// All of them.
    pub(crate) fn every() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().chain(Self::BEYOND)
    }

    pub(crate) fn is_damped(self) -> bool {
        matches!(self, Self::Dashpot | Self::Restitution)
    }
}

/// A chain of `kind` over 20 to 300 collision times; 1 g, 1e7 N·m^−α and 5 m/s but for what is drawn.
pub(crate) fn chain(random: &mut Random, kind: Kind, method: Method) -> RunConfig {
    let mut config = Preset::find("homogeneous").unwrap().config();
    config.integrator.method = method;
    // what takes more steps gets fewer beads and shorter times
    let (most_beads, longest_t) = match method {
        _ if kind.is_damped() => (15, 40.0),
        Method::Gear5 | Method::Rk5 => (25, 100.0),
        Method::Rkn4 | Method::VelocityVerlet => (60, 300.0),
    };
    config.chain.beads = 5 + random.below(most_beads - 4);
    if Kind::BEYOND.contains(&kind) {
        config.integrator.method = beyond::method(kind, method);
        let fewest = if matches!(kind, Kind::Ring | Kind::Alphas) { 3.0 } else { 2.0 };
        config.chain.beads = whole(random.ratio(fewest, most_beads as f64));
    }
    let alpha = if random.happens(0.4) {
        1.5
    } else if random.happens(0.5) {
        random.among(&[1.1, 1.2, 1.3, 1.4, 1.75, 2.0, 2.5, 3.0, 4.0, 5.0])
    } else {
        random.ratio(1.1, 5.0)
    };
    config.chain.alpha = Some(alpha);
    masses(random, &mut config);
    stiffnesses(random, &mut config);
    let last = config.chain.beads - 1;
    config.striker.bead = if random.happens(0.7) { 0 } else { random.below(last + 1) };
    if config.striker.bead == last || (config.striker.bead > 0 && random.happens(0.5)) {
        config.striker.velocity_m_s = -5.0;
    }
    let length_m = (1e-3 * 25.0 / 1e7_f64).powf(1.0 / (alpha + 1.0));
    let time_s = length_m / 5.0;
    ends(random, &mut config, kind);
    match kind {
        Kind::Loaded => load(random, &mut config, length_m),
        Kind::Dashpot => {
            config.damping = Some(DampingConfig::ViscousNSPerM(random.ratio(1e-3, 2.0) * 1e-3 / time_s));
        }
        Kind::Restitution => config.damping = Some(DampingConfig::Restitution(random.between(0.1, 0.99))),
        _ => {}
    }
    config.time.duration_s = random.ratio(20.0, longest_t) * time_s;
    beyond::change(random, &mut config, kind, length_m, time_s);
    config
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
fn whole(number: f64) -> u64 {
    number as u64
}

fn masses(random: &mut Random, config: &mut RunConfig) {
    let chain = &mut config.chain;
    let beads = usize::try_from(chain.beads).unwrap();
    chain.masses = match random.below(6) {
        0..=2 => MassRule::Uniform,
        3 => {
            let count = (2 + random.below(2)).min(chain.beads);
            MassRule::PatternKg((0..count).map(|_| random.ratio(0.1e-3, 3e-3)).collect())
        }
        4 => MassRule::Taper(random.between(0.93, 1.07)),
        _ => MassRule::ListKg((0..beads).map(|_| random.ratio(0.3e-3, 3e-3)).collect()),
    };
    if random.happens(0.5) {
        let bead = random.below(chain.beads);
        chain.impurities = vec![Impurity { bead, mass_kg: random.ratio(0.05e-3, 20e-3) }];
    }
    // a light or heavy striker at the end
    if random.happens(0.2) && chain.impurities.iter().all(|impurity| impurity.bead != 0) {
        chain.impurities.push(Impurity { bead: 0, mass_kg: random.ratio(0.05e-3, 20e-3) });
    }
}

fn stiffnesses(random: &mut Random, config: &mut RunConfig) {
    let chain = &mut config.chain;
    chain.stiffnesses = match random.below(8) {
        0 => StiffnessRule::Pattern((0..2).map(|_| random.ratio(1e6, 3e7)).collect()),
        1 if chain.alpha == Some(1.5) => StiffnessRule::Radii,
        _ => StiffnessRule::Uniform,
    };
    if random.happens(0.1) {
        let contact = random.below(chain.beads - 1);
        chain.contacts = vec![OddContact { contact, stiffness: random.ratio(1e6, 1e9) }];
    }
}

fn ends(random: &mut Random, config: &mut RunConfig, kind: Kind) {
    let ends = &mut config.ends;
    (ends.left, ends.right) = match kind {
        Kind::TwoWalls => (End::Fixed, End::Fixed),
        Kind::OneWall if random.happens(0.5) => (End::Fixed, End::Free),
        Kind::OneWall => (End::Free, End::Fixed),
        Kind::Loaded | Kind::Dashpot | Kind::Restitution => {
            let mut end = || if random.happens(0.5) { End::Free } else { End::Fixed };
            (end(), end())
        }
        _ => (End::Free, End::Free),
    };
    if ends.right == End::Fixed && random.happens(0.2) {
        ends.right_stiffness = Some(random.ratio(1e6, 1e8));
    }
}

/// Overlaps at rest of 0.001 to 30 L, from weight or pressure.
fn load(random: &mut Random, config: &mut RunConfig, length_m: f64) {
    let load_n = |overlap: f64| 1e7 * (overlap * length_m).powf(config.chain.alpha.unwrap());
    let is_pressed = random.happens(0.5);
    if is_pressed {
        config.load.precompression_n = load_n(random.ratio(1e-3, 30.0));
    }
    if !is_pressed || random.happens(0.3) {
        config.ends.right = End::Fixed;
        config.load.gravity_m_s2 = load_n(random.ratio(1e-3, 3.0)) / 1e-3;
    }
}

/// What `docs/NUMERICS.md` promises of max|ΔE/E|.
pub(crate) fn promise(config: &RunConfig) -> f64 {
    let chain = &config.chain;
    let is_even = chain.masses.is_uniform() && chain.stiffnesses.is_uniform() && chain.contacts.is_empty();
    let is_struck = config.disorder.is_empty() && config.initial.is_none() && config.drive.is_empty();
    let is_plain = is_struck
        && chain.alphas.is_none()
        && chain.second.is_none()
        && chain.gaps_m.is_none()
        && config.on_site.is_none()
        && config.resonators.is_none();
    let is_of_the_paper = is_even && is_plain && config.ends.is_free() && config.load.is_none();
    let is_blunt = chain.spheres.is_some() || chain.alphas.is_some() || chain.gaps_m.is_some();
    match (config.damping, config.integrator.method) {
        (None, Method::Rkn4) if !config.drive.is_empty() => 3e-6,
        (None, Method::Rkn4) if is_blunt => 5e-7,
        (Some(DampingConfig::ViscousNSPerM(_)), _) => 1e-3,
        (Some(DampingConfig::Restitution(_)), _) => 2e-4,
        (None, Method::VelocityVerlet) => 1e-5,
        (None, Method::Rkn4) if is_of_the_paper && chain.alpha > Some(1.3) && chain.alpha < Some(2.0) => 5e-7,
        (None, Method::Rkn4 | Method::Gear5) => 1e-7,
        (None, Method::Rk5) => 5e-7,
        (Some(DampingConfig::KuwabaraKonoS(_) | DampingConfig::Power(_)), _) => 1e-4,
    }
}

/// max|ΔE/E| with the default step, looked at about fifty times in a collision time.
pub(crate) fn error(config: &RunConfig) -> f64 {
    let physics = Physics::resolve(config).unwrap();
    let look_every = (0.02 * physics.scales().time_s / physics.dt_s).max(1.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
    let look_every = look_every as u64;
    energy_error(&physics, u64::MAX, look_every, |_| {}).largest
}

/// Holds `count` chains of each of `kinds` to what is promised of them, and prints what they came to.
#[expect(clippy::print_stdout, reason = "what was found, for who looks with --nocapture")]
fn search(seed: u64, count: u64, method: Method, kinds: &[Kind]) {
    let mut broken = Vec::new();
    for kind in kinds {
        let mut random = Random(seed);
        let mut errors = Vec::new();
        for index in 0..count {
            let config = chain(&mut random, *kind, method);
            let (found, promised) = (error(&config), promise(&config));
            errors.push(found);
            if found >= promised || found.is_nan() {
                let physics = Physics::resolve(&config).unwrap();
                let limit = physics.limit_words(physics.usual_step().1);
                broken.push(format!(
                    "{method}, {kind:?}, chain {index}: {found:e}, {limit}\n{}",
                    config.to_toml()
                ));
            }
        }
        errors.sort_by(f64::total_cmp);
        let above = errors.iter().filter(|error| **error >= 1e-7).count();
        let [median, most] = [errors.len() / 2, errors.len() - 1].map(|place| errors[place]);
        println!(
            "{method}, {kind:?}: {count} chains, max|ΔE/E| = {most:.1e}, median {median:.1e}, {above} above 1e-7"
        );
    }
    assert!(broken.is_empty(), "{} chains break their promise:\n{}", broken.len(), broken.join("\n"));
}

const UNDAMPED: [Kind; 4] = [Kind::Free, Kind::OneWall, Kind::TwoWalls, Kind::Loaded];

#[test]
fn rkn4_keeps_the_energy_of_random_chains() {
    search(1, 40, Method::Rkn4, &UNDAMPED);
}

#[test]
fn gear5_and_velocity_verlet_keep_the_energy_of_random_chains() {
    search(2, 8, Method::Gear5, &UNDAMPED);
    search(3, 8, Method::VelocityVerlet, &UNDAMPED);
}

#[test]
fn energy_and_dissipated_work_of_random_damped_chains_add_up() {
    search(4, 10, Method::Rk5, &[Kind::Dashpot, Kind::Restitution]);
}

#[test]
fn energy_of_random_chains_of_every_other_kind_is_kept() {
    search(5, 4, Method::Rkn4, &Kind::BEYOND);
}

/// More of them, for another seed: `BEADLINE_CHAINS=SEED cargo test -p beadline-producer more_random -- --nocapture`.
#[test]
fn more_random_chains_keep_their_energy_if_asked() {
    let Some(seed) = std::env::var("BEADLINE_CHAINS").ok().and_then(|seed| seed.parse().ok()) else { return };
    search(seed, 400, Method::Rkn4, &UNDAMPED);
    search(seed, 60, Method::Gear5, &UNDAMPED);
    search(seed, 60, Method::Rk5, &Kind::ALL);
    search(seed, 60, Method::VelocityVerlet, &UNDAMPED);
}

/// A thousand chains of the other kinds: `BEADLINE_CHAINS=SEED cargo test -p beadline-producer other_random -- --nocapture`.
#[test]
fn other_random_chains_keep_their_energy_if_asked() {
    let Some(seed) = std::env::var("BEADLINE_CHAINS").ok().and_then(|seed| seed.parse().ok()) else { return };
    search(seed, 67, Method::Rkn4, &Kind::BEYOND);
}
