//! Dormand's and Prince's Runge–Kutta method of fifth order, for forces that depend on velocities and on time.
//!
//! All values of a state are integrated together: displacements, velocities, resonators, dissipated work, the work of
//! drives. The seventh evaluation, which their pair needs for its error estimate, is the first of the next step; here
//! there are six.
//!
//! # Source
//! J. R. Dormand and P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19, doi:10.1016/0771-050X(80)90013-3, table 2.

use crate::aligned::Padded;
use crate::drives::{Acts, Drives, Now, When};
use crate::kernel::{Activity, Kernel, Motion};
use crate::pieces::{Knots, Piece};
use crate::state::ChainState;
use crate::tangents::Tangents;
use schemas::chain::Chain;
use schemas::manifest::Physics;
use schemas::rows::Rows;
use schemas::simd::{cut, vectorized};
use std::ops::Range;

/// Evaluations of forces in a step.
const STAGES: usize = 6;

/// Times of the stages, in steps.
const C: [f64; STAGES] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0];

/// Weights of the earlier slopes in the state at each stage but the first, and in the state at the end.
const A: [[f64; STAGES]; STAGES] = [
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];

/// Displacements and velocities of beads and resonators, dissipated work: N values each, or none; and a value of each
/// drive.
#[derive(Debug, Clone)]
struct Values {
    arrays: [Padded; ARRAYS],
    works_j: Vec<f64>,
}

const ARRAYS: usize = 5;
/// Indices of the rows in `Values`; the dissipated work is the last.
const U: usize = 0;
const V: usize = 1;
const W: usize = 2;
const W_V: usize = 3;

/// Advances the states of one chain.
#[derive(Debug, Clone)]
pub(crate) struct Runge {
    kernel: Kernel,
    dt_s: f64,
    rows: Rows,
    mass_kg: Vec<f64>,
    drives: Option<Drives>,
    /// The step that the window of the kernel and the first slopes belong to.
    slopes_of_step: Option<u64>,
    /// Slopes at the stages.
    slopes: [Values; STAGES],
    /// The state at a stage.
    at: Values,
    knots: Knots,
    now: Vec<Now>,
    /// The velocities (m/s) at the beginning of a piece of the beads that drives move.
    started_m_s: Vec<f64>,
    /// Power (W) that contacts dissipate, N values.
    power_w: Vec<f64>,
    has_damped_left_wall: bool,
    /// Changes of the state that it carries with it.
    tangents: Option<Tangents>,
}

impl Runge {
    /// Makes one for a run of `physics` and `chain`, with the forces of `kernel`.
    pub(crate) fn new(physics: &Physics, chain: &Chain, kernel: Kernel) -> Self {
        let (rows, beads) = (physics.rows(), chain.bead_count());
        let drives = Drives::of(&physics.drives, physics.dt_s);
        let zeros = |is_there: bool| Padded::zeros(if is_there { beads } else { 0 });
        let values = || Values {
            arrays: [
                zeros(true),
                zeros(true),
                zeros(rows.resonators),
                zeros(rows.resonators),
                zeros(rows.work),
            ],
            works_j: vec![0.0; physics.drives.len()],
        };
        Self {
            kernel,
            dt_s: physics.dt_s,
            rows,
            mass_kg: chain.mass_kg.clone(),
            drives,
            slopes_of_step: None,
            slopes: std::array::from_fn(|_| values()),
            at: values(),
            knots: Knots::of(&physics.drives, physics.dt_s, physics.kernel_version),
            now: Vec::new(),
            started_m_s: Vec::new(),
            power_w: vec![0.0; beads],
            has_damped_left_wall: chain.damping.is_some() && chain.walls.left.is_there,
            tangents: None,
        }
    }

    /// Carries `tangents` with the states of this run of `chain`, from the state on that it is given next.
    pub(crate) fn carry(&mut self, tangents: Tangents, chain: &Chain) {
        (self.tangents, self.slopes_of_step) = (Some(tangents.in_stages(chain, &A)), None);
    }

    /// The tangents of the state stepped to last.
    pub(crate) fn tangents(&mut self) -> Option<&mut Tangents> {
        self.tangents.as_mut()
    }

