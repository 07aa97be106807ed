//! Chains that go beyond one struck bead and one power law, drawn from a seed.

use super::{Kind, Random};
use schemas::config::{
    Disorder, Disordered, End, Gaussian, MassRule, ModeShape, OnSite, Profile, Resonators, RunConfig,
    SecondPower, Sphere, Spheres, StiffnessRule, StrikerConfig, Thermal,
};
use schemas::drive::{self, Drive, Interpolation, Place, Quantity, Side, Sine, Step, Table, Waveform};
use schemas::material::Material;
use schemas::method::Method;
use schemas::term::{Spring, TermLaw, Toda};

/// Makes the chain `config`, whose collisions have the length `length_m` and take `time_s`, one of `kind`. Small chains are as likely as large ones.
pub(super) fn change(random: &mut Random, config: &mut RunConfig, kind: Kind, length_m: f64, time_s: f64) {
    let last = config.chain.beads - 1;
    let tangent = 1.5e7 * length_m.powf(config.chain.alpha.unwrap() - 1.0);
    match kind {
        Kind::Disorder => disorder(random, config),
        Kind::Spheres => spheres(random, config),
        Kind::Bonds | Kind::Toda => bonds(random, config, kind),
        Kind::Alphas => {
            // equally stiff at an overlap of L, or nearly so
            plain(config);
            let alphas = [config.chain.alpha.unwrap(), random.ratio(1.2, 4.0)];
            let stiffness = alphas.map(|alpha| {
                random.ratio(0.2, 5.0) * 1e7 * length_m.powf(config.chain.alpha.unwrap() - alpha)
            });
            config.chain.alphas = Some(Profile::Pattern(alphas.to_vec()));
            config.chain.stiffnesses = StiffnessRule::Pattern(stiffness.to_vec());
        }
        Kind::Second => {
            plain(config);
            let alpha = random.ratio(1.2, 4.0);
            let stiffness =
                random.ratio(0.01, 10.0) * 1e7 * length_m.powf(config.chain.alpha.unwrap() - alpha);
            config.chain.second = Some(SecondPower { alpha, stiffness: Profile::Same(stiffness) });
        }
        Kind::Ring => {
            (config.ends.left, config.ends.right) = (End::Periodic, End::Periodic);
            config.chain.stiffnesses = StiffnessRule::Uniform;
        }
        Kind::Resonators => {
            let (mass_kg, stiffness) = (random.ratio(0.1e-3, 3e-3), tangent * random.ratio(0.01, 3.0));
            config.resonators = Some(Resonators {
                mass_kg: Profile::Same(mass_kg),
                stiffness_n_per_m: Profile::Same(stiffness),
            });
        }
        Kind::OnSite => {
            let linear = tangent * random.ratio(0.01, 3.0);
            let cubic = random.happens(0.5).then(|| linear / (length_m * length_m));
            config.on_site = OnSite {
                linear_n_per_m: Some(Profile::Same(linear)),
                cubic_n_per_m3: cubic.map(Profile::Same),
                drag_n_s_per_m: None,
            };
        }
        Kind::Gaps => {
            let gaps = (0..last).map(|_| length_m * random.ratio(0.01, 3.0)).collect();
            config.chain.gaps_m = Some(Profile::List(gaps));
            if random.happens(0.5) {
                (config.ends.left, config.ends.right) = (End::Fixed, End::Fixed);
            }
        }
        Kind::Initial => initial(random, config, length_m),
        Kind::Absorbing => {
            config.ends.right = End::Absorbing;
            if random.happens(0.5) {
                config.on_site.drag_n_s_per_m = Some(Profile::Same(random.ratio(1e-3, 0.3) * 1e-3 / time_s));
            }
        }
        Kind::DrivenWall | Kind::DrivenBead | Kind::Pushed => driven(random, config, kind, length_m, time_s),
        Kind::Jumps => jumping(random, config, length_m, time_s),
        _ => {}
    }
}

/// Which method a kind needs, where that is not the one that was asked for.
pub(super) fn method(kind: Kind, asked: Method) -> Method {
    if kind == Kind::Absorbing { Method::Rk5 } else { asked }
}

fn plain(config: &mut RunConfig) {
    config.chain.stiffnesses = StiffnessRule::Uniform;
    config.chain.contacts.clear();
}

