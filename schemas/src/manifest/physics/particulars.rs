//! A run in words, for captions and listings.

use super::Physics;
use crate::amounts::{counted, typed, typed_quantity};
use crate::bath::Bath;
use crate::config::{
    Disorder, Disordered, End, MassRule, OddContact, OddSphere, Sphere, StiffnessRule, TwoValued,
};
use crate::damping::Damping;
use crate::drive::Drive;
use crate::material::{MATERIALS, Material};

/// Largest number of values that are written out.
const SHOWN: usize = 4;

impl Physics {
    /// The differences from equal beads with free ends, but for the impurities: a phrase each, in SI units.
    ///
    /// ```
    /// use schemas::{manifest::Physics, presets::Preset};
    /// let physics = Physics::resolve(&Preset::find("gravity").ok_or("no preset")?.config())?;
    /// assert_eq!(physics.particulars(), ["wall on the right", "g = 9.81 m/s²"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn particulars(&self) -> Vec<String> {
        let mut phrases = Vec::new();
        phrases.extend(match &self.masses {
            MassRule::Uniform => None,
            MassRule::PatternKg(pattern) => Some(format!("masses of {} kg in turn", first_of(pattern))),
            MassRule::Taper(ratio) => Some(format!("each bead {ratio} times as heavy as the one before")),
            MassRule::ListKg(_) => Some("masses from a list".to_owned()),
        });
        phrases.extend(match &self.stiffnesses {
            StiffnessRule::Uniform => None,
            StiffnessRule::Radii => Some("stiffnesses of spheres by their radii".to_owned()),
            StiffnessRule::Pattern(pattern) => {
                Some(format!("stiffnesses of {} N/m^α in turn", first_of(pattern)))
            }
            StiffnessRule::List(_) => Some("stiffnesses from a list".to_owned()),
        });
        let odd = |odd: &OddContact| format!("contact {}: {:e} N/m^α", odd.contact, odd.stiffness);
        phrases.extend(first_few(&self.contacts, odd, "odd contacts"));
        phrases.extend(self.walls_in_words().map(str::to_owned));
        self.ends_in_words(&mut phrases);
        let load = &self.load;
        phrases.extend((load.gravity_m_s2 != 0.0).then(|| format!("g = {} m/s²", load.gravity_m_s2)));
        phrases.extend(
            (load.precompression_n != 0.0).then(|| format!("pressed by {} N", load.precompression_n)),
        );
        phrases.extend(self.damping.iter().map(Damping::words));
        self.additions_in_words(&mut phrases);
        phrases
    }

    /// Adds a phrase for each thing beyond one struck bead and one power law.
    fn additions_in_words(&self, phrases: &mut Vec<String>) {
        if let Some(spheres) = &self.spheres {
            let words = first_few(&spheres.0, sphere_in_words, "kinds of spheres");
            let in_turn = if spheres.0.len() > 1 { " in turn" } else { "" };
            phrases.push(format!("spheres of {}{in_turn}", words.join(", ")));
        }
        let odd = |odd: &OddSphere| format!("bead {}: {}", odd.bead, sphere_in_words(&odd.sphere));
        phrases.extend(first_few(&self.odd_spheres, odd, "other spheres"));
        phrases.extend(self.alphas.as_ref().map(|alphas| format!("α of {}", first_of(alphas.written()))));
        phrases.extend(self.second.as_ref().map(|second| format!("a second power, α = {}", second.alpha)));
        phrases.extend(self.gaps_m.as_ref().map(|_| "gaps".to_owned()));
        if let Some(bonds) = &self.bonds {
            let kinds = bonds.laws().map(|bond| {
                let of = |(_, unit)| format!(" ({} {unit})", typed(bond.law.named().1));
                let parameter = bond.form.parameter.map(of).unwrap_or_default();
                format!("{} {}{parameter}", bond.form.words, first_of(bond.stiffness.written()))
            });
            phrases.push(format!("bonds: {}", kinds.collect::<Vec<_>>().join(", ")));
        }
        for disorder in &self.disorder {
            let of = match disorder.of {
                Disordered::Masses => "masses",
                Disordered::Radii => "radii",
                Disordered::Stiffnesses => "stiffnesses",
            };
            phrases.push(format!("disordered {of} ({})", disorder_in_words(disorder)));
        }
        let on_site = &self.on_site;
        if on_site.linear_n_per_m.is_some() || on_site.cubic_n_per_m3.is_some() {
            phrases.push("on-site springs".to_owned());
        }
        phrases.extend(on_site.drag_n_s_per_m.as_ref().map(|_| "drag".to_owned()));
        phrases.extend(self.resonators.as_ref().map(|_| "resonators".to_owned()));
        phrases.extend(first_few(&self.drives, Drive::words, "drives"));
        phrases.extend(first_few(&self.baths, Bath::words, "baths"));
        phrases.extend((!self.initial.is_none()).then(|| "an initial state".to_owned()));
        self.seeds_in_words(phrases);
        if !self.strikers.is_empty() {
            phrases.push(format!("{} strikers", self.strikers.len() + 1));
        }
    }

    /// Adds a phrase for each seed. That of the run is told where it draws, or where lists may have been drawn with it.
    fn seeds_in_words(&self, phrases: &mut Vec<String>) {
        let by_run = self.baths.iter().any(|bath| bath.seed.is_none());
        let draws = by_run || !self.disorder.is_empty() || self.initial.thermal.is_some();
        phrases.extend((draws || self.seed != 0).then(|| format!("seed {}", self.seed)));
        let own =
            self.baths.iter().zip(0..).filter_map(|(bath, i)| Some(format!("bath {i}: seed {}", bath.seed?)));
        phrases.extend(own.take(SHOWN));
    }

    /// Adds a phrase for each number and material of an end that is given.
    fn ends_in_words(&self, phrases: &mut Vec<String>) {
        let ends = &self.ends;
        for (side, stiffness, material) in [
            ("left", ends.left_stiffness, ends.left_material),
            ("right", ends.right_stiffness, ends.right_material),
        ] {
            phrases.extend(stiffness.map(|stiffness| format!("{side} wall: {stiffness:e} N/m^α")));
            phrases.extend(material.map(|wall| format!("{side} wall of {}", material_in_words(wall.0))));
        }
        phrases.extend(ends.absorbing_beads.map(|beads| format!("absorbed over {}", counted(beads, "bead"))));
        let drag = ends.absorbing_drag_n_s_per_m;
        phrases.extend(drag.map(|drag| format!("absorbed by a drag up to {} N·s/m", typed(drag))));
    }

    fn walls_in_words(&self) -> Option<&'static str> {
        match (self.ends.left, self.ends.right) {
            (End::Free, End::Free) => None,
            (End::Fixed, End::Free) => Some("wall on the left"),
            (End::Free, End::Fixed) => Some("wall on the right"),
            (End::Fixed, End::Fixed) => Some("walls at both ends"),
            (End::Periodic, _) | (_, End::Periodic) => Some("a ring"),
            (End::Absorbing, End::Absorbing) => Some("absorbing ends"),
            (End::Absorbing, End::Free) => Some("absorbing on the left"),
            (End::Free, End::Absorbing) => Some("absorbing on the right"),
            (End::Absorbing, End::Fixed) => Some("absorbing on the left, wall on the right"),
            (End::Fixed, End::Absorbing) => Some("wall on the left, absorbing on the right"),
        }
    }
}

