//! The dispersion relation of a periodic chain.

use crate::eigen::{Eigen, Square};
use crate::linear::{LinearChain, Resonator};
use std::f64::consts::{PI, TAU};

/// The unit that a chain repeats, but for impurities and ends.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitCell {
    /// Mass of each bead (kg).
    mass_kg: Vec<f64>,
    /// The contact after each bead (N/m), the last one leads to the next cell.
    contact_n_per_m: Vec<f64>,
    /// The spring of each bead to its site (N/m).
    on_site_n_per_m: Vec<f64>,
    /// The resonator of each bead.
    resonators: Vec<Option<Resonator>>,
}

/// A band of frequencies (Hz) of waves that travel.
pub type Band = [f64; 2];

impl UnitCell {
    /// The most beads that a cell may have.
    pub const MOST: usize = 16;
    /// Most beads in a hundred that may be unlike the one a period later: impurities and ends.
    const ODD_PERCENT: usize = 10;

    /// The shortest cell that nine of ten beads of `chain` repeat, if there is one.
    pub fn of(chain: &LinearChain) -> Option<Self> {
        let last = chain.bead_count().saturating_sub(1);
        (1..=Self::MOST.min(chain.bead_count() / 3)).find_map(|period| {
            // beads with a contact behind them, so that the end is not compared
            let repeats: Vec<bool> =
                (0..last.saturating_sub(period)).map(|bead| is_alike(chain, bead, bead + period)).collect();
            let odd = repeats.iter().filter(|repeats| !**repeats).count();
            if repeats.is_empty() || odd * 100 > repeats.len() * Self::ODD_PERCENT {
                return None;
            }
            let places: Vec<usize> = (0..repeats.len().saturating_sub(period - 1))
                .filter(|place| repeats[*place..][..period].iter().all(|repeats| *repeats))
                .collect();
            // what is odd may lie at one of these, not at two
            let quarters = [1, 2, 3].into_iter().filter_map(|quarter| places.get(places.len() * quarter / 4));
            let first = quarters
                .copied()
                .find(|first| unlike(chain, *first, period) * 100 <= last * Self::ODD_PERCENT)?;
            let beads = first..first + period;
            Some(Self {
                mass_kg: chain.mass_kg[beads.clone()].to_vec(),
                contact_n_per_m: chain.contact_n_per_m[beads.clone()].to_vec(),
                on_site_n_per_m: chain.on_site_n_per_m[beads.clone()].to_vec(),
                resonators: beads.map(|bead| chain.resonator(bead)).collect(),
            })
        })
    }

    /// Beads in the cell.
    pub fn period(&self) -> usize {
        self.mass_kg.len()
    }

    /// The frequencies (Hz) of waves `exp(i(q·j − ωt))` over beads `j`, ascending, for `q` in rad per bead.
    pub fn frequencies_hz(&self, q_rad: f64) -> Vec<f64> {
        let period = self.period();
        let inner: Vec<(usize, Resonator)> =
            self.resonators.iter().enumerate().filter_map(|(bead, inner)| Some((bead, (*inner)?))).collect();
        let count = period + inner.len();
        let masses = self.mass_kg.iter().copied().chain(inner.iter().map(|(_, inner)| inner.mass_kg));
        let root_mass: Vec<f64> = masses.map(f64::sqrt).collect();
        // the real part, and the imaginary one beside it: a Hermitian matrix as a symmetric one, with each eigenvalue twice
        let mut springs = Square::zeros(2 * count);
        let mut add = |row: usize, column: usize, real: f64, imaginary: f64| {
            let weight = 1.0 / (root_mass[row] * root_mass[column]);
            *springs.at(row, column) += weight * real;
            *springs.at(count + row, count + column) += weight * real;
            *springs.at(row, count + column) -= weight * imaginary;
            *springs.at(count + row, column) += weight * imaginary;
        };
        for bead in 0..period {
            let k = self.contact_n_per_m[bead];
            let next = (bead + 1) % period;
            add(bead, bead, k + self.on_site_n_per_m[bead], 0.0);
            add(next, next, k, 0.0);
            // the phase from one cell to the next
            let turn = if bead + 1 == period { q_rad * period as f64 } else { 0.0 };
            add(bead, next, -k * turn.cos(), -k * turn.sin());
            add(next, bead, -k * turn.cos(), k * turn.sin());
        }
        for (index, (bead, inner)) in inner.iter().enumerate() {
            let (row, k) = (period + index, inner.stiffness_n_per_m);
            add(*bead, *bead, k, 0.0);
            add(row, row, k, 0.0);
            add(*bead, row, -k, 0.0);
            add(row, *bead, -k, 0.0);
        }
        // springs and masses are finite, and QL steps converge for what is
        let squares = Eigen::of(springs).map(|found| found.values).unwrap_or_default();
        // rounding makes the zero of a translation one of this size
        let zero = 32.0 * f64::EPSILON * squares.iter().fold(0.0_f64, |largest, square| largest.max(*square));
        let frequency = |square: &f64| if *square > zero { square.sqrt() / TAU } else { 0.0 };
        squares.iter().step_by(2).map(frequency).collect()
    }

