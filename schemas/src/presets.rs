//! Ready-made configurations: the runs of the paper, and an example of each thing beyond it.

mod field;

use crate::config::{DampingConfig, End, Impurity, MassRule, RunConfig, StiffnessRule};

/// A configuration with a name and a sentence about it.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// Name on the command line, and of the run.
    pub name: &'static str,
    /// A sentence about the things that the run shows.
    pub about: &'static str,
    beads: u64,
    duration_s: f64,
    /// Changes a configuration of equal beads with free ends into that of the preset.
    change: fn(&mut RunConfig),
}

/// Every preset; the first is the default.
pub const PRESETS: [Preset; 23] = [
    Preset {
        name: "light-impurity",
        about: "1000 beads, bead 500 of 0.6 g: the impurity rattles and emits solitary waves both ways",
        beads: 1000,
        duration_s: 0.08,
        change: |config| impurity(config, 500, 0.6e-3),
    },
    Preset {
        name: "heavy-impurity",
        about: "1000 beads, bead 500 of 10 g: the transmitted wave breaks up into a train",
        beads: 1000,
        duration_s: 0.08,
        change: |config| impurity(config, 500, 10e-3),
    },
    Preset {
        name: "homogeneous",
        about: "200 equal beads: one solitary wave",
        beads: 200,
        duration_s: 0.016,
        change: |_| {},
    },
    Preset {
        name: "striker-3g",
        about: "100 beads struck by a first bead of 3 g: several solitary waves",
        beads: 100,
        duration_s: 0.007,
        change: |config| impurity(config, 0, 3e-3),
    },
    Preset {
        name: "striker-10g",
        about: "100 beads struck by a first bead of 10 g: a longer train",
        beads: 100,
        duration_s: 0.007,
        change: |config| impurity(config, 0, 10e-3),
    },
    Preset {
        name: "dimer",
        about: "beads of 1 g and 0.3428 g in turn: a solitary wave that leaves nothing behind",
        beads: 200,
        duration_s: 0.014,
        change: |config| config.chain.masses = MassRule::PatternKg(vec![1e-3, 0.3428e-3]),
    },
    Preset {
        name: "tapered",
        about: "spheres that get smaller, stiffness by their radii: the pulse speeds up",
        beads: 100,
        duration_s: 0.006,
        change: |config| {
            config.chain.masses = MassRule::Taper(0.97);
            config.chain.stiffnesses = StiffnessRule::Radii;
        },
    },
    Preset {
        name: "precompressed",
        about: "200 beads pressed together by 10 N, weakly struck: sound, with its dispersion",
        beads: 200,
        duration_s: 0.015,
        change: |config| {
            config.load.precompression_n = 10.0;
            config.striker.velocity_m_s = 0.01;
        },
    },
    Preset {
        name: "gravity",
        about: "a column of 300 beads under its weight, weakly struck from above: sound speeds up with depth",
        beads: 300,
        duration_s: 0.035,
        change: |config| {
            config.ends.right = End::Fixed;
            config.load.gravity_m_s2 = 9.81;
            config.striker.velocity_m_s = 1e-4;
        },
    },
    Preset {
        name: "walls",
        about: "50 beads between two walls: the solitary wave runs to and fro, and breaks up",
        beads: 50,
        duration_s: 0.02,
        change: |config| (config.ends.left, config.ends.right) = (End::Fixed, End::Fixed),
    },
    Preset {
        name: "damped",
        about: "60 beads with a coefficient of restitution of 0.95: the pulse decays",
        beads: 60,
        duration_s: 0.006,
        change: |config| config.damping = Some(DampingConfig::Restitution(0.95)),
    },
    Preset {
        name: "band-gap",
        about: "100 beads of 2 g and 1 g in turn under 10 N, the left wall shaken within the gap: it passes no energy on",
        beads: 100,
        duration_s: 0.05,
        change: field::band_gap,
    },
    Preset {
        name: "steel-spheres",
        about: "52 spheres of bearing steel, 8 mm wide, struck at 1 m/s: the chain of an experiment",
        beads: 52,
        duration_s: 0.8e-3,
        change: field::steel_spheres,
    },
    Preset {
        name: "fput-alpha",
        about: "31 masses on springs that are not quite linear, in their lowest mode: it gives its energy away and gets it back",
        beads: 31,
        duration_s: 10_500.0,
        change: field::fput_alpha,
    },
    Preset {
        name: "collision",
        about: "200 beads struck at both ends: two solitary waves meet and leave small ones behind",
        beads: 200,
        duration_s: 0.016,
        change: field::collision,
    },
    Preset {
        name: "disordered",
        about: "400 masses at random on equal linear springs, the middle one struck: much of the energy stays there",
        beads: 400,
        duration_s: 0.018,
        change: field::disordered,
    },
    Preset {
        name: "driven-damped",
        about: "40 beads with dashpots under 10 N, the first pushed and pulled by 4 N: what goes in, the contacts take up",
        beads: 40,
        duration_s: 0.02,
        change: field::driven_damped,
    },
    Preset {
        name: "absorbing",
        about: "300 beads whose last 60 are slowed down: the solitary wave does not come back",
        beads: 300,
        duration_s: 0.04,
        change: field::absorbing,
    },
    Preset {
        name: "resonators",
        about: "100 beads under 10 N, each with a mass on a spring inside, the left wall shaken in the gap that these make",
        beads: 100,
        duration_s: 0.05,
        change: field::resonators,
    },
    field::SOLITON,
    Preset {
        name: "piston",
        about: "200 beads and a wall that moves at 1 m/s: a shock of solitary waves runs ahead of it",
        beads: 200,
        duration_s: 0.02,
        change: field::piston,
    },
    Preset {
        name: "thermal",
        about: "100 masses on springs with a cubic part, with velocities as of a temperature: energy is in all modes",
        beads: 100,
        duration_s: 100.0,
        change: field::thermal,
    },
    Preset {
        name: "hot-and-cold",
        about: "32 masses on springs with a cubic part, between a hot and a cold bath: heat flows through them",
        beads: 32,
        duration_s: 5_000.0,
        change: field::hot_and_cold,
    },
];

