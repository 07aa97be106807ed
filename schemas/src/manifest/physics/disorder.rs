//! Random changes of the masses and stiffnesses that the rules give.

use super::{Physics, range};
use crate::config::{ConfigError, Disorder, Disordered, End, Sphere, StiffnessRule};
use crate::functions::exp;
use crate::philox::uniform;
use crate::random::{normal, permutation};

/// Largest number of disorders of one chain.
const MOST_DISORDERS: usize = 16;

/// Masses and stiffnesses of a chain, before powers and bonds share out the stiffnesses.
pub(super) struct Resolved {
    /// Mass of each bead (kg), N values.
    pub(super) mass_kg: Vec<f64>,
    /// Stiffness of each contact (N·m^−α), [`Physics::contacts_by_rule`] values.
    pub(super) stiffness: Vec<f64>,
    /// Stiffnesses (N·m^−α) of the contacts with the walls, where there are walls.
    pub(super) walls: [f64; 2],
}

/// The smallest and the largest mass and stiffness, after spheres and disorder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ranges {
    /// The masses (kg).
    pub mass_kg: [f64; 2],
    /// The stiffnesses (N·m^−α) of the contacts between beads.
    pub stiffness: [f64; 2],
    /// The stiffnesses (N·m^−α) of the contacts with the left and the right wall, where there are walls.
    pub walls: [Option<f64>; 2],
}

/// Largest number of values that a glance makes: they take milliseconds.
const GLANCE_VALUES: u64 = 1 << 17;

impl Physics {
    /// The ranges of masses and stiffnesses; none if the chain is so long that they take more than a glance.
    pub fn ranges_at_a_glance(&self) -> Option<Ranges> {
        let values = self.beads.saturating_mul(1 + self.disorder.len() as u64);
        (values <= GLANCE_VALUES).then(|| {
            let Resolved { mass_kg, stiffness, walls } = self.masses_and_stiffnesses();
            let fixed = [self.ends.left, self.ends.right].map(|end| end == End::Fixed);
            let wall = |side: usize| fixed[side].then_some(walls[side]);
            let ends = |values: &[f64]| <[f64; 2]>::from(range(values));
            Ranges { mass_kg: ends(&mass_kg), stiffness: ends(&stiffness), walls: [wall(0), wall(1)] }
        })
    }

    /// The mass of each bead (kg), N values.
    pub(super) fn chain_masses_kg(&self) -> Vec<f64> {
        self.masses_and_stiffnesses().mass_kg
    }

    /// The number of contacts that the rules of the chain give a number: N − 1, and in a ring one more, number N − 1, which closes it.
    /// Kernel 2 took that one for a wall.
    pub(super) fn contacts_by_rule(&self) -> u64 {
        self.beads - u64::from(self.ends.left != End::Periodic || self.kernel_version < 3)
    }

    /// Masses and stiffnesses of the chain.
    pub(super) fn masses_and_stiffnesses(&self) -> Resolved {
        let mut spheres = self.all_spheres();
        let mut mass_kg = self.masses_kg();
        for (disorder, stream) in self.disorder.iter().zip(0..) {
            match (disorder.of, &mut spheres) {
                (Disordered::Radii, Some(spheres)) => {
                    let mut radius_m: Vec<f64> = spheres.iter().map(|sphere| sphere.radius_m).collect();
                    self.apply(disorder, stream, &mut radius_m);
                    spheres
                        .iter_mut()
                        .zip(radius_m)
                        .for_each(|(sphere, radius_m)| sphere.radius_m = radius_m);
                }
                (Disordered::Radii, None) => {
                    let mut factor = vec![1.0; mass_kg.len()];
                    self.apply(disorder, stream, &mut factor);
                    mass_kg.iter_mut().zip(factor).for_each(|(mass_kg, f)| *mass_kg *= f * f * f);
                }
                (Disordered::Masses | Disordered::Stiffnesses, _) => {}
            }
        }
        if let Some(spheres) = &spheres {
            mass_kg = spheres.iter().map(Sphere::mass_kg).collect();
        }
        let mut stiffness = self.contact_stiffnesses(&mass_kg, spheres.as_deref());
        let by_radii = self.wall_stiffnesses(&mass_kg, spheres.as_deref());
        for (disorder, stream) in self.disorder.iter().zip(0..) {
            match disorder.of {
                Disordered::Masses => self.apply(disorder, stream, &mut mass_kg),
                Disordered::Stiffnesses => self.apply(disorder, stream, &mut stiffness),
                Disordered::Radii => {}
            }
        }
        let walls = if self.kernel_version < 3 {
            self.wall_stiffnesses(&mass_kg, self.all_spheres().as_deref())
        } else {
            by_radii
        };
        Resolved { mass_kg, stiffness, walls }
    }

