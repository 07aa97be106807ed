//! The time from which the last places of a run's numbers decide where its beads are, estimated beside the run at
//! little cost.
//!
//! Changes by roundings obey, as long as they are small, the linear equations
//! `m·d²δu_i/dt² = s_{i−1}·(δu_{i−1} − δu_i) − s_i·(δu_i − δu_{i+1})`
//! with the slopes `s` of the contacts along the run itself. Leapfrog solves them with steps of about 0.3 T of the
//! lightest bead: one evaluation of forces in the time in which the run makes sixty or more. At each of these steps
//! each number gets another rounding, with a sign from a hash. So there is no second run: the states are those of the
//! run.
//!
//! The result is an estimate, good to a factor of some tens, as is the number of roundings. Where differences grow
//! exponentially, this shifts the time at which they count by a few T. `beadline check` finds the time by twins.

use crate::kernel::Activity;
use crate::state::ChainState;
use crate::tangents::slopes::Slopes;
use pulp::Arch;
use schemas::chain::Chain;
use schemas::damping::Damping;
use schemas::drive::{Place, Quantity};
use schemas::frame::Active;
use schemas::functions::ln;
use schemas::manifest::Physics;
use schemas::simd::{ordered_sum, vectorized};
use std::ops::Range;

/// Time between two looks in units of the longest step that a run may have, a quarter of the collision time of its lightest bead.
const LOOK_INTERVAL: f64 = 1.2;

/// Fewest evaluations of forces between two looks: a look takes up to one and a half.
const FEWEST_EVALUATIONS: u64 = 75;

/// The same of a run with steps so coarse that those would take longer than [`LONGEST_INTERVAL`].
const FEWEST_COARSE_EVALUATIONS: u64 = 15;

/// The longest time between two looks, in the same units; leapfrog is stable up to 4/√α.
const LONGEST_INTERVAL: f64 = 1.6;

/// The largest part by which damping changes a velocity from look to look.
const MOST_DAMPED: f64 = 0.5;

/// The largest ω²·t² of a bead alone between its neighbours for which leapfrog with steps of t is stable in any chain.
const STABLE: f64 = 2.0;

/// Most pieces of the time between two looks, where contacts have become stiffer than the run was thought to make them.
const MOST_PIECES: f64 = 16.0;

/// The relative change of a number by a rounding: one unit in the last place of a number just above a power of two.
const ROUNDING: f64 = f64::EPSILON;

/// Differences from which on they count, in units of L and L/T: the tolerance of `beadline check`.
const COUNTS: f64 = 1e-4;

/// Differences from which on their growth is measured.
const MEASURED: f64 = 1e-10;

/// Growth over six decades is exponential if it takes no more than this many times the time before it. Growth by a
/// power of the time would take 10 times with `t^6`, and 1000 times with `t^2`.
const SUDDEN: f64 = 4.0;

/// Most beads that are watched: each takes five numbers.
const MOST_BEADS: usize = 1_000_000;

/// The loss of a motion to rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lost {
    /// Time (s) from which on roundings count.
    pub at_s: f64,
    /// The rate λ (1/s) of the growth `exp(λt)` before that time.
    pub growth_per_s: f64,
}

/// The changes of a run by roundings, computed beside it.
#[derive(Debug, Clone)]
pub struct Growth {
    chain: Chain,
    slopes: Slopes,
    dashpot_n_s_per_m: f64,
    /// Beads whose motion is prescribed.
    moved: Vec<usize>,
    dt_s: f64,
    every: u64,
    next: u64,
    looks: u64,
    /// L (m) and L/T (m/s).
    scales: [f64; 2],
    /// The differences: displacements (m) and velocities (m/s).
    du_m: Vec<f64>,
    dv_m_s: Vec<f64>,
    /// The time between looks over the mass (s/kg) of each bead.
    kick_s_per_kg: Vec<f64>,
    /// ± a rounding for each bead.
    rounding: Vec<f64>,
    /// The force (N) of the differences in each contact.
    force_n: Vec<f64>,
    /// The time (s) and the difference of the last look at which it was below [`MEASURED`].
    small: (f64, f64),
    began_s: Option<f64>,
    lost: Option<Lost>,
    /// The largest ω²·t² so far, over the time t between two looks.
    stiffest: f64,
    is_over: bool,
}

