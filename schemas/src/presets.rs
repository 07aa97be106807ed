//! Ready-made configurations: the runs of the paper.

use crate::config::{
    ChainConfig, EndsConfig, Impurity, IntegratorConfig, LoadConfig, MassRule, RunConfig, StiffnessRule,
    StreamConfig, StrikerConfig, TimeConfig,
};

/// A configuration with a name and a sentence about it.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// Name on the command line, and of the run.
    pub name: &'static str,
    /// What the run shows.
    pub about: &'static str,
    beads: u64,
    impurity: Option<Impurity>,
    duration_s: f64,
}

/// Every preset; the first is the default.
pub const PRESETS: [Preset; 5] = [
    Preset {
        name: "light-impurity",
        about: "1000 beads, bead 500 of 0.6 g: the impurity rattles and emits solitary waves both ways",
        beads: 1000,
        impurity: Some(Impurity { bead: 500, mass_kg: 0.6e-3 }),
        duration_s: 0.08,
    },
    Preset {
        name: "heavy-impurity",
        about: "1000 beads, bead 500 of 10 g: the transmitted wave breaks up into a train",
        beads: 1000,
        impurity: Some(Impurity { bead: 500, mass_kg: 10e-3 }),
        duration_s: 0.08,
    },
    Preset {
        name: "homogeneous",
        about: "200 equal beads: one solitary wave",
        beads: 200,
        impurity: None,
        duration_s: 0.016,
    },
    Preset {
        name: "striker-3g",
        about: "100 beads struck by a first bead of 3 g: several solitary waves",
        beads: 100,
        impurity: Some(Impurity { bead: 0, mass_kg: 3e-3 }),
        duration_s: 0.007,
    },
    Preset {
        name: "striker-10g",
        about: "100 beads struck by a first bead of 10 g: a longer train",
        beads: 100,
        impurity: Some(Impurity { bead: 0, mass_kg: 10e-3 }),
        duration_s: 0.007,
    },
];

impl Preset {
    /// The preset of that name.
    pub fn find(name: &str) -> Option<Self> {
        PRESETS.into_iter().find(|preset| preset.name == name)
    }

    /// Its configuration: Hertz contacts, beads of 1 g, k = 1e7 N·m^−3/2, bead 0 at 5 m/s.
    pub fn config(&self) -> RunConfig {
        RunConfig {
            name: Some(self.name.to_owned()),
            chain: ChainConfig {
                beads: self.beads,
                bead_mass_kg: 1e-3,
                alpha: 1.5,
                stiffness: 1e7,
                masses: MassRule::Uniform,
                stiffnesses: StiffnessRule::Uniform,
                impurities: self.impurity.into_iter().collect(),
                contacts: Vec::new(),
            },
            ends: EndsConfig::default(),
            load: LoadConfig::default(),
            damping: None,
            striker: StrikerConfig { bead: 0, velocity_m_s: 5.0 },
            time: TimeConfig { duration_s: self.duration_s, dt_s: None },
            integrator: IntegratorConfig::default(),
            stream: StreamConfig::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::Physics;

    #[test]
    fn every_preset_is_a_valid_run() {
        for preset in PRESETS {
            Physics::resolve(&preset.config()).expect(preset.name);
        }
    }
}
