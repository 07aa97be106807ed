//! Runs of chains beside each other.

use super::{Conductor, Ended, Job, Simulation};
use crate::integrator::{Integrator, Lanes, Shape};
use crate::state::ChainState;
use pulp::Arch;
use schemas::frame::FrameSink;
use schemas::manifest::RunManifest;
use std::ops::ControlFlow;

/// A run among others, its number among all, and its shape if it can lie beside them.
struct Member<'a, P, R, C> {
    number: usize,
    shape: Option<Shape>,
    simulation: Simulation<'a, P, R, C>,
}

impl<P: FrameSink, R: FrameSink, C: Conductor<P, R>> Member<'_, P, R, C> {
    /// Its chain, step (s) and state.
    fn chain(&self) -> Option<(&Shape, f64, &ChainState)> {
        let Simulation { manifest, state, .. } = &self.simulation;
        Some((self.shape.as_ref()?, manifest.physics.dt_s, state))
    }

    /// Has all look at the state in `lane` if it is one that they wait for; gives the outcome if the run ends.
    fn visit(&mut self, lane: usize, lanes: &Lanes) -> Option<Ended<P, R>> {
        let simulation = &mut self.simulation;
        if !simulation.is_there() {
            return simulation.is_stopped().then(|| simulation.give_up());
        }
        lanes.copy_to(lane, &mut simulation.state);
        let ChainState { u_m, v_m_s, .. } = &simulation.state;
        let is_finite = |(u, v): (&f64, &f64)| u.is_finite() && v.is_finite();
        let found = u_m.iter().zip(v_m_s.iter()).position(|both| !is_finite(both));
        simulation.check(found).and_then(|()| simulation.look(lanes.active())).map_or_else(
            |error| Some(Err(error)),
            |looked| match looked {
                ControlFlow::Continue(()) => None,
                ControlFlow::Break(outcome) => Some(Ok(outcome)),
            },
        )
    }
}

/// Runs of chains that can lie beside each other, or one run that has to be made alone.
#[derive(Debug)]
pub struct Together {
    numbers: Vec<usize>,
    /// The shape of each; none of a run that is alone.
    shapes: Vec<Shape>,
}

impl Together {
    /// Sorts runs: as many as possible together, but no more than there are lanes.
    pub fn of<'a>(manifests: impl IntoIterator<Item = &'a RunManifest>) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for (number, manifest) in manifests.into_iter().enumerate() {
            let shape = Shape::of(&manifest.physics);
            let fits = |one: &&mut Self| match (one.shapes.first(), &shape) {
                (Some(first), Some(shape)) => one.numbers.len() < Lanes::most() && first.is_like(shape),
                _ => false,
            };
            match all.iter_mut().find(fits) {
                Some(one) => {
                    one.numbers.push(number);
                    one.shapes.extend(shape);
                }
                None => all.push(Self { numbers: vec![number], shapes: shape.into_iter().collect() }),
            }
        }
        all
    }

    /// The places of these runs among the sorted ones.
    pub fn numbers(&self) -> &[usize] {
        &self.numbers
    }

    /// Makes the runs, of which `jobs` are in the order of [`numbers`](Self::numbers). `done` is given the number, the job and the outcome
    /// of each that ends, and decides whether the others go on. Every run is as if it were alone. Nobody watches them for chaos.
    pub fn run<'a, P: FrameSink + 'a, R: FrameSink + 'a, C: Conductor<P, R> + 'a>(
        self,
        jobs: impl IntoIterator<Item = Job<'a, P, R, C>>,
        mut done: impl FnMut(usize, Job<'a, P, R, C>, Ended<P, R>) -> ControlFlow<()>,
    ) {
        let begun = jobs.into_iter().map(|job| {
            let state = ChainState::initial(&job.manifest.physics);
            Simulation::new(job, state, true)
        });
        let shapes = self.shapes.into_iter().map(Some).chain(std::iter::once(None));
        let members = self.numbers.into_iter().zip(begun).zip(shapes);
        let mut members: Vec<_> =
            members.map(|((number, simulation), shape)| Member { number, shape, simulation }).collect();
        while Lanes::is_worth_it(members.len()) {
            let chains = members.iter().filter_map(Member::chain);
            let mut lanes = Lanes::of(chains, Arch::new());
            let mut ended = loop {
                let visited = members.iter_mut().enumerate().map(|(lane, member)| member.visit(lane, &lanes));
                let ended: Vec<_> = visited.collect();
                if ended.iter().any(Option::is_some) {
                    break ended;
                }
                let to_next = members.iter().map(|member| member.simulation.steps_to_next());
                let made = lanes.advance(to_next.min().unwrap_or(1)); // integers
                for member in &mut members {
                    member.simulation.state.step += made;
                }
            };
            for lane in (0..members.len()).rev() {
                let Some(ended) = ended.remove(lane) else {
                    lanes.copy_to(lane, &mut members[lane].simulation.state);
                    continue;
                };
                let Member { number, simulation, .. } = members.remove(lane);
                if done(number, simulation.into_job(), ended).is_break() {
                    return;
                }
            }
        }
        for Member { number, mut simulation, .. } in members {
            let mut integrator = Integrator::new(&simulation.manifest.physics);
            let ended = simulation.finish(&mut integrator, &mut None);
            if done(number, simulation.into_job(), ended).is_break() {
                return;
            }
        }
    }
}