/// One bead of another mass.
fn impurity(config: &mut RunConfig, bead: u64, mass_kg: f64) {
    config.chain.impurities = vec![Impurity { bead, mass_kg }];
}

impl Preset {
    /// The preset of that name.
    pub fn find(name: &str) -> Option<Self> {
        PRESETS.into_iter().find(|preset| preset.name == name)
    }

    /// Its configuration. Unless the preset changes it: Hertz contacts, beads of 1 g, k = 1e7 N·m^−3/2, bead 0 at 5 m/s.
    #[expect(clippy::missing_panics_doc, reason = "a test makes every preset")]
    pub fn config(&self) -> RunConfig {
        let Self { name, beads, duration_s, .. } = self;
        let plain = format!(
            "name = \"{name}\"\n\
             chain = {{ beads = {beads}, bead_mass_kg = 1e-3, alpha = 1.5, stiffness = 1e7 }}\n\
             striker = {{ bead = 0, velocity_m_s = 5.0 }}\n\
             time = {{ duration_s = {duration_s:?} }}"
        );
        let mut config = RunConfig::from_toml(&plain).expect("equal beads, the first of which is struck");
        (self.change)(&mut config);
        config.integrator.method = config.default_method();
        config
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::Physics;

    #[test]
    fn every_preset_is_a_valid_run() {
        for preset in PRESETS {
            let config = preset.config();
            assert_eq!(RunConfig::from_toml(&config.to_toml()).as_ref(), Ok(&config), "{}", preset.name);
            Physics::resolve(&config).expect(preset.name);
        }
    }

    /// Documents, figures and recordings count these steps.
    #[test]
    fn presets_keep_their_steps() {
        let steps = [
            ("light-impurity", 55_189),
            ("heavy-impurity", 55_189),
            ("homogeneous", 11_038),
            ("striker-3g", 4_829),
            ("striker-10g", 4_829),
            ("dimer", 31_105),
            ("tapered", 40_492),
            ("precompressed", 7_962),
            ("gravity", 14_278),
            ("walls", 73_586),
            ("damped", 33_114),
            ("band-gap", 61_239),
            ("steel-spheres", 4_013),
            ("fput-alpha", 105_000),
            ("collision", 11_038),
            ("disordered", 12_703),
            ("driven-damped", 80_000),
            ("absorbing", 67_593),
            ("resonators", 50_000),
            ("toda", 4_693),
            ("piston", 26_667),
            ("thermal", 6_205),
            ("hot-and-cold", 100_000),
        ];
        for (preset, expected) in PRESETS.iter().zip(steps) {
            let physics = Physics::resolve(&preset.config()).expect(preset.name);
            assert_eq!((preset.name, physics.step_count), expected);
        }
    }
}
