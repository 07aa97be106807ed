//! The known name that a misspelt one is meant to be.

/// `; did you mean `alpha`?` where one of the names in `known` is near to `found`, else nothing.
///
/// ```
/// use schemas::spelling::did_you_mean;
/// let known = ["alpha", "bead_mass_kg", "stiffness"];
/// assert_eq!(did_you_mean("alhpa", known), "; did you mean `alpha`?");
/// assert_eq!(did_you_mean("bead_mass", known), "; did you mean `bead_mass_kg`?");
/// assert_eq!(did_you_mean("colour", known), "");
/// ```
pub fn did_you_mean<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    closest(found, known).map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}

/// The nearest name: one that differs in at most a third of its letters, or that `found` is without its unit.
fn closest<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let letters: Vec<char> = found.to_lowercase().chars().collect();
    let far = letters.len() / 3 + 1;
    let distance = |name: &str| {
        let is_without_unit = name.strip_prefix(found).is_some_and(|rest| rest.starts_with('_'));
        if is_without_unit { 1 } else { edits(&letters, &name.chars().collect::<Vec<_>>()) }
    };
    let distances = known.into_iter().map(|name| (distance(name), name));
    // one letter has nothing in common with another
    let near = distances.filter(|(distance, name)| *distance <= far && *distance < name.chars().count());
    near.min_by_key(|(distance, _)| *distance).map(|(_, name)| name)
}

/// Letters that are put in, left out, replaced, or swapped with their neighbour to make one word of another.
fn edits(one: &[char], other: &[char]) -> usize {
    let mut rows: Vec<Vec<usize>> = vec![(0..=other.len()).collect()];
    for i in 1..=one.len() {
        let mut row = vec![i];
        for j in 1..=other.len() {
            let replaced = rows[i - 1][j - 1] + usize::from(one[i - 1] != other[j - 1]);
            let mut least = replaced.min(rows[i - 1][j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && one[i - 1] == other[j - 2] && one[i - 2] == other[j - 1] {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            row.push(least);
        }
        rows.push(row);
    }
    rows[one.len()][other.len()]
}
