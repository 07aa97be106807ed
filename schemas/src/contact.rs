//! The contact law: force and energy of two beads that overlap by `δ`.
//!
//! Force and energy share one power so that they are consistent to rounding, in every loop that evaluates
//! them: the dynamics, the analyses, or a re-simulation.

use crate::power::power;

/// How `δ^α` is computed. Each form is exact to its own rounding and is part of the bits of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    /// α = 1: `δ`
    Linear,
    /// α = 3/2 (Hertz): `δ·√δ`
    Hertz,
    /// α = 2: `δ·δ`
    Square,
    /// α = 3: `δ·δ·δ`
    Cube,
    /// α = 5: `(δ·δ)·(δ·δ)·δ`
    Fifth,
    /// any other α: [`power`]
    General,
}

/// `F = k·δ^α` for `δ > 0`, otherwise 0.
///
/// Overlaps up to [`ContactLaw::zero_below_m`] give exactly zero force and energy, so that no
/// force or energy of a closed contact is ever subnormal.
///
/// ```
/// let hertz = schemas::contact::ContactLaw::new(1.5);
/// let overlap_m = 1.0 / 4096.0; // 2^-12 m, so δ^1.5 = 2^-18
/// assert_eq!(hertz.force(1_048_576.0, overlap_m), 4.0); // 2^20 · 2^-18 N
/// assert_eq!(hertz.energy(1_048_576.0, overlap_m), 4.0 * overlap_m / 2.5); // F·δ/(α + 1)
/// assert_eq!(hertz.force(1e7, -1.0), 0.0); // an open contact
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactLaw {
    alpha: f64,
    zero_below_m: f64,
    form: Form,
}

impl ContactLaw {
    /// The law with exponent `alpha ≥ 1` (dimensionless).
    pub fn new(alpha: f64) -> Self {
        let form = match alpha {
            1.0 => Form::Linear,
            1.5 => Form::Hertz,
            2.0 => Form::Square,
            3.0 => Form::Cube,
            5.0 => Form::Fifth,
            _ => Form::General,
        };
        Self { alpha, zero_below_m: zero_bound_m(alpha), form }
    }

    /// The exponent α.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// Overlaps (m) at or below this give zero force: `2^(−900/(α+1))`, so that `δ^(α+1)` of any larger
    /// overlap is above `2^−900`, a normal double with room for `k/(α+1)`.
    pub fn zero_below_m(&self) -> f64 {
        self.zero_below_m
    }

    /// Force (N) of a contact of stiffness `stiffness` (N·m^−α) and overlap `overlap_m` (m).
    pub fn force(&self, stiffness: f64, overlap_m: f64) -> f64 {
        if overlap_m > self.zero_below_m { stiffness * self.power_of(overlap_m) } else { 0.0 }
    }

    /// Potential energy (J), `k·δ^(α+1)/(α+1)`.
    pub fn energy(&self, stiffness: f64, overlap_m: f64) -> f64 {
        self.force(stiffness, overlap_m) * overlap_m / (self.alpha + 1.0)
    }

    /// Calls `user` with the power of this law as a function that the compiler can inline into
    /// `user`'s loops: one copy of the loop for each form of the power, none with a branch in it.
    #[inline(always)]
    pub fn with_power<U: PowerUser>(&self, user: U) -> U::Output {
        let (alpha, bound) = (self.alpha, self.zero_below_m);
        // a closure that is not inlined would be compiled without the caller's instruction set
        match self.form {
            Form::Linear => user.run(
                bound,
                #[inline(always)]
                |d| d,
            ),
            Form::Hertz => user.run(
                bound,
                #[inline(always)]
                |d: f64| d * d.sqrt(),
            ),
            Form::Square => user.run(
                bound,
                #[inline(always)]
                |d| d * d,
            ),
            Form::Cube => user.run(
                bound,
                #[inline(always)]
                |d| d * d * d,
            ),
            Form::Fifth => user.run(
                bound,
                #[inline(always)]
                |d| (d * d) * (d * d) * d,
            ),
            Form::General => user.run(
                bound,
                #[inline(always)]
                move |d| power(d, alpha),
            ),
        }
    }

