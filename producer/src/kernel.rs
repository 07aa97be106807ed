//! Kicks, drifts and contact forces, over the part of the chain that has ever moved.
//!
//! Architecture invariant: a bead is skipped only where the full step would return the bits it
//! already has. Outside the [`Activity`] window displacement and velocity are zero, every contact has its
//! force at rest, which is subtracted in the form in which it was computed, and a kick or a drift adds
//! exactly zero.

mod damped;

use damped::Damped;
use pulp::Arch;
use schemas::chain::{Chain, Walls, ordered_sum};
use schemas::contact::{ContactLaw, PowerUser};
use std::ops::Range;

/// The beads that may differ from rest: all others have zero bits in `u` and `v`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Activity {
    beads: Range<usize>,
}

impl Activity {
    /// The smallest window around the beads that are not at rest at zero displacement.
    pub fn of(u_m: &[f64], v_m_s: &[f64]) -> Self {
        let active = |(u, v): (&f64, &f64)| u.to_bits() != 0 || v.to_bits() != 0;
        let pairs = || u_m.iter().zip(v_m_s);
        let first = pairs().position(active).unwrap_or(0);
        let end = pairs().rposition(active).map_or(first, |last| last + 1);
        Self { beads: first..end }
    }

    /// This window, widened over the beads that have one of `values` (N of them) other than zero.
    pub(crate) fn including(mut self, values: &[f64]) -> Self {
        let active = |x: &f64| x.to_bits() != 0;
        if let (Some(first), Some(last)) = (values.iter().position(active), values.iter().rposition(active)) {
            let beads = &self.beads;
            let (start, end) = if beads.is_empty() { (first, last + 1) } else { (beads.start, beads.end) };
            self.beads = if first < start { first } else { start }..if last < end { end } else { last + 1 };
        }
        self
    }
}

/// The active beads and what pushes them, with slices over just these beads.
#[derive(Debug, Clone)]
pub(crate) struct Pushed<'a> {
    /// The window of active beads.
    pub(crate) beads: Range<usize>,
    /// Force (N) beyond that at rest of the contact on the left of each, which pushes it to the right.
    pub(crate) left: &'a [f64],
    /// The same of the contact on the right of each, which pushes it to the left.
    pub(crate) right: &'a [f64],
    /// `1/m` (1/kg) of each.
    pub(crate) inverse_mass: &'a [f64],
}

/// The static equilibrium of a loaded chain, N − 1 values each.
#[derive(Debug, Clone)]
struct Rest {
    overlap_m: Vec<f64>,
    force_n: Vec<f64>,
}

/// The arrays of a chain in the form in which the kernel uses them.
#[derive(Debug, Clone)]
pub struct Kernel {
    arch: Arch,
    law: ContactLaw,
    inverse_mass: Vec<f64>,
    stiffness: Vec<f64>,
    /// What presses the contacts together at rest, if anything does.
    rest: Option<Rest>,
    walls: Walls,
    damped: Option<Damped>,
    /// Force (N) of contact `c` beyond that at rest at index `c + 1`; those of the walls at both ends.
    force: Vec<f64>,
    activity: Activity,
}

impl Kernel {
    /// A kernel for `chain` that uses the widest SIMD instructions of this machine.
    pub fn new(chain: &Chain) -> Self {
        Self::with_arch(chain, Arch::new())
    }

    /// A kernel with a given instruction set; every one gives the same bits.
    pub fn with_arch(chain: &Chain, arch: Arch) -> Self {
        let rest = || Rest { overlap_m: chain.rest_overlap_m.clone(), force_n: chain.rest_force_n.clone() };
        Self {
            arch,
            law: chain.law,
            inverse_mass: chain.mass_kg.iter().map(|m| 1.0 / m).collect(),
            stiffness: chain.stiffness.clone(),
            rest: chain.is_loaded().then(rest),
            walls: chain.walls,
            damped: Damped::of(chain),
            force: vec![0.0; chain.bead_count() + 1],
            activity: Activity { beads: 0..0 },
        }
    }

