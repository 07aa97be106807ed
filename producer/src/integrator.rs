//! One integrator for all methods.

mod gear;
mod lanes;
mod runge;
mod splitting;

use crate::aligned::Padded;
use crate::baths::Baths;
use crate::kernel::{Kernel, TILE};
use crate::state::ChainState;
use crate::tangents::{Neighbours, NoDerivative, NoTangent, Tangents};
use gear::{Gear, taylor_terms};
pub use lanes::Lanes;
pub(crate) use lanes::Shape;
use pulp::Arch;
use runge::Runge;
use schemas::frame::Active;
use schemas::manifest::Physics;
use schemas::method::Method;
use splitting::{RKN4, Splitting, VELOCITY_VERLET};

/// Advances the states of one chain by the method of its run.
///
/// Architecture invariant: a step is a pure function of the state. Data that an integrator keeps from step to step
/// saves work and decides no bit, so that a fresh one started at any state goes on with the same bits.
#[derive(Debug, Clone)]
pub struct Integrator {
    by_method: ByMethod,
    baths: Option<Box<Baths>>,
}

#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "one for a run")]
enum ByMethod {
    Splitting(Splitting),
    Gear(Gear),
    Runge(Box<Runge>),
}

impl Integrator {
    /// The integrator of a run.
    ///
    /// # Panics
    /// When no dynamics of this program computes the run any more; see
    /// [`check_kernel`](crate::resimulation::check_kernel).
    pub fn new(physics: &Physics) -> Self {
        Self::with_arch(physics, Arch::new())
    }

    /// Like [`new`](Self::new), with a given instruction set; all give the same bits.
    pub fn with_arch(physics: &Physics, arch: Arch) -> Self {
        Self::with_tiles(physics, arch, TILE)
    }

    /// Like [`with_arch`](Self::with_arch), with a given length of tiles, too.
    fn with_tiles(physics: &Physics, arch: Arch, tile: usize) -> Self {
        assert!(physics.retired().is_none(), "nobody makes a run that `check_kernel` refuses");
        let chain = physics.chain();
        let mut kernel = Kernel::with_arch(&chain, arch, tile);
        let baths = Baths::of(physics, &chain);
        baths.iter().flat_map(Baths::beads).for_each(|beads| kernel.shake(&beads));
        let by_method = match physics.method {
            Method::VelocityVerlet => {
                ByMethod::Splitting(Splitting::new(VELOCITY_VERLET, physics, &chain, kernel))
            }
            Method::Rkn4 => ByMethod::Splitting(Splitting::new(RKN4, physics, &chain, kernel)),
            Method::Gear5 => ByMethod::Gear(Gear::new(physics.dt_s, kernel)),
            Method::Rk5 => ByMethod::Runge(Box::new(Runge::new(physics, &chain, kernel))),
        };
        Self { by_method, baths: baths.map(Box::new) }
    }

    /// The integrator of a run that carries `count` tangents with the states, all zero at first. It makes the same states.
    ///
    /// # Errors
    /// When the derivatives of the run's steps are not computed.
    ///
    /// # Panics
    /// When no dynamics of this program computes the run any more, as for [`new`](Self::new).
    pub fn with_tangents(physics: &Physics, count: usize) -> Result<Self, NoTangent> {
        Self::carrying(physics, count, Arch::new())
    }

