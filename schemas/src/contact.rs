//! The contact law: force and energy of two beads that overlap by `δ`.
//!
//! Force and energy share one power so that they are consistent to rounding, in every loop that evaluates
//! them: the dynamics, the analyses, or a re-simulation.

use crate::power::{PowerTable, Powers, bounds};
use crate::roots::ByMultiplyAdds;
use crate::simd::{Group, load, store};
use pulp::{Scalar, Simd};
use std::sync::Arc;

/// Form in which `δ^α` is computed. Each form is exact to its own rounding and is part of the bits of a run.
#[derive(Debug, Clone)]
enum Form {
    Formula(Formula),
    /// any other α
    General(Arc<PowerTable>),
}

/// `F = k·δ^α` for `δ > 0`, otherwise 0.
///
/// Overlaps up to [`ContactLaw::zero_up_to_m`] give exactly zero force and energy, so that no
/// force or energy of a closed contact is ever subnormal.
///
/// ```
/// let hertz = schemas::contact::ContactLaw::new(1.5);
/// let overlap_m = 1.0 / 4096.0; // 2^-12 m, so δ^1.5 = 2^-18
/// assert_eq!(hertz.force(1_048_576.0, overlap_m), 4.0); // 2^20 · 2^-18 N
/// assert_eq!(hertz.energy(1_048_576.0, overlap_m), 4.0 * overlap_m / 2.5); // F·δ/(α + 1)
/// assert_eq!(hertz.force(1e7, -1.0), 0.0); // an open contact
/// ```
#[derive(Debug, Clone)]
pub struct ContactLaw {
    alpha: f64,
    zero_up_to_m: f64,
    form: Form,
}

/// The exponent is all that tells laws apart.
impl PartialEq for ContactLaw {
    fn eq(&self, other: &Self) -> bool {
        self.alpha == other.alpha
    }
}

impl ContactLaw {
    /// The law with exponent `alpha` (dimensionless), from 1 to 1000.
    pub fn new(alpha: f64) -> Self {
        let form = match alpha {
            1.0 => Form::Formula(Formula::Linear),
            1.5 => Form::Formula(Formula::Hertz(ByMultiplyAdds::measured())),
            2.0 => Form::Formula(Formula::Square),
            3.0 => Form::Formula(Formula::Cube),
            5.0 => Form::Formula(Formula::Fifth),
            _ => Form::General(PowerTable::shared(alpha)),
        };
        let zero_up_to_m = match &form {
            Form::General(table) => table.zero_up_to(),
            Form::Formula(_) => bounds(alpha)[0],
        };
        Self { alpha, zero_up_to_m, form }
    }

    /// The exponent α.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// Overlaps (m) up to this give zero force. `δ^(α+1)` of any larger overlap is above `2^−900`, a normal double with
    /// room for `k/(α+1)`.
    pub fn zero_up_to_m(&self) -> f64 {
        self.zero_up_to_m
    }

    /// The overlap (m) as it counts in forces and energies: 0 in an open contact.
    fn closed_m(&self, overlap_m: f64) -> f64 {
        if overlap_m > self.zero_up_to_m { overlap_m } else { 0.0 }
    }

    /// Force (N) of a contact of stiffness `stiffness` (N·m^−α) and overlap `overlap_m` (m).
    pub fn force(&self, stiffness: f64, overlap_m: f64) -> f64 {
        stiffness * self.power_of(self.closed_m(overlap_m))
    }

    /// Potential energy (J), `k·δ^(α+1)/(α+1)`.
    pub fn energy(&self, stiffness: f64, overlap_m: f64) -> f64 {
        self.force(stiffness, overlap_m) * self.closed_m(overlap_m) / (self.alpha + 1.0)
    }

    /// Slope dF/dδ (N/m) of a contact: `k·α·δ^(α−1)`; 0 where it is not pressed, and has no slope on both sides of δ = 0.
    pub fn tangent(&self, stiffness: f64, overlap_m: f64) -> f64 {
        let closed_m = self.closed_m(overlap_m);
        if closed_m > 0.0 { stiffness * self.alpha * (self.power_of(closed_m) / closed_m) } else { 0.0 }
    }

