//! Checks of the physics of a run.

use super::disorder::Resolved;
use super::{Physics, larger, range};
use crate::config::{ConfigError, Disorder, Disordered, End, Impurity, MassRule, OddContact, StiffnessRule};
use crate::damping::Damping;
use crate::manifest::{KERNEL_VERSION, MAX_BEADS, MAX_STEPS};
use crate::method::{Feature, Method};
use std::collections::BTreeSet;

impl Physics {
    /// Checks the form of a manifest from elsewhere as strictly as a configuration, in a time proportional to its length.
    /// [`check_whole`](Self::check_whole) checks the values that need the whole chain.
    pub(in crate::manifest) fn check_form(&self) -> Result<(), ConfigError> {
        self.check_written(&self.impurities, &self.contacts)?;
        self.check_method(false)?;
        self.check_order()?;
        if !(self.dt_s > 0.0 && self.dt_s.is_finite()) {
            return Err(ConfigError::number("time.dt_s", self.dt_s, "a step of more than 0 s"));
        }
        if !(1..=MAX_STEPS).contains(&self.step_count) {
            return Err(ConfigError::value("step_count", self.step_count, "1 to 2^52 steps"));
        }
        self.check_drive_times()?;
        self.check_frictions()?;
        let first = self.first_kernel();
        if self.kernel_version == KERNEL_VERSION && first < KERNEL_VERSION {
            let allowed = format!("{first}, the first version that gives the bits of this run");
            return Err(ConfigError::value("kernel_version", self.kernel_version, &allowed));
        }
        Ok(())
    }

