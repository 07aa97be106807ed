//! Words that a person reads for the name of a column.

/// The ends of names that are units, the longest of those that fit first.
const UNITS: [(&str, &str); 25] = [
    ("_beads_per_s", "beads/s"),
    ("_rad_per_s", "rad/s"),
    ("_n_per_m", "N/m"),
    ("_n_per_m3", "N/m³"),
    ("_n_s_per_m", "N·s/m"),
    ("_kg_m3", "kg/m³"),
    ("_m_s2", "m/s²"),
    ("_beads2", "beads²"),
    ("_kg_m_s", "kg m/s"),
    ("_n_s", "N s"),
    ("_m_s", "m/s"),
    ("_beads_s", "beads/s"),
    ("_per_s", "1/s"),
    ("_per_m", "1/m"),
    ("_beads", "beads"),
    ("_kg", "kg"),
    ("_rad", "rad"),
    ("_hz", "Hz"),
    ("_pa", "Pa"),
    ("_j", "J"),
    ("_w", "W"),
    ("_k", "K"),
    ("_n", "N"),
    ("_m", "m"),
    ("_s", "s"),
];

/// Prefixes of columns of statistics, and their words.
const STATISTICS: [(&str, &str); 8] = [
    ("mean_", "mean of "),
    ("standard_error_", "standard error of "),
    ("median_", "median of "),
    ("q05_", "5 % quantile of "),
    ("q25_", "25 % quantile of "),
    ("q75_", "75 % quantile of "),
    ("q95_", "95 % quantile of "),
    ("missing_", "rows without "),
];

/// A column's name as the label of an axis: words, and the unit in brackets.
///
/// ```
/// use plots::column_label;
/// assert_eq!(column_label("striker.velocity_m_s"), "striker velocity (m/s)");
/// assert_eq!(column_label("chain.impurities[0].mass_kg"), "impurity 0 mass (kg)");
/// assert_eq!(column_label("forward_v_peak_m_s"), "forward peak velocity (m/s)");
/// assert_eq!(column_label("standard_error_total_j"), "standard error of total (J)");
/// assert_eq!(column_label("disorder[0].uniform"), "disorder 0 uniform");
/// assert_eq!(column_label("drive[0].displacement_m.sine.amplitude"), "drive 0 displacement (m)");
/// assert_eq!(column_label("drive[0].displacement_m.sine.frequency_hz"), "drive 0 frequency (Hz)");
/// assert_eq!(column_label("chain.alpha"), "α");
/// assert_eq!(column_label("initial.solitary.speed_beads_s"), "initial solitary speed (beads/s)");
/// assert_eq!(column_label("drive[0].steepness_per_m"), "drive 0 steepness (1/m)");
/// assert_eq!(column_label("modal(threshold=0.1).equipartition_s"), "modal equipartition (s), threshold=0.1");
/// assert_eq!(column_label("forces.peak_n@right"), "forces peak at right (N)");
/// ```
pub fn column_label(column: &str) -> String {
    let (prefix, name) = STATISTICS
        .iter()
        .find_map(|(start, words)| Some((*words, column.strip_prefix(start)?)))
        .unwrap_or(("", column));
    let (name, place) = match name.split_once('@') {
        Some((name, place)) => (name, format!(" at {place}")),
        None => (name, String::new()),
    };
    // options of an analysis stay as they are written
    if let Some((analysis, (options, name))) =
        name.split_once('(').and_then(|(analysis, rest)| Some((analysis, rest.split_once(").")?)))
    {
        return format!("{prefix}{analysis} {}{place}, {options}", column_label(name));
    }
    let name = name.strip_prefix("chain.").unwrap_or(name);
    let waveform = name.split_once(".sine.").map(|(drive, of)| match of {
        // it has the unit of its drive
        "amplitude" => drive.to_owned(),
        of => format!("{}.{of}", drive.split_once('.').map_or(drive, |(drive, _)| drive)),
    });
    let name = waveform.as_deref().unwrap_or(name);
    if name == "alpha" {
        return format!("{prefix}α");
    }
    let of = |(end, unit): &(&str, &'static str)| Some((name.strip_suffix(end)?, *unit));
    let (name, unit) = match UNITS.iter().find_map(of) {
        Some((name, unit)) if !name.is_empty() => (name, unit),
        _ => (name, ""),
    };
    let words = name.replace("v_peak", "peak_velocity").replace("impurities[", "impurity ");
    let words = words.replace(['_', '.', '['], " ").replace(']', "");
    let is_count = prefix.starts_with("rows") || unit.is_empty();
    let words = format!("{prefix}{words}{place}");
    if is_count { words } else { format!("{words} ({unit})") }
}
