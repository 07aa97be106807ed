//! The columns of a sweep's rows.

use crate::measures;
use crate::point::Leading;
use crate::series;
use consumers::determination::{Outcome, Quantity};
use consumers::energies::{EnergyOutcome, Reflection};
use consumers::pulses::{Counts, Measured, Pulse};
use consumers::table::{Cell, Column, Kind};
use consumers::uncertain::Uncertain;
use producer::sweep::{ParameterKind, ParameterValue, Sweep};

/// The columns of the results, with units.
const RESULTS: [(&str, Kind); 49] = [
    ("end", Kind::Word),
    ("steps", Kind::Integer),
    ("time_s", Kind::Double),
    ("dt_s", Kind::Double),
    ("split_bead", Kind::Integer),
    // of the last frame
    ("kinetic_j", Kind::Double),
    ("potential_j", Kind::Double),
    ("total_j", Kind::Double),
    ("left_j", Kind::Double),
    ("split_j", Kind::Double),
    ("right_j", Kind::Double),
    ("dissipated_j", Kind::Double),
    // of the last frame before a front met an end, as `beadline energies` has them
    ("reflected_at_s", Kind::Double),
    ("reflected_over_total", Kind::Double),
    ("reflected_over_total_uncertainty", Kind::Double),
    ("reflected_over_transmitted", Kind::Double),
    ("reflected_over_transmitted_uncertainty", Kind::Double),
    ("reflected_uncertainty_j", Kind::Double),
    ("stationary_since_s", Kind::Double),
    ("recoil_j", Kind::Double),
    ("recoil_uncertainty_j", Kind::Double),
    ("corrected_over_total", Kind::Double),
    ("corrected_over_total_uncertainty", Kind::Double),
    ("corrected_over_transmitted", Kind::Double),
    ("corrected_over_transmitted_uncertainty", Kind::Double),
    ("corrected_over_incident", Kind::Double),
    ("corrected_over_incident_uncertainty", Kind::Double),
    ("pulses", Kind::Integer),
    // what leaves the split bead towards higher and towards lower bead numbers
    ("forward_pulses", Kind::Integer),
    ("forward_bead", Kind::Integer),
    ("forward_v_peak_m_s", Kind::Double),
    ("forward_speed_beads_per_s", Kind::Double),
    ("forward_fwhm_beads", Kind::Double),
    ("forward_energy_j", Kind::Double),
    ("backward_pulses", Kind::Integer),
    ("backward_bead", Kind::Integer),
    ("backward_v_peak_m_s", Kind::Double),
    ("backward_speed_beads_per_s", Kind::Double),
    ("backward_fwhm_beads", Kind::Double),
    ("backward_energy_j", Kind::Double),
    ("coarse_crests", Kind::Integer),
    ("unresolved_crests", Kind::Integer),
    ("unfollowed", Kind::Integer),
    ("relative_drift", Kind::Double),
    ("max_abs_relative_drift", Kind::Double),
    ("front_bead", Kind::Integer),
    ("physics_sha256", Kind::Word),
    ("state_sha256", Kind::Word),
    (ERROR_COLUMN, Kind::Word),
];

/// The columns that follow where a sweep asks for `check`.
const CHECKED: [(&str, Kind); 4] = [
    ("determined_until_s", Kind::Double),
    ("bounded_by", Kind::Word),
    ("reflected_step_error", Kind::Double),
    ("reflected_rounding_error", Kind::Double),
];

/// The column of why a point has no results.
pub const ERROR_COLUMN: &str = "error";

/// The columns of a sweep's rows: its parameters, then the results, then those of other analyses that it asks for, then these over time.
pub fn columns(sweep: &Sweep) -> Vec<Column> {
    let kind = |kind| match kind {
        ParameterKind::Integer => Kind::Integer,
        ParameterKind::Double => Kind::Double,
        ParameterKind::Word => Kind::Word,
    };
    let parameters = sweep.parameters().iter().map(|p| Column::new(p.key.clone(), kind(p.kind)));
    let results = results(sweep).map(|(name, kind)| Column::new(*name, *kind));
    let measured = measures::columns(sweep.measure());
    parameters.chain(results).chain(measured).chain(series::columns(sweep)).collect()
}

/// The columns of the results of `sweep`.
fn results(sweep: &Sweep) -> impl Iterator<Item = &'static (&'static str, Kind)> + use<> {
    let checked = if sweep.check() { &CHECKED[..] } else { &[] };
    RESULTS.iter().chain(checked)
}

/// The values of [`RESULTS`] and of [`CHECKED`], if the sweep asks for these, and of what else it asks for; those that are not
/// set do not exist.
pub(crate) struct Results {
    results: Vec<Cell>,
    measured: Vec<Cell>,
}

impl Results {
    /// Nothing yet.
    pub(crate) fn of(sweep: &Sweep) -> Self {
        Self {
            results: vec![Cell::Empty; results(sweep).count()],
            measured: vec![Cell::Empty; sweep.measure().len() + series::columns(sweep).count()],
        }
    }

    /// Sets the values of other analyses that the sweep asks for, and those over time.
    pub(crate) fn measured(&mut self, cells: Vec<Cell>) {
        self.measured = cells;
    }

