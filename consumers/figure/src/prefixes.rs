//! Prefixes of units.

/// True if the unit of an axis label has a prefix, or can have one, for thousands of it.
pub(super) fn takes_prefix(label: &str) -> bool {
    let unit = label.strip_suffix(')').and_then(|label| label.rsplit_once('('));
    unit.is_some_and(|(_, unit)| with_prefix(unit, 3).is_some())
}

/// A unit made 10^`exponent` times as large by its prefix, if it has one of SI and its first part is not raised to a
/// power.
pub(super) fn with_prefix(unit: &str, exponent: i32) -> Option<String> {
    const PREFIXES: [(&str, i32); 9] =
        [("", 0), ("f", -15), ("p", -12), ("n", -9), ("µ", -6), ("m", -3), ("k", 3), ("M", 6), ("G", 9)];
    const UNITS: [&str; 8] = ["m", "s", "g", "N", "J", "W", "Pa", "Hz"];
    let length = unit.find(|character: char| !character.is_alphabetic()).unwrap_or(unit.len());
    let (first, rest) = unit.split_at(length);
    if rest.starts_with(['^', '²', '³', '⁻']) {
        return None;
    }
    let known = |(prefix, power): &(&str, i32)| {
        let base = first.strip_prefix(prefix).filter(|base| UNITS.contains(base))?;
        Some((base, *power))
    };
    let (base, old) = PREFIXES.iter().find_map(known)?;
    let (prefix, _) = PREFIXES.iter().find(|(_, power)| *power == old + exponent)?;
    Some(format!("{prefix}{base}{rest}"))
}
