//! Pictures of a film: a map with a line at one moment after the other, and beside it the chain and the energies then.

use super::fields::{
    ColourSteps, label_beyond_rest, mark_impurities, marked, profile_axis, shown_range, space_time,
};
use super::{energy_curve, parts, prefix};
use consumers::energies::EnergyRow;
use consumers::footage::{Footage, Shot};
use figure::{Axis, Colour, Column, Curve, Figure, FigureError, Panel};
use schemas::manifest::RunManifest;

/// The axes of a film, and the things that all of its pictures show.
#[derive(Debug)]
pub struct Film<'a> {
    manifest: &'a RunManifest,
    footage: &'a Footage,
    /// Label of the profile's values, their factor from SI units, and the range that is shown.
    profile: (String, f64, [f64; 2]),
    /// Prefix of the unit of energies, and their factor from J.
    energy: (&'static str, f64),
    /// Names and columns of the energies that are shown.
    energies: [(String, &'static str); 3],
    /// Unit of the time, its factor from s, and the decimals by which pictures differ.
    time: (&'static str, f64, usize),
}

impl<'a> Film<'a> {
    /// The film of a run's footage.
    pub fn new(manifest: &'a RunManifest, footage: &'a Footage) -> Self {
        let values = footage.shots.iter().flat_map(|shot| &shot.profile).map(|(_, value)| f64::from(*value));
        let shown = shown_range(manifest, footage.field, true, &values.collect::<Vec<_>>());
        let (label, factor) = label_beyond_rest(manifest, footage.field, shown[0].abs().max(shown[1].abs()));
        let totals = energy_curve(&footage.energies, "total_j").map(|(_, energy_j)| energy_j.abs());
        let struck = manifest.physics.striker.bead;
        let energies = if manifest.physics.impurities.iter().all(|impurity| impurity.bead == struck) {
            let of = |name: &str, column| (name.to_owned(), column);
            [of("kinetic", "kinetic_j"), of("potential", "potential_j"), of("total", "total_j")]
        } else {
            parts(footage.split_bead())
        };
        let apart_ms = footage.shots.windows(2).map(|pair| (pair[1].time_s - pair[0].time_s) * 1e3);
        let least_ms = apart_ms.filter(|apart| *apart > 0.0).fold(f64::INFINITY, f64::min);
        let decimals = -least_ms.log10().floor();
        // one moment is apart from none
        let decimals = if decimals.is_finite() { decimals } else { 6.0 };
        let (unit, per_s, decimals) =
            if decimals > 9.0 { ("ns", 1e9, decimals - 6.0) } else { ("ms", 1e3, decimals) };
        Self {
            manifest,
            footage,
            profile: (label, factor, shown),
            energy: prefix(totals.fold(0.0, f64::max)),
            energies,
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 9")]
            time: (unit, per_s, decimals.clamp(0.0, 9.0) as usize),
        }
    }

    /// The figures from left to right, without their moments: a wide picture has the map beside the rest, another one
    /// above it.
    ///
    /// # Errors
    /// When the map cannot be drawn, which is a mistake of ours.
    pub fn columns(
        &self,
        is_wide: bool,
        steps: ColourSteps,
        range: Option<[f64; 2]>,
    ) -> Result<Vec<Column>, FigureError> {
        let (manifest, field, places) = (self.manifest, self.footage.field, self.places());
        let map = space_time(manifest, field, &self.footage.map, steps, range)?;
        let (label, factor, [least, largest]) = &self.profile;
        let y = Axis::new(label.as_str()).limits(least * factor, largest * factor);
        let profile = Panel::new().x_axis(profile_axis(field, places)).y_axis(y).title(" ");
        let profile = mark_impurities(profile, manifest, field, places, true);
        let extent = self.footage.map.extent();
        let time_ms = |step: u64| manifest.physics.time_s(step) * 1e3;
        let (from, to) = (*extent.steps.start(), *extent.steps.end());
        let x = Axis::new("time (ms)").limits(time_ms(from), time_ms(to.max(from + 1)));
        let (prefix, factor) = self.energy;
        let energies = Panel::new().x_axis(x).y_axis(format!("energy ({prefix}J)"));
        let energies = self.energies.iter().fold(energies, |panel, (name, column)| {
            let curve = energy_curve(&self.footage.energies, column);
            panel.line(name, curve.map(|(time_s, energy_j)| (time_s * 1e3, energy_j * factor)))
        });
        Ok(if is_wide {
            let right = Figure::new().panel(profile).panel(energies);
            [map, right].map(|figure| Column { figure, part: 0.5 }).into()
        } else {
            vec![Column { figure: map.panel(profile).panel(energies), part: 1.0 }]
        })
    }

    /// The contents of the panels at one moment.
    pub fn moment(&self, shot: &Shot) -> [Panel; 3] {
        let time_ms = shot.time_s * 1e3;
        let places = self.places();
        let ends = [places.start as f64 - 0.5, places.end as f64 - 0.5];
        let cursor = Curve::line("", ends.map(|place| (place, time_ms))).colour(Colour::Black);
        let factor = self.profile.1;
        let points =
            shot.profile.iter().map(|(place, value)| (f64::from(*place), f64::from(*value) * factor));
        let (unit, per_s, decimals) = self.time;
        let title = format!("t = {:.decimals$}\u{a0}{unit}", shot.time_s * per_s);
        let column = |name| EnergyRow::COLUMNS.iter().zip(shot.energies).find(|(column, _)| **column == name);
        let energies = self.energies.iter().fold(Panel::new().vertical("", time_ms), |panel, (_, name)| {
            let energy_j = column(*name).map(|(_, energy_j)| energy_j);
            panel.points("", energy_j.map(|energy_j| (time_ms, energy_j * self.energy.1)))
        });
        [
            Panel::new().curve(cursor),
            Panel::new().curve(marked(Curve::line("", points), places)).title(title),
            energies,
        ]
    }

    fn places(&self) -> &std::ops::Range<usize> {
        &self.footage.map.extent().places
    }
}
