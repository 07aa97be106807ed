//! Multipliers of an orbit: growth of small changes over a period.

use crate::eigenvalues::eigenvalues;
use crate::krylov::Largest;
use nalgebra::{Complex, DMatrix};
use serde::Serialize;

/// Distance from the unit circle up to which a multiplier is on it. Multipliers 1 come in defective pairs where energy is conserved, which rounding
/// moves by some 1e-7.
pub const ON_CIRCLE: f64 = 1e-6;

/// A multiplier, a complex number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Multiplier {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

/// The way in which an orbit is, or becomes, unstable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Instability {
    /// A real multiplier above 1: changes grow without a turn.
    Real,
    /// A real multiplier below −1: the state comes back after two periods.
    PeriodDoubling,
    /// A complex pair of a chain with losses: a second frequency appears.
    NeimarkSacker,
    /// Complex multipliers of a chain that conserves energy: changes grow and oscillate.
    Oscillatory,
}

impl Instability {
    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Real => "real instability",
            Self::PeriodDoubling => "period doubling",
            Self::NeimarkSacker => "Neimark–Sacker",
            Self::Oscillatory => "oscillatory instability",
        }
    }
}

/// The multipliers of an orbit, by descending size: all, or of a long chain the largest.
#[derive(Debug, Clone, PartialEq)]
pub struct Multipliers {
    found: Vec<Multiplier>,
    limit: Option<Limit>,
    /// Places of those that any such chain has: 1, for the directions in which an orbit is displaced or goes over into others.
    trivial: Vec<usize>,
    is_conservative: bool,
}

/// The extent to which multipliers are found, where they are not all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limit {
    /// Size above which they are all, but for one in which hardly any change has a part.
    pub above: f64,
    /// Largest residual `|M·x − μ·x|/|x|`.
    pub residual: f64,
}

impl Multiplier {
    /// Distance from 0.
    pub fn size(self) -> f64 {
        self.re.hypot(self.im)
    }

    /// Angle (rad).
    pub fn angle_rad(self) -> f64 {
        self.im.atan2(self.re)
    }

    /// Distance from `other`.
    fn from(self, re: f64, im: f64) -> f64 {
        (self.re - re).hypot(self.im - im)
    }

    fn is_real(self) -> bool {
        self.im.abs() <= 1e-9 * self.size().max(1.0)
    }

    /// `μ + 1/μ`, real where a chain conserves energy and μ is real or on the unit circle.
    fn trace(self) -> Complex<f64> {
        let here = Complex::new(self.re, self.im);
        here + here.inv()
    }
}

impl Multipliers {
    /// Those of the derivative `monodromy` of the map of a period, of which so many are 1 by symmetry; none if they cannot be found.
    pub(crate) fn of(monodromy: &DMatrix<f64>, trivial: usize, is_conservative: bool) -> Option<Self> {
        let found = eigenvalues(monodromy)?.into_iter().map(|[re, im]| Multiplier { re, im });
        Some(Self::sorted(found.collect(), None, (trivial, f64::INFINITY), is_conservative))
    }

    /// The largest, of which up to so many are 1 by symmetry.
    pub(crate) fn largest_of(largest: &Largest, trivial: usize, is_conservative: bool) -> Self {
        let Largest { found, above, from_one } = largest;
        let residual = found.iter().map(|one| one.residual).fold(0.0, f64::max);
        let found = found.iter().map(|one| Multiplier { re: one.value.re, im: one.value.im });
        let limit = Some(Limit { above: *above, residual });
        Self::sorted(found.collect(), limit, (trivial, *from_one), is_conservative)
    }

    /// Those `found`, of which up to so many that are so near 1 are it by symmetry.
    fn sorted(
        mut found: Vec<Multiplier>,
        limit: Option<Limit>,
        (trivial, from_one): (usize, f64),
        is_conservative: bool,
    ) -> Self {
        found.sort_by(|a, b| b.size().total_cmp(&a.size()).then(b.im.total_cmp(&a.im)));
        let away = |place: &usize| found[*place].from(1.0, 0.0);
        let mut near: Vec<usize> = (0..found.len()).filter(|place| away(place) <= from_one).collect();
        near.sort_by(|a, b| away(a).total_cmp(&away(b)));
        near.truncate(trivial);
        Self { found, limit, trivial: near, is_conservative }
    }

    /// Those that are found, by descending size: all, unless there is a [`limit`](Self::limit).
    pub fn found(&self) -> &[Multiplier] {
        &self.found
    }

    /// The extent to which they are found; none if they are all.
    pub fn limit(&self) -> Option<Limit> {
        self.limit
    }

    /// True if none is outside of the unit circle; nothing if none is found there, and there may be one.
    pub fn is_stable(&self) -> Option<bool> {
        let is_stable = self.unstable().next().is_none();
        let is_known = !is_stable || self.limit.is_none_or(|limit| limit.above <= 1.0 + ON_CIRCLE);
        is_known.then_some(is_stable)
    }