    /// Advances `state` by one step.
    pub(crate) fn step(&mut self, state: &mut ChainState) {
        if self.slopes_of_step != Some(state.step) {
            self.restart(state);
        }
        let knots = std::mem::take(&mut self.knots);
        for piece in knots.pieces(state.step) {
            self.make_piece(piece, state);
        }
        self.knots = knots;
        state.step += 1;
        self.slopes_of_step = Some(state.step);
    }

    /// Makes a step, or a piece of one.
    fn make_piece(&mut self, piece: Piece, state: &mut ChainState) {
        let dt_s = piece.length_s();
        if piece.begins_at_knot() {
            let beads = self.kernel.reached(1);
            self.put_moved(piece.start(), state);
            self.evaluate(0, &beads);
        }
        // each evaluation reaches one bead further
        let beads = self.kernel.reached(STAGES + 1);
        for (stage, c) in C.iter().enumerate().skip(1) {
            self.combine(stage, dt_s, state, &beads);
            self.put_moved(if stage == STAGES - 1 { piece.end() } else { piece.within(c * dt_s) }, state);
            self.evaluate(stage, &beads);
        }
        if let Some(tangents) = &mut self.tangents {
            tangents.step(dt_s);
        }
        self.combine(STAGES, dt_s, state, &beads);
        self.put_moved(piece.end(), state);
        self.store(state, &beads);
        self.kernel.widen(&beads, &self.at.arrays[U], &self.at.arrays[V]);
        self.evaluate(0, &beads);
    }

    /// Evaluates the first slopes of a state that another integrator may have come to.
    fn restart(&mut self, state: &mut ChainState) {
        state.v_m_s.iter_mut().for_each(|v| *v += 0.0);
        let beads = state.u_m.len();
        let [w_m, w_m_s] = self.rows.resonators_of(&state.extra);
        let activity = Activity::of(&state.u_m, &state.v_m_s).including(w_m).including(w_m_s);
        let activity = self.drives.iter().fold(activity, |activity, drives| drives.widen(activity, beads));
        // what the left wall dissipates stands beside the last bead
        let activity = if self.has_damped_left_wall { activity.with(0).with(beads - 1) } else { activity };
        self.kernel.restart(activity);
        self.slopes.iter_mut().flat_map(|slopes| &mut slopes.arrays).for_each(|array| array.fill(0.0));
        self.at.arrays.iter_mut().for_each(|array| array.fill(0.0));
        self.power_w.fill(0.0);
        self.at.arrays[U].copy_from_slice(&state.u_m);
        self.at.arrays[V].copy_from_slice(&state.v_m_s);
        if self.rows.resonators {
            self.at.arrays[W].copy_from_slice(w_m);
            self.at.arrays[W_V].copy_from_slice(w_m_s);
        }
        if let Some(drives) = &self.drives {
            let start = Piece::whole(state.step, self.dt_s).start();
            drives.at(start, self.rows.drives_of(&state.extra), &mut self.now);
        }
        let beads = self.kernel.reached(1);
        self.evaluate(0, &beads);
    }

    /// Computes the state at `stage`, or at the end of the step, from the earlier slopes.
    fn combine(&mut self, stage: usize, dt_s: f64, state: &ChainState, beads: &Range<usize>) {
        let weights = A[stage - 1];
        let (mut used, mut count) = ([0; STAGES], 0);
        for s in (0..STAGES).filter(|s| weights[*s] != 0.0) {
            used[count] = s;
            count += 1;
        }
        let used = &used[..count];
        let n = state.u_m.len();
        let rows = [&state.u_m[..], &state.v_m_s[..]].into_iter().chain(state.extra.chunks_exact(n));
        let is_there = self.at.arrays.each_ref().map(|values| !values.is_empty());
        let arch = self.kernel.arch();
        for (array, from) in (0..ARRAYS).filter(|array| is_there[*array]).zip(rows) {
            let (from, to) = (&from[beads.clone()], &mut self.at.arrays[array][beads.clone()]);
            let slopes: [&[f64]; STAGES] =
                std::array::from_fn(|s| &self.slopes[s].arrays[array][beads.clone()]);
            vectorized(
                arch,
                #[inline(always)]
                || add_slopes(from, to, dt_s, &slopes, &weights, used),
            );
        }
        let row = self.rows.drives_of(&state.extra);
        for d in 0..self.at.works_j.len() {
            let mut sum = 0.0;
            for (turn, s) in used.iter().enumerate() {
                let part = weights[*s] * self.slopes[*s].works_j[d];
                sum = if turn == 0 { part } else { sum + part };
            }
            self.at.works_j[d] = row[2 * d] + dt_s * sum;
        }
    }