fn disorder(random: &mut Random, config: &mut RunConfig) {
    config.seed = random.below(1000);
    let of = if random.happens(0.5) { Disordered::Masses } else { Disordered::Stiffnesses };
    let mut one =
        Disorder { of, uniform: None, normal: None, log_normal: None, two_valued: None, permuted: false };
    if random.happens(0.5) {
        one.uniform = Some(random.between(0.05, 0.9));
    } else {
        one.log_normal = Some(random.between(0.05, 0.7));
    }
    config.disorder = vec![one];
    // half of them are what else would be a chain of the paper
    if random.happens(0.5) {
        plain(config);
        config.chain.masses = MassRule::Uniform;
    }
    ends(random, config);
}

/// Free ends as often as not, else walls at one or both.
fn ends(random: &mut Random, config: &mut RunConfig) {
    let mut end = || if random.happens(0.7) { End::Free } else { End::Fixed };
    (config.ends.left, config.ends.right) = (end(), end());
}

fn spheres(random: &mut Random, config: &mut RunConfig) {
    plain(config);
    config.chain.masses = MassRule::Uniform;
    config.chain.impurities.clear();
    config.chain.alpha = Some(1.5);
    let steel = Material { density_kg_m3: 7780.0, young_pa: 203e9, poisson: 0.3 };
    let soft = Material { density_kg_m3: 2150.0, young_pa: 1.46e9, poisson: 0.46 };
    let mut sphere = || Sphere {
        radius_m: random.ratio(2e-3, 10e-3),
        material: if random.happens(0.7) { steel } else { soft },
    };
    let pattern: Vec<Sphere> = (0..2).map(|_| sphere()).collect();
    let first = random.happens(0.3).then(|| vec![pattern[0]]);
    let spheres = Spheres(first.unwrap_or(pattern));
    (config.chain.bead_mass_kg, config.chain.stiffness) = (None, None);
    config.chain.spheres = Some(spheres);
    config.striker.velocity_m_s = config.striker.velocity_m_s.signum() * random.ratio(0.01, 5.0);
    ends(random, config);
}

/// Masses of 1 kg on springs of 1 N/m, with nonlinear parts up to some ten times as strong as that.
fn bonds(random: &mut Random, config: &mut RunConfig, kind: Kind) {
    plain(config);
    config.chain.masses = MassRule::Uniform;
    config.chain.impurities.clear();
    if random.happens(0.5) {
        let bead = random.below(config.chain.beads);
        config.chain.impurities = vec![schemas::config::Impurity { bead, mass_kg: random.ratio(0.05, 5.0) }];
    }
    (config.chain.bead_mass_kg, config.chain.alpha, config.chain.stiffness) =
        (Some(1.0), Some(1.0), Some(1.0));
    let speed_m_s = random.ratio(0.01, 2.0);
    config.striker = StrikerConfig { bead: config.striker.bead, velocity_m_s: speed_m_s }.into();
    let spring = |n: u8, stiffness: f64| (TermLaw::Spring(Spring(n)), stiffness);
    let laws = if kind == Kind::Toda {
        vec![(TermLaw::Toda(Toda(random.ratio(0.1, 50.0))), 1.0)]
    } else if random.happens(0.5) {
        vec![spring(1, 1.0), spring(3, random.ratio(0.01, 10.0))]
    } else {
        vec![spring(1, 1.0), spring(2, 0.25 / speed_m_s), spring(3, 0.1 / (speed_m_s * speed_m_s))]
    };
    config.chain.bonds = Some(laws.into_iter().collect());
    if random.happens(0.2) {
        config.striker = StrikerConfig { bead: 0, velocity_m_s: 0.0 }.into();
        let energy_j = Some(random.ratio(0.01, 0.3));
        config.initial.thermal = Some(Thermal { temperature_k: None, energy_j });
    }
    ends(random, config);
    config.time.duration_s = random.ratio(20.0, 300.0);
}

/// Displacements or velocities of many beads in place of a striker, loaded as often as not.
fn initial(random: &mut Random, config: &mut RunConfig, length_m: f64) {
    config.striker = StrikerConfig { bead: 0, velocity_m_s: 0.0 }.into();
    let (displacement_m, velocity_m_s) = if random.happens(0.5) {
        (length_m * random.ratio(0.1, 3.0), 0.0)
    } else {
        (0.0, random.ratio(0.5, 5.0))
    };
    if random.happens(0.7) {
        let bead = random.below(config.chain.beads) as f64;
        let width_beads = random.between(0.5, 5.0);
        config.initial.gaussian = Some(Gaussian { bead, width_beads, displacement_m, velocity_m_s });
    } else {
        let number = 1 + random.below(config.chain.beads - 1);
        config.initial.mode = Some(ModeShape { number, displacement_m, velocity_m_s });
    }
    ends(random, config);
}

