//! Obstacles, which break a pulse up: beads of another mass than the chain around them, contacts of another stiffness, and the ends.

use super::signed;
use schemas::chain::Chain;
use std::collections::BTreeSet;

/// Masses that differ by less than this, relative to each other, let a pulse pass as it is: one per cent reflects
/// 1e-5 of its energy.
const SAME: f64 = 0.01;

/// The chain is even where so many beads are alike: a few of a disordered chain are so by chance.
const EVEN: usize = 6;

/// Beads on either side of an obstacle among which neighbours of different masses …
const AROUND: usize = 24;

/// … are no more than these: four impurities in a row have so many. With more of them the chain is made that way, and
/// a few of its beads are alike by chance.
const MOST_CHANGES: usize = 8;

/// Beads where a pulse ends and others begin.
///
/// An obstacle is a bead whose mass differs from that of a neighbour behind which the chain goes on evenly: an
/// impurity, or either side of a step; or one at a contact whose stiffness differs from that of all contacts around it,
/// which are alike. There are no obstacles if more than a tenth of the beads would be one, or if the
/// masses change often around them, as in a chain of dimers or a disordered one: then the chain is made that way, and
/// pulses travel through it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Obstacles {
    bead_count: i64,
    /// In the order of the beads.
    beads: Vec<i64>,
}

impl Obstacles {
    /// The obstacles of a chain.
    pub fn of(chain: &Chain) -> Self {
        let m = &chain.mass_kg;
        let same = |a: usize, b: usize| (m[a] - m[b]).abs() <= SAME * m[a];
        let even = EVEN.min((m.len() - 1) / 2);
        let left = |bead: usize| (0..bead).rev().take(even);
        let right = |bead: usize| (bead + 1..m.len()).take(even);
        let is_obstacle = |bead: usize| {
            ends_at(bead, even, &left(bead), right(bead), &same)
                || ends_at(bead, even, &right(bead), left(bead), &same)
        };
        let changes: Vec<usize> = (1..m.len()).filter(|bead| !same(bead - 1, *bead)).collect();
        let is_alone = |bead: usize| {
            let before = |limit: usize| changes.partition_point(|change| *change < limit);
            before(bead + AROUND + 1) - before(bead.saturating_sub(AROUND)) <= MOST_CHANGES
        };
        let stiffnesses: Vec<f64> =
            (0..chain.contact_count()).map(|contact| chain.own_stiffness(contact)).collect();
        let odd = odd_contacts(&stiffnesses, even);
        let is_odd = |bead: usize| odd.contains(&bead) || bead > 0 && odd.contains(&(bead - 1));
        let found = (0..m.len()).filter(|bead| is_obstacle(*bead) && is_alone(*bead) || is_odd(*bead));
        let mut beads: Vec<i64> = found.map(|bead| signed(bead as u64)).collect();
        if beads.len() * 10 > m.len() {
            beads.clear();
        }
        Self { bead_count: signed(m.len() as u64), beads }
    }

    /// The obstacle that is nearest to `bead`, or `bead` itself if there is none.
    pub fn nearest(&self, bead: u64) -> u64 {
        let distance = |obstacle: &&i64| (**obstacle - bead.cast_signed()).unsigned_abs();
        self.beads.iter().min_by_key(distance).map_or(bead, |nearest| nearest.unsigned_abs())
    }

    /// True if a bead is an obstacle.
    pub(super) fn contains(&self, bead: i64) -> bool {
        self.beads.binary_search(&bead).is_ok()
    }

    /// True if an obstacle lies between two beads.
    pub(super) fn between(&self, a: i64, b: i64) -> bool {
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        let next = self.beads.partition_point(|bead| *bead < low);
        self.beads.get(next).is_some_and(|bead| *bead <= high)
    }

    /// Beads from `bead` to the next obstacle or end in the direction `sign`, and whether it is an obstacle.
    pub(super) fn ahead(&self, bead: i64, sign: i64) -> (i64, bool) {
        let next = if sign > 0 {
            self.beads.get(self.beads.partition_point(|obstacle| *obstacle <= bead)).map(|next| next - bead)
        } else {
            let below = self.beads.partition_point(|obstacle| *obstacle < bead);
            below.checked_sub(1).map(|last| bead - self.beads[last])
        };
        let end = if sign > 0 { self.bead_count - 1 - bead } else { bead };
        next.map_or((end, false), |distance| (distance, true))
    }
}