    /// Puts the walls and beads that drives move at their places at `when`.
    fn put_moved(&mut self, when: When, state: &ChainState) {
        let Some(drives) = &self.drives else { return };
        drives.at(when, self.rows.drives_of(&state.extra), &mut self.now);
        for (d, now) in self.now.iter().enumerate() {
            if let Acts::Moves(bead) = drives.acts(d) {
                self.at.arrays[U][bead] = now.x_m;
                self.at.arrays[V][bead] = now.v_m_s;
            }
        }
    }

    /// Evaluates the slopes of `stage`, from the state there.
    fn evaluate(&mut self, stage: usize, beads: &Range<usize>) {
        let walls = self.drives.as_ref().map(|drives| drives.walls(&self.now));
        let [walls_m, walls_m_s] = walls.unwrap_or_default();
        let [u_m, v_m_s, ..] = &mut self.at.arrays;
        let mut motion = Motion { u_m: u_m.whole(), v_m_s: v_m_s.whole(), walls_m, walls_m_s };
        self.kernel.evaluate_moving(beads, &mut motion, &mut self.power_w);
        if let Some(tangents) = &mut self.tangents {
            tangents.look_at(stage, &motion);
            let [u_m, v_m_s, w_m, ..] = self.at.arrays.each_ref().map(|array| &array[..]);
            tangents.look_beside(stage, [u_m, v_m_s, w_m], &self.now);
        }
        let [u_m, v_m_s, w_m, w_m_s, _] = &self.at.arrays;
        let slopes = &mut self.slopes[stage];
        let [du, dv, dw, dw_v, dwork] = &mut slopes.arrays;
        du[beads.clone()].copy_from_slice(&v_m_s[beads.clone()]);
        let sites = self.kernel.sites();
        let inverse_mass = self.kernel.inverse_mass();
        // net forces first
        self.kernel.net_forces(beads, [u_m, v_m_s, w_m], dv);
        if let Some(drives) = &self.drives {
            for (d, now) in self.now.iter().enumerate() {
                slopes.works_j[d] = match drives.acts(d) {
                    Acts::Pushes(bead) => now.force_n * v_m_s[bead],
                    Acts::Wall(0) => self.kernel.forces_at(0)[0] * now.v_m_s,
                    Acts::Wall(_) => 0.0 - self.kernel.forces_at(u_m.len() - 1)[1] * now.v_m_s,
                    Acts::Moves(bead) => 0.0 - dv[bead] * now.v_m_s,
                };
            }
        }
        vectorized(
            self.kernel.arch(),
            #[inline(always)]
            || {
                let (part, count) = (beads.clone(), beads.len());
                let dv = &mut dv[part.clone()][..count];
                let [inverse_mass] = cut([&inverse_mass[part.clone()]], count);
                for i in 0..count {
                    dv[i] *= inverse_mass[i];
                }
                if sites.has_resonators() {
                    dw[part.clone()].copy_from_slice(&w_m_s[part.clone()]);
                    let dw_v = &mut dw_v[part.clone()][..count];
                    let springs = [&sites.resonator_kg, &sites.resonator_n_per_m, &u_m[..], &w_m[..]];
                    let [m, k, u, w] = cut(springs.map(|all| &all[part.clone()]), count);
                    for i in 0..count {
                        let pulled = (1.0 / m[i]) * -(k[i] * (w[i] - u[i]));
                        dw_v[i] = if m[i] > 0.0 { pulled } else { 0.0 };
                    }
                }
                if self.rows.work {
                    let dwork = &mut dwork[part.clone()][..count];
                    let [power_w, v] = cut([&self.power_w[part.clone()], &v_m_s[part.clone()]], count);
                    for i in 0..count {
                        // −0 becomes 0
                        dwork[i] = power_w[i] + 0.0;
                    }
                    if sites.has_drag() {
                        let [drag] = cut([&sites.drag_n_s_per_m[part]], count);
                        for i in 0..count {
                            dwork[i] = power_w[i] + drag[i] * (v[i] * v[i]);
                        }
                    }
                }
            },
        );
        if let Some(drives) = &self.drives {
            for (d, now) in self.now.iter().enumerate() {
                match drives.acts(d) {
                    Acts::Pushes(bead) => dv[bead] += inverse_mass[bead] * now.force_n,
                    Acts::Moves(bead) => (du[bead], dv[bead]) = (0.0, 0.0),
                    Acts::Wall(_) => {}
                }
            }
        }
    }

