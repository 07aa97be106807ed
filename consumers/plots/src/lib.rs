//! Figures of each analysis, drawn with [`figure`].

mod deformation;
mod determination;
mod fields;
mod film;
mod pulses;
mod tables;
mod waves;

pub use self::waves::{
    ModeShape, ModesShown, SensedForces, Spectra, TransmissionCurve, WavesOver, forces, mode_energies,
    mode_shapes, modes, spectra, wave_grid,
};
pub use deformation::deformations;
pub use determination::determination;
pub use fields::{ColourSteps, profile, profiles, space_time};
pub use film::Film;
pub use pulses::pulses;
pub use tables::{
    Band, HeatMap, TableCurve, TableFigure, TableFit, TablePanel, TablePoint, column_label, heat_map,
    table_curves,
};

use consumers::contacts::{COMPRESSED, Class, OPEN, TOUCHING};
use consumers::energies::{EnergyRow, Reflection, STATIONARY};
use consumers::impurity::{Event, EventKind, Motion};
use consumers::series::Series;
use consumers::space_time::{Cell, Extent, Picture};
use figure::{Axis, Colour, ColourScale, Curve, Figure, FigureError, Panel, Raster};
use schemas::manifest::{Physics, RunManifest};

/// The values of a column of [`EnergyRow`] over time.
fn energy_curve<'a>(
    rows: &'a Series<{ EnergyRow::COLUMNS.len() }>,
    name: &str,
) -> impl Iterator<Item = (f64, f64)> + use<'a> {
    let place = EnergyRow::COLUMNS.iter().position(|column| *column == name);
    place.into_iter().flat_map(|place| rows.curve(place))
}

/// The parameters of a run as one line of text.
pub fn caption(manifest: &RunManifest) -> String {
    let physics = &manifest.physics;
    let dt = scientific(physics.dt_s);
    let (name, phrases) = (&manifest.provenance.name, phrases(physics, SHOWN).join(", "));
    format!("{name}: {phrases}; {}, dt = {dt}\u{a0}s", physics.method)
}

/// Decimals of numbers and of powers of ten in phrases: those that are shown, and all.
const SHOWN: [usize; 2] = [5, 2];
const ALL: [usize; 2] = [16, 16];

/// The parameters that all of several runs have in common, to the last digit, in the words of [`caption`].
pub fn common_caption<'a>(runs: impl IntoIterator<Item = &'a Physics>) -> String {
    let mut runs = runs.into_iter();
    let both = |physics| phrases(physics, SHOWN).into_iter().zip(phrases(physics, ALL)).collect();
    let mut common: Vec<_> = runs.next().map(both).unwrap_or_default();
    for physics in runs {
        let own = phrases(physics, ALL);
        common.retain(|(_, phrase)| own.contains(phrase));
    }
    common.into_iter().map(|(phrase, _)| phrase).collect::<Vec<_>>().join(", ")
}

/// The parts of a run, a phrase for each parameter.
fn phrases(physics: &Physics, [decimals, of_powers]: [usize; 2]) -> Vec<String> {
    let short = |value: f64| fitting(value, decimals);
    let mut phrases = vec![format!("N = {}", physics.beads)];
    // beside spheres and bonds they are those of the scales, and decide nothing in the chain
    let of_spheres = physics.spheres.is_some();
    phrases.extend((!of_spheres).then(|| format!("m = {}\u{a0}g", short(physics.bead_mass_kg * 1e3))));
    if physics.bonds.is_none() {
        phrases.push(format!("α = {}", short(physics.alpha)));
        let stiffness = || format!("k = {}\u{a0}N\u{a0}m^{{−α}}", powered(physics.stiffness, of_powers));
        phrases.extend((!of_spheres).then(stiffness));
    }
    let impurities = physics.impurities.iter().take(4);
    phrases.extend(
        impurities
            .map(|impurity| format!("bead {}: {}\u{a0}g", impurity.bead, short(impurity.mass_kg * 1e3))),
    );
    if physics.impurities.len() > 4 {
        phrases.push(format!("… ({} impurities)", physics.impurities.len()));
    }
    // before a digit a hyphen is a minus
    let minus = |phrase: String, digit: char| phrase.replace(&format!("-{digit}"), &format!("−{digit}"));
    phrases.extend(physics.particulars().into_iter().map(|phrase| ('0'..='9').fold(phrase, minus)));
    let striker = physics.striker;
    if striker.velocity_m_s != 0.0 {
        let speed = short(striker.velocity_m_s);
        phrases.push(format!("v_{{0}} = {speed}\u{a0}m/s on bead {}", striker.bead));
    }
    phrases
}