    /// The integrator of a run that carries its derivatives by some numbers of its configuration with the states, one for each of `neighbours`.
    ///
    /// They are found to some 1e-10 of their size where the numbers differ by 1e-5 of theirs; where contacts open that are pressed at
    /// rest, to some 1e-7.
    ///
    /// # Errors
    /// When a number changes more than forces, masses and the beginning, or the method has no derivatives.
    ///
    /// # Panics
    /// As for [`new`](Self::new).
    pub fn with_derivatives(physics: &Physics, neighbours: &[Neighbours<'_>]) -> Result<Self, NoDerivative> {
        neighbours.iter().try_for_each(|pair| pair.check(physics))?;
        let mut integrator = Self::with_tangents(physics, neighbours.len())?;
        integrator.tangents().into_iter().for_each(|tangents| tangents.follow(neighbours));
        Ok(integrator)
    }

    /// Like [`with_tangents`](Self::with_tangents), with a given instruction set.
    fn carrying(physics: &Physics, count: usize, arch: Arch) -> Result<Self, NoTangent> {
        let mut integrator = Self::with_arch(physics, arch);
        let chain = physics.chain();
        let tangents = || Tangents::of(physics, &chain, count, arch);
        match &mut integrator.by_method {
            ByMethod::Splitting(splitting) => splitting.carry(tangents()),
            ByMethod::Runge(runge) => runge.carry(tangents(), &chain),
            ByMethod::Gear(_) => return Err(NoTangent(physics.method)),
        }
        Ok(integrator)
    }

    /// The tangents of the state stepped to last, if it carries any.
    pub fn tangents(&mut self) -> Option<&mut Tangents> {
        self.by_method.tangents()
    }

    /// Advances `state` by one step.
    ///
    /// Pass each call the state that the call before left.
    pub fn step(&mut self, state: &mut ChainState) {
        self.advance(state, state.step + 1);
    }

    /// Advances `state` by at least one step and at most to step `last`: by as many steps as can be made while the
    /// chain is fetched once. Where nobody looks at the states between, this is faster than step by step.
    ///
    /// As for [`Integrator::step`], pass each call the state that the call before left.
    pub fn advance(&mut self, state: &mut ChainState, last: u64) {
        let Some(baths) = &mut self.baths else { return self.by_method.advance(state, last, None) };
        baths.before(&mut state.v_m_s, &mut state.extra, state.step);
        self.by_method.tangents().into_iter().for_each(|tangents| baths.slow(tangents, false));
        self.by_method.advance(state, last, Some(baths));
        baths.after(&mut state.v_m_s, &mut state.extra, state.step - 1);
        self.by_method.tangents().into_iter().for_each(|tangents| baths.slow(tangents, true));
    }

    /// The beads that may differ from rest in `state`, if this integrator has just stepped to it.
    pub fn active(&self, state: &ChainState) -> Option<Active> {
        let beads = match &self.by_method {
            ByMethod::Splitting(splitting) => splitting.active_beads(state),
            ByMethod::Gear(gear) => gear.active_beads(state),
            ByMethod::Runge(runge) => runge.active_beads(state),
        }?;
        Some(Active { first: beads.start, end: beads.end })
    }

    /// The first bead of the `state` just stepped to that has a value which is not finite.
    pub fn first_non_finite(&self, state: &ChainState) -> Option<usize> {
        match &self.by_method {
            ByMethod::Splitting(splitting) => splitting.first_non_finite(state),
            ByMethod::Gear(gear) => gear.first_non_finite(state),
            ByMethod::Runge(runge) => runge.first_non_finite(state),
        }
    }
}

impl ByMethod {
    fn tangents(&mut self) -> Option<&mut Tangents> {
        match self {
            Self::Splitting(splitting) => splitting.tangents(),
            Self::Runge(runge) => runge.tangents(),
            Self::Gear(_) => None,
        }
    }

    /// Advances `state` as [`Integrator::advance`] does; `baths` act between the steps.
    fn advance(&mut self, state: &mut ChainState, last: u64, baths: Option<&mut Baths>) {
        match self {
            Self::Splitting(splitting) => splitting.advance(state, last, baths),
            Self::Gear(gear) => gear.step(state),
            Self::Runge(runge) => runge.step(state),
        }
    }
}

impl ChainState {
    /// The state at step 0.
    pub fn initial(physics: &Physics) -> Self {
        let (u_m, v_m_s) = physics.initial_state();
        Self::starting_at(physics, &u_m, &v_m_s)
    }

    /// A state at step 0 with the given displacements (m) and velocities (m/s), N values each.
    ///
    /// The higher derivatives that `gear5` carries are those of the exact motion, so that it has its order
    /// from the first step.
    pub fn starting_at(physics: &Physics, u_m: &[f64], v_m_s: &[f64]) -> Self {
        let mut extra = physics.initial_extra(u_m);
        let terms = first_terms(physics, u_m, v_m_s);
        extra[..terms.len()].copy_from_slice(&terms);
        Self { u_m: Padded::of(u_m), v_m_s: Padded::of(v_m_s), extra: Padded::of(&extra), step: 0 }
    }
}

/// The first rows of `extra`, which the method of `physics` carries, for the displacements `u_m` (m) and velocities
/// `v_m_s` (m/s) of a state.
fn first_terms(physics: &Physics, u_m: &[f64], v_m_s: &[f64]) -> Vec<f64> {
    match physics.method {
        Method::Gear5 => taylor_terms(&physics.chain(), u_m, v_m_s, physics.dt_s),
        Method::VelocityVerlet | Method::Rkn4 | Method::Rk5 => Vec::new(),
    }
}

#[cfg(test)]
mod tests;
