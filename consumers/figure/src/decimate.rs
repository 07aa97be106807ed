//! Thins curves that are too dense to be seen, so that files stay small and no peak disappears.

/// Finest detail kept, in points: a dot at 300 dots per inch.
const DOT: f64 = 72.0 / 300.0;
/// Places farther away than this are drawn here: off any page, and still short to write.
const FAR: f64 = 1e4;

/// A line with the same look and at most `limit` points (at least 8): of each stretch that stays within
/// one column of dots the first, the extreme and the last points are kept, in their order. Where that
/// leaves too many, as on a path that runs along y, the same is done for rows, and then for larger dots.
pub(super) fn line(points: &[(f64, f64)], limit: usize) -> Vec<(f64, f64)> {
    let clamp = |place: f64| place.clamp(-FAR, FAR);
    let mut thinned: Vec<_> = points.iter().map(|&(x, y)| (clamp(x), clamp(y))).collect();
    let mut dot = DOT;
    loop {
        thinned = thin(&thinned, |(x, _)| (x / dot).floor());
        if thinned.len() <= limit.max(8) || dot > FAR {
            return thinned;
        }
        thinned = thin(&thinned, |(_, y)| (y / dot).floor());
        dot *= 1.5;
    }
}

/// Keeps the first, the outermost four and the last points of each stretch with the same `strip`.
fn thin(points: &[(f64, f64)], strip: impl Fn((f64, f64)) -> f64) -> Vec<(f64, f64)> {
    let mut kept = Vec::new();
    for stretch in points.chunk_by(|a, b| strip(*a) == strip(*b)) {
        let mut chosen = [0, 0, 0, 0, 0, stretch.len() - 1];
        for (index, (x, y)) in stretch.iter().enumerate() {
            let beyond = [
                *x < stretch[chosen[1]].0,
                *x > stretch[chosen[2]].0,
                *y < stretch[chosen[3]].1,
                *y > stretch[chosen[4]].1,
            ];
            for (outermost, beyond) in chosen[1..5].iter_mut().zip(beyond) {
                if beyond {
                    *outermost = index;
                }
            }
        }
        chosen.sort_unstable();
        let mut chosen = chosen.to_vec();
        chosen.dedup();
        kept.extend(chosen.into_iter().map(|index| stretch[index]));
    }
    kept
}

/// Keeps the first of the markers that fall on the same dot; at most `limit` (at least 8) in all.
pub(super) fn marks(points: &[(f64, f64)], limit: usize) -> Vec<(f64, f64)> {
    let mut dot = DOT;
    loop {
        let mut taken = std::collections::BTreeSet::new();
        let cell = |place: f64| {
            // Clamped to a range that i32 holds many times over.
            #[allow(clippy::cast_possible_truncation)]
            let cell = (place.clamp(-FAR, FAR) / dot).floor() as i32;
            cell
        };
        let visible = points.iter().copied();
        let kept: Vec<_> = visible.filter(|&(x, y)| taken.insert((cell(x), cell(y)))).collect();
        if kept.len() <= limit.max(8) || dot > FAR {
            return kept;
        }
        dot *= 1.5;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(count: u32) -> Vec<(f64, f64)> {
        let place = |index: u32| {
            let hash = index.wrapping_mul(2_654_435_761) >> 8;
            (f64::from(index) * 200.0 / f64::from(count), f64::from(hash % 1000) / 10.0)
        };
        (0..count).map(place).collect()
    }

    #[test]
    fn a_single_peak_among_55_000_points_survives() {
        let mut points: Vec<_> = (0..55_000).map(|i| (f64::from(i) * 200.0 / 55_000.0, 50.0)).collect();
        points[31_415].1 = 3.0;
        points[31_417].1 = 97.0;
        let thinned = line(&points, 4000);
        assert!(thinned.len() < 2000);
        assert!(thinned.contains(&points[31_415]) && thinned.contains(&points[31_417]));
    }

    #[test]
    fn a_line_keeps_its_order_its_ends_and_its_limit() {
        let points = noise(55_000);
        let thinned = line(&points, 4000);
        assert!(thinned.len() <= 4000);
        assert!(thinned.windows(2).all(|pair| pair[0].0 <= pair[1].0));
        assert_eq!(thinned.first(), points.first());
        assert_eq!(thinned.last(), points.last());
    }

    #[test]
    fn a_path_that_runs_along_y_is_thinned_too() {
        let upright: Vec<_> = noise(55_000).into_iter().map(|(x, y)| (y, x)).collect();
        assert!(line(&upright, 4000).len() <= 4000);
    }

    #[test]
    fn few_points_are_left_alone() {
        let points = [(0.0, 0.0), (50.0, 1.0), (50.01, 80.0), (100.0, 0.0)];
        assert_eq!(line(&points, 100), points);
        assert_eq!(line(&[], 100), []);
        assert_eq!(marks(&points, 100), points);
    }

    #[test]
    fn markers_stay_below_their_limit() {
        assert!(marks(&noise(55_000), 3000).len() <= 3000);
    }
}