    /// The key of the first thing in the run that manifests of version 1.0 do not have.
    pub(in crate::manifest) fn key_since_1_1(&self) -> Option<&'static str> {
        let newer_end = |end: End| matches!(end, End::Periodic | End::Absorbing);
        [
            ("strikers", !self.strikers.is_empty()),
            ("seed", self.seed != 0),
            ("disorder", !self.disorder.is_empty()),
            ("spheres", self.spheres.is_some()),
            ("odd_spheres", !self.odd_spheres.is_empty()),
            ("alphas", self.alphas.is_some()),
            ("second", self.second.is_some()),
            ("gaps_m", self.gaps_m.is_some()),
            ("bonds", self.bonds.is_some()),
            ("on_site", !self.on_site.is_none()),
            ("resonators", self.resonators.is_some()),
            ("initial", !self.initial.is_none()),
            ("drives", !self.drives.is_empty()),
            ("baths", !self.baths.is_empty()),
            ("ends", newer_end(self.ends.left) || newer_end(self.ends.right)),
            ("damping", self.damping.as_ref().is_some_and(Damping::is_since_1_1)),
            ("method", self.method.is_since_1_1()),
        ]
        .into_iter()
        .find_map(|(key, is_there)| is_there.then_some(key))
    }

    /// Checks all that needs the arrays of the chain: the values that disorder makes, the scales, and the step.
    pub(in crate::manifest) fn check_whole(&self) -> Result<(), ConfigError> {
        self.check_what_disorder_makes()?;
        self.check_scales()?;
        self.check_dt(self.dt_s)
    }

    /// Checks everything but the time; `impurities` and `contacts` are in the user's order.
    pub(super) fn check_chain(
        &self,
        impurities: &[Impurity],
        contacts: &[OddContact],
    ) -> Result<(), ConfigError> {
        self.check_written(impurities, contacts)?;
        self.check_method(true)?;
        self.check_effects()?;
        self.check_what_disorder_makes()?;
        // recordings of chains that do not are read
        if self.bonds.is_some() && !self.load.is_none() && !self.carries_its_load() {
            let allowed = "loads that all of chain.bonds carry: one without stiffness carries none, and a quadratic stiffness below 0 gives \
                           the force a largest value";
            return Err(ConfigError::value("load", "more than a bond can carry", allowed));
        }
        self.check_scales()
    }

    /// Refuses what would have no effect in this chain. Manifests from before this was refused are read.
    fn check_effects(&self) -> Result<(), ConfigError> {
        let ends = &self.ends;
        let of_stiffness = |entry: &Disorder| entry.of == Disordered::Stiffnesses;
        if let (Some(entry), Some(_)) = (self.disorder.iter().position(of_stiffness), &self.bonds) {
            let allowed = "masses: bonds have lists and patterns of stiffnesses of their own";
            return Err(ConfigError::value(&format!("disorder[{entry}].of"), "stiffnesses", allowed));
        }
        if let (Some(_), Some(_)) = (&self.alphas, &self.spheres) {
            let allowed = "nothing beside spheres, whose stiffnesses are those of the exponent 1.5";
            return Err(ConfigError::value("chain.alphas", "exponents", allowed));
        }
        for (side, end, stiffness, material) in [
            ("left", ends.left, ends.left_stiffness, ends.left_material.is_some()),
            ("right", ends.right, ends.right_stiffness, ends.right_material.is_some()),
        ] {
            if let (Some(stiffness), true) = (stiffness, self.bonds.is_some()) {
                let allowed = "nothing beside chain.bonds: a wall holds the last bead as the first or the last bond does";
                return Err(ConfigError::number(&format!("ends.{side}_stiffness"), stiffness, allowed));
            }
            if material && (end != End::Fixed || stiffness.is_some()) {
                let allowed = format!("a fixed end that has no {side}_stiffness");
                return Err(ConfigError::value(&format!("ends.{side}_material"), "a material", &allowed));
            }
        }
        Ok(())
    }

    /// Checks each number that is written, without an array of the chain.
    fn check_written(&self, impurities: &[Impurity], contacts: &[OddContact]) -> Result<(), ConfigError> {
        if !(2..=MAX_BEADS).contains(&self.beads) {
            return Err(ConfigError::value("chain.beads", self.beads, "2 to 20000000 beads"));
        }
        check_positive("chain.bead_mass_kg", self.bead_mass_kg, "kg")?;
        if !(1.0..=1000.0).contains(&self.alpha) {
            return Err(ConfigError::number("chain.alpha", self.alpha, "an exponent from 1 to 1000"));
        }
        check_positive("chain.stiffness", self.stiffness, STIFFNESS_UNIT)?;
        self.check_masses()?;
        self.check_stiffnesses()?;
        let mut seen = BTreeSet::new();
        for (i, impurity) in impurities.iter().enumerate() {
            let key = format!("chain.impurities[{i}].bead");
            self.check_bead(&key, impurity.bead)?;
            check_positive(&format!("chain.impurities[{i}].mass_kg"), impurity.mass_kg, "kg")?;
            if !seen.insert(impurity.bead) {
                return Err(ConfigError::value(&key, impurity.bead, "each bead once"));
            }
        }
        self.check_contacts(contacts)?;
        for (i, striker) in std::iter::once(&self.striker).chain(&self.strikers).enumerate() {
            let key = if self.strikers.is_empty() {
                "striker.bead".to_owned()
            } else {
                format!("striker[{i}].bead")
            };
            self.check_bead(&key, striker.bead)?;
        }
        self.check_spheres()?;
        self.check_disorder()?;
        self.check_laws()?;
        self.check_ends()?;
        self.check_sites()?;
        self.check_initial()?;
        self.check_drives()?;
        self.check_baths()?;
        self.check_load()?;
        self.damping.iter().try_for_each(Damping::check)?;
        self.check_velocity()
    }

    /// Checks that lists are in order and no number is −0: one physics has one form, and one hash.
    fn check_order(&self) -> Result<(), ConfigError> {
        if !self.impurities.is_sorted_by_key(|impurity| impurity.bead) {
            return Err(ConfigError::value("impurities", "a list out of order", "the order of the beads"));
        }
        if !self.contacts.is_sorted_by_key(|odd| odd.contact) {
            return Err(ConfigError::value("contacts", "a list out of order", "the order of the contacts"));
        }
        let is_minus_zero = |x: f64| x == 0.0 && x.is_sign_negative();
        let mut strikers = std::iter::once(&self.striker).chain(&self.strikers);
        if strikers.any(|striker| is_minus_zero(striker.velocity_m_s)) {
            return Err(ConfigError::value("striker.velocity_m_s", "−0", "0"));
        }
        if !self.odd_spheres.is_sorted_by_key(|odd| odd.bead) {
            return Err(ConfigError::value("odd_spheres", "a list out of order", "the order of the beads"));
        }
        Ok(())
    }

    fn check_masses(&self) -> Result<(), ConfigError> {
        let key = "chain.masses";
        match &self.masses {
            MassRule::Uniform => Ok(()),
            MassRule::PatternKg(pattern) => self.check_pattern("chain.masses.pattern_kg", pattern, "kg"),
            MassRule::ListKg(list) => check_list("chain.masses.list_kg", list, self.beads, "bead", "kg"),
            MassRule::Taper(ratio) => {
                check_positive("chain.masses.taper", *ratio, "(mass ratio of neighbours)")?;
                let last_kg = self.tapered_kg(*ratio, (self.beads - 1) as f64);
                check_positive(key, last_kg, "kg, here of the last bead of a tapered chain")
            }
        }
    }

    fn check_stiffnesses(&self) -> Result<(), ConfigError> {
        match &self.stiffnesses {
            StiffnessRule::Uniform => Ok(()),
            StiffnessRule::Pattern(pattern) => {
                self.check_pattern("chain.stiffnesses.pattern", pattern, STIFFNESS_UNIT)
            }
            StiffnessRule::List(list) => {
                check_list("chain.stiffnesses.list", list, self.contacts_by_rule(), "contact", STIFFNESS_UNIT)
            }
            StiffnessRule::Radii if self.alpha == 1.5 => Ok(()),
            StiffnessRule::Radii => {
                let allowed = "alpha = 1.5: the stiffness of spheres by their radii is Hertz's law";
                Err(ConfigError::value(
                    "chain.stiffnesses",
                    format!("radii with alpha = {}", self.alpha),
                    allowed,
                ))
            }
        }?;
        let ends = &self.ends;
        for (key, end, stiffness) in [
            ("ends.left_stiffness", ends.left, ends.left_stiffness),
            ("ends.right_stiffness", ends.right, ends.right_stiffness),
        ] {
            let Some(stiffness) = stiffness else { continue };
            check_positive(key, stiffness, STIFFNESS_UNIT)?;
            if matches!(end, End::Free | End::Absorbing) {
                return Err(ConfigError::number(
                    key,
                    stiffness,
                    "nothing at a free end: there is no wall to touch",
                ));
            }
        }
        Ok(())
    }

    fn check_contacts(&self, contacts: &[OddContact]) -> Result<(), ConfigError> {
        let mut seen = BTreeSet::new();
        for (i, odd) in contacts.iter().enumerate() {
            let key = format!("chain.contacts[{i}].contact");
            if odd.contact >= self.contacts_by_rule() {
                let allowed = format!("contacts 0 to {} of this chain", self.contacts_by_rule() - 1);
                return Err(ConfigError::value(&key, odd.contact, &allowed));
            }
            check_positive(&format!("chain.contacts[{i}].stiffness"), odd.stiffness, STIFFNESS_UNIT)?;
            if !seen.insert(odd.contact) {
                return Err(ConfigError::value(&key, odd.contact, "each contact once"));
            }
        }
        Ok(())
    }

    fn check_pattern(&self, key: &str, pattern: &[f64], unit: &str) -> Result<(), ConfigError> {
        if pattern.is_empty() || pattern.len() as u64 > self.beads {
            let found = format!("{} values", pattern.len());
            return Err(ConfigError::value(key, found, "1 value to one for each bead"));
        }
        pattern.iter().try_for_each(|value| check_positive(key, *value, unit))
    }

    fn check_load(&self) -> Result<(), ConfigError> {
        let load = &self.load;
        if !(0.0..=1e100).contains(&load.precompression_n) {
            let allowed = "a force of 0 to 1e100 N; a chain cannot be pulled";
            return Err(ConfigError::number("load.precompression_n", load.precompression_n, allowed));
        }
        let (gravity, key) = (load.gravity_m_s2, "load.gravity_m_s2");
        if gravity.is_nan() || gravity.abs() > 1e100 {
            return Err(ConfigError::number(key, gravity, "an acceleration of at most 1e100 m/s²"));
        }
        let (carrier, end) =
            if gravity > 0.0 { ("right", self.ends.right) } else { ("left", self.ends.left) };
        if gravity != 0.0 && end != End::Fixed {
            let allowed = format!(
                "with `{carrier} = \"fixed\"` in [ends]: something must carry the weight (a positive \
                 acceleration points to the right, towards higher bead numbers)"
            );
            return Err(ConfigError::number(key, gravity, &allowed));
        }
        Ok(())
    }

    /// Refuses a feature that the method does not take; in a new run also one that the method does not take any more.
    pub(super) fn check_method(&self, is_new: bool) -> Result<(), ConfigError> {
        let method = self.method;
        let is_refused =
            |feature: &Feature| !method.takes(*feature) && (is_new || self.retired() != Some(*feature));
        let Some(feature) = self.features().into_iter().find(is_refused) else { return Ok(()) };
        let both =
            |other: Feature| Method::ALL.iter().any(|method| method.takes(feature) && method.takes(other));
        if let Some(other) = self.features().into_iter().find(|other| !both(*other)) {
            let found = format!("{feature} beside {other}");
            return Err(ConfigError::value(
                "integrator.method",
                found,
                "one of them, as no method takes both",
            ));
        }
        let allowed = format!("{} with {feature}, which {method} does not take", Method::names_with(feature));
        Err(ConfigError::value("integrator.method", method, &allowed))
    }

    fn check_velocity(&self) -> Result<(), ConfigError> {
        let velocity_m_s = self.striker.velocity_m_s;
        let is_moved = self.typical_speed_m_s() > 0.0
            || self.typical_overlap_m() > 0.0
            || self.initial.displacements_m.iter().any(|u_m| *u_m != 0.0)
            || self.of_resonators(&self.initial.resonator_displacements_m).any(|(_, w_m)| *w_m != 0.0);
        if !is_moved && self.load.is_none() {
            if !self.is_moved_otherwise() && self.strikers.is_empty() {
                let allowed = "a velocity other than 0: nothing else would set this chain in motion";
                return Err(ConfigError::number("striker.velocity_m_s", velocity_m_s, allowed));
            }
            let key = match self {
                Self { drives, .. } if !drives.is_empty() => "drive",
                Self { baths, .. } if !baths.is_empty() => "bath",
                _ => "initial",
            };
            let allowed = "a displacement, velocity, force or temperature other than 0 somewhere: nothing sets this chain in motion";
            return Err(ConfigError::value(key, "only zeros", allowed));
        }
        for (i, striker) in std::iter::once(&self.striker).chain(&self.strikers).enumerate() {
            let velocity_m_s = striker.velocity_m_s;
            if velocity_m_s != 0.0 && !(1e-100..=1e100).contains(&velocity_m_s.abs()) {
                let key = if i == 0 {
                    "striker.velocity_m_s".to_owned()
                } else {
                    format!("striker[{i}].velocity_m_s")
                };
                let allowed = "a velocity of 1e-100 to 1e100 m/s, in either direction";
                return Err(ConfigError::number(&key, velocity_m_s, allowed));
            }
        }
        Ok(())
    }

    /// Checks that overlaps, from `m·v0²/k` and from `load/k`, are far from where forces are flushed to zero.
    fn check_scales(&self) -> Result<(), ConfigError> {
        let scales = self.scales();
        let is_scale = |scale: f64| scale > 0.0 && scale.is_finite();
        if !is_scale(scales.length_m) || !is_scale(scales.time_s) {
            let found = format!("L = {:e} m, T = {:e} s", scales.length_m, scales.time_s);
            let allowed = "masses, stiffnesses and a speed, displacement or force with scales L and T that doubles can hold";
            return Err(ConfigError::value("chain", found, allowed));
        }
        if self.bonds.is_some() {
            return Ok(());
        }
        let extremes = self.extremes();
        let speed_m_s = self.typical_speed_m_s();
        let squared = speed_m_s * speed_m_s;
        let ratios = [
            extremes.lightest_kg * squared / extremes.stiffest,
            extremes.heaviest_kg * squared / extremes.softest,
        ];
        for ratio in ratios {
            if squared != 0.0 && !(1e-200..=1e200).contains(&ratio) {
                let allowed = "stiffness, masses and velocity with m·v0²/k from 1e-200 to 1e200 m^(α+1)";
                let found = format!("{:e} with m·v0²/k = {ratio:e}", self.stiffness);
                return Err(ConfigError::value("chain.stiffness", found, allowed));
            }
        }
        if self.load.is_none() {
            return Ok(());
        }
        let loads = self.extreme_loads_n();
        for ratio in [loads.0 / extremes.stiffest, loads.1 / extremes.softest] {
            if !(1e-200..=1e200).contains(&ratio) {
                let allowed = "loads and stiffnesses with load/k from 1e-200 to 1e200 m^α";
                return Err(ConfigError::value("load", format!("load/k = {ratio:e}"), allowed));
            }
        }
        Ok(())
    }

    /// The ends of the ranges of masses and stiffnesses.
    pub(super) fn extremes(&self) -> Extremes {
        if self.spheres.is_some() || !self.disorder.is_empty() {
            let Resolved { mass_kg, stiffness, walls } = self.masses_and_stiffnesses();
            let ((lightest_kg, heaviest_kg), (softest, mut stiffest)) = (range(&mass_kg), range(&stiffness));
            for (end, stiffness) in [(self.ends.left, walls[0]), (self.ends.right, walls[1])] {
                stiffest = if end == End::Fixed { larger(stiffest, stiffness) } else { stiffest };
            }
            return Extremes { lightest_kg, heaviest_kg, softest, stiffest };
        }
        let mut masses: Vec<f64> = match &self.masses {
            MassRule::Uniform => vec![self.bead_mass_kg],
            MassRule::PatternKg(values) | MassRule::ListKg(values) => values.clone(),
            MassRule::Taper(ratio) => {
                vec![self.bead_mass_kg, self.tapered_kg(*ratio, (self.beads - 1) as f64)]
            }
        };
        masses.extend(self.impurities.iter().map(|impurity| impurity.mass_kg));
        let (lightest_kg, heaviest_kg) = range(&masses);
        let mut stiffnesses: Vec<f64> = match &self.stiffnesses {
            StiffnessRule::Uniform => vec![self.stiffness],
            // the larger both spheres, the stiffer; against a wall stiffer still
            StiffnessRule::Radii => {
                vec![self.stiffness_of_spheres(lightest_kg, lightest_kg), self.stiffness_at_wall(heaviest_kg)]
            }
            StiffnessRule::Pattern(values) | StiffnessRule::List(values) => values.clone(),
        };
        stiffnesses.extend(self.contacts.iter().map(|odd| odd.stiffness));
        for (end, stiffness) in
            [(self.ends.left, self.ends.left_stiffness), (self.ends.right, self.ends.right_stiffness)]
        {
            if end == End::Fixed {
                stiffnesses.push(stiffness.unwrap_or(self.stiffness));
            }
        }
        let (softest, stiffest) = range(&stiffnesses);
        Extremes { lightest_kg, heaviest_kg, softest, stiffest }
    }

    pub(super) fn check_bead(&self, key: &str, bead: u64) -> Result<(), ConfigError> {
        if bead < self.beads {
            return Ok(());
        }
        let allowed = format!("beads 0 to {} of this chain", self.beads - 1);
        Err(ConfigError::value(key, bead, &allowed))
    }
}

