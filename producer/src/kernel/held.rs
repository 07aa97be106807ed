//! Short chains, held in registers: all passes of a sweep without loads and stores of beads and forces between them.
//!
//! A stage of a short chain takes as long as one bead waits for the other operations: a force that is stored, and loaded again one place
//! further, is the longest wait but for a root.

use super::constants::{BARE, LOADED, SPRINGS, before_terms};
use super::group::{Motion, of_springs};
use super::layout::{Along, COUNTED, GROUP, Layout as _, PerLane, right};
use super::sweep::{Pass, Sweep};
use pulp::{Simd, WithSimd, bytemuck};
use schemas::contact::Formula;
use schemas::simd::{load, store};

/// A sweep over a chain of `R` registers: a function of its own for each kind and number.
struct Held<'s, 'a, const KIND: u8, const R: usize> {
    sweep: &'s mut Sweep<'a>,
    formula: Formula,
}

/// The beads of a chain, the force on the left of each, and their constants. What does not stay in a register lies in one line of the cache.
#[repr(align(64))]
struct Registers<V, const R: usize> {
    u: [V; R],
    v: [V; R],
    force: [V; R],
    inverse_mass: [V; R],
    /// Stiffnesses, overlaps and forces at rest; or the stiffnesses of up to three springs.
    constants: [[V; R]; 3],
}

impl Sweep<'_> {
    /// Takes the chain through all passes if it fits into registers. True if it did.
    #[inline(always)]
    pub(super) fn hold<S: Simd, const KIND: u8>(&mut self, simd: S, formula: Formula) -> bool {
        /// One copy of the loops for each number of registers.
        macro_rules! held {
            ($($registers:literal)+) => {
                match (self.count + usize::from(!self.fills_registers::<S>())).div_ceil(S::F64_LANES) {
                    $($registers => {
                        simd.vectorize(Held::<KIND, $registers> { sweep: self, formula });
                        true
                    })+
                    _ => false,
                }
            };
        }
        held! { 1 2 3 4 5 6 7 8 9 }
    }

    /// True for a ring of whole registers, in which no contact is behind the last bead.
    #[inline(always)]
    fn fills_registers<S: Simd>(&self) -> bool {
        self.ends.is_ring && self.count.is_multiple_of(S::F64_LANES)
    }
}

impl<const KIND: u8, const R: usize> WithSimd for Held<'_, '_, KIND, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { sweep, formula } = self;
        let mut beads = Registers::<S::f64s, R>::load::<S, KIND>(simd, sweep);
        let mut evaluation = 0;
        for pass in sweep.passes {
            match pass {
                Pass::Stage { kick_s, drift_s } => {
                    beads.kick(simd, kick_s, 1);
                    beads.drift(simd, drift_s);
                }
                Pass::StageAfterKick { kick_s, drift_s } => {
                    beads.kick(simd, kick_s, 2);
                    beads.drift(simd, drift_s);
                }
                Pass::Forces => {}
                Pass::Kick { kick_s } => {
                    beads.kick(simd, kick_s, 1);
                    continue;
                }
                Pass::Drift { drift_s } => {
                    beads.drift(simd, drift_s);
                    continue;
                }
            }
            beads.press::<S, KIND>(simd, formula, sweep, evaluation);
            if !sweep.places_m.is_empty() {
                let row = &mut sweep.places_m[evaluation * sweep.force.len()..];
                let registers = beads.u.iter().enumerate();
                registers.for_each(|(number, u)| store::<S>(*u, row, number * S::F64_LANES));
            }
            evaluation += 1;
        }
        let behind = sweep.count % S::F64_LANES;
        sweep.wall_forces_n.iter_mut().for_each(|[_, of_right]| of_right.0[0] = of_right.0[behind]);
        beads.store::<S, KIND>(sweep);
    }
}

impl<V: bytemuck::Pod, const R: usize> Registers<V, R> {
    #[inline(always)]
    fn load<S: Simd<f64s = V>, const KIND: u8>(simd: S, sweep: &Sweep<'_>) -> Self {
        let numbers = |from: &[f64]| {
            let mut registers = [simd.splat_f64s(0.0); R];
            for (number, register) in registers.iter_mut().enumerate() {
                *register = load::<S>(from, number * S::F64_LANES);
            }
            registers
        };
        let row = |row: usize| {
            let mut registers = [simd.splat_f64s(0.0); R];
            let groups = sweep.constants.numbers.as_chunks::<GROUP>().0;
            for (number, register) in registers.iter_mut().enumerate() {
                let place = number * S::F64_LANES;
                let group = &groups[place / GROUP * sweep.constants.rows + row];
                *register = load::<S>(group, place % GROUP);
            }
            registers
        };
        let first = if KIND & SPRINGS == 0 { 1 } else { before_terms(KIND) };
        let last = sweep.constants.rows - 1;
        // rows that a kind does not have are not read
        let constants =
            [first, first + 1, first + 2].map(|wanted| row(if wanted < last { wanted } else { last }));
        let [u, v, force] = [&*sweep.u_m, &*sweep.v_m_s, &*sweep.force].map(numbers);
        Self { u, v, force, inverse_mass: row(0), constants }
    }

