//! Steps with drives and resonators.
//!
//! Time moves with the drifts: the forces of a kick are those at the time that the drifts of the step have come to. So
//! a force that depends on time, or a wall that moves, is one more coordinate to these methods, and they keep their
//! order.

use super::{Others, Splitting};
use crate::drives::{Acts, Drives, When};
use crate::kernel::{Activity, Pass, PerLane, Pushed, Shake};
use crate::pieces::Piece;
use crate::state::ChainState;
use schemas::simd::vectorized;

impl Splitting {
    /// Makes one step.
    pub(super) fn step_with(&mut self, others: &mut Others, state: &mut ChainState) {
        if self.forces_of_step != Some(state.step) {
            self.start_with(others, state);
        }
        let knots = std::mem::take(&mut others.knots);
        for piece in knots.pieces(state.step) {
            self.make_piece(piece, others, state);
        }
        others.knots = knots;
        state.step += 1;
        self.forces_of_step = Some(state.step);
    }

    /// Makes a step, or a piece of one.
    fn make_piece(&mut self, piece: Piece, others: &mut Others, state: &mut ChainState) {
        let dt_s = piece.length_s();
        if let Some(drives) = &others.drives {
            if piece.begins_at_knot() {
                drives.at(piece.start(), others.rows.drives_of(&state.extra), &mut others.now);
            }
            others.started_m_s.clear();
            let beads = (0..drives.count()).map(|d| drives.velocity_at(d, &state.v_m_s));
            others.started_m_s.extend(beads);
        }
        let last = self.stages.kick_drift.len() - 1;
        let mut after = 0.0;
        for (stage, (b, a)) in self.stages.kick_drift.iter().enumerate() {
            self.kick_with(others, b * dt_s, state);
            let drift_s = a * dt_s;
            after += a;
            let when = if stage == last { piece.end() } else { piece.within(after * dt_s) };
            self.drift_with(others, drift_s, when, state);
            if let Some(tangents) = &mut self.tangents {
                tangents.stage(b * dt_s, drift_s);
                tangents.look(&state.u_m, others.walls_m(), &self.kernel.active_beads());
                let [w_m, _] = others.rows.resonators_of(&state.extra);
                tangents.look_beside(0, [&state.u_m, &state.v_m_s, w_m], &others.now);
            }
        }
        self.kick_with(others, self.stages.last_kick * dt_s, state);
        if let Some(tangents) = &mut self.tangents {
            tangents.kick_at_the_end(self.stages.last_kick * dt_s);
        }
        if let Some(drives) = &others.drives {
            finish_piece(drives, others, state);
        }
    }

    /// Makes a drift of `drift_s`, which ends at `when`, and evaluates the forces there.
    fn drift_with(&mut self, others: &mut Others, drift_s: f64, when: When, state: &mut ChainState) {
        let [w_m, w_m_s, ..] = others.rows.split_mut(&mut state.extra);
        if others.rows.resonators {
            let beads = self.kernel.active_beads();
            let (w_m, w_m_s) = (&mut w_m[beads.clone()], &w_m_s[beads]);
            vectorized(
                self.kernel.arch(),
                #[inline(always)]
                || w_m.iter_mut().zip(w_m_s).for_each(|(w, w_m_s)| *w += drift_s * w_m_s),
            );
        }
        // a kick of no duration adds zero
        let (kick_s, drift_s) = (PerLane::same(0.0), PerLane::same(drift_s));
        let passes: &[Pass] = if others.drives.as_ref().is_some_and(Drives::move_beads) {
            self.kernel.sweep(&[Pass::Drift { drift_s }], state.u_m.whole(), state.v_m_s.whole());
            &[Pass::Forces]
        } else {
            &[Pass::Stage { kick_s, drift_s }]
        };
        self.move_to(others, when, state);
        self.kernel.sweep(passes, state.u_m.whole(), state.v_m_s.whole());
    }

