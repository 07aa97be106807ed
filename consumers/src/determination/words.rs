//! Results in words.

use super::{Outcome, Quantity};
use schemas::amounts::seconds;
use schemas::manifest::Physics;

/// The verdict in one line.
pub fn verdict(physics: &Physics, outcome: &Outcome) -> String {
    let end = time(physics, outcome.compared_until.1);
    let tolerance = outcome.tolerance;
    match outcome.first_lost() {
        None if outcome.compared_until.0 == physics.step_count => {
            format!("to the end, {end}, within {tolerance:e}")
        }
        None => format!("as far as it was compared, {end}, within {tolerance:e}"),
        Some(lost) => format!(
            "until {} of {end} within {tolerance:e}: {}, bounded by {}",
            time(physics, lost.until_s.unwrap_or_default()),
            label(lost.quantity, physics, outcome.split_bead),
            lost.bound.map_or("", |bound| bound.as_str()),
        ),
    }
}

/// A time, also in T.
pub fn time(physics: &Physics, time_s: f64) -> String {
    format!("{} ({:.0} T)", seconds(time_s), time_s / physics.scales().time_s)
}

/// Name of a quantity in text.
pub fn label(quantity: Quantity, physics: &Physics, split_bead: u64) -> String {
    let bead = match &physics.impurities[..] {
        [] => format!("bead {split_bead}"),
        [only] => format!("bead {}", only.bead),
        _ => "impurities".to_owned(),
    };
    match quantity {
        Quantity::Displacement => "displacement of any bead".to_owned(),
        Quantity::Velocity => "velocity of any bead".to_owned(),
        Quantity::Peak => "peak velocity".to_owned(),
        Quantity::Position => format!("displacement of {bead}"),
        Quantity::BeadVelocity => format!("velocity of {bead}"),
        Quantity::TotalEnergy => "total energy".to_owned(),
        Quantity::LeftEnergy => format!("energy left of bead {split_bead}"),
        Quantity::SplitEnergy => format!("energy of bead {split_bead}"),
        Quantity::RightEnergy => format!("energy right of bead {split_bead}"),
        Quantity::Reflected => "reflected part".to_owned(),
        Quantity::Contacts => "classes of contacts".to_owned(),
        Quantity::Front => "front bead".to_owned(),
        Quantity::Pulses => "number of pulses".to_owned(),
    }
}