    /// The row of a point with these parameters.
    pub(crate) fn cells(self, parameters: &[Option<ParameterValue>]) -> Vec<Cell> {
        let parameters = parameters.iter().map(|value| parameter_cell(value.as_ref()));
        parameters.chain(self.results).chain(self.measured).collect()
    }

    fn set(&mut self, name: &str, cell: Cell) -> &mut Self {
        let column = RESULTS.iter().chain(&CHECKED).position(|(column, _)| *column == name);
        debug_assert!(column.is_some(), "there is no column `{name}`");
        if let Some(place) = column.and_then(|column| self.results.get_mut(column)) {
            *place = cell;
        }
        self
    }

    /// A double; a value that does not exist is NaN.
    pub(crate) fn double(&mut self, name: &str, value: f64) -> &mut Self {
        self.set(name, if value.is_nan() { Cell::Empty } else { Cell::Double(value) })
    }

    /// A double with all its bits, and how far it may be off in the column beside it.
    fn uncertain(&mut self, name: &str, found: Uncertain) -> &mut Self {
        self.double(name, found.value).double(&format!("{name}_uncertainty"), found.plus_minus)
    }

    pub(crate) fn integer(&mut self, name: &str, value: u64) -> &mut Self {
        self.set(name, Cell::Integer(value))
    }

    pub(crate) fn word(&mut self, name: &str, word: impl Into<String>) -> &mut Self {
        self.set(name, Cell::Word(word.into()))
    }

    pub(crate) fn energies(&mut self, outcome: &EnergyOutcome) {
        let last = &outcome.last;
        self.integer("split_bead", outcome.split_bead);
        self.double("kinetic_j", last.kinetic_j).double("potential_j", last.potential_j);
        self.double("total_j", last.total_j);
        self.double("left_j", last.left_j).double("split_j", last.split_j).double("right_j", last.right_j);
        self.double("dissipated_j", last.dissipated_j);
        self.double("max_abs_relative_drift", outcome.max_abs_drift);
        if let Ok(reflection) = &outcome.reflection {
            self.reflection(reflection);
        }
    }

    fn reflection(&mut self, reflection: &Reflection) {
        if let Some(energies) = &reflection.energies {
            self.double("reflected_at_s", energies.at.time_s);
            self.uncertain("reflected_over_total", energies.over_total());
            self.uncertain("reflected_over_transmitted", energies.over_transmitted());
            self.double("reflected_uncertainty_j", energies.uncertainty_j);
        }
        if let Some(since) = reflection.stationary_since {
            self.double("stationary_since_s", since.time_s);
        }
        if let Some(recoil) = &reflection.recoil {
            self.double("recoil_j", recoil.energy_j).double("recoil_uncertainty_j", recoil.uncertainty_j);
        }
        if let Some(corrected) = reflection.corrected() {
            self.uncertain("corrected_over_total", corrected.over_total);
            self.uncertain("corrected_over_transmitted", corrected.over_transmitted);
            self.uncertain("corrected_over_incident", corrected.over_incident);
        }
    }

    /// Until when the run is determined; a run that is to its end is so until `end`.
    pub(crate) fn determined(&mut self, outcome: &Outcome) {
        let lost = outcome.first_lost();
        let until_s = lost.and_then(|lost| lost.until_s).unwrap_or(outcome.compared_until.1);
        let bound = lost.and_then(|lost| lost.bound).map_or("end", |bound| bound.as_str());
        self.double("determined_until_s", until_s).word("bounded_by", bound);
        if let Some(reflected) = outcome.of(Quantity::Reflected) {
            self.double("reflected_step_error", reflected.step.at_end);
            self.double("reflected_rounding_error", reflected.rounding.at_end);
        }
    }

    pub(crate) fn pulses(&mut self, counts: &Counts, leading: &[Leading; 2]) {
        self.integer("pulses", counts.pulses);
        self.integer("coarse_crests", counts.coarse_crests);
        self.integer("unresolved_crests", counts.unresolved_crests);
        self.integer("unfollowed", counts.unfollowed);
        for Leading { direction, count, strongest } in leading {
            let way = direction.as_str();
            self.integer(&format!("{way}_pulses"), *count);
            let Some(Pulse { measured: Measured { point, energy_j, .. }, .. }) = strongest else { continue };
            self.integer(&format!("{way}_bead"), point.bead);
            self.double(&format!("{way}_v_peak_m_s"), point.v_peak_m_s);
            self.double(&format!("{way}_speed_beads_per_s"), point.speed_beads_per_s.unwrap_or(f64::NAN));
            self.double(&format!("{way}_fwhm_beads"), point.shape.map_or(f64::NAN, |shape| shape.fwhm_beads));
            self.double(&format!("{way}_energy_j"), *energy_j);
        }
    }
}

/// The cell of the value of a parameter, which not every point has.
pub fn parameter_cell(value: Option<&ParameterValue>) -> Cell {
    match value {
        None => Cell::Empty,
        Some(ParameterValue::Integer(value)) => Cell::Integer(*value),
        Some(ParameterValue::Double(value)) => Cell::Double(*value),
        Some(ParameterValue::Word(word)) => Cell::Word(word.clone()),
    }
}