/// A sine that grows over some periods, or a Gaussian, of a period of 2 to 50 T; loaded as often as not.
fn driven(random: &mut Random, config: &mut RunConfig, kind: Kind, length_m: f64, time_s: f64) {
    config.striker = StrikerConfig { bead: 0, velocity_m_s: 0.0 }.into();
    ends(random, config);
    let is_loaded = random.happens(0.5);
    if is_loaded {
        config.load.precompression_n =
            1e7 * (length_m * random.ratio(0.1, 3.0)).powf(config.chain.alpha.unwrap());
    }
    let period_s = time_s * random.ratio(2.0, 50.0);
    let (at, prescribes, amplitude) = match kind {
        Kind::DrivenWall => {
            config.ends.left = End::Fixed;
            (Place::Wall(Side::Left), Quantity::Displacement, length_m * random.ratio(0.01, 3.0))
        }
        Kind::DrivenBead => {
            let bead = random.below(config.chain.beads);
            (Place::Bead(bead), Quantity::Velocity, 5.0 * random.ratio(0.01, 1.0))
        }
        _ => {
            let bead = random.below(config.chain.beads);
            let force_n = 1e7 * (length_m * random.ratio(0.01, 1.0)).powf(config.chain.alpha.unwrap());
            (Place::Bead(bead), Quantity::Force, force_n)
        }
    };
    let waveform = if random.happens(0.5) {
        let (frequency_hz, ramp_s) = (1.0 / period_s, period_s * random.between(1.0, 4.0));
        Waveform::Sine(Sine {
            amplitude,
            frequency_hz,
            phase_rad: 0.0,
            ramp_s,
            until_s: None,
            ramp_down_s: 0.0,
        })
    } else {
        let width_s = 0.2 * period_s;
        Waveform::Gaussian(drive::Gaussian { amplitude, at_s: 9.0 * width_s, width_s, frequency_hz: 0.0 })
    };
    config.drive = vec![Drive { at, prescribes, waveform }];
    config.time.duration_s = config.time.duration_s.max(3.0 * period_s);
}

/// Forces and velocities that jump, displacements along straight lines, a sine that is cut off: at any moment of a step.
fn jumping(random: &mut Random, config: &mut RunConfig, length_m: f64, time_s: f64) {
    config.striker = StrikerConfig { bead: 0, velocity_m_s: 0.0 }.into();
    ends(random, config);
    if random.happens(0.5) {
        config.load.precompression_n =
            1e7 * (length_m * random.ratio(0.1, 3.0)).powf(config.chain.alpha.unwrap());
    }
    let mut time = 0.0;
    let mut later_s = || {
        time += time_s * random.ratio(0.01, 5.0);
        time
    };
    let times_s = vec![0.0, later_s(), later_s(), later_s(), 1e3];
    let force_n = 1e7 * (length_m * random.ratio(0.01, 1.0)).powf(config.chain.alpha.unwrap());
    let speed_m_s = 5.0 * random.ratio(0.01, 1.0);
    let bead = Place::Bead(random.below(config.chain.beads));
    let (at_s, interpolation) = (times_s[1], Interpolation::Linear);
    let steps = |amplitude: f64| Waveform::Step(Step { amplitude, at_s, rise_s: 0.0 });
    let (at, prescribes, waveform) = match random.below(5) {
        0 => (bead, Quantity::Force, steps(force_n)),
        1 => (bead, Quantity::Velocity, steps(speed_m_s)),
        2 => {
            let values = vec![0.0, 0.0, force_n, 0.0, 0.0];
            (bead, Quantity::Force, Waveform::Table(Table { times_s, values, interpolation }))
        }
        3 => {
            let (frequency_hz, until_s) = (0.05 / time_s, Some(times_s[3] + time_s));
            let sine = Sine {
                amplitude: force_n,
                frequency_hz,
                phase_rad: 0.0,
                ramp_s: 0.0,
                until_s,
                ramp_down_s: 0.0,
            };
            (bead, Quantity::Force, Waveform::Sine(sine))
        }
        _ => {
            config.ends.left = End::Fixed;
            let step_m = speed_m_s * (times_s[2] - times_s[1]);
            let values = vec![0.0, 0.0, step_m, step_m, step_m];
            let table = Table { times_s, values, interpolation };
            (Place::Wall(Side::Left), Quantity::Displacement, Waveform::Table(table))
        }
    };
    config.drive = vec![Drive { at, prescribes, waveform }];
}