    /// The bands, ascending. In a chain where each bead touches two others a band is monotonic in q, so that its
    /// edges are at q = 0 and at that of half a wave a cell.
    pub fn bands_hz(&self) -> Vec<Band> {
        let (long, short) = (self.frequencies_hz(0.0), self.frequencies_hz(PI / self.period() as f64));
        long.into_iter().zip(short).map(|(a, b)| if a < b { [a, b] } else { [b, a] }).collect()
    }

    /// True if a frequency (Hz) is in a band, to a part in 10⁹.
    pub fn carries(bands: &[Band], frequency_hz: f64) -> bool {
        let room = 1e-9 * bands.last().map_or(0.0, |band| band[1]);
        bands.iter().any(|[from, to]| frequency_hz >= from - room && frequency_hz <= to + room)
    }
}

/// Number of beads that are not those of the cell at `first` in their turn, which begins anew behind a wall between two domains.
fn unlike(chain: &LinearChain, first: usize, period: usize) -> usize {
    let last = chain.bead_count() - 1;
    let is_at = |bead: usize, place: usize| bead < last && is_alike(chain, bead, first + place % period);
    let (mut odd, mut place) = (0, period - first % period);
    for bead in 0..last {
        place += 1;
        if !is_at(bead, place - 1) {
            odd += 1;
            let goes_on = |turn: &usize| (1..=period).all(|away| is_at(bead + away, turn + away - 1));
            place = (0..period).find(goes_on).unwrap_or(place % period);
        }
    }
    odd
}

/// True if two beads with the contacts behind them are the same, to rounding.
fn is_alike(chain: &LinearChain, one: usize, other: usize) -> bool {
    let same = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
    let of = |values: &[f64]| same(values[one], values[other]);
    let inner = match (chain.resonator(one), chain.resonator(other)) {
        (None, None) => true,
        (Some(a), Some(b)) => same(a.mass_kg, b.mass_kg) && same(a.stiffness_n_per_m, b.stiffness_n_per_m),
        _ => false,
    };
    of(&chain.mass_kg) && of(&chain.contact_n_per_m) && of(&chain.on_site_n_per_m) && inner
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::tests::chain;

    fn near(found: f64, expected: f64) -> bool {
        (found - expected).abs() < 1e-12 * expected.max(1.0)
    }

    #[test]
    fn equal_beads_have_one_band() {
        let cell = UnitCell::of(&chain(30, &[2.0], 3.0, 0.0)).expect("periodic");
        assert_eq!(cell.period(), 1);
        for q in [0.0, 0.3, -1.7, PI] {
            let expected = 2.0 * (3.0 / 2.0_f64).sqrt() * (q / 2.0).sin().abs() / TAU;
            assert!(near(cell.frequencies_hz(q)[0], expected), "{q}");
        }
    }

    /// Masses M > m in turn: 0 to √(2K/M), and √(2K/m) to √(2K(1/m + 1/M)); an impurity changes nothing.
    #[test]
    fn a_dimer_has_its_gap() {
        let (heavy, light, k) = (3.0, 1.0, 5.0);
        let mut dimer = chain(80, &[heavy, light], k, 0.0);
        dimer.mass_kg[33] = 7.0;
        let cell = UnitCell::of(&dimer).expect("periodic");
        let edges: Vec<f64> = cell.bands_hz().into_iter().flatten().map(|edge| edge * TAU).collect();
        let (low, high) = ((2.0 * k / heavy).sqrt(), (2.0 * k / light).sqrt());
        let expected = [0.0, low, high, (2.0 * k * (1.0 / light + 1.0 / heavy)).sqrt()];
        assert!(edges.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7), "{edges:?} {expected:?}");
        assert!(!UnitCell::carries(&cell.bands_hz(), 0.5 * (low + high) / TAU));
    }

    /// A head of other beads is odd, and so is a wall between two domains; two halves have no cell of both.
    #[test]
    fn a_cell_is_that_of_nearly_all_beads() {
        let with = |mass_kg: &dyn Fn(usize) -> f64| {
            let mut linear = chain(60, &[1.0], 1.0, 0.0);
            (0..60).for_each(|bead| linear.mass_kg[bead] = mass_kg(bead));
            UnitCell::of(&linear).map(|cell| cell.mass_kg)
        };
        assert_eq!(with(&|bead| if bead < 30 { 1.0 } else { 0.25 }), None);
        assert_eq!(with(&|bead| if bead < 30 && bead % 2 == 0 { 2.0 } else { 1.0 }), None);
        assert_eq!(with(&|bead| if bead < 4 { 5.0 } else { 2.0 }), Some(vec![2.0]));
        let mut domains = with(&|bead| [1.0, 3.0][(bead + usize::from(bead > 20)) % 2]).expect("two domains");
        domains.sort_by(f64::total_cmp);
        assert_eq!(domains, [1.0, 3.0]);
    }

    #[test]
    fn what_does_not_repeat_has_no_cell() {
        let mut tapered = chain(60, &[1.0], 1.0, 0.0);
        (0..60_u8).for_each(|bead| tapered.mass_kg[usize::from(bead)] = 1.0 + 0.01 * f64::from(bead));
        assert_eq!(UnitCell::of(&tapered), None);
    }
}