    /// Changes `values` as `disorder` says, by the numbers of `stream`.
    fn apply(&self, disorder: &Disorder, stream: u32, values: &mut [f64]) {
        if disorder.permuted {
            let order = permutation(self.seed, stream, values.len());
            let before = values.to_vec();
            values.iter_mut().zip(order).for_each(|(value, from)| *value = before[from]);
            return;
        }
        for (i, value) in (0..).zip(values) {
            *value *= self.factor(disorder, stream, i);
        }
    }

    fn factor(&self, disorder: &Disorder, stream: u32, i: u64) -> f64 {
        if let Some(width) = disorder.uniform {
            1.0 + width * (2.0 * uniform(self.seed, stream, i) - 1.0)
        } else if let Some(deviation) = disorder.normal {
            1.0 + deviation * normal(self.seed, stream, i)
        } else if let Some(deviation) = disorder.log_normal {
            exp(deviation * normal(self.seed, stream, i))
        } else if let Some(two) = disorder.two_valued {
            if uniform(self.seed, stream, i) < two.fraction { two.factor } else { 1.0 }
        } else {
            1.0
        }
    }

    /// Refuses impossible disorder.
    pub(super) fn check_disorder(&self) -> Result<(), ConfigError> {
        if self.disorder.len() > MOST_DISORDERS {
            let allowed = format!("at most {MOST_DISORDERS}: each goes through the whole chain");
            return Err(ConfigError::value("disorder", format!("{} of them", self.disorder.len()), &allowed));
        }
        for (i, disorder) in self.disorder.iter().enumerate() {
            let key = format!("disorder[{i}]");
            let asked =
                [disorder.uniform.is_some(), disorder.normal.is_some(), disorder.log_normal.is_some()];
            let asked = asked.iter().filter(|asked| **asked).count()
                + usize::from(disorder.two_valued.is_some())
                + usize::from(disorder.permuted);
            if asked != 1 {
                let allowed = "one of uniform, normal, log_normal, two_valued and permuted = true";
                return Err(ConfigError::value(&key, format!("{asked} of them"), allowed));
            }
            let widths = [
                ("uniform", disorder.uniform),
                ("normal", disorder.normal),
                ("log_normal", disorder.log_normal),
            ];
            for (name, width) in widths {
                let key = format!("{key}.{name}");
                match width {
                    Some(width) if !(0.0..=10.0).contains(&width) => {
                        return Err(ConfigError::number(&key, width, "a width from 0 to 10"));
                    }
                    _ => {}
                }
            }
            if let Some(two) = disorder.two_valued
                && !(0.0..=1.0).contains(&two.fraction)
            {
                let key = format!("{key}.two_valued.fraction");
                return Err(ConfigError::number(&key, two.fraction, "a fraction from 0 to 1"));
            }
            let by_radii = self.spheres.is_some() || self.stiffnesses == StiffnessRule::Radii;
            if disorder.of == Disordered::Radii && !by_radii {
                let allowed =
                    "radii only with `spheres`, or with stiffnesses = \"radii\"; else masses, stiffnesses";
                return Err(ConfigError::value(&format!("{key}.of"), "radii", allowed));
            }
        }
        Ok(())
    }

    /// Refuses disorder that makes an impossible mass or stiffness.
    pub(super) fn check_what_disorder_makes(&self) -> Result<(), ConfigError> {
        if self.disorder.is_empty() {
            return Ok(());
        }
        let Resolved { mass_kg, stiffness, .. } = self.masses_and_stiffnesses();
        let wrong = |values: &[f64]| values.iter().position(|value| !(1e-100..=1e100).contains(value));
        let last = format!("disorder[{}]", self.disorder.len() - 1);
        let seed = self.seed;
        if let Some(bead) = wrong(&mass_kg) {
            let found = format!("seed {seed}, which makes bead {bead} weigh {:e} kg", mass_kg[bead]);
            let allowed = "masses above 0: a narrower distribution, log_normal, or another seed";
            return Err(ConfigError::value(&last, found, allowed));
        }
        if let Some(contact) = wrong(&stiffness) {
            let found =
                format!("seed {seed}, which gives contact {contact} the stiffness {:e}", stiffness[contact]);
            let allowed = "stiffnesses above 0: a narrower distribution, log_normal, or another seed";
            return Err(ConfigError::value(&last, found, allowed));
        }
        Ok(())
    }
}
