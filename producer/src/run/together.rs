//! Runs of chains beside each other.

use super::{Conductor, Ended, Job, Simulation};
use crate::integrator::{Integrator, Lanes, Shape};
use crate::state::ChainState;
use pulp::Arch;
use schemas::frame::FrameSink;
use std::ops::ControlFlow;

/// A run that lies beside others, and its number among all.
struct Member<'a, P, R, C> {
    number: usize,
    shape: Shape,
    simulation: Simulation<'a, P, R, C>,
}

impl<P: FrameSink, R: FrameSink, C: Conductor<P, R>> Member<'_, P, R, C> {
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

/// Makes some runs, and tells `done` the number and the outcome of each that ends. Chains of one shape are computed beside each other;
/// every run is as if it were alone.
///
/// Nobody watches them for chaos.
pub fn run_together<'a, P: FrameSink + 'a, R: FrameSink + 'a, C: Conductor<P, R> + 'a>(
    jobs: impl IntoIterator<Item = Job<'a, P, R, C>>,
    mut done: impl FnMut(usize, Ended<P, R>),
) {
    let mut alike: Vec<Vec<Member<'_, P, R, C>>> = Vec::new();
    for (number, job) in jobs.into_iter().enumerate() {
        let physics = &job.manifest.physics;
        let (shape, state) = (Shape::of(physics), ChainState::initial(physics));
        let mut simulation = Simulation::new(job, state, true);
        let Some(shape) = shape else {
            done(number, alone(&mut simulation));
            continue;
        };
        let member = Member { number, shape, simulation };
        match alike.iter_mut().find(|members| members[0].shape.is_like(&member.shape)) {
            Some(members) => members.push(member),
            None => alike.push(vec![member]),
        }
    }
    for mut members in alike {
        while !members.is_empty() {
            let rest = members.split_off(members.len().min(Lanes::most()));
            beside_each_other(members, &mut done);
            members = rest;
        }
    }
}

/// Makes the rest of a run.
fn alone<P: FrameSink, R: FrameSink, C: Conductor<P, R>>(
    simulation: &mut Simulation<'_, P, R, C>,
) -> Ended<P, R> {
    let mut integrator = Integrator::new(&simulation.manifest.physics);
    simulation.finish(&mut integrator, &mut None)
}

/// Makes runs of one shape, as long as so many are left that it is worth it.
fn beside_each_other<P: FrameSink, R: FrameSink, C: Conductor<P, R>>(
    mut members: Vec<Member<'_, P, R, C>>,
    done: &mut impl FnMut(usize, Ended<P, R>),
) {
    while Lanes::is_worth_it(members.len()) {
        let chains = members.iter().map(|Member { shape, simulation, .. }| {
            (shape, simulation.manifest.physics.dt_s, &simulation.state)
        });
        let mut lanes = Lanes::of(chains, Arch::new());
        let mut ended = loop {
            let visited = members.iter_mut().enumerate().map(|(lane, member)| member.visit(lane, &lanes));
            let ended: Vec<_> = visited.collect();
            if ended.iter().any(Option::is_some) {
                break ended;
            }
            let to_next = members.iter().map(|member| member.simulation.steps_to_next());
            let made = lanes.advance(to_next.min().unwrap_or(1));
            members.iter_mut().for_each(|member| member.simulation.state.step += made);
        };
        for lane in (0..members.len()).rev() {
            match ended.remove(lane) {
                Some(ended) => done(members.remove(lane).number, ended),
                None => lanes.copy_to(lane, &mut members[lane].simulation.state),
            }
        }
    }
    for mut member in members {
        done(member.number, alone(&mut member.simulation));
    }
}
