//! Gear's predictor-corrector: the motion of each bead as a polynomial of fifth degree, carried from step to
//! step and corrected by the force at its end.
//!
//! Each bead has the six terms `q_k = dt^k/k!·d^k u/dt^k` (m) of its Taylor series over one time step: `q0` is the
//! displacement, `q1 = v·dt`, and `q2` to `q5` begin the frame's `extra`. A step is
//!
//! ```text
//! predict   p_k = Σ_{j ≥ k} binomial(j, k)·q_j            the series, one step later
//! evaluate  a = F(p_0)·dt²/2m                             at the predicted displacements
//! correct   q_k = p_k + c_k·(a − p_2)                     c = 3/20, 251/360, 1, 11/18, 1/6, 1/60
//! ```
//!
//! `c_0` is 3/20, the value for forces that depend on displacements.
//!
//! A step is a pure function of (u, v, extra): the polynomials are part of the state. From step to step an integrator
//! keeps only the window of beads that may not be at rest.
//!
//! # Source
//! C. W. Gear, *Numerical Initial Value Problems in Ordinary Differential Equations* (Prentice-Hall, 1971),
//! section 9.2; M. P. Allen and D. J. Tildesley, *Computer Simulation of Liquids* (Oxford, 1987), section
//! 3.2 and appendix E.

mod taylor;

use crate::kernel::{Activity, Kernel, Pass, Pushed};
use crate::state::ChainState;
use schemas::simd::{ordered_sum, vectorized};
use std::ops::Range;
pub(super) use taylor::taylor_terms;

/// The corrector's coefficients; that of `q2` is 1.
const C0: f64 = 3.0 / 20.0;
const C1: f64 = 251.0 / 360.0;
const C3: f64 = 11.0 / 18.0;
const C4: f64 = 1.0 / 6.0;
const C5: f64 = 1.0 / 60.0;

/// `q2` to `q5`.
const TERMS_IN_EXTRA: usize = 4;

/// Terms (m) up to this size are exactly zero: `2^-900`.
///
/// A bead that no contact touches loses its higher derivatives: each rounding error of them is a further `2^-53`
/// smaller after a few steps. Without a bound they would end as subnormals, which are slow.
const ZERO_UP_TO_M: f64 = f64::from_bits((1023 - 900) << 52);

/// Advances the states of one chain by Gear's method.
#[derive(Debug, Clone)]
pub(crate) struct Gear {
    kernel: Kernel,
    dt_s: f64,
    /// The step that the window of the kernel belongs to.
    window_of_step: Option<u64>,
}

impl Gear {
    /// Makes steps of `dt_s` with the forces of `kernel`, whose contacts are not damped.
    pub(crate) fn new(dt_s: f64, kernel: Kernel) -> Self {
        Self { kernel, dt_s, window_of_step: None }
    }

    /// Advances `state` by one step.
    pub(crate) fn step(&mut self, state: &mut ChainState) {
        if self.window_of_step != Some(state.step) {
            self.restart(state);
        }
        let terms = Terms::of(state, &self.kernel.active_beads());
        vectorized(
            self.kernel.arch(),
            #[inline(always)]
            || predict(self.dt_s, terms),
        );
        self.kernel.sweep(&[Pass::Forces], state.u_m.whole(), state.v_m_s.whole());
        // a bead that a contact pushes for the first time is at rest, and so is its prediction
        let pushed = self.kernel.pushed();
        let terms = Terms::of(state, &pushed.beads);
        vectorized(
            self.kernel.arch(),
            #[inline(always)]
            || correct(self.dt_s, &pushed, terms),
        );
        state.step += 1;
        self.window_of_step = Some(state.step);
    }

    /// Finds the beads of `state` that are not at rest.
    fn restart(&mut self, state: &ChainState) {
        let of_motion = Activity::of(&state.u_m, &state.v_m_s);
        let terms = state.extra.chunks_exact(state.u_m.len()).take(TERMS_IN_EXTRA);
        self.kernel.restart(terms.fold(of_motion, Activity::including));
    }

    /// The beads that may differ from rest, if `state` is the one just stepped to.
    pub(crate) fn active_beads(&self, state: &ChainState) -> Option<Range<usize>> {
        (self.window_of_step == Some(state.step)).then(|| self.kernel.active_beads())
    }