    /// Makes some steps in one sweep, at least one and at most to step `last`, with drives that do nothing but move
    /// walls and push beads: what they do does not depend on the chain.
    pub(super) fn sweep_with(&mut self, others: &mut Others, state: &mut ChainState, last: u64) {
        if self.forces_of_step != Some(state.step) {
            self.start_with(others, state);
        }
        let (steps, stages, dt_s) = (self.steps_to(state.step, last), self.stages, self.dt_s());
        let beads = self.looked_at();
        let Others { rows, mass_kg, drives: Some(drives), now, before_kick, moments, .. } = others else {
            return;
        };
        let ChainState { u_m, v_m_s, extra, step } = state;
        let [.., row] = rows.split_mut(extra);
        // what each drive does at the beginning and after each drift, one after the other
        moments.clone_from(now);
        for step in *step..*step + steps {
            let (piece, mut after) = (Piece::whole(step, dt_s), 0.0);
            for (stage, (_, a)) in stages.kick_drift.iter().enumerate() {
                after += a;
                let is_end = stage + 1 == stages.kick_drift.len();
                let when = if is_end { piece.end() } else { piece.within(after * dt_s) };
                drives.at(when, row, now);
                moments.extend_from_slice(now);
            }
            now.iter().enumerate().for_each(|(d, now)| row[2 * d + 1] = now.x_m);
        }
        let after = |drifts: usize| &moments[drifts * drives.count()..][..drives.count()];
        let drifts = 1..moments.len() / drives.count(); // integers
        self.kernel.move_walls_along(drifts.map(|drifts| drives.walls(after(drifts))[0]));
        let before_n = self.kernel.forces_at_ends();
        before_kick.clear();
        before_kick.extend((0..drives.count()).map(|d| (drives.velocity_at(d, v_m_s), 0.0)));
        let mut kicks = stages.kicks(dt_s, steps);
        let mut push = |v_m_s: &mut [f64]| {
            let Some((kick_s, drifts)) = kicks.next() else { return };
            for (d, now) in after(drifts).iter().enumerate() {
                if let Acts::Pushes(bead) = drives.acts(d) {
                    let (before_m_s, _) = before_kick[d];
                    row[2 * d] += now.push(kick_s, 1.0 / mass_kg[bead], before_m_s, &mut v_m_s[bead]);
                }
            }
            // velocities do not change until the next kick
            before_kick
                .iter_mut()
                .enumerate()
                .for_each(|(d, before)| before.0 = drives.velocity_at(d, v_m_s));
        };
        let has_pushed = drives.pushed().next().is_some();
        let push = has_pushed.then_some(&mut push as Shake<'_>);
        self.kernel.sweep_and_shake(&self.passes, u_m.whole(), v_m_s.whole(), push);
        self.carry_through(steps, &beads, v_m_s, |evaluation| {
            let now = &moments[(evaluation + 1) * drives.count()..][..drives.count()];
            (drives.walls(now)[0], now)
        });
        let forces_n = self.kernel.wall_forces_n();
        for (kick_s, drifts) in stages.kicks(dt_s, steps) {
            let forces_n = if drifts == 0 { before_n } else { forces_n(drifts - 1) };
            for (d, now) in after(drifts).iter().enumerate() {
                if let Acts::Wall(side) = drives.acts(d) {
                    row[2 * d] += now.work_at_wall(side, kick_s, forces_n);
                }
            }
        }
        *step += steps;
        self.forces_of_step = Some(*step);
    }

    /// Evaluates the forces at the beginning of a step that another integrator may have come to.
    fn start_with(&mut self, others: &mut Others, state: &mut ChainState) {
        // as without drives: see `Splitting::advance`
        state.v_m_s.iter_mut().for_each(|v| *v += 0.0);
        let [w_m, w_m_s] = others.rows.resonators_of(&state.extra);
        let activity = Activity::of(&state.u_m, &state.v_m_s).including(w_m).including(w_m_s);
        let activity =
            others.drives.iter().fold(activity, |activity, drives| drives.widen(activity, state.u_m.len()));
        self.kernel.restart(activity);
        if let Some(drives) = &others.drives {
            let start = Piece::whole(state.step, self.dt_s()).start();
            drives.at(start, others.rows.drives_of(&state.extra), &mut others.now);
            self.kernel.move_walls(drives.walls(&others.now)[0]);
        }
        self.kernel.sweep(&[Pass::Forces], state.u_m.whole(), state.v_m_s.whole());
        let [w_m, _] = others.rows.resonators_of(&state.extra);
        self.look_at(state, others.walls_m(), w_m, &others.now);
    }

    /// Puts the walls and beads that drives move at their places at `when`.
    fn move_to(&mut self, others: &mut Others, when: When, state: &mut ChainState) {
        let Some(drives) = &others.drives else { return };
        drives.at(when, others.rows.drives_of(&state.extra), &mut others.now);
        for (d, now) in others.now.iter().enumerate() {
            if let Acts::Moves(bead) = drives.acts(d) {
                state.u_m[bead] = now.x_m;
            }
        }
        self.kernel.move_walls(drives.walls(&others.now)[0]);
    }

    /// Makes a kick of `kick_s` by the forces evaluated last, and adds the work of the drives meanwhile.
    fn kick_with(&mut self, others: &mut Others, kick_s: f64, state: &mut ChainState) {
        if let Some(drives) = &others.drives {
            let mut before = std::mem::take(&mut others.before_kick);
            before.clear();
            before.extend(
                (0..drives.count()).map(|d| {
                    (drives.velocity_at(d, &state.v_m_s), self.net_of_moved(drives, d, others, state))
                }),
            );
            others.before_kick = before;
        }
        if self.kernel.sites().has_resonators() {
            self.kick_resonators(others, kick_s, state);
        } else {
            let kick_s = PerLane::same(kick_s);
            self.kernel.sweep(&[Pass::Kick { kick_s }], state.u_m.whole(), state.v_m_s.whole());
        }
        let Some(drives) = &others.drives else { return };
        let [.., row] = others.rows.split_mut(&mut state.extra);
        for (d, (now, (before_m_s, net_n))) in others.now.iter().zip(&others.before_kick).enumerate() {
            let work_j = match drives.acts(d) {
                Acts::Pushes(bead) => {
                    let inverse_mass = self.kernel.inverse_mass()[bead];
                    now.push(kick_s, inverse_mass, *before_m_s, &mut state.v_m_s[bead])
                }
                Acts::Wall(side) => now.work_at_wall(side, kick_s, self.kernel.forces_at_ends()),
                Acts::Moves(_) => -(kick_s * (net_n * now.v_m_s)),
            };
            row[2 * d] += work_j;
        }
    }

    /// The net force (N) on the bead that drive `d` moves, if it moves one.
    fn net_of_moved(&self, drives: &Drives, d: usize, others: &Others, state: &ChainState) -> f64 {
        let Acts::Moves(bead) = drives.acts(d) else { return 0.0 };
        let [left, right] = self.kernel.forces_at(bead);
        let [w_m, _] = others.rows.resonators_of(&state.extra);
        let mut net_n = [left - right];
        self.kernel.sites().add_to(&mut net_n, &(bead..bead + 1), [&state.u_m, w_m]);
        net_n[0]
    }

    /// Kicks beads that have resonators, and those.
    fn kick_resonators(&mut self, others: &mut Others, kick_s: f64, state: &mut ChainState) {
        let Pushed { beads, left, right, inverse_mass } = self.kernel.pushed();
        let sites = self.kernel.sites();
        let of = |all: &'_ [f64]| if all.is_empty() { 0..0 } else { beads.clone() };
        let (linear, cubic) = (&sites.linear_n_per_m, &sites.cubic_n_per_m3);
        let (linear, cubic) = (&linear[of(linear)], &cubic[of(cubic)]);
        let [w_m, w_m_s, ..] = others.rows.split_mut(&mut state.extra);
        let (w_m, w_m_s) = (&w_m[beads.clone()], &mut w_m_s[beads.clone()]);
        let (u_m, v_m_s) = (&state.u_m[beads.clone()], &mut state.v_m_s[beads.clone()]);
        let stiffness = &sites.resonator_n_per_m[beads.clone()];
        let inverse_resonator = &others.inverse_resonator[beads.clone()];
        let (net_n, count) = (&mut others.net_n[beads.clone()], beads.len());
        vectorized(
            self.kernel.arch(),
            #[inline(always)]
            || {
                for i in 0..count {
                    net_n[i] = left[i] - right[i];
                }
                if !cubic.is_empty() {
                    for i in 0..count {
                        net_n[i] -= linear[i] * u_m[i] + cubic[i] * (u_m[i] * u_m[i] * u_m[i]);
                    }
                } else if !linear.is_empty() {
                    for i in 0..count {
                        net_n[i] -= linear[i] * u_m[i];
                    }
                }
                for i in 0..count {
                    let pull_n = stiffness[i] * (w_m[i] - u_m[i]);
                    v_m_s[i] += kick_s * inverse_mass[i] * (net_n[i] + pull_n);
                    w_m_s[i] += kick_s * inverse_resonator[i] * -pull_n;
                }
            },
        );
    }
}

impl Others {
    /// The places of the walls (m).
    fn walls_m(&self) -> [f64; 2] {
        self.drives.as_ref().map_or([0.0; 2], |drives| drives.walls(&self.now)[0])
    }
}

/// Finishes the pieces of moved beads: sets their velocities, adds the work that accelerates them, and sets the places
/// to which drives have moved walls and beads.
fn finish_piece(drives: &Drives, others: &Others, state: &mut ChainState) {
    let [.., row] = others.rows.split_mut(&mut state.extra);
    for (d, now) in others.now.iter().enumerate() {
        if let Acts::Moves(bead) = drives.acts(d) {
            state.v_m_s[bead] = now.v_m_s;
            let kinetic_j = |v: f64| 0.5 * others.mass_kg[bead] * (v * v);
            row[2 * d] += kinetic_j(now.v_m_s) - kinetic_j(others.started_m_s[d]);
        }
        row[2 * d + 1] = now.x_m;
    }
}
