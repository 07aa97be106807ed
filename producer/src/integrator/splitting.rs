//! Symplectic integrators: alternating kicks (at constant displacement) and drifts (at constant
//! velocity).
//!
//! The forces that end one step and begin the next are kept, but they depend on the displacements alone, so
//! that a fresh integrator started at any state goes on with the same bits.

mod with_drives;

use crate::baths::Baths;
use crate::drives::{Drives, Now};
use crate::kernel::{Activity, Kernel, Pass, PerLane, Shake};
use crate::pieces::Knots;
use crate::state::ChainState;
use crate::tangents::{TOGETHER, Tangents};
use schemas::chain::Chain;
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::rows::Rows;
use std::ops::Range;

/// The stages of a method `K(b₁) D(a₁) K(b₂) D(a₂) … K(b_last)`, as fractions of the time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stages {
    /// The kicks but the last, each with the drift after it: `(b, a)`.
    pub(crate) kick_drift: &'static [(f64, f64)],
    /// The last kick, which is as long as the first.
    pub(crate) last_kick: f64,
}

/// Velocity Verlet, second order.
///
/// # Source
/// W. C. Swope et al., J. Chem. Phys. 76 (1982) 637, doi:10.1063/1.442716.
pub(crate) const VELOCITY_VERLET: Stages = Stages { kick_drift: &[(0.5, 1.0)], last_kick: 0.5 };

const A1: f64 = 0.245_298_957_184_271;
const A2: f64 = 0.604_872_665_711_080;
const A3: f64 = 0.5 - (A1 + A2);
const B1: f64 = 0.082_984_406_417_405_2;
const B2: f64 = 0.396_309_801_498_368;
const B3: f64 = -0.039_056_304_922_348_6;
const B4: f64 = 1.0 - 2.0 * (B1 + B2 + B3);

/// Runge–Kutta–Nyström splitting with six stages, fourth order.
///
/// # Source
/// S. Blanes and P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313, table 3 (`SRKN6b`),
/// doi:10.1016/S0377-0427(01)00492-7.
pub(crate) const RKN4: Stages =
    Stages { kick_drift: &[(B1, A1), (B2, A2), (B3, A3), (B4, A3), (B3, A2), (B2, A1)], last_kick: B1 };

impl Stages {
    /// The stages of a method of kicks and drifts.
    pub(crate) fn of(method: Method) -> Option<Self> {
        match method {
            Method::VelocityVerlet => Some(VELOCITY_VERLET),
            Method::Rkn4 => Some(RKN4),
            _ => None,
        }
    }

    /// Passes that a step adds to those before it: its first kick shares one with the last kick of the step before.
    fn passes_per_step(&self) -> u64 {
        self.kick_drift.len() as u64
    }

    /// The kicks of `steps` steps of `dt_s`: the duration (s) of each, and the number of drifts before it.
    fn kicks(self, dt_s: f64, steps: u64) -> impl Iterator<Item = (f64, usize)> {
        let (drifts, mut begun) = (self.kick_drift.len(), 0);
        let of_step = self.kick_drift.iter().map(|(b, _)| *b).chain([self.last_kick]).enumerate();
        (0..steps).flat_map(move |_| {
            let before = begun;
            begun += drifts;
            of_step.clone().map(move |(kick, b)| (b * dt_s, before + kick))
        })
    }

    /// The passes of a sweep that makes `steps` steps of `dt_s`.
    fn passes(&self, dt_s: PerLane, steps: u64) -> Vec<Pass> {
        let mut passes = Vec::new();
        for step in 0..steps {
            for (stage, (b, a)) in self.kick_drift.iter().enumerate() {
                let (kick_s, drift_s) = (dt_s * *b, dt_s * *a);
                passes.push(if step > 0 && stage == 0 {
                    Pass::StageAfterKick { kick_s, drift_s }
                } else {
                    Pass::Stage { kick_s, drift_s }
                });
            }
        }
        passes.push(Pass::Kick { kick_s: dt_s * self.last_kick });
        passes
    }
}

/// Advances the states of one chain, or of some beside each other, by kicks and drifts.
#[derive(Debug, Clone)]
pub(crate) struct Splitting {
    kernel: Kernel,
    stages: Stages,
    dt_s: PerLane,
    /// The passes of a sweep of `steps_together` steps.
    passes: Vec<Pass>,
    steps_together: u64,
    /// The step at which the kernel's forces were evaluated.
    forces_of_step: Option<u64>,
    /// Drives and resonators, if there is more than contacts, springs and walls that stand still.
    others: Option<Others>,
    /// Changes of the state that it carries with it.
    tangents: Option<Tangents>,
}