    /// Calls `user` with the power of this law as something that the compiler can inline into `user`'s loops: one copy of them for
    /// spheres, one for the other formulas, one for tables.
    #[inline(always)]
    pub fn with_power<U: PowerUser>(&self, user: U) -> U::Output {
        match &self.form {
            Form::Formula(Formula::Hertz(by)) => user.run(Each(Hertz(*by))),
            Form::Formula(formula) => user.run(Each(*formula)),
            Form::General(table) => user.run(table.powers()),
        }
    }

    /// True if it has roots, and this machine is slow to find them in its widest registers.
    pub fn has_slow_roots(&self) -> bool {
        matches!(self.form, Form::Formula(Formula::Hertz(ByMultiplyAdds::EveryOther)))
    }

    /// Calls `user` with no power, for chains in which no contact has a stiffness of its law.
    #[inline(always)]
    pub fn with_no_power<U: PowerUser>(user: U) -> U::Output {
        user.run(NoPower)
    }

    /// `δ^α` of one overlap.
    fn power_of(&self, overlap_m: f64) -> f64 {
        struct One(f64);
        impl PowerUser for One {
            type Output = f64;
            fn run(self, power: impl Power) -> f64 {
                power.raise_one(self.0)
            }
        }
        self.with_power(One(overlap_m))
    }
}

/// Something that evaluates powers of many overlaps; see [`ContactLaw::with_power`].
pub trait PowerUser {
    /// The result of the evaluation.
    type Output;

    /// Runs with the power of a law.
    fn run(self, power: impl Power) -> Self::Output;
}

/// `δ^α` of overlaps that are 0 or above [the bound](ContactLaw::zero_up_to_m); 0 of 0.
pub trait Power: Copy {
    /// True if there is a power at all, which bonds have not.
    const IS_ANY: bool = true;

    /// Powers of a block of overlaps.
    fn raise<const B: usize>(self, overlaps: &[f64; B]) -> [f64; B];

    /// Powers of a group of overlaps, in vectors.
    fn raise_group<S: Simd, const G: usize>(self, simd: S, overlaps: &Group<G>) -> Group<G>;

    /// The formula that it is, unless it comes from a table.
    fn formula(self) -> Option<Formula> {
        None
    }

    /// Power of one overlap.
    fn raise_one(self, overlap: f64) -> f64;
}

/// A power that needs no table.
#[derive(Debug, Clone, Copy)]
pub enum Formula {
    /// α = 1: `δ`
    Linear,
    /// α = 3/2: `δ·√δ`
    Hertz(ByMultiplyAdds),
    /// α = 2: `δ·δ`
    Square,
    /// α = 3: `δ·δ·δ`
    Cube,
    /// α = 5: `(δ·δ)·(δ·δ)·δ`
    Fifth,
}

impl Formula {
    /// Powers of a register of overlaps `d`, one of several that follow each other.
    #[inline(always)]
    pub fn of<S: Simd>(self, simd: S, d: S::f64s, number: usize) -> S::f64s {
        match self {
            Self::Linear => d,
            Self::Hertz(by) => simd.mul_f64s(d, by.root(simd, d, number)),
            Self::Square => simd.mul_f64s(d, d),
            Self::Cube => simd.mul_f64s(simd.mul_f64s(d, d), d),
            Self::Fifth => {
                let square = simd.mul_f64s(d, d);
                simd.mul_f64s(simd.mul_f64s(square, square), d)
            }
        }
    }

