//! Chains of one shape beside each other: each in a lane of the registers.

use super::splitting::{Splitting, Stages};
use crate::aligned::Padded;
use crate::baths::Baths;
use crate::kernel::{Kernel, PerLane, lanes};
use crate::state::ChainState;
use pulp::Arch;
use schemas::chain::Chain;
use schemas::frame::Active;
use schemas::manifest::Physics;

/// The most beads of chains that are worth it: longer ones fill the registers and the caches alone.
const LONGEST: usize = 1024;

/// Advances the states of some chains together, with the bits that each has alone.
///
/// They have a number of beads, ends, laws and a method in common; each has its own masses, stiffnesses, loads and time step.
#[derive(Debug, Clone)]
pub struct Lanes {
    splitting: Splitting,
    baths: Option<Baths>,
    /// The numbers of each bead side by side, one of each chain, and the steps made.
    together: ChainState,
    width: usize,
}

/// Everything that chains have in common which lie beside each other.
#[derive(Debug, PartialEq)]
pub(crate) struct Shape {
    stages: Stages,
    chain: Chain,
    baths: Option<Baths>,
}

impl Shape {
    /// The shape of the chain of `physics`, unless it has to be computed alone: with drives, resonators or damping, by another method than
    /// by kicks and drifts, or because it is long.
    pub(crate) fn of(physics: &Physics) -> Option<Self> {
        let (stages, chain) = (Stages::of(physics.method)?, physics.chain());
        let alone = !physics.drives.is_empty()
            || chain.sites.has_resonators()
            || chain.sites.has_drag()
            || chain.damping.is_some()
            || chain.bead_count() > LONGEST;
        (!alone).then(|| Self { stages, baths: Baths::of(physics, &chain), chain })
    }

    /// True if chains of both can lie beside each other.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        let ends = |chain: &Chain| [chain.walls.left.is_there, chain.walls.right.is_there, chain.is_ring];
        let springs = |chain: &Chain| [chain.sites.has_springs(), chain.sites.cubic_n_per_m3.is_empty()];
        let [one, two] = [&self.chain, &other.chain];
        self.stages == other.stages
            && self.baths.is_some() == other.baths.is_some()
            && one.bead_count() == two.bead_count()
            && ends(one) == ends(two)
            && springs(one) == springs(two)
            && one.law == two.law
            && one.terms.iter().map(|term| &term.law).eq(two.terms.iter().map(|term| &term.law))
    }
}

impl Lanes {
    /// The most chains that lie beside each other on this machine.
    pub fn most() -> usize {
        lanes(Arch::new())
    }

    /// True if so many chains are faster together than one after the other: a step takes as long for some chains as for
    /// [`most`](Self::most) of them.
    pub(crate) fn is_worth_it(chains: usize) -> bool {
        chains > 1 && 2 * chains > Self::most()
    }

    /// Puts chains of like shapes beside each other, with their steps (s) and states.
    pub(crate) fn of<'a>(chains: impl Iterator<Item = (&'a Shape, f64, &'a ChainState)>, arch: Arch) -> Self {
        let (width, chains) = (lanes(arch), chains.collect::<Vec<_>>());
        let (first, _, first_state) = chains[0];
        let numbers = first.chain.bead_count() * width;
        let baths = first
            .baths
            .as_ref()
            .map(|_| Baths::beside(chains.iter().filter_map(|(shape, ..)| shape.baths.as_ref()), width));
        let mut together = ChainState {
            u_m: Padded::zeros(numbers),
            v_m_s: Padded::zeros(numbers),
            // the heat of baths is all that such chains have
            extra: Padded::zeros(if baths.is_some() { numbers } else { 0 }),
            step: first_state.step,
        };
        let mut dt_s = PerLane::same(0.0);
        for (lane, (_, chain_dt_s, state)) in chains.iter().enumerate() {
            dt_s.0[lane] = *chain_dt_s;
            let ChainState { u_m, v_m_s, extra, .. } = &mut together;
            for (all, own) in [(u_m, &state.u_m), (v_m_s, &state.v_m_s), (extra, &state.extra)] {
                all.iter_mut().skip(lane).step_by(width).zip(own.iter()).for_each(|(to, from)| *to = *from);
            }
        }
        let of_each: Vec<_> = chains.iter().map(|(shape, ..)| &shape.chain).collect();
        let mut kernel = Kernel::of_many(&of_each, arch);
        baths.iter().flat_map(Baths::beads).for_each(|beads| kernel.shake(&beads));
        let splitting = Splitting::without_drives(first.stages, dt_s, kernel);
        Self { splitting, baths, together, width }
    }

    /// Advances all by as many steps as one sweep can make, by one at least and `most` at most; gives how many.
    pub(crate) fn advance(&mut self, most: u64) -> u64 {
        let Self { splitting, baths, together, .. } = self;
        let before = together.step;
        if let Some(baths) = baths {
            baths.before(&mut together.v_m_s, &mut together.extra, before);
        }
        splitting.advance(together, before + most, baths.as_mut());
        if let Some(baths) = baths {
            baths.after(&mut together.v_m_s, &mut together.extra, together.step - 1);
        }
        together.step - before
    }

    /// Copies the numbers of the chain in `lane` into `state`; its step is the caller's.
    pub(crate) fn copy_to(&self, lane: usize, state: &mut ChainState) {
        let ChainState { u_m, v_m_s, extra, .. } = &self.together;
        for (all, own) in [(u_m, &mut state.u_m), (v_m_s, &mut state.v_m_s), (extra, &mut state.extra)] {
            own.iter_mut().zip(all.iter().skip(lane).step_by(self.width)).for_each(|(to, from)| *to = *from);
        }
    }

    /// The beads that may differ from rest in one of the chains.
    pub(crate) fn active(&self) -> Option<Active> {
        let beads = self.splitting.active_beads(&self.together)?;
        Some(Active { first: beads.start, end: beads.end })
    }
}