/// Drives and resonators.
#[derive(Debug, Clone)]
struct Others {
    rows: Rows,
    mass_kg: Vec<f64>,
    drives: Option<Drives>,
    knots: Knots,
    /// True if sweeps can make several steps: drives move walls, or push beads of a chain that is swept at once, and there is nothing else.
    have_sweeps: bool,
    /// The present action of each drive.
    now: Vec<Now>,
    /// The velocities (m/s) at the beginning of a piece of the beads that drives move.
    started_m_s: Vec<f64>,
    /// The velocity (m/s) of the bead that each drive pushes or moves, and the net force (N) on it, before a kick.
    before_kick: Vec<(f64, f64)>,
    /// The actions of the drives at all moments of a sweep.
    moments: Vec<Now>,
    /// Net forces (N) of a kick.
    net_n: Vec<f64>,
    /// `1/m` (1/kg) of the resonator of each bead, 0 where there is none.
    inverse_resonator: Vec<f64>,
}

impl Others {
    fn of(physics: &Physics, chain: &Chain, kernel: &Kernel) -> Self {
        let drives = Drives::of(&physics.drives, physics.dt_s);
        let fit = |drives: &Drives| {
            !drives.move_beads() && (kernel.fits_in_a_tile() || drives.pushed().next().is_none())
        };
        let inverse = |m: &f64| if *m > 0.0 { 1.0 / m } else { 0.0 };
        Self {
            rows: physics.rows(),
            mass_kg: chain.mass_kg.clone(),
            have_sweeps: !chain.sites.has_resonators() && drives.as_ref().is_some_and(fit),
            drives,
            knots: Knots::of(&physics.drives, physics.dt_s, physics.kernel_version),
            now: Vec::new(),
            started_m_s: Vec::new(),
            before_kick: Vec::new(),
            moments: Vec::new(),
            net_n: vec![0.0; chain.bead_count()],
            inverse_resonator: chain.sites.resonator_kg.iter().map(inverse).collect(),
        }
    }
}

impl Splitting {
    /// Makes steps by `stages` in a run of `physics` and `chain`, with the forces of `kernel`.
    pub(crate) fn new(stages: Stages, physics: &Physics, chain: &Chain, mut kernel: Kernel) -> Self {
        let has_others = !physics.drives.is_empty() || chain.sites.has_resonators();
        let others = has_others.then(|| Others::of(physics, chain, &kernel));
        let drives = others.iter().flat_map(|others| &others.drives);
        drives.flat_map(Drives::pushed).for_each(|bead| kernel.push(bead));
        Self { others, ..Self::without_drives(stages, PerLane::same(physics.dt_s), kernel) }
    }

    /// Makes steps of `dt_s` by `stages`, with the forces of `kernel` and no others.
    pub(crate) fn without_drives(stages: Stages, dt_s: PerLane, kernel: Kernel) -> Self {
        let (passes, others, tangents) = (Vec::new(), None, None);
        Self { kernel, stages, dt_s, passes, steps_together: 0, forces_of_step: None, others, tangents }
    }

    /// Carries `tangents` with the states, from the state on that it is given next.
    pub(crate) fn carry(&mut self, tangents: Tangents) {
        self.kernel.keep_places();
        (self.tangents, self.forces_of_step) = (Some(tangents), None);
    }

    /// The tangents of the state stepped to last.
    pub(crate) fn tangents(&mut self) -> Option<&mut Tangents> {
        let tangents = self.tangents.as_mut()?;
        tangents.settle();
        Some(tangents)
    }

    /// The step (s) of the only chain.
    fn dt_s(&self) -> f64 {
        self.dt_s.0[0]
    }