    /// Their slopes `α·δ^(α−1)`.
    #[inline(always)]
    pub(crate) fn slope<S: Simd>(self, simd: S, d: S::f64s, number: usize) -> S::f64s {
        let times = |alpha: f64, power: S::f64s| simd.mul_f64s(simd.splat_f64s(alpha), power);
        match self {
            Self::Linear => simd.splat_f64s(1.0),
            Self::Hertz(by) => times(1.5, by.root(simd, d, number)),
            Self::Square => times(2.0, d),
            Self::Cube => times(3.0, simd.mul_f64s(d, d)),
            Self::Fifth => {
                let square = simd.mul_f64s(d, d);
                times(5.0, simd.mul_f64s(square, square))
            }
        }
    }
}

/// [`Formula::Hertz`] where the compiler knows it.
#[derive(Clone, Copy)]
struct Hertz(ByMultiplyAdds);

impl From<Hertz> for Formula {
    #[inline(always)]
    fn from(Hertz(by): Hertz) -> Self {
        Self::Hertz(by)
    }
}

/// No power.
#[derive(Clone, Copy)]
struct NoPower;

impl Power for NoPower {
    const IS_ANY: bool = false;

    #[inline(always)]
    fn raise<const B: usize>(self, _: &[f64; B]) -> [f64; B] {
        [0.0; B]
    }

    #[inline(always)]
    fn raise_group<S: Simd, const G: usize>(self, _: S, _: &Group<G>) -> Group<G> {
        Group([0.0; G])
    }

    #[inline(always)]
    fn raise_one(self, _: f64) -> f64 {
        0.0
    }
}

/// A formula of each overlap.
#[derive(Clone, Copy)]
struct Each<F>(F);

impl<F: Copy + Into<Formula>> Power for Each<F> {
    #[inline(always)]
    fn raise<const B: usize>(self, overlaps: &[f64; B]) -> [f64; B] {
        let mut powers = [0.0; B];
        for c in 0..B {
            powers[c] = self.raise_one(overlaps[c]);
        }
        powers
    }

    #[inline(always)]
    fn raise_group<S: Simd, const G: usize>(self, simd: S, overlaps: &Group<G>) -> Group<G> {
        let mut powers = Group([0.0; G]);
        for at in (0..G).step_by(S::F64_LANES) {
            let register = load::<S>(&overlaps.0, at);
            store::<S>(self.0.into().of(simd, register, at / S::F64_LANES), &mut powers.0, at);
        }
        powers
    }

    #[inline(always)]
    fn formula(self) -> Option<Formula> {
        Some(self.0.into())
    }

    #[inline(always)]
    fn raise_one(self, overlap: f64) -> f64 {
        self.0.into().of(Scalar::new(), overlap, 0)
    }
}

impl Power for Powers<'_> {
    #[inline(always)]
    fn raise<const B: usize>(self, overlaps: &[f64; B]) -> [f64; B] {
        Powers::raise(self, overlaps)
    }

    #[inline(always)]
    fn raise_group<S: Simd, const G: usize>(self, _: S, overlaps: &Group<G>) -> Group<G> {
        Group(Powers::raise(self, &overlaps.0))
    }

    #[inline(always)]
    fn raise_one(self, overlap: f64) -> f64 {
        Powers::raise_one(self, overlap)
    }
}

/// Contacts that are looked at together. Loops over fewer are not compiled for vectors.
pub const BLOCK: usize = 32;