    /// `δ^α` of one overlap.
    fn power_of(&self, overlap_m: f64) -> f64 {
        struct One(f64);
        impl PowerUser for One {
            type Output = f64;
            fn run(self, _: f64, power: impl Fn(f64) -> f64 + Copy) -> f64 {
                power(self.0)
            }
        }
        self.with_power(One(overlap_m))
    }
}

/// Something that evaluates powers of many overlaps; see [`ContactLaw::with_power`].
pub trait PowerUser {
    /// What it computes.
    type Output;

    /// Runs with `power(δ) = δ^α`, to be trusted for `δ > zero_below_m` only: smaller overlaps have
    /// no force, and the caller selects 0 for them.
    fn run(self, zero_below_m: f64, power: impl Fn(f64) -> f64 + Copy) -> Self::Output;
}

/// Contacts that are looked at together. Loops over fewer are not compiled for vectors.
pub const BLOCK: usize = 32;

/// Neighbouring contacts that are open at rest, as slices of one length.
#[derive(Debug)]
pub struct Contacts<'a> {
    /// Displacements (m) of the beads on the left.
    pub left_m: &'a [f64],
    /// Displacements (m) of the beads on the right.
    pub right_m: &'a [f64],
    /// Stiffnesses (N·m^−α).
    pub stiffness: &'a [f64],
    /// Where the values go.
    pub values: &'a mut [f64],
}

impl Contacts<'_> {
    /// Sets the value of each contact that overlaps by more than `zero_below_m` to `value(overlap, stiffness)`, that of each
    /// other contact to 0. Blocks with no closed contact are skipped; `note(number, any_closed)` is called for each block,
    /// counted from 0.
    ///
    /// Call it through [`vectorized`](crate::simd::vectorized).
    #[inline(always)]
    pub fn evaluate_closed(
        self,
        zero_below_m: f64,
        value: impl Fn(f64, f64) -> f64,
        mut note: impl FnMut(usize, bool),
    ) {
        let (left, left_rest) = self.left_m.as_chunks::<BLOCK>();
        let (right, right_rest) = self.right_m.as_chunks::<BLOCK>();
        let (stiffness, stiffness_rest) = self.stiffness.as_chunks::<BLOCK>();
        let (values, values_rest) = self.values.as_chunks_mut::<BLOCK>();
        let whole = left.len();
        for (block, (((left, right), stiffness), values)) in
            left.iter().zip(right).zip(stiffness).zip(values).enumerate()
        {
            let any_closed = any_closed(left, right, zero_below_m);
            note(block, any_closed);
            if any_closed {
                evaluate([left, right, stiffness], values, zero_below_m, &value);
            } else {
                *values = [0.0; BLOCK];
            }
        }
        if !values_rest.is_empty() {
            note(whole, any_closed(left_rest, right_rest, zero_below_m));
            evaluate([left_rest, right_rest, stiffness_rest], values_rest, zero_below_m, &value);
        }
    }
}

#[inline(always)]
fn any_closed(left: &[f64], right: &[f64], zero_below_m: f64) -> bool {
    let mut any_closed = false;
    for c in 0..left.len() {
        any_closed |= left[c] - right[c] > zero_below_m;
    }
    any_closed
}

#[inline(always)]
fn evaluate(
    [left, right, stiffness]: [&[f64]; 3],
    values: &mut [f64],
    zero_below_m: f64,
    value: &impl Fn(f64, f64) -> f64,
) {
    for c in 0..values.len() {
        let overlap = left[c] - right[c];
        let closed = overlap > zero_below_m;
        // computed in any case: a loop with a branch would have no vectors
        let found = value(if closed { overlap } else { 1.0 }, stiffness[c]);
        values[c] = if closed { found } else { 0.0 };
    }
}

/// `2^(−900/(α+1))` (m).
fn zero_bound_m(alpha: f64) -> f64 {
    power(2.0, -900.0 / (alpha + 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let smallest = law.zero_below_m() * (1.0 + f64::EPSILON);
            assert!(law.energy(1e-3, smallest) >= f64::MIN_POSITIVE, "α = {alpha}");
            assert_eq!(law.force(1e7, law.zero_below_m()), 0.0);
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
