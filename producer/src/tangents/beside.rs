//! Derivatives of a run by a number of its configuration.
//!
//! With a number `θ` of the chain the state changes by its derivative `w = dz/dθ`, which is a tangent whose kicks have a part of their own:
//! besides `(h/m)·(slopes·δu)` a kick of `h` adds `h·∂a/∂θ`, the change of the acceleration where the beads are. That is found as a difference
//! between two chains beside that of the run, at the same state: `θ` may be any number of the configuration.

use super::{NONE, NoTangent, Numbers, SCALE};
use crate::aligned::Padded;
use crate::drives::{Acts, Drives, Now};
use crate::kernel::{Activity, Kernel, Motion, TILE};
use crate::state::ChainState;
use pulp::Arch;
use schemas::manifest::Physics;
use schemas::simd::LANES;

/// Two runs beside a third, from which they differ by a little of one number: that of the third lies in the middle between theirs.
#[derive(Debug, Clone, Copy)]
pub struct Neighbours<'a> {
    /// The run with the smaller number.
    pub below: &'a Physics,
    /// The run with the larger number.
    pub above: &'a Physics,
    /// The larger number less the smaller one.
    pub apart: f64,
}

/// Reason why a run has no derivative by a number of its configuration.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoDerivative {
    /// Its steps have none.
    #[error(transparent)]
    Tangent(#[from] NoTangent),
    /// The number is one of its heat baths, or they would act in another way.
    #[error("a run with heat baths has no derivative by numbers of its configuration; leave [[bath]] out")]
    Baths,
    /// The number changes something beside the forces, the masses and the beginning.
    #[error(
        "the number changes {0}; a run has derivatives by numbers that change its forces, its masses or its beginning, at the same steps \
         (time.dt_s) and with the same drives"
    )]
    Changes(&'static str),
}

impl Neighbours<'_> {
    /// Refuses runs that differ from that of `physics` in more than what derivatives are found of.
    pub(crate) fn check(&self, physics: &Physics) -> Result<(), NoDerivative> {
        if !physics.baths.is_empty() {
            return Err(NoDerivative::Baths);
        }
        for other in [self.below, self.above] {
            let changed = [
                (other.dt_s.to_bits() != physics.dt_s.to_bits(), "the time step"),
                (other.method != physics.method, "the method"),
                (other.drives != physics.drives, "the drives"),
                (other.chain().bead_count() != physics.chain().bead_count(), "the number of beads"),
                (other.rows() != physics.rows(), "the kinds of forces"),
                (!other.baths.is_empty(), "the baths"),
            ];
            if let Some((_, what)) = changed.iter().find(|(is_changed, _)| *is_changed) {
                return Err(NoDerivative::Changes(what));
            }
        }
        Ok(())
    }

    /// The derivative of the first state.
    pub(crate) fn first(&self) -> Vec<f64> {
        let [below, above] = [self.below, self.above].map(|physics| {
            let state = ChainState::initial(physics);
            let resonators = physics.rows().resonators_of(&state.extra).concat();
            [&state.u_m[..], &state.v_m_s[..], &resonators].concat()
        });
        below.iter().zip(above).map(|(below, above)| (above - below) / self.apart).collect()
    }
}

/// Chains beside that of a run, whose accelerations are compared.
#[derive(Debug, Clone)]
pub(super) struct Beside {
    below: Pushed,
    above: Pushed,
    apart: f64,
}

/// A chain and its accelerations.
#[derive(Debug, Clone)]
struct Pushed {
    kernel: Kernel,
    drives: Option<Drives>,
    u_m: Padded,
    v_m_s: Padded,
    power_w: Vec<f64>,
    /// Accelerations (m/s²) of beads and of resonators.
    found: [Vec<f64>; 2],
}

impl Beside {
    pub(super) fn of(neighbours: &Neighbours<'_>, arch: Arch) -> Self {
        let [below, above] = [neighbours.below, neighbours.above].map(|physics| Pushed::of(physics, arch));
        Self { below, above, apart: neighbours.apart }
    }
}

impl Pushed {
    fn of(physics: &Physics, arch: Arch) -> Self {
        let chain = physics.chain();
        let (beads, resonators) = (chain.bead_count(), chain.sites.resonator_kg.len());
        Self {
            kernel: Kernel::with_arch(&chain, arch, TILE),
            drives: Drives::of(&physics.drives, physics.dt_s),
            u_m: Padded::zeros(beads),
            v_m_s: Padded::zeros(beads),
            power_w: vec![0.0; beads],
            found: [beads, resonators].map(|count| vec![0.0; count]),
        }
    }

    /// Finds the accelerations at displacements and velocities of beads and the displacements of resonators `rows`, while drives act as `now`.
    fn find(&mut self, rows: [&[f64]; 3], now: &[Now]) {
        let [u_m, v_m_s, w_m] = rows;
        let beads = 0..u_m.len();
        self.u_m.copy_from_slice(u_m);
        self.v_m_s.copy_from_slice(v_m_s);
        let [walls_m, walls_m_s] = self.drives.as_ref().map(|drives| drives.walls(now)).unwrap_or_default();
        self.kernel.restart(Activity::of(u_m, v_m_s).with(0).with(u_m.len() - 1));
        let mut motion = Motion { u_m: self.u_m.whole(), v_m_s: self.v_m_s.whole(), walls_m, walls_m_s };
        self.kernel.evaluate_moving(&beads, &mut motion, &mut self.power_w);
        let [of_beads, of_resonators] = &mut self.found;
        self.kernel.net_forces(&beads, rows, of_beads);
        for (d, now) in now.iter().enumerate() {
            if let Some(Acts::Pushes(bead)) = self.drives.as_ref().map(|drives| drives.acts(d)) {
                of_beads[bead] += now.force_n;
            }
        }
        of_beads.iter_mut().zip(self.kernel.inverse_mass()).for_each(|(a, inverse)| *a *= inverse);
        let sites = self.kernel.sites();
        for (i, a) in of_resonators.iter_mut().enumerate() {
            let mass_kg = sites.resonator_kg[i];
            *a = if mass_kg > 0.0 { -sites.resonator_n(i, u_m[i], w_m[i]) / mass_kg } else { 0.0 };
        }
    }
}

/// Parts `∂a/∂θ` of the accelerations of beads and of resonators, of the tangents of each block; none without neighbours.
pub(super) type Sources = Vec<[Numbers; 2]>;

/// Finds the sources at displacements and velocities of beads and the displacements of resonators `rows`, while drives act as `now`. What has
/// no inverse mass does not change: drives prescribe it.
pub(super) fn find(
    beside: &mut [Beside],
    rows: [&[f64]; 3],
    now: &[Now],
    inverse: [&[f64]; 2],
    to: &mut Sources,
) {
    to.resize_with(beside.len().div_ceil(LANES), || inverse.map(|masses| vec![NONE; masses.len()]));
    for (number, Beside { below, above, apart }) in beside.iter_mut().enumerate() {
        below.find(rows, now);
        above.find(rows, now);
        for (row, inverse) in inverse.iter().enumerate() {
            let accelerations = below.found[row].iter().zip(&above.found[row]);
            for ((inverse, (below, above)), to) in
                inverse.iter().zip(accelerations).zip(&mut to[number / LANES][row])
            {
                to.0[number % LANES] = if *inverse > 0.0 { SCALE * ((above - below) / *apart) } else { 0.0 };
            }
        }
    }
}