/// Evaluates neighbouring contacts into `values`. A contact has the value `value(known, δ, δ^α)`: `known` holds its `K` numbers, and
/// `δ = overlap(known)`, or 0 where that is not above `zero_up_to_m`. `takes(number, any_closed)` decides for each block, counted
/// from 0, whether it is evaluated; the values of the others are 0.
///
/// Call it through [`vectorized`](crate::simd::vectorized).
#[inline(always)]
pub fn evaluate<const K: usize>(
    known: [&[f64]; K],
    values: &mut [f64],
    power: impl Power,
    zero_up_to_m: f64,
    overlap: impl Fn([f64; K]) -> f64,
    value: impl Fn([f64; K], f64, f64) -> f64,
    mut takes: impl FnMut(usize, bool) -> bool,
) {
    let (values, values_rest) = values.as_chunks_mut::<BLOCK>();
    // one check for each slice instead of one for each number
    let blocks = known.map(
        #[inline(always)]
        |numbers| &numbers.as_chunks::<BLOCK>().0[..values.len()],
    );
    for (block, values) in values.iter_mut().enumerate() {
        let known = blocks.map(
            #[inline(always)]
            |blocks| &blocks[block],
        );
        *values = evaluate_block(known, power, zero_up_to_m, &overlap, &value, |any_closed| {
            takes(block, any_closed)
        });
    }
    if !values_rest.is_empty() {
        // the same block, filled up by contacts that nobody asked for
        let filled = known.map(|numbers| {
            let mut filled = [0.0; BLOCK];
            let rest = &numbers[values.len() * BLOCK..][..values_rest.len()];
            filled[..rest.len()].copy_from_slice(rest);
            filled
        });
        let known = filled.each_ref();
        let found = evaluate_block(known, power, zero_up_to_m, &overlap, &value, |any_closed| {
            takes(values.len(), any_closed)
        });
        values_rest.copy_from_slice(&found[..values_rest.len()]);
    }
}

#[inline(always)]
fn evaluate_block<const K: usize>(
    known: [&[f64; BLOCK]; K],
    power: impl Power,
    zero_up_to_m: f64,
    overlap: &impl Fn([f64; K]) -> f64,
    value: &impl Fn([f64; K], f64, f64) -> f64,
    takes: impl FnOnce(bool) -> bool,
) -> [f64; BLOCK] {
    let mut overlaps = [0.0; BLOCK];
    // as integers: the compiler makes no vectors of a loop that keeps a truth value
    let mut any_bits = 0;
    for c in 0..BLOCK {
        let found = overlap(known.map(
            #[inline(always)]
            |numbers| numbers[c],
        ));
        overlaps[c] = if found > zero_up_to_m { found } else { 0.0 };
        any_bits |= overlaps[c].to_bits();
    }
    let mut values = [0.0; BLOCK];
    if takes(any_bits != 0) {
        let powers = power.raise(&overlaps);
        for c in 0..BLOCK {
            let known = known.map(
                #[inline(always)]
                |numbers| numbers[c],
            );
            values[c] = value(known, overlaps[c], powers[c]);
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::power::power;

    #[test]
    fn short_cuts_agree_with_the_general_power_to_rounding() {
        for alpha in [1.0, 1.5, 2.0, 3.0, 5.0] {
            let law = ContactLaw::new(alpha);
            for overlap_m in [1e-12, 3.7e-6, 0.02, 1.9] {
                let (short, general) = (law.force(1.0, overlap_m), power(overlap_m, alpha));
                // at most four roundings in the longest short cut (α = 5), one in the power
                assert!((short / general - 1.0).abs() < 5.0 * f64::EPSILON, "α = {alpha}");
            }
        }
    }

    #[test]
    fn closed_contacts_never_have_subnormal_force_or_energy() {
        for alpha in [1.0, 1.01, 1.5, 2.2, 5.0, 10.0, 150.0, 1000.0] {
            let law = ContactLaw::new(alpha);
            let smallest = law.zero_up_to_m() * (1.0 + f64::EPSILON);
            assert!(law.energy(1e-3, smallest) >= f64::MIN_POSITIVE, "α = {alpha}");
            assert_eq!(law.force(1e7, law.zero_up_to_m()), 0.0);
        }
    }

    #[test]
    fn energy_is_the_integral_of_the_force() {
        for alpha in [1.0, 1.3, 1.5, 3.0, 10.0] {
            let law = ContactLaw::new(alpha);
            let (d, h) = (0.3, 1e-6);
            let slope = (law.energy(2.0, d + h) - law.energy(2.0, d - h)) / (2.0 * h);
            // central difference: h² F''/6 relative, below 1e-10 here, and 1e-10 of cancellation
            assert!((slope / law.force(2.0, d) - 1.0).abs() < 1e-8);
        }
    }
}
