//! An orbit in words and as JSON.

use crate::display::counted;
use crate::report::Rows;
use orbits::multipliers::Limit;
use orbits::{Orbit, shown};
use schemas::amounts::{number, quantity};
use serde_json::{Value, json};

/// Multipliers that are listed.
const SHOWN: usize = 6;

/// Tells that a residual is larger than rounding, and why.
pub(super) fn tell_residual(orbit: &Orbit) {
    // the whole period has twice the roundings
    if orbit.returns > 100.0 * orbits::newton::TOLERANCE {
        notice!(
            "the state comes back to {:.0e} only, of its size: where contacts open within steps, or changes grow by much in a period, no state \
             comes back to rounding; more steps (orbit.steps) or parts (orbit.segments) help",
            orbit.returns
        );
    }
}

pub(super) fn words(orbit: &Orbit) -> String {
    let found = limit(orbit).map_or(String::new(), |limit| format!("; multipliers: {limit}"));
    format!("period {}, {}{found}", quantity(orbit.period_s(), "s"), shown::way(&orbit.multipliers))
}

/// The extent to which multipliers are found, where they are not all.
fn limit(orbit: &Orbit) -> Option<String> {
    let Limit { above, residual } = orbit.multipliers.limit()?;
    Some(match orbit.multipliers.found() {
        [] => format!("none above {above:.4} in size"),
        _ => format!("those above {above:.4} in size, to a residual of {residual:.0e}"),
    })
}

pub(super) fn add_rows(rows: &mut Rows, orbit: &Orbit) {
    let steps = orbit.physics.step_count;
    let period = quantity(orbit.period_s(), "s");
    rows.add(
        "period",
        format_args!("{period} ({} of {})", counted(steps, "step"), quantity(orbit.physics.dt_s, "s")),
    );
    let place = shown::place(orbit).map_or(String::new(), |place| format!(", {place}"));
    rows.add("frequency", format_args!("{}{place}", quantity(1.0 / orbit.period_s(), "Hz")));
    rows.add("energy", quantity(orbit.energy_j, "J"));
    rows.add("largest displacement", format_args!("{} at its beginning", quantity(orbit.amplitude_m(), "m")));
    let asked = orbit.surpassed().map(|(bead, size_m)| format!("{}, of bead {bead}", quantity(size_m, "m")));
    rows.each("asked for", asked);
    rows.add("comes back to", format_args!("{:.1e} of its size", orbit.returns));
    let unstable: Vec<_> = orbit.multipliers.unstable().collect();
    rows.add(
        "stability",
        if unstable.is_empty() {
            shown::way(&orbit.multipliers).to_owned()
        } else {
            format!("{} outside of the unit circle", counted(unstable.len() as u64, "multiplier"))
        },
    );
    rows.each(
        "multiplier",
        unstable.iter().take(SHOWN).map(|one| {
            let kind = orbit.multipliers.kind(*one).as_str();
            format!(
                "{} {} {}i, |μ| = {}: {kind}",
                number(one.re),
                if one.im < 0.0 { '−' } else { '+' },
                number(one.im.abs()),
                beside_one(one.size())
            )
        }),
    );
    rows.more("multiplier", unstable.len() as u64, SHOWN, "");
    rows.each("multipliers found", limit(orbit));
}

/// A size in digits that tell it from 1.
fn beside_one(size: f64) -> String {
    let above = size - 1.0;
    if above > 0.0 && above < 1e-3 { format!("1 + {above:.2e}") } else { number(size) }
}

/// An orbit as JSON.
pub(super) fn told(orbit: &Orbit) -> Value {
    let unstable = orbit.multipliers.unstable().map(|one| {
        json!({ "re": one.re, "im": one.im, "size": one.size(), "kind": orbit.multipliers.kind(one).as_str() })
    });
    json!({
        "period_s": orbit.period_s(),
        "frequency_hz": 1.0 / orbit.period_s(),
        "frequency_is": shown::place(orbit),
        "steps": orbit.physics.step_count,
        "dt_s": orbit.physics.dt_s,
        "energy_j": orbit.energy_j,
        "amplitude_m": orbit.amplitude_m(),
        "asked_bead": orbit.asked_bead,
        "residuals": orbit.residuals,
        "returns": orbit.returns,
        "is_stable": orbit.multipliers.is_stable(),
        "unstable": unstable.collect::<Vec<_>>(),
        "multipliers": orbit.multipliers.found(),
        "multipliers_limit": orbit.multipliers.limit(),
    })
}