    /// Advances `state` by as many steps as one sweep can make, at least by one and at most to step `last`; `baths` act between them.
    pub(crate) fn advance(&mut self, state: &mut ChainState, last: u64, baths: Option<&mut Baths>) {
        let has_more = self.others.is_some() || self.tangents.is_some();
        let is_alone = baths.is_some() && (has_more || !self.kernel.fits_in_a_tile());
        let last = if is_alone { state.step + 1 } else { last };
        if let Some(mut others) = self.others.take() {
            let knot = others.knots.next(state.step);
            if others.have_sweeps && knot != Some(state.step) {
                let last = knot.filter(|knot| *knot < last).unwrap_or(last);
                self.sweep_with(&mut others, state, last);
            } else {
                self.step_with(&mut others, state);
            }
            self.others = Some(others);
            return;
        }
        if self.forces_of_step != Some(state.step) {
            // The first kick makes a velocity of -0 one of +0, and no later one is -0: its forces are too large to be lost
            // in rounding. So kicks by nothing can be left out from here on.
            state.v_m_s.iter_mut().for_each(|v| *v += 0.0);
            self.kernel.restart(Activity::of(&state.u_m, &state.v_m_s));
            self.kernel.sweep(&[Pass::Forces], state.u_m.whole(), state.v_m_s.whole());
            self.look_at(state, [0.0; 2], &[], &[]);
        }
        let ChainState { u_m, v_m_s, extra, step } = state;
        let steps = self.steps_to(*step, last);
        let beads = self.looked_at();
        let mut made = *step;
        let mut shake = baths.map(|baths| {
            move |v_m_s: &mut [f64]| {
                baths.after(v_m_s, extra, made);
                made += 1;
                baths.before(v_m_s, extra, made);
            }
        });
        let shake = shake.as_mut().map(|shake| shake as Shake<'_>);
        self.kernel.sweep_and_shake(&self.passes, u_m.whole(), v_m_s.whole(), shake);
        self.carry_through(steps, &beads, v_m_s, |_| ([0.0; 2], &[]));
        *step += steps;
        self.forces_of_step = Some(*step);
    }

    /// Lets the tangents look at a state which they have not come to, where the walls are at `walls_m` (m), at the resonators `w_m` (m), and
    /// drives act as `now`.
    fn look_at(&mut self, state: &ChainState, walls_m: [f64; 2], w_m: &[f64], now: &[Now]) {
        let Some(tangents) = &mut self.tangents else { return };
        tangents.look_at_all(&state.u_m, walls_m);
        tangents.look_beside(0, [&state.u_m, &state.v_m_s, w_m], now);
    }

    /// The beads that move in the next sweep, if there are tangents which look at them.
    fn looked_at(&self) -> Range<usize> {
        if self.tangents.is_none() || self.kernel.active_beads().is_empty() {
            return 0..0;
        }
        // all passes but the last kick evaluate forces
        self.kernel.reached(self.passes.len() - 1)
    }

    /// Carries the tangents through the last sweep, of `steps`, in which `beads` moved; tells where the walls (m) were and how drives acted at
    /// each evaluation of forces. Those of a sweep do not depend on velocities.
    fn carry_through<'a>(
        &mut self,
        steps: u64,
        beads: &Range<usize>,
        v_m_s: &[f64],
        at: impl Fn(usize) -> ([f64; 2], &'a [Now]),
    ) {
        let (dt_s, mut evaluation) = (self.dt_s(), 0);
        let Some(tangents) = &mut self.tangents else { return };
        for _ in 0..steps {
            for (b, a) in self.stages.kick_drift {
                tangents.stage(b * dt_s, a * dt_s);
                if !beads.is_empty() {
                    let (u_m, (walls_m, now)) = (self.kernel.places_m(evaluation), at(evaluation));
                    tangents.look(u_m, walls_m, beads);
                    tangents.look_beside(0, [u_m, v_m_s, &[]], now);
                }
                evaluation += 1;
            }
            tangents.kick_at_the_end(self.stages.last_kick * dt_s);
        }
    }

    /// Number of steps from step `step` to `last` that one sweep can make; makes its passes.
    fn steps_to(&mut self, step: u64, last: u64) -> u64 {
        let most = match self.tangents {
            None => self.kernel.passes_of_a_sweep() - 1,
            Some(_) if self.kernel.fits_in_a_tile() => TOGETHER,
            Some(_) => 1,
        };
        let most = most as u64 / self.stages.passes_per_step();
        let steps = last.saturating_sub(step).clamp(1, most.max(1)); // integers
        if self.steps_together != steps {
            self.passes = self.stages.passes(self.dt_s, steps);
            self.steps_together = steps;
        }
        steps
    }

    /// The beads that may differ from rest, if `state` is the one just stepped to.
    pub(crate) fn active_beads(&self, state: &ChainState) -> Option<Range<usize>> {
        (self.forces_of_step == Some(state.step)).then(|| self.kernel.active_beads())
    }

    /// The first bead of `state` whose displacement or velocity is not finite.
    pub(crate) fn first_non_finite(&self, state: &ChainState) -> Option<usize> {
        self.kernel.first_non_finite(&state.u_m, &state.v_m_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `SRKN6b` is consistent: kicks and drifts add up to one step each.
    #[test]
    fn stages_add_up_to_one_step() {
        for stages in [VELOCITY_VERLET, RKN4] {
            let kicks: f64 = stages.kick_drift.iter().map(|(b, _)| b).sum::<f64>() + stages.last_kick;
            let drifts: f64 = stages.kick_drift.iter().map(|(_, a)| a).sum();
            assert!((kicks - 1.0).abs() < 1e-15 && (drifts - 1.0).abs() < 1e-15);
            // `Pass::StageAfterKick` makes both with one duration
            assert_eq!(stages.last_kick, stages.kick_drift[0].0);
        }
    }
}