    /// Those that are not 1 by symmetry, by descending size.
    pub fn telling(&self) -> impl Iterator<Item = Multiplier> {
        self.found.iter().enumerate().filter(|(place, _)| !self.trivial.contains(place)).map(|(_, one)| *one)
    }

    /// The largest of those that are not 1 by symmetry.
    pub fn largest(&self) -> Option<Multiplier> {
        self.telling().next()
    }

    /// Those outside of the unit circle.
    pub fn unstable(&self) -> impl Iterator<Item = Multiplier> {
        self.telling().filter(|one| one.size() > 1.0 + ON_CIRCLE)
    }

    /// The smallest of those outside of the unit circle that are of a kind of which `other` has fewer.
    pub(crate) fn gained(&self, other: &Self) -> Option<Multiplier> {
        let count = |these: &Self, kind| these.unstable().filter(|one| these.kind(*one) == kind).count();
        let is_more = |one: &Multiplier| {
            let kind = self.kind(*one);
            count(self, kind) > count(other, kind)
        };
        self.unstable().filter(is_more).last()
    }

    /// Largest difference between the multipliers and those of `other`, over their size, of those that are not 1 by symmetry.
    pub(crate) fn difference(&self, other: &Self) -> f64 {
        let sorted = |these: &Self| {
            let mut all: Vec<Multiplier> = these.telling().collect();
            all.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
            all
        };
        let apart = |(a, b): (&Multiplier, &Multiplier)| a.from(b.re, b.im) / (1.0 + a.size());
        sorted(self).iter().zip(&sorted(other)).map(apart).fold(0.0, f64::max)
    }

    /// The way in which changes grow by `multiplier`.
    pub fn kind(&self, multiplier: Multiplier) -> Instability {
        match (multiplier.is_real(), self.is_conservative) {
            (true, _) if multiplier.re > 0.0 => Instability::Real,
            (true, _) => Instability::PeriodDoubling,
            (false, true) => Instability::Oscillatory,
            (false, false) => Instability::NeimarkSacker,
        }
    }

    /// A number that passes through 0, smoothly in a parameter, where the orbit gains or loses the instability `kind` by a multiplier like `like`.
    /// None if those that pass are not found.
    pub(crate) fn test(&self, kind: Instability, like: Multiplier) -> Option<f64> {
        if self.limit.is_some_and(|limit| limit.above > 1.0) {
            return None;
        }
        let nearest = |re: f64, im: f64| {
            let mut all: Vec<Multiplier> = self.telling().collect();
            all.sort_by(|a, b| a.from(re, im).total_cmp(&b.from(re, im)));
            all
        };
        let sign = match kind {
            Instability::Real => 1.0,
            Instability::PeriodDoubling => -1.0,
            Instability::NeimarkSacker => {
                let size = nearest(like.re, like.im).first()?.size();
                return Some(size * size - 1.0);
            }
            Instability::Oscillatory => {
                // two pairs meet on the unit circle, where their traces are equal
                let angle = like.angle_rad();
                let near: Vec<_> = nearest(angle.cos(), angle.sin()).into_iter().take(2).collect();
                let [one, other] = near[..] else { return None };
                let difference = one.trace() - other.trace();
                return Some(-(difference * difference).re);
            }
        };
        let near = nearest(sign, 0.0);
        let first = *near.first()?;
        if self.is_conservative {
            return Some(sign * first.trace().re - 2.0);
        }
        let distance = |one: Multiplier| Complex::new(one.re - sign, one.im);
        // real ones pass alone, and may have met as a pair before
        let pair = near.get(1).filter(|second| first.is_real() == second.is_real());
        Some(-pair.map_or(-sign * (first.re - sign), |second| (distance(first) * distance(*second)).re))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pair has left the circle before, and is nearer to it than the multiplier that leaves next.
    #[test]
    fn a_second_instability_has_its_own_name() {
        let of = |numbers: &[[f64; 2]]| {
            let found = numbers.iter().map(|[re, im]| Multiplier { re: *re, im: *im });
            Multipliers::sorted(found.collect(), None, (0, 0.0), true)
        };
        let before = of(&[[0.8, 0.9], [0.8, -0.9], [-0.6, 0.8], [-0.6, -0.8]]);
        let after = of(&[[0.8, 1.0], [0.8, -1.0], [-1.29, 0.0], [-0.775, 0.0]]);
        for found in [after.gained(&before), of(&[[-1.29, 0.0]]).gained(&of(&[]))] {
            let found = found.expect("one");
            assert_eq!((found.re, after.kind(found)), (-1.29, Instability::PeriodDoubling));
        }
        assert_eq!((before.gained(&after), after.gained(&after)), (None, None));
    }
}
