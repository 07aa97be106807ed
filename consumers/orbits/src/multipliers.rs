//! Multipliers of an orbit: growth of small changes over a period.

use crate::eigenvalues::eigenvalues;
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

/// The multipliers of an orbit, by descending size.
#[derive(Debug, Clone, PartialEq)]
pub struct Multipliers {
    all: Vec<Multiplier>,
    /// Places of those that any such chain has: 1, for the directions in which an orbit is displaced or goes over into others.
    trivial: Vec<usize>,
    is_conservative: bool,
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
    pub(crate) fn of(monodromy: DMatrix<f64>, trivial: usize, is_conservative: bool) -> Option<Self> {
        let count = monodromy.nrows();
        let all = eigenvalues(monodromy)?.into_iter();
        let mut all: Vec<Multiplier> = all.map(|[re, im]| Multiplier { re, im }).collect();
        all.sort_by(|a, b| b.size().total_cmp(&a.size()).then(b.im.total_cmp(&a.im)));
        let mut near: Vec<usize> = (0..count).collect();
        near.sort_by(|a, b| all[*a].from(1.0, 0.0).total_cmp(&all[*b].from(1.0, 0.0)));
        near.truncate(trivial);
        Some(Self { all, trivial: near, is_conservative })
    }

    /// All, by descending size.
    pub fn all(&self) -> &[Multiplier] {
        &self.all
    }

    /// Those that are not 1 by symmetry, by descending size.
    pub fn telling(&self) -> impl Iterator<Item = Multiplier> {
        self.all.iter().enumerate().filter(|(place, _)| !self.trivial.contains(place)).map(|(_, one)| *one)
    }

    /// The largest of those that are not 1 by symmetry.
    pub fn largest(&self) -> Option<Multiplier> {
        self.telling().next()
    }

    /// Those outside of the unit circle.
    pub fn unstable(&self) -> impl Iterator<Item = Multiplier> {
        self.telling().filter(|one| one.size() > 1.0 + ON_CIRCLE)
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
    pub(crate) fn test(&self, kind: Instability, like: Multiplier) -> Option<f64> {
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