pub(super) const STIFFNESS_UNIT: &str = "N/m^alpha";

/// The ends of the ranges of masses (kg) and stiffnesses (N·m^−α) in a chain.
pub(super) struct Extremes {
    pub(super) lightest_kg: f64,
    pub(super) heaviest_kg: f64,
    pub(super) softest: f64,
    pub(super) stiffest: f64,
}

/// Checks that a list has one positive value for each of `count` beads or contacts.
fn check_list(key: &str, list: &[f64], count: u64, what: &str, unit: &str) -> Result<(), ConfigError> {
    if list.len() as u64 != count {
        let allowed = format!("{count} values, one for each {what}");
        return Err(ConfigError::value(key, format!("{} values", list.len()), &allowed));
    }
    list.iter().try_for_each(|value| check_positive(key, *value, unit))
}

pub(super) fn is_positive(value: f64) -> bool {
    (1e-100..=1e100).contains(&value)
}

pub(super) fn is_0_or_more(value: f64) -> bool {
    value == 0.0 || is_positive(value)
}

/// Checks that a value is positive, and so far from the ends of the range that no product of scales leaves it.
pub(super) fn check_positive(key: &str, value: f64, unit: &str) -> Result<(), ConfigError> {
    if is_positive(value) {
        return Ok(());
    }
    Err(ConfigError::number(key, value, &format!("a positive number of {unit}, 1e-100 to 1e100")))
}