    /// Writes the state at the end of the step.
    fn store(&mut self, state: &mut ChainState, beads: &Range<usize>) {
        let [u_m, v_m_s, w_m, w_m_s, work_j] = &self.at.arrays;
        if let Some(drives) = &self.drives {
            self.started_m_s.clear();
            self.started_m_s.extend((0..drives.count()).map(|d| drives.velocity_at(d, &state.v_m_s)));
        }
        state.u_m[beads.clone()].copy_from_slice(&u_m[beads.clone()]);
        state.v_m_s[beads.clone()].copy_from_slice(&v_m_s[beads.clone()]);
        let [to_w, to_w_v, to_work, row] = self.rows.split_mut(&mut state.extra);
        for (to, from) in [(to_w, w_m), (to_w_v, w_m_s), (to_work, work_j)] {
            if !from.is_empty() {
                to[beads.clone()].copy_from_slice(&from[beads.clone()]);
            }
        }
        let Some(drives) = &self.drives else { return };
        for (d, now) in self.now.iter().enumerate() {
            row[2 * d] = self.at.works_j[d];
            if let Acts::Moves(bead) = drives.acts(d) {
                let kinetic_j = |v: f64| 0.5 * self.mass_kg[bead] * (v * v);
                row[2 * d] += kinetic_j(now.v_m_s) - kinetic_j(self.started_m_s[d]);
            }
            row[2 * d + 1] = now.x_m;
        }
    }

    /// The beads that may differ from rest, if `state` is the one just stepped to.
    pub(crate) fn active_beads(&self, state: &ChainState) -> Option<Range<usize>> {
        (self.slopes_of_step == Some(state.step)).then(|| self.kernel.active_beads())
    }

    /// The first bead of `state` that has a value which is not finite.
    pub(crate) fn first_non_finite(&self, state: &ChainState) -> Option<usize> {
        self.kernel.first_non_finite(&state.u_m, &state.v_m_s)
    }
}

/// `to = from + dt·Σ weight·slope` over the slopes that are `used`.
#[inline(always)]
fn add_slopes(
    from: &[f64],
    to: &mut [f64],
    dt_s: f64,
    slopes: &[&[f64]; STAGES],
    weights: &[f64; STAGES],
    used: &[usize],
) {
    let n = to.len();
    let from = &from[..n];
    let [a, b, c, d, e] =
        [0, 1, 2, 3, 4].map(|k| used.get(k).map_or((0.0, from), |s| (weights[*s], &slopes[*s][..n])));
    // each number of slopes has a plain loop of its own: a closure in it would not come into vectors
    match used.len() {
        1 => {
            for i in 0..n {
                to[i] = from[i] + dt_s * (a.0 * a.1[i]);
            }
        }
        2 => {
            for i in 0..n {
                to[i] = from[i] + dt_s * (a.0 * a.1[i] + b.0 * b.1[i]);
            }
        }
        3 => {
            for i in 0..n {
                to[i] = from[i] + dt_s * (a.0 * a.1[i] + b.0 * b.1[i] + c.0 * c.1[i]);
            }
        }
        4 => {
            for i in 0..n {
                to[i] = from[i] + dt_s * (a.0 * a.1[i] + b.0 * b.1[i] + c.0 * c.1[i] + d.0 * d.1[i]);
            }
        }
        _ => {
            for i in 0..n {
                let earlier = a.0 * a.1[i] + b.0 * b.1[i] + c.0 * c.1[i] + d.0 * d.1[i];
                to[i] = from[i] + dt_s * (earlier + e.0 * e.1[i]);
            }
        }
    }
}