impl Growth {
    /// Makes one for the run of `physics` from `state` on. None for resonators, baths and dampings that are no dashpots,
    /// whose motion is not watched, for damping so strong that a look would not follow it, and for steps so long that looking would cost much.
    pub fn of(physics: &Physics, state: &ChainState) -> Option<Self> {
        let beads = state.u_m.len();
        let dashpot_n_s_per_m = match physics.damping {
            None => 0.0,
            Some(Damping::ViscousNSPerM(coefficient)) => coefficient,
            Some(_) => return None,
        };
        if physics.resonators.is_some() || !physics.baths.is_empty() || beads > MOST_BEADS {
            return None;
        }
        let chain = physics.chain();
        let moved = physics.drives.iter().filter_map(|drive| match (drive.at, drive.prescribes) {
            (Place::Bead(bead), Quantity::Displacement | Quantity::Velocity) => usize::try_from(bead).ok(),
            _ => None,
        });
        let longest_dt_s = physics.longest_dt_s();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let steps = |interval: f64| (interval * longest_dt_s / physics.dt_s) as u64;
        let of_step = u64::from(physics.method.force_evaluations_per_step());
        let fewest = FEWEST_EVALUATIONS.div_ceil(of_step);
        let every = steps(LOOK_INTERVAL).max(fewest).min(steps(LONGEST_INTERVAL)); // integers
        if every.saturating_mul(of_step) < FEWEST_COARSE_EVALUATIONS {
            return None;
        }
        // the leapfrog of a look takes damping as it was before, which is stable in short looks alone
        let per_s = |bead: usize| {
            let drag = chain.sites.drag_n_s_per_m.get(bead).copied().unwrap_or(0.0);
            (4.0 * dashpot_n_s_per_m + drag) / chain.mass_kg[bead]
        };
        if (0..beads).any(|bead| per_s(bead) * every as f64 * physics.dt_s > MOST_DAMPED) {
            return None;
        }
        let sign = |bead: usize| if hash(bead as u64) & 1 == 0 { ROUNDING } else { -ROUNDING };
        let scales = physics.scales();
        Some(Self {
            slopes: Slopes::of(&chain),
            dashpot_n_s_per_m,
            moved: moved.collect(),
            dt_s: physics.dt_s,
            every,
            next: state.step + every,
            looks: 0,
            scales: [scales.length_m, scales.speed_m_s()],
            du_m: vec![0.0; beads],
            dv_m_s: vec![0.0; beads],
            kick_s_per_kg: chain
                .mass_kg
                .iter()
                .map(|mass_kg| every as f64 * physics.dt_s / mass_kg)
                .collect(),
            rounding: (0..beads).map(sign).collect(),
            force_n: vec![0.0; beads],
            small: (0.0, 0.0),
            began_s: None,
            lost: None,
            stiffest: 0.0,
            is_over: false,
            chain,
        })
    }

    /// The next step at which it looks, or `step` if that comes first.
    pub fn next_before(&self, step: u64) -> u64 {
        if self.is_over || self.next > step { step } else { self.next }
    }

    /// The time from which on roundings count, if they do, because they have grown exponentially.
    pub fn lost(&self) -> Option<Lost> {
        self.lost
    }

    /// The largest ω·dt of a bead between its neighbours at any look, with the step of the run.
    pub fn stiffest_step(&self) -> f64 {
        self.stiffest.sqrt() / self.every as f64
    }

    /// Looks at the run, if it has come to the next step for a look. No bead outside of `active` has moved, where that is known.
    pub fn look(&mut self, state: &ChainState, active: Option<Active>) {
        if self.is_over || state.step < self.next {
            return;
        }
        self.next = state.step + self.every;
        let within = active.map_or(0..state.u_m.len(), |active| active.first..active.end);
        let beads = Activity::of(&state.u_m[within.clone()], &state.v_m_s[within.clone()]).beads();
        let beads = within.start + beads.start..within.start + beads.end;
        if beads.is_empty() {
            return;
        }
        self.looks += 1;
        self.slopes.find(Arch::new(), &state.u_m, self.chain.walls_m(&state.extra), &beads);
        let stiffness = self.stiffness(&beads);
        self.stiffest = if stiffness > self.stiffest { stiffness } else { self.stiffest };
        let pieces = (stiffness / STABLE).sqrt().ceil();
        let pieces = if pieces > 1.0 { pieces } else { 1.0 };
        if pieces > MOST_PIECES {
            self.is_over = true;
            return;
        }
        let mut piece = 0.0;
        while piece < pieces {
            vectorized(
                Arch::new(),
                #[inline(always)]
                || {
                    self.kick(state, &beads, 1.0 / pieces);
                    self.drift(state, &beads, 1.0 / pieces);
                },
            );
            for bead in &self.moved {
                (self.du_m[*bead], self.dv_m_s[*bead]) = (0.0, 0.0);
            }
            piece += 1.0;
        }
        self.measure(state.step as f64 * self.dt_s, &beads);
    }

    /// The contacts that touch one of `beads`.
    fn contacts_of(&self, beads: &Range<usize>) -> Range<usize> {
        beads.start.saturating_sub(1)..beads.end.min(self.chain.contact_count()) // integers
    }

    /// The largest ω²·t² of `beads`, each alone between its neighbours, over the time t to the next look.
    fn stiffness(&self, beads: &Range<usize>) -> f64 {
        let time_s = self.every as f64 * self.dt_s;
        let (slopes, springs) = (&self.slopes.contacts, &self.slopes.springs);
        let of = |bead: usize| slopes[bead] + slopes[bead + 1] + springs.get(bead).copied().unwrap_or(0.0);
        let squares = beads.clone().map(|bead| of(bead) * self.kick_s_per_kg[bead] * time_s);
        squares.fold(0.0, |most, square| if square > most { square } else { most })
    }