/// A number in at most six digits.
fn short(value: f64) -> String {
    fitting(value, SHOWN[0])
}

/// A number in one digit and at most `decimals` others, as a power of ten where zeros would make it long.
fn fitting(value: f64, decimals: usize) -> String {
    let size = value.abs();
    if size > 0.0 && size < 1e-4 || (1e6..f64::INFINITY).contains(&size) {
        return powered(value, decimals).replace('-', "−");
    }
    let rounded = format!("{value:.decimals$e}").parse::<f64>().unwrap_or(value);
    format!("{rounded}").replace('-', "−")
}

/// Three digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Three digits, zeros among them.
fn three(value: f64) -> String {
    if value.abs() < 1e-2 {
        return scientific(value).replace('-', "−");
    }
    let power = value.abs().log10().floor();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 5")]
    let decimals = (2.0 - power).clamp(0.0, 5.0) as usize;
    format!("{value:.decimals$}").replace('-', "−")
}

/// A quantity in three digits, with a prefix.
fn quantity(value: f64, unit: &str) -> String {
    let (prefix, factor) = prefix(value.abs());
    format!("{}\u{a0}{prefix}{unit}", short(rounded(value * factor)))
}

/// A number as `1.45×10^{−6}`.
fn scientific(value: f64) -> String {
    powered(value, SHOWN[1])
}

/// The same with at most so many `decimals`.
fn powered(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let digits =
        if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits };
    let power = format!("10^{{{}}}", exponent.replace('-', "−"));
    if digits == "1" { power } else { format!("{digits}×{power}") }
}

/// A prefix of a unit and how many of it make one, so that `largest` is shown as 1 to 1000 of them.
fn prefix(largest: f64) -> (&'static str, f64) {
    match largest {
        value if value >= 1.0 => ("", 1.0),
        value if value >= 1e-3 => ("m", 1e3),
        value if value >= 1e-6 => ("µ", 1e6),
        _ => ("n", 1e9),
    }
}

/// Columns of any rows over time, a panel for each.
pub fn columns_over_time<'a>(
    manifest: &RunManifest,
    names: impl IntoIterator<Item = &'a str>,
    curves: &[Series<1>],
) -> Figure {
    let panel = |(name, curve): (&str, &Series<1>)| {
        let points = curve.curve(0).map(|(t, value)| (t * 1e3, value));
        Panel::new().x_axis("time (ms)").y_axis(column_label(name)).line("", points)
    };
    let panels = names.into_iter().zip(curves).map(panel);
    panels.fold(Figure::new().shared_x().caption(caption(manifest)), Figure::panel)
}