    /// Forgets the forces of before and takes `activity` as the beads that may not be at rest.
    pub fn restart(&mut self, activity: Activity) {
        self.force.fill(0.0);
        self.activity = activity;
    }

    /// Evaluates `F = k·δ^α` of every contact at the displacements `u_m`, and widens the window over
    /// the beads that a contact now pushes.
    pub fn evaluate_forces(&mut self, u_m: &[f64]) {
        let beads = self.activity.beads.clone();
        if beads.is_empty() {
            return;
        }
        let contacts = self.contacts_of(&beads);
        let (first, end) = (contacts.start, contacts.end);
        let law = self.law;
        let forces = Forces {
            left: &u_m[first..end],
            right: &u_m[first + 1..=end],
            stiffness: &self.stiffness[first..end],
            force: &mut self.force[first + 1..=end],
        };
        if let Some(rest) = &self.rest {
            let rest_overlap = &rest.overlap_m[first..end];
            let loaded = LoadedForces { forces, rest_overlap, rest_force: &rest.force_n[first..end] };
            self.arch.dispatch(
                #[inline(always)]
                || law.with_power(loaded),
            );
        } else {
            self.arch.dispatch(
                #[inline(always)]
                || law.with_power(forces),
            );
        }
        self.push_by_walls(&beads, u_m);
        self.widen(first, end);
    }

    /// The beads that may not be at rest.
    pub(crate) fn active_beads(&self) -> Range<usize> {
        self.activity.beads.clone()
    }

    /// The contacts that touch one of `beads`: contact c joins beads c and c + 1.
    fn contacts_of(&self, beads: &Range<usize>) -> Range<usize> {
        beads.start.saturating_sub(1)..beads.end.min(self.stiffness.len()) // integers
    }

    /// The forces of the walls on the end beads that are active.
    fn push_by_walls(&mut self, beads: &Range<usize>, u_m: &[f64]) {
        let last = u_m.len() - 1;
        if self.walls.left.stiffness > 0.0 && beads.start == 0 {
            self.force[0] = self.walls.left.excess_force_n(self.law, -u_m[0]);
        }
        if self.walls.right.stiffness > 0.0 && beads.end > last {
            self.force[last + 1] = self.walls.right.excess_force_n(self.law, u_m[last]);
        }
    }

    fn widen(&mut self, first_contact: usize, end_contact: usize) {
        let beads = &mut self.activity.beads;
        if first_contact < beads.start && self.force[first_contact + 1] != 0.0 {
            beads.start = first_contact;
        }
        if end_contact == beads.end && self.force[end_contact] != 0.0 {
            beads.end += 1;
        }
    }

    /// A kick `v ← v + h·F/m` followed by a drift `u ← u + d·v`, with the forces evaluated last.
    pub fn kick_drift(&self, kick_s: f64, drift_s: f64, u_m: &mut [f64], v_m_s: &mut [f64]) {
        let beads = self.activity.beads.clone();
        let (left, right) = self.forces_beside(&beads);
        let inverse_mass = &self.inverse_mass[beads.clone()];
        let (u, v) = (&mut u_m[beads.clone()], &mut v_m_s[beads]);
        self.arch.dispatch(
            #[inline(always)]
            || {
                for i in 0..left.len() {
                    let velocity = (kick_s * inverse_mass[i]).mul_add(left[i] - right[i], v[i]);
                    v[i] = velocity;
                    u[i] = drift_s.mul_add(velocity, u[i]);
                }
            },
        );
    }

    /// A kick `v ← v + h·F/m` with the forces evaluated last.
    pub fn kick(&self, kick_s: f64, v_m_s: &mut [f64]) {
        let beads = self.activity.beads.clone();
        let (left, right) = self.forces_beside(&beads);
        let inverse_mass = &self.inverse_mass[beads.clone()];
        let v = &mut v_m_s[beads];
        self.arch.dispatch(
            #[inline(always)]
            || {
                for i in 0..left.len() {
                    v[i] = (kick_s * inverse_mass[i]).mul_add(left[i] - right[i], v[i]);
                }
            },
        );
    }