/// Contacts of another stiffness than `even` on either side, which are alike.
fn odd_contacts(stiffness: &[f64], even: usize) -> BTreeSet<usize> {
    let same = |a: f64, b: f64| (a - b).abs() <= SAME * a;
    let is_odd = |at: &usize| {
        let around = [&stiffness[at - even..*at], &stiffness[at + 1..=at + even]];
        let usual = around[0][0];
        around.into_iter().flatten().all(|k| same(usual, *k)) && !same(usual, stiffness[*at])
    };
    (even.max(1)..stiffness.len().saturating_sub(even)).filter(is_odd).collect()
}

/// True if `bead` differs from the two `ahead`, which are alike, and the chain is even ahead or `behind`.
fn ends_at(
    bead: usize,
    even: usize,
    ahead: &(impl ExactSizeIterator<Item = usize> + Clone),
    mut behind: impl ExactSizeIterator<Item = usize>,
    same: &impl Fn(usize, usize) -> bool,
) -> bool {
    let mut two = ahead.clone();
    let (Some(next), Some(second)) = (two.next(), two.next()) else { return false };
    let even_ahead = ahead.len() == even && ahead.clone().all(|other| same(next, other));
    let mut even_behind = || behind.len() == even && behind.all(|other| same(bead, other));
    !same(next, bead) && same(next, second) && (even_ahead || even_behind())
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::chain::Walls;
    use schemas::contact::ContactLaw;

    fn obstacles(mass_kg: Vec<f64>) -> Obstacles {
        let contacts = mass_kg.len() - 1;
        let (stiffness, rest_overlap_m) = (vec![1.0; contacts], vec![0.0; contacts]);
        Obstacles::of(&Chain::new(mass_kg, stiffness, rest_overlap_m, Walls::default(), ContactLaw::new(1.5)))
    }

    #[test]
    fn a_contact_of_another_stiffness_is_an_obstacle() {
        let law = ContactLaw::new(1.5);
        let of = |stiffness: &dyn Fn(u32) -> f64| {
            let stiffness: Vec<f64> = (0..99).map(stiffness).collect();
            let rest_overlap_m = vec![0.0; 99];
            let chain = Chain::new(vec![1.0; 100], stiffness, rest_overlap_m, Walls::default(), law.clone());
            Obstacles::of(&chain).beads
        };
        assert_eq!(of(&|contact| if contact == 50 { 100.0 } else { 1.0 }), [50, 51]);
        assert_eq!(of(&|contact| if contact % 2 == 0 { 2.0 } else { 1.0 }), [0; 0]);
        assert_eq!(of(&|contact| 0.95_f64.powf(contact.into())), [0; 0]);
    }

    #[test]
    fn impurities_and_steps_are_obstacles_and_textures_are_not() {
        let mut masses = vec![1.0; 100];
        masses[50] = 0.6;
        let impurity = obstacles(masses.clone());
        assert_eq!(impurity.beads, [50]);
        assert_eq!([48, 49, 50, 51].map(|bead| impurity.nearest(bead)), [50; 4]);
        assert!(impurity.between(50, 52) && impurity.between(51, 40) && !impurity.between(51, 99));
        assert_eq!((impurity.ahead(40, 1), impurity.ahead(50, 1)), ((10, true), (49, false)));
        assert_eq!((impurity.ahead(60, -1), impurity.ahead(50, -1)), ((10, true), (50, false)));
        masses[51] = 0.6;
        assert_eq!(obstacles(masses).beads, [49, 50, 51, 52], "two steps");
        let step = (0..100).map(|bead| if bead < 30 { 1.0 } else { 2.0 });
        assert_eq!(obstacles(step.collect()).beads, [29, 30]);
        let striker = (0..100).map(|bead| if bead == 0 { 10.0 } else { 1.0 });
        assert_eq!(obstacles(striker.collect()).beads, [0]);
        let dimers = (0..100).map(|bead| if bead % 2 == 0 { 1.0 } else { 2.0 });
        assert_eq!(obstacles(dimers.collect()).beads, [0; 0]);
        let chance =
            |bead: u32| [1.0, 1.0, 1.0, 1.4, 0.8, 0.8, 1.2, 1.1, 0.9, 0.9, 0.9, 1.3][bead as usize % 12];
        assert_eq!(obstacles((0..100).map(chance).collect()).beads, [0; 0], "alike by chance");
        let tapered = (0..100).map(|bead| 0.95_f64.powi(bead));
        assert_eq!(obstacles(tapered.collect()).beads, [0; 0]);
    }
}