/// Names and columns of the energies left of, in and right of the split bead.
fn parts(split_bead: u64) -> [(String, &'static str); 3] {
    let of = |place: &str| format!("{place}bead {split_bead}");
    [(of("left of "), "left_j"), (of(""), "split_j"), (of("right of "), "right_j")]
}

/// The energies left of, in and right of the split bead, what of them may still cross it, and the drift of
/// their sum. Where something is reflected, also when the pulse arrived and since when that is stationary.
pub fn energies(
    manifest: &RunManifest,
    split_bead: u64,
    rows: &Series<{ EnergyRow::COLUMNS.len() }>,
    reflection: Option<&Reflection>,
) -> Figure {
    let curve = |column: &str, factor: f64| {
        energy_curve(rows, column).map(move |(t, value)| (t * 1e3, value * factor))
    };
    let panel = || Panel::new().x_axis("time (ms)");
    let of_part = |panel: Panel, (name, column)| panel.line(name, curve(column, 1e3));
    let parts = parts(split_bead).into_iter().fold(panel().y_axis("energy (mJ)"), of_part);
    let physics = &manifest.physics;
    let is_conserved = physics.is_without_loss() && physics.drives.is_empty() && physics.baths.is_empty();
    let drift = panel()
        .y_axis(if is_conserved { "(E−E_{0})/E_{0}" } else { "error of the balance ΔE/E" })
        .curve(Curve::line("", curve("relative_drift", 1.0)).colour(Colour::Black))
        .height(0.6);
    let figure = Figure::new().shared_x().caption(caption(manifest)).panel(parts);
    match reflection {
        Some(reflection) => figure.panel(scattering(panel(), rows, reflection)).panel(drift),
        None => figure.panel(drift),
    }
}

/// Panel of the energy on the incident side without the recoil, and of the energy that may still cross, both as parts
/// of the total energy.
fn scattering(panel: Panel, rows: &Series<{ EnergyRow::COLUMNS.len() }>, reflection: &Reflection) -> Panel {
    // the total is another one from then on
    let end_s = reflection.exchanged.map_or(f64::INFINITY, |at| at.time_s);
    let part = |column: &str| {
        let both = energy_curve(rows, column).zip(energy_curve(rows, "total_j"));
        both.filter(move |((t, _), _)| *t < end_s).map(|((t, value), (_, total))| (t * 1e3, value / total))
    };
    let mut panel = panel
        .y_axis(Axis::new("energy/total").log().limits(1e-7, 2.0))
        .line("reflected, without recoil", part("corrected_j"))
        .line("may still cross", part("inbound_j"))
        .horizontal("", STATIONARY);
    if let Some(since) = reflection.stationary_since {
        let last_s = rows.span_s().map_or(since.time_s, |(_, last_s)| last_s);
        let until_s = reflection.until().map_or(last_s, |at| at.time_s);
        panel = panel.band_x("stationary", since.time_s * 1e3, until_s * 1e3);
    }
    panel
}

/// Most turning points that are marked: more would hide the curves.
const MOST_TURNS: usize = 60;

/// Displacement and velocity of the beads that were followed; `motions` holds one series a bead.
pub fn trajectories(
    manifest: &RunManifest,
    beads: &[u64],
    motions: &[Series<{ Motion::QUANTITIES.len() }>],
    events: &[Event],
) -> Figure {
    let (from_ms, to_ms) = shown_ms(motions, events);
    let panel =
        |label: &str| Panel::new().x_axis(Axis::new("time (ms)").limits(from_ms, to_ms)).y_axis(label);
    let (mut displacement, mut velocity) = (panel("displacement (mm)"), panel("velocity (m/s)").height(0.7));
    for (bead, series) in beads.iter().zip(motions) {
        let displacements = series.curve(0).map(|(t, u)| (t * 1e3, u * 1e3));
        displacement = displacement.line(format!("bead {bead}"), displacements);
        velocity = velocity.line("", series.curve(1).map(|(t, v)| (t * 1e3, v)));
    }
    let turns = events.iter().filter(|event| event.kind == EventKind::Turns);
    let turns: Vec<_> = turns.map(|event| (event.time_s * 1e3, event.u_m * 1e3)).collect();
    if turns.len() > MOST_TURNS {
        displacement = displacement.note(format!("{} turning points", turns.len()));
    } else if !turns.is_empty() {
        displacement = displacement.curve(Curve::points("turning points", turns).colour(Colour::Black));
    }
    Figure::new().shared_x().caption(caption(manifest)).panel(displacement).panel(velocity)
}

/// The times (ms) from a little before the first event to the end, or all of them: where the first event is a turn, motion came before it.
fn shown_ms(motions: &[Series<{ Motion::QUANTITIES.len() }>], events: &[Event]) -> (f64, f64) {
    let Some((first_s, last_s)) = motions.first().and_then(Series::span_s) else { return (0.0, 1.0) };
    let first = events.first().filter(|event| event.kind != EventKind::Turns);
    let begin_s = first.map_or(first_s, |event| event.time_s - 0.04 * (last_s - event.time_s));
    (if begin_s > first_s { begin_s } else { first_s } * 1e3, last_s * 1e3)
}

/// The space-time map of the contacts, time running down as in the paper.
///
/// # Errors
/// When the cells hold something else than classes of contacts.
pub fn contact_map(
    manifest: &RunManifest,
    tolerance_m: f64,
    picture: &Picture<Class>,
) -> Result<Figure, FigureError> {
    const NOTHING: u8 = 3;
    let mut classes = vec![("", Colour::White); 3];
    classes[usize::from(TOUCHING)] = ("touching", Colour::White);
    classes[usize::from(COMPRESSED)] = ("compressed", Colour::Black);
    classes[usize::from(OPEN)] = ("open", Colour::Orange);
    let cells: Vec<u8> = picture.cells().map(|class| class.map_or(NOTHING, |class| class.0)).collect();
    if cells.contains(&NOTHING) {
        classes.push(("no frames", Colour::LightGrey));
    }
    let (columns, rows) = sides(picture);
    let map = Raster::classes(columns, rows, cells, &classes)?;
    let panel = map_panel(manifest, "contact", picture.extent(), map);
    let text = format!("{}; touching: |δ| ≤ {} m", caption(manifest), scientific(tolerance_m));
    Ok(Figure::new().caption(text).panel(panel))
}

/// Columns and rows, of which there are at most [`Cell::MOST`].
fn sides<T: Cell>(picture: &Picture<T>) -> (u32, u32) {
    let side = |cells: usize| u32::try_from(cells).unwrap_or(u32::MAX);
    (side(picture.columns()), side(picture.rows()))
}

/// A map of numbers from 0 to 1 of each bead, which `label` names, over time.
///
/// # Errors
/// When the map cannot be drawn, which is a mistake of ours.
pub fn share_map(manifest: &RunManifest, label: &str, picture: &Picture<f32>) -> Result<Panel, FigureError> {
    let (columns, rows) = sides(picture);
    let cells: Vec<Option<f32>> = picture.cells().collect();
    let raster = Raster::values(columns, rows, &cells, ColourScale::new(label, 0.0, 1.0))?;
    Ok(map_panel(manifest, "bead", picture.extent(), raster))
}

/// A panel with a raster over places and times, time running down.
fn map_panel(manifest: &RunManifest, place: &str, extent: &Extent, raster: Raster) -> Panel {
    let (first, last) = (*extent.steps.start(), *extent.steps.end());
    let time_ms = |step: u64| manifest.physics.time_s(step) * 1e3;
    let end_ms = time_ms(last.max(first + 1));
    let edges = (extent.places.start as f64 - 0.5, extent.places.end as f64 - 0.5);
    Panel::new()
        .x_axis(Axis::new(place).limits(edges.0, edges.1))
        .y_axis(Axis::new("time (ms)").limits(time_ms(first), end_ms).reversed())
        .raster(raster.over(edges, (time_ms(first), end_ms)))
        .height(1.6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::config::RunConfig;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    #[test]
    fn a_caption_names_every_parameter() {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let m = RunManifest::new(&PRESETS[0].config(), "run", origin).expect("valid");
        assert_eq!(
            caption(&m).replace('\u{a0}', " "),
            "light-impurity: N = 1000, m = 1 g, α = 1.5, k = 10^{7} N m^{−α}, bead 500: 0.6 g, \
             v_{0} = 5 m/s on bead 0; rkn4, dt = 1.45×10^{−6} s"
        );
    }

    #[test]
    fn numbers_are_short_and_none_is_lost() {
        let numbers = [0.0, 0.6, 1_234.567_89, 1e-4, 999_999.0, 1e-27, -5e18];
        let expected = ["0", "0.6", "1234.57", "0.0001", "999999", "10^{−27}", "−5×10^{18}"];
        assert_eq!(numbers.map(short), expected);
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let one = RunManifest::new(&PRESETS[0].config(), "run", origin).expect("valid").physics;
        let mut other = one.clone();
        assert!(common_caption([&one, &other]).contains("v_{0} = 5\u{a0}m/s on bead 0"));
        other.striker.velocity_m_s += 1e-10;
        assert!(!common_caption([&one, &other]).contains("v_{0}"), "they differ");
    }

    /// Bonds have laws of their own: the contact law is not that of the chain.
    #[test]
    fn a_caption_of_bonds_has_no_contact_law() {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let config = RunConfig::from_toml(
            "name = 'bonded'\nchain = { beads = 8, bead_mass_kg = 1.0, bonds = { linear = 1.0, cubic = 5.0 } }\n\
             striker = { bead = 0, velocity_m_s = 1.0 }\ntime = { duration_s = 1.0, dt_s = 0.01 }",
        );
        let m = RunManifest::new(&config.expect("valid"), "run", origin).expect("valid");
        for text in [caption(&m), common_caption([&m.physics])] {
            assert!(text.contains("N = 8, m = 1000\u{a0}g, bonds: linear 1, cubic (FPUT-β) 5"), "{text}");
            assert!(!text.contains('α') && !text.contains("k = "), "{text}");
        }
    }
}