    /// The instruction set to compile loops for.
    pub(crate) fn arch(&self) -> Arch {
        self.arch
    }

    /// The active beads, with the forces evaluated last.
    pub(crate) fn pushed(&self) -> Pushed<'_> {
        let beads = self.active_beads();
        let (left, right) = self.forces_beside(&beads);
        let inverse_mass = &self.inverse_mass[beads.clone()];
        Pushed { beads, left, right, inverse_mass }
    }

    /// The first active bead whose displacement or velocity is not finite.
    pub fn first_non_finite(&self, u_m: &[f64], v_m_s: &[f64]) -> Option<usize> {
        let beads = self.activity.beads.clone();
        let (u, v) = (&u_m[beads.clone()], &v_m_s[beads.clone()]);
        // x·0 is NaN exactly where x is not finite, and a sum keeps a NaN
        let sum = self.arch.dispatch(
            #[inline(always)]
            || ordered_sum(u.len(), |i| u[i] * 0.0 + v[i] * 0.0),
        );
        if sum == 0.0 {
            return None;
        }
        let found = u.iter().zip(v).position(|(u, v)| !(u.is_finite() && v.is_finite()));
        found.map(|i| beads.start + i)
    }

    /// Forces (N) of the contacts on the left and on the right of each of `beads`.
    fn forces_beside(&self, beads: &Range<usize>) -> (&[f64], &[f64]) {
        (&self.force[beads.clone()], &self.force[beads.start + 1..=beads.end])
    }
}

/// The loop over contacts, one copy for each form of the power.
struct Forces<'a> {
    left: &'a [f64],
    right: &'a [f64],
    stiffness: &'a [f64],
    force: &'a mut [f64],
}

/// Contacts that are looked at together: where none of them is closed, no power is computed.
const BLOCK: usize = 64;

impl PowerUser for Forces<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, zero_below_m: f64, power: impl Fn(f64) -> f64 + Copy) {
        let left = self.left.chunks(BLOCK);
        let blocks = left.zip(self.right.chunks(BLOCK)).zip(self.stiffness.chunks(BLOCK));
        for (((left, right), stiffness), force) in blocks.zip(self.force.chunks_mut(BLOCK)) {
            let contacts = force.len();
            let (left, right, stiffness) = (&left[..contacts], &right[..contacts], &stiffness[..contacts]);
            let mut any_closed = false;
            for c in 0..contacts {
                any_closed |= left[c] - right[c] > zero_below_m;
            }
            if !any_closed {
                force.fill(0.0);
                continue;
            }
            for c in 0..contacts {
                let overlap = left[c] - right[c];
                let closed = overlap > zero_below_m;
                let f = stiffness[c] * power(if closed { overlap } else { 1.0 });
                force[c] = if closed { f } else { 0.0 };
            }
        }
    }
}

/// The same loop in a loaded chain: overlaps count from those at rest, forces beyond those at rest.
struct LoadedForces<'a> {
    forces: Forces<'a>,
    rest_overlap: &'a [f64],
    rest_force: &'a [f64],
}

impl PowerUser for LoadedForces<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, zero_below_m: f64, power: impl Fn(f64) -> f64 + Copy) {
        let contacts = self.forces.force.len();
        let (left, right) = (&self.forces.left[..contacts], &self.forces.right[..contacts]);
        let (stiffness, force) = (&self.forces.stiffness[..contacts], &mut self.forces.force[..contacts]);
        let (rest_overlap, rest_force) = (&self.rest_overlap[..contacts], &self.rest_force[..contacts]);
        for c in 0..contacts {
            let overlap = (left[c] - right[c]) + rest_overlap[c];
            let closed = overlap > zero_below_m;
            let f = stiffness[c] * power(if closed { overlap } else { 1.0 });
            force[c] = (if closed { f } else { 0.0 }) - rest_force[c];
        }
    }
}