    /// The first bead of `state` whose displacement, velocity or a higher derivative is not finite.
    pub(crate) fn first_non_finite(&self, state: &ChainState) -> Option<usize> {
        let of_motion = self.kernel.first_non_finite(&state.u_m, &state.v_m_s);
        let active = self.kernel.active_beads();
        let of_terms = || {
            let mut arrays = state.extra.chunks_exact(state.u_m.len()).map(|values| &values[active.clone()]);
            arrays.find_map(|values| {
                // x·0 is NaN exactly where x is not finite, and a sum keeps a NaN
                let is_finite = ordered_sum([values], |[x]| x * 0.0) == 0.0;
                let found = || values.iter().position(|x| !x.is_finite());
                if is_finite { None } else { found().map(|i| active.start + i) }
            })
        };
        of_motion.or_else(of_terms)
    }
}

/// The series of some beads: six slices of one length.
struct Terms<'a> {
    u_m: &'a mut [f64],
    v_m_s: &'a mut [f64],
    /// `dt²/2!·u''` (m)
    q2: &'a mut [f64],
    /// `dt³/3!·u'''` (m)
    q3: &'a mut [f64],
    /// `dt⁴/4!·u''''` (m)
    q4: &'a mut [f64],
    /// `dt⁵/5!·u'''''` (m)
    q5: &'a mut [f64],
}

impl<'a> Terms<'a> {
    /// The terms of `beads`.
    fn of(state: &'a mut ChainState, beads: &Range<usize>) -> Self {
        let chain = state.u_m.len();
        let (q2, rest) = state.extra.split_at_mut(chain);
        let (q3, rest) = rest.split_at_mut(chain);
        let (q4, rest) = rest.split_at_mut(chain);
        let [q2, q3, q4, q5] = [q2, q3, q4, rest].map(|q| &mut q[beads.clone()]);
        let (u_m, v_m_s) = (&mut state.u_m[beads.clone()], &mut state.v_m_s[beads.clone()]);
        Self { u_m, v_m_s, q2, q3, q4, q5 }
    }
}

/// Replaces displacements and velocities by the predicted ones; the other terms stay as they were.
#[inline(always)]
fn predict(dt_s: f64, terms: Terms<'_>) {
    let Terms { u_m, v_m_s, q2, q3, q4, q5 } = terms;
    let n = u_m.len();
    let (v_m_s, q2, q3, q4, q5) = (&mut v_m_s[..n], &q2[..n], &q3[..n], &q4[..n], &q5[..n]);
    let per_dt = 1.0 / dt_s;
    for i in 0..n {
        let change = dt_s * v_m_s[i] + (((q5[i] + q4[i]) + q3[i]) + q2[i]);
        let higher = 2.0 * q2[i] + (3.0 * q3[i] + (4.0 * q4[i] + 5.0 * q5[i]));
        u_m[i] += change;
        v_m_s[i] += per_dt * higher;
    }
}

/// Predicts the other terms, and corrects all of them by the forces at the predicted displacements.
#[inline(always)]
fn correct(dt_s: f64, pushed: &Pushed<'_>, terms: Terms<'_>) {
    let Terms { u_m, v_m_s, q2, q3, q4, q5 } = terms;
    let n = u_m.len();
    let (left, right, inverse_mass) = (&pushed.left[..n], &pushed.right[..n], &pushed.inverse_mass[..n]);
    let (v_m_s, q2, q3, q4, q5) = (&mut v_m_s[..n], &mut q2[..n], &mut q3[..n], &mut q4[..n], &mut q5[..n]);
    let half_dt2 = 0.5 * (dt_s * dt_s);
    let velocity_per_term = C1 / dt_s;
    for i in 0..n {
        let found = (half_dt2 * inverse_mass[i]) * (left[i] - right[i]);
        let expected = (3.0 * q3[i] + (6.0 * q4[i] + 10.0 * q5[i])) + q2[i];
        let miss = found - expected;
        u_m[i] += C0 * miss;
        v_m_s[i] += velocity_per_term * miss;
        q2[i] = found;
        q3[i] = normal(((4.0 * q4[i] + 10.0 * q5[i]) + q3[i]) + C3 * miss);
        q4[i] = normal((5.0 * q5[i] + q4[i]) + C4 * miss);
        q5[i] = normal(q5[i] + C5 * miss);
    }
}

/// The term `x` (m), or `+0` up to [`ZERO_UP_TO_M`].
#[inline(always)]
fn normal(x: f64) -> f64 {
    // a NaN is kept: it ends the run
    if x.abs() <= ZERO_UP_TO_M { 0.0 } else { x }
}