    #[inline(always)]
    fn store<S: Simd<f64s = V>, const KIND: u8>(self, sweep: &mut Sweep<'_>) {
        for number in 0..R {
            let at = number * S::F64_LANES;
            store::<S>(self.u[number], sweep.u_m, at);
            store::<S>(self.v[number], sweep.v_m_s, at);
            store::<S>(self.force[number], sweep.force, at);
        }
        if sweep.fills_registers::<S>() {
            sweep.force[sweep.count] = sweep.force[0];
        }
        if KIND == BARE {
            let groups = sweep.force.as_chunks::<GROUP>().0.iter().take(sweep.count / GROUP + 1);
            for (presses, group) in sweep.presses.iter_mut().zip(groups) {
                *presses = group.iter().any(|force| *force != 0.0);
            }
        }
    }

    /// Kicks the beads by the last forces, once or twice.
    #[inline(always)]
    fn kick<S: Simd<f64s = V>>(&mut self, simd: S, kick_s: &PerLane, kicks: u8) {
        let kick_s = kick_s.load::<S>();
        let motion = Motion { kicks, kick_s, drift_s: kick_s };
        // in a ring of whole registers the last bead has the first contact on its right; no other last register ends with a bead
        for number in 0..R {
            let next = self.force[(number + 1) % R];
            let net = simd.sub_f64s(self.force[number], right(simd, self.force[number], next));
            self.v[number] = motion.kicked(simd, self.inverse_mass[number], net, self.v[number]);
        }
    }

    #[inline(always)]
    fn drift<S: Simd<f64s = V>>(&mut self, simd: S, drift_s: &PerLane) {
        let drift_s = drift_s.load::<S>();
        for number in 0..R {
            self.u[number] = simd.add_f64s(self.u[number], simd.mul_f64s(drift_s, self.v[number]));
        }
    }

    /// Evaluates the contacts on the left of the beads, and that behind the last.
    #[inline(always)]
    fn press<S: Simd<f64s = V>, const KIND: u8>(
        &mut self,
        simd: S,
        formula: Formula,
        sweep: &mut Sweep<'_>,
        evaluation: usize,
    ) {
        let lanes = S::F64_LANES;
        let (ends, fills) = (sweep.ends, sweep.fills_registers::<S>());
        let behind = sweep.count % lanes;
        let [left_m, right_m] = if ends.is_ring {
            let last = self.u[R - if behind == 0 && !fills { 2 } else { 1 }];
            let places: &[f64] = bytemuck::cast_slice(std::slice::from_ref(&last));
            let left_m = if fills { last } else { simd.splat_f64s(places[(behind + lanes - 1) % lanes]) };
            [left_m, simd.splat_f64s(bytemuck::cast_slice(&self.u[..1])[0])]
        } else {
            let last = sweep.walls_m.len() - 1;
            sweep.walls_m[if evaluation < last { evaluation } else { last }].map(|wall_m| wall_m.load::<S>())
        };
        let counted = load::<S>(&COUNTED, 0);
        let is_first = simd.less_than_f64s(counted, simd.splat_f64s(1.0));
        let is_behind = simd.equal_f64s(counted, simd.splat_f64s(behind as f64));
        let zero_up_to_m = simd.splat_f64s(sweep.law.zero_up_to_m());
        let mut before = left_m;
        for number in 0..R {
            let here = self.u[number];
            let (mut left, mut right) = (Along::left(simd, before, here), here);
            before = here;
            if number + 1 == R && !fills {
                // what touches nothing has an overlap of zero
                let there = if ends.have_wall[1] { right_m } else { left };
                right = simd.select_f64s(is_behind, there, right);
            }
            if number == 0 && !ends.have_wall[0] {
                left = simd.select_f64s(is_first, right, left);
            }
            let mut overlap = simd.sub_f64s(left, right);
            if KIND == LOADED {
                overlap = simd.add_f64s(overlap, self.constants[1][number]);
            }
            self.force[number] = if KIND & SPRINGS == 0 {
                // whatever comes of open contacts is left out, while the root is on its way
                let raised = formula.of(simd, overlap, number);
                let is_closed = simd.greater_than_f64s(overlap, zero_up_to_m);
                let raised = simd.select_f64s(is_closed, raised, simd.splat_f64s(0.0));
                let found = simd.mul_f64s(self.constants[0][number], raised);
                if KIND == LOADED { simd.sub_f64s(found, self.constants[2][number]) } else { found }
            } else {
                of_springs::<S, KIND>(simd, |row| self.constants[row][number], overlap)
            };
        }
        if let Some([of_left, of_right]) = sweep.wall_forces_n.get_mut(evaluation) {
            store::<S>(self.force[0], &mut of_left.0, 0);
            store::<S>(self.force[if fills { 0 } else { R - 1 }], &mut of_right.0, 0);
        }
    }
}