/// `steel (radius 4.76 mm)`
fn sphere_in_words(sphere: &Sphere) -> String {
    format!("{} (radius {})", material_in_words(sphere.material), typed_quantity(sphere.radius_m, "m"))
}

fn material_in_words(material: Material) -> String {
    let Material { density_kg_m3, young_pa, poisson } = material;
    let name = MATERIALS.iter().find(|known| known.material == material).map(|known| known.name);
    name.map_or_else(
        || format!("ρ = {density_kg_m3} kg/m³, E = {} GPa and ν = {poisson}", typed(young_pa / 1e9)),
        str::to_owned,
    )
}

/// The words for a disorder: `uniform ±20 %`.
fn disorder_in_words(disorder: &Disorder) -> String {
    let percent = |part: f64| typed(100.0 * part);
    let words = [
        disorder.uniform.map(|width| format!("uniform ±{} %", percent(width))),
        disorder.normal.map(|width| format!("normal, {} %", percent(width))),
        disorder.log_normal.map(|width| format!("log-normal, s = {}", typed(width))),
        disorder
            .two_valued
            .map(|TwoValued { fraction, factor }| format!("{} % times {}", percent(fraction), typed(factor))),
        disorder.permuted.then(|| "permuted".to_owned()),
    ];
    words.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The first few values, in words.
fn first_of(values: &[f64]) -> String {
    first_few(values, f64::to_string, "values").join(", ")
}

/// The first of some things in words, and the count of all `things` if there are more.
fn first_few<T>(all: &[T], words: impl Fn(&T) -> String, things: &str) -> Vec<String> {
    let mut few: Vec<_> = all.iter().take(SHOWN).map(words).collect();
    few.extend((all.len() > SHOWN).then(|| format!("… ({} {things})", all.len())));
    few
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{DampingConfig, OddContact, RunConfig};
    use crate::method::Method;
    use crate::presets::PRESETS;

    #[test]
    fn every_particular_is_named() {
        let mut config = PRESETS[2].config();
        assert!(Physics::resolve(&config).expect("valid").particulars().is_empty());
        config.chain.masses = MassRule::PatternKg(vec![1e-3, 0.0005]);
        config.chain.stiffnesses = StiffnessRule::Pattern(vec![1.0; 5]);
        config.chain.contacts = vec![OddContact { contact: 3, stiffness: 2e6 }];
        (config.ends.left, config.ends.right) = (End::Fixed, End::Fixed);
        (config.load.gravity_m_s2, config.load.precompression_n) = (-9.81, 0.5);
        config.damping = Some(DampingConfig::Restitution(0.9));
        config.integrator.method = Method::Rk5;
        config.time.duration_s = 10.0;
        let found = Physics::resolve(&config).expect("valid").particulars();
        let expected = [
            "masses of 0.001, 0.0005 kg in turn",
            "stiffnesses of 1, 1, 1, 1, … (5 values) N/m^α in turn",
            "contact 3: 2e6 N/m^α",
            "walls at both ends",
            "g = -9.81 m/s²",
            "pressed by 0.5 N",
            "coefficient of restitution 0.9",
        ];
        assert_eq!(found, expected);
    }

    /// The particulars that a referee asks of a figure: the drives, the disorder and the materials of the chain, and the ring if it is one.
    #[test]
    fn drives_disorder_materials_and_rings_have_their_numbers() {
        let text = "seed = 7\n[chain]\nbeads = 20\nspheres = [{ material = \"steel\", radius_m = 4.76e-3 }, \
            { density_kg_m3 = 2500, young_pa = 70e9, poisson = 0.2, radius_m = 2e-3 }]\n\
            odd_spheres = [{ bead = 9, material = \"brass\", diameter_m = 6e-3 }]\n\
            [[disorder]]\nof = \"radii\"\nuniform = 0.05\n[[disorder]]\nof = \"stiffnesses\"\n\
            two_valued = { fraction = 0.3, factor = 2 }\n[ends]\nleft = \"periodic\"\nright = \"periodic\"\n\
            [[drive]]\nbead = 3\nforce_n = { sine = { amplitude = 0.25, frequency_hz = 6300 } }\n\
            [time]\nduration_s = 1e-3\n";
        let config = RunConfig::from_toml(text).expect("valid");
        let expected = [
            "a ring",
            "spheres of steel (radius 4.76 mm), ρ = 2500 kg/m³, E = 70 GPa and ν = 0.2 (radius 2 mm) in turn",
            "bead 9: brass (radius 3 mm)",
            "disordered radii (uniform ±5 %)",
            "disordered stiffnesses (30 % times 2)",
            "force on bead 3: sine of 250 mN at 6300 Hz",
            "seed 7",
        ];
        assert_eq!(Physics::resolve(&config).expect("valid").particulars(), expected);
    }

    /// Runs that differ in their seeds alone differ in nothing but that phrase.
    #[test]
    fn every_seed_is_told_that_draws() {
        let seeds = |text: &str| {
            let text = format!(
                "chain = {{ beads = 4, bead_mass_kg = 1.0, bonds = {{ linear = 1.0 }} }}\ntime = {{ duration_s = 1.0 }}\n{text}"
            );
            let physics = Physics::resolve(&RunConfig::from_toml(&text).expect("valid")).expect("valid");
            let phrases = physics.particulars().into_iter();
            phrases.filter(|phrase| phrase.contains("seed")).collect::<Vec<_>>()
        };
        let bath = |more: &str| format!("bath = [{{ temperature_j = 1.0, friction_per_s = 0.1{more} }}]\n");
        assert_eq!(seeds("striker = { bead = 0, velocity_m_s = 1.0 }"), [""; 0]);
        assert_eq!(seeds("initial = { thermal = { energy_j = 1.0 } }"), ["seed 0"]);
        assert_eq!(seeds(&format!("seed = 2\n{}", bath(""))), ["seed 2"]);
        assert_eq!(seeds(&bath(", seed = 5")), ["bath 0: seed 5"]);
    }

    #[test]
    fn ends_have_their_numbers() {
        let text = "[chain]\nbeads = 20\nspheres = [{ material = \"steel\", radius_m = 4.76e-3 }]\n\
            [ends]\nleft = \"absorbing\"\nabsorbing_beads = 5\nabsorbing_drag_n_s_per_m = 0.25\n\
            right = \"fixed\"\nright_material = \"brass\"\n[striker]\nbead = 9\nvelocity_m_s = 1.0\n[time]\nduration_s = 1e-3\n";
        let found = |text: &str| {
            let config = RunConfig::from_toml(text).expect("valid");
            Physics::resolve(&config).expect("valid").particulars()
        };
        let expected = [
            "absorbing on the left, wall on the right",
            "right wall of brass",
            "absorbed over 5 beads",
            "absorbed by a drag up to 0.25 N·s/m",
            "spheres of steel (radius 4.76 mm)",
        ];
        assert_eq!(found(text), expected);
        let of_stiffness = text.replace("right_material = \"brass\"", "right_stiffness = 3e6");
        assert_eq!(found(&of_stiffness)[1], "right wall: 3e6 N/m^α");
    }
}