    /// Changes the velocities by the forces of a look, over a part of the time to the next one.
    #[inline(always)]
    fn kick(&mut self, state: &ChainState, beads: &Range<usize>, part: f64) {
        let contacts = self.contacts_of(beads);
        let du_m = &self.du_m[contacts.start..=contacts.end];
        let slope = &self.slopes.contacts[contacts.start + 1..=contacts.end];
        let force_n = &mut self.force_n[contacts.clone()];
        for c in 0..slope.len() {
            force_n[c] = slope[c] * (du_m[c] - du_m[c + 1]);
        }
        if self.dashpot_n_s_per_m > 0.0 {
            let dv_m_s = &self.dv_m_s[contacts.start..=contacts.end];
            for c in 0..slope.len() {
                if slope[c] > 0.0 {
                    force_n[c] += self.dashpot_n_s_per_m * (dv_m_s[c] - dv_m_s[c + 1]);
                }
            }
        }
        let time_s = part * (self.every as f64 * self.dt_s);
        for force_n in &mut force_n[..] {
            *force_n *= part;
        }
        let kick_s_per_kg = &self.kick_s_per_kg[contacts.start..=contacts.end];
        let dv_m_s = &mut self.dv_m_s[contacts.start..=contacts.end];
        let count = force_n.len();
        for i in 1..count {
            dv_m_s[i] += kick_s_per_kg[i] * (force_n[i - 1] - force_n[i]);
        }
        dv_m_s[0] -= kick_s_per_kg[0] * force_n[0];
        dv_m_s[count] += kick_s_per_kg[count] * force_n[count - 1];
        self.kick_ends(state, time_s);
        self.kick_at_sites(beads, time_s);
    }

    /// Adds the forces of walls, or of the contact that closes a ring.
    fn kick_ends(&mut self, state: &ChainState, time_s: f64) {
        let chain = &self.chain;
        let last = state.u_m.len() - 1;
        for (side, bead) in [(0, 0), (1, last)] {
            if !chain.wall(side).is_there {
                continue;
            }
            let slope = self.slopes.contacts[side * (last + 1)];
            let other = if chain.is_ring { last } else { bead };
            let approach_m = if chain.is_ring { self.du_m[last] - self.du_m[0] } else { -self.du_m[bead] };
            self.dv_m_s[bead] += time_s * (slope * approach_m / chain.mass_kg[bead]);
            if chain.is_ring {
                self.dv_m_s[other] -= time_s * (slope * approach_m / chain.mass_kg[other]);
            }
        }
    }

    /// Adds the forces of springs at the beads' places and of drag.
    fn kick_at_sites(&mut self, beads: &Range<usize>, time_s: f64) {
        let sites = &self.chain.sites;
        for i in beads.clone() {
            let mut force_n = 0.0;
            if sites.has_springs() {
                force_n -= self.slopes.springs[i] * self.du_m[i];
            } else if !sites.has_drag() {
                return;
            }
            if sites.has_drag() {
                force_n -= sites.drag_n_s_per_m[i] * self.dv_m_s[i];
            }
            self.dv_m_s[i] += time_s * (force_n / self.chain.mass_kg[i]);
        }
    }

    /// Changes the displacements over a part of the time to the next look, and adds as much of another rounding to each number.
    #[inline(always)]
    fn drift(&mut self, state: &ChainState, beads: &Range<usize>, part: f64) {
        let time_s = part * (self.every as f64 * self.dt_s);
        let sign = if hash(self.looks) & 1 == 0 { part } else { 0.0 - part };
        let (du_m, dv_m_s) = (&mut self.du_m[beads.clone()], &mut self.dv_m_s[beads.clone()]);
        let (u_m, v_m_s) = (&state.u_m[beads.clone()], &state.v_m_s[beads.clone()]);
        let rounding = &self.rounding[beads.clone()];
        for i in 0..du_m.len() {
            dv_m_s[i] += sign * rounding[i] * v_m_s[i];
            du_m[i] += time_s * dv_m_s[i] + sign * rounding[i] * u_m[i];
        }
    }

    fn measure(&mut self, time_s: f64, beads: &Range<usize>) {
        let size = |values: &[f64], scale: f64| {
            let values = &values[beads.clone()];
            let squares = vectorized(
                Arch::new(),
                #[inline(always)]
                || ordered_sum([values], |[x]| x * x),
            );
            squares.sqrt() / scale
        };
        let (by_u, by_v) = (size(&self.du_m, self.scales[0]), size(&self.dv_m_s, self.scales[1]));
        let difference = if by_u > by_v { by_u } else { by_v };
        let began_s = *self.began_s.get_or_insert(time_s);
        if difference < MEASURED {
            self.small = (time_s, difference);
        } else if difference >= COUNTS || difference.is_nan() {
            self.is_over = true;
            let (since_s, before) = self.small;
            let grown_s = time_s - since_s;
            let is_sudden = grown_s <= SUDDEN * (since_s - began_s);
            if is_sudden && difference.is_finite() && before > 0.0 {
                self.lost = Some(Lost { at_s: time_s, growth_per_s: ln(difference / before) / grown_s });
            }
        }
    }
}

/// A whole number whose bits look random.
fn hash(number: u64) -> u64 {
    let mixed = number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed ^ mixed >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93) >> 40
}
