//! Pulses that pass a bead, in a run and in its partners: with twice the step, and with another last digit.

use super::judgement::{Counted, Number, StudyError, pool_uncertainty};
use super::observe::{Observations, Observed};
use super::reference::ReferenceTable;
use super::runs::Run;
use consumers::pulses::Passage;

/// A pulse in a run, and the same one in the run with twice the step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Passed {
    pub(super) fine: Passage,
    pub(super) coarse: Passage,
    /// The largest relative error of the energy in the run.
    pub(super) drift: f64,
}

impl Passed {
    /// Its amplitude (m/s).
    pub(super) fn amplitude(self, what: impl Into<String>) -> Number {
        self.number(what, "m/s", |pulse| pulse.v_peak_m_s)
    }

    /// Its speed (beads/s).
    pub(super) fn speed(self, what: impl Into<String>) -> Number {
        self.number(what, "beads/s", |pulse| pulse.speed_beads_per_s)
    }

    fn number(self, what: impl Into<String>, unit: &'static str, of: fn(&Passage) -> f64) -> Number {
        Number::stepped(what, (of(&self.fine), of(&self.coarse)), unit, self.drift)
    }
}

/// The run, and the same with twice the step.
pub(super) fn both_steps(run: Run) -> Vec<Run> {
    let coarse = run.clone().with_step_times(2);
    vec![run, coarse]
}

/// The run and its partners.
pub(super) fn with_partners(run: Run) -> Vec<Run> {
    let (coarse, twin) = (run.clone().with_step_times(2), run.clone().twin());
    vec![run, coarse, twin]
}

/// A count in a run, and in its partners.
pub(super) fn counted(
    seen: &Observations,
    run: Run,
    count: impl Fn(&Observed) -> Result<usize, StudyError>,
) -> Result<Counted, StudyError> {
    let counts = with_partners(run).iter().map(|run| count(seen.of(run)?)).collect::<Result<Vec<_>, _>>()?;
    Ok(Counted::of(&counts))
}

/// Number of pulses that pass `bead` in one direction.
pub(super) fn count_past(
    seen: &Observations,
    run: Run,
    bead: u64,
    forward: bool,
) -> Result<Counted, StudyError> {
    counted(seen, run, |seen| Ok(seen.pulses_past(bead, forward).len()))
}

/// The first `count` pulses that pass `bead` in one direction.
pub(super) fn pulses(
    seen: &Observations,
    run: &Run,
    bead: u64,
    forward: bool,
    count: usize,
) -> Result<Vec<Passed>, StudyError> {
    let (fine, coarse) = (seen.of(run)?, seen.of(&run.clone().with_step_times(2))?);
    let pairs = fine.pulses_past(bead, forward).into_iter().zip(coarse.pulses_past(bead, forward));
    let drift = fine.max_abs_drift;
    let pulses: Vec<_> = pairs.map(|(fine, coarse)| Passed { fine, coarse, drift }).take(count).collect();
    if pulses.len() < count {
        return Err(fine.absent(format!("{} pulse {} at bead {bead}", direction(forward), pulses.len() + 1)));
    }
    Ok(pulses)
}

/// The pulses of a reference table: forward ones at bead 700, backward ones at bead 300.
pub(super) fn pulses_of_table(
    seen: &Observations,
    run: &Run,
    table: ReferenceTable,
    forward: bool,
) -> Result<Vec<Passed>, StudyError> {
    let count = table.rows().filter(|row| row[0] == direction(forward)).count();
    pulses(seen, run, if forward { FORWARD_BEAD } else { BACKWARD_BEAD }, forward, count)
}

/// Beads at which pulses behind and before the impurity at bead 500 are measured.
pub(super) const FORWARD_BEAD: u64 = 700;
pub(super) const BACKWARD_BEAD: u64 = 300;

/// Amplitude and speed of each pulse, against a table that is good to the part `good_to`.
pub(super) fn against_table(
    pulses: &[Passed],
    table: ReferenceTable,
    forward: bool,
    good_to: f64,
) -> Result<Vec<Number>, StudyError> {
    let direction = direction(forward);
    let mut numbers = Vec::new();
    for (index, pulse) in pulses.iter().enumerate() {
        let order = (index + 1).to_string();
        let reference = table.values(&[direction, &order])?;
        let amplitude = pulse.amplitude(format!("{direction} pulse {order}: peak velocity"));
        let speed = pulse.speed(format!("{direction} pulse {order}: speed"));
        numbers.extend([amplitude.against(reference[0], good_to), speed.against(reference[1], good_to)]);
    }
    pool_uncertainty(&mut numbers);
    Ok(numbers)
}

fn direction(forward: bool) -> &'static str {
    if forward { "forward" } else { "backward" }
}

/// The amplitudes (m/s).
pub(super) fn heights(pulses: &[Passed]) -> Vec<f64> {
    pulses.iter().map(|pulse| pulse.fine.v_peak_m_s).collect()
}

/// True if the magnitudes fall from each to the next.
pub(super) fn falls(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair[1].abs() < pair[0].abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn magnitudes_fall() {
        assert!(falls(&[-3.0, 2.0, -1.0]) && falls(&[1.0]) && !falls(&[1.0, 1.0]) && !falls(&[2.0, -3.0]));
    }
}
