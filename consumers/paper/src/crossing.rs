//! Crossings of two curves over the same masses, and the masses at which a crossing is still uncertain.
//!
//! A difference has a sign only if it is larger than its uncertainty. Two curves count as not crossing only if the
//! masses lie close enough: [`wanting`] names the masses to add first.

use consumers::uncertain::Uncertain;

/// Masses (g) are not put closer together than this.
const FINEST_G: f64 = 0.0125;

/// One curve minus another at a mass (g), and its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Difference {
    pub(super) mass_g: f64,
    pub(super) value: f64,
    pub(super) off: f64,
}

impl Difference {
    /// −1 or 1, or 0 where it is not certain.
    fn sign(self) -> f64 {
        if self.value.abs() > self.off { self.value.signum() } else { 0.0 }
    }
}

/// The masses (g) at which two curves cross, between differences in the order of their masses. They may be off by half the
/// distance between the masses where the sign is certain.
pub(super) fn crossings(differences: &[Difference]) -> Vec<Uncertain> {
    let certain: Vec<Difference> = differences.iter().copied().filter(|at| at.sign() != 0.0).collect();
    let change = |pair: &[Difference]| {
        let [from, to] = [pair[0], pair[1]];
        let width_g = to.mass_g - from.mass_g;
        let mass_g = from.mass_g + width_g * from.value / (from.value - to.value);
        (from.sign() != to.sign()).then(|| Uncertain::new(mass_g, 0.5 * width_g))
    };
    certain.windows(2).filter_map(change).collect()
}

/// The masses (g) to add before it can be said that there are no crossings but those found: the middle of each interval
/// that is wider than [`FINEST_G`] and where the sign at an end is not certain, or where the difference comes so near
/// zero that it may cross it twice.
pub(super) fn wanting(differences: &[Difference]) -> Vec<f64> {
    let is_wanting = |left: usize| {
        let (from, to) = (differences[left], differences[left + 1]);
        if to.mass_g - from.mass_g <= FINEST_G * (1.0 + 1e-9) || from.sign() * to.sign() < 0.0 {
            return false;
        }
        from.sign() * to.sign() == 0.0 || may_touch_zero(differences, left)
    };
    let middle_g = |left: usize| 0.5 * (differences[left].mass_g + differences[left + 1].mass_g);
    // to a microgram, for names that are short
    let rounded = |mass_g: f64| (mass_g * 1e6).round() / 1e6;
    (0..differences.len().saturating_sub(1))
        .filter(|left| is_wanting(*left))
        .map(|left| rounded(middle_g(left)))
        .collect()
}

/// True if the difference may come to zero between number `left` and the next, which have the same certain sign. Both
/// its branches are continued as straight lines: a curve that dips towards zero and comes back lies above their meeting
/// point.
fn may_touch_zero(differences: &[Difference], left: usize) -> bool {
    let (from, to) = (differences[left], differences[left + 1]);
    let sign = from.sign();
    let slope = |a: Difference, b: Difference| sign * (b.value - a.value) / (b.mass_g - a.mass_g);
    let into = left.checked_sub(1).map_or(0.0, |before| slope(differences[before], from));
    let out = differences.get(left + 2).map_or(0.0, |after| slope(to, *after));
    let (near, far) = (sign * from.value, sign * to.value);
    let width_g = to.mass_g - from.mass_g;
    if into >= out {
        return false;
    }
    // near + into·x = far − out·(width − x)
    let meet_g = (far - out * width_g - near) / (into - out);
    (0.0..=width_g).contains(&meet_g) && near + into * meet_g <= from.off.max(to.off)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn differences(points: &[(f64, f64, f64)]) -> Vec<Difference> {
        points
            .iter()
            .map(|(mass_g, value, off)| Difference { mass_g: *mass_g, value: *value, off: *off })
            .collect()
    }

    /// Two thirds of the way from −1 to 0.5, and a certain sign on either side of an uncertain one.
    #[test]
    fn crossings_are_between_certain_signs() {
        let found =
            crossings(&differences(&[(1.0, -1.0, 0.1), (2.0, 0.5, 0.1), (3.0, 0.05, 0.1), (4.0, 2.0, 0.1)]));
        assert_eq!(found.len(), 1);
        assert!((found[0].value - 5.0 / 3.0).abs() < 1e-12 && found[0].plus_minus == 0.5);
        let across = crossings(&differences(&[(1.0, -1.0, 0.1), (2.0, 0.05, 0.1), (3.0, 1.0, 0.1)]));
        assert_eq!(across, [Uncertain::new(2.0, 1.0)]);
    }

    /// The corrected curves of α = 1.2 and 1.5, of the total: on the masses of the figure their difference is negative on
    /// either side of 1 g, and yet it is positive from 0.932 g to just above 1.02 g (the numbers of the reference, good to
    /// 1e-7 here).
    #[test]
    fn a_crossing_between_the_masses_of_the_figure_is_not_missed() {
        let coarse = [
            (0.8, -7.5e-4, 1e-5),
            (0.9, -7e-5, 1e-6),
            (1.0, 0.0, 1e-8),
            (1.1, -1.3e-4, 1e-6),
            (1.2, -6e-4, 1e-5),
        ];
        assert_eq!(crossings(&differences(&coarse)), []);
        // so nothing may be said yet
        assert_eq!(wanting(&differences(&coarse)), [0.95, 1.05]);
        let reference = [(0.92, -1.58e-5), (0.94, 1.11e-5), (0.96, 1.64e-5), (1.02, 4e-7), (1.05, -2.96e-5)];
        let mut fine = coarse.to_vec();
        fine.extend(reference.map(|(mass_g, value)| (mass_g, value, 1e-7)));
        fine.sort_by(|a, b| a.0.total_cmp(&b.0));
        let found = crossings(&differences(&fine));
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].value - 0.932).abs() < 1e-3 && (found[0].plus_minus - 0.01).abs() < 1e-12);
        assert!((1.02..1.021).contains(&found[1].value), "{found:?}");
    }

    /// A parabola whose dip comes near zero between two points is looked at more closely, one that stays away is not.
    #[test]
    fn a_dip_between_two_masses_is_looked_into() {
        let parabola = |least: f64| -> Vec<Difference> {
            let at = |mass_g: f64| (mass_g, (mass_g - 2.5).powi(2) + least, 0.01);
            differences(&[1.0, 2.0, 3.0, 4.0].map(at))
        };
        assert_eq!(wanting(&parabola(-0.2)), [2.5]);
        assert_eq!(wanting(&parabola(0.0)), [2.5]);
        assert!(wanting(&parabola(2.0)).is_empty());
        // a line has no dip, and where the sign changes a crossing is known
        assert!(wanting(&differences(&[(1.0, 1.0, 0.1), (2.0, 2.0, 0.1), (3.0, 3.0, 0.1)])).is_empty());
        assert!(wanting(&differences(&[(1.0, -1.0, 0.1), (2.0, 1.0, 0.1)])).is_empty());
        // there is an end to it
        assert!(wanting(&differences(&[(1.0, 0.0, 0.1), (1.0 + FINEST_G, 0.0, 0.1)])).is_empty());
    }
}
