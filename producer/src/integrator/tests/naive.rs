//! The definition of a step: every bead, every contact, one after the other, nothing kept and nothing skipped.

use super::*;
use crate::integrator::splitting::Stages;
use schemas::chain::Chain;
use schemas::damping::Damping;
use schemas::functions::{Moment, exp, exp_m1};
use schemas::random::normals;

pub(super) fn step(physics: &Physics, state: &mut ChainState) {
    bathe(physics, state, 0);
    match physics.method {
        Method::VelocityVerlet => splitting_step(physics, VELOCITY_VERLET, state),
        Method::Rkn4 => splitting_step(physics, RKN4, state),
        Method::Gear5 => gear_step(physics, state),
        Method::Rk5 => runge_step(physics, state),
    }
    bathe(physics, state, 1);
    state.step += 1;
}

/// Lets the baths of a run act before (0) or after (1) a step: each bath by itself, one bead or pair after the other.
fn bathe(physics: &Physics, state: &mut ChainState, half: usize) {
    let (chain, step, dt_s) = (physics.chain(), state.step, physics.dt_s);
    let mut all = Vec::new();
    for bath in &physics.baths {
        let beads = bath.beads.range();
        for bead in beads.clone() {
            let next = if bead + 1 < beads.end { bead + 1 } else { 0 };
            let joins = next > 0 || (chain.is_ring && beads.len() == chain.bead_count());
            match bath.pairs {
                true if joins => all.push((bath, bead, Some(next))),
                true => {}
                false => all.push((bath, bead, None)),
            }
        }
    }
    if half == 1 {
        all.reverse();
    }
    for (bath, bead, other) in all {
        let temperature_j = bath.temperature_j(Moment::new(step + half as u64, dt_s, 0.0));
        let place = u32::try_from(bead).expect("a bead");
        let stream = [place, if bath.pairs { 2 } else { 1 }];
        let noise = normals(bath.seed.unwrap_or(physics.seed), step, stream)[half];
        let (decay, spread) = (
            exp(-(bath.friction_per_s * (0.5 * dt_s))),
            (0.0 - exp_m1(-(bath.friction_per_s * dt_s))).sqrt(),
        );
        let of = |bead: usize| 1.0 / chain.mass_kg[bead];
        let before = [state.v_m_s[bead], other.map_or(0.0, |other| state.v_m_s[other])];
        let after = match other {
            None => [(decay * before[0] + spread * (temperature_j * of(bead)).sqrt() * noise) + 0.0, 0.0],
            Some(other) => {
                let (both, relative) = (of(bead) + of(other), before[0] - before[1]);
                let change = (decay * relative + spread * (temperature_j * both).sqrt() * noise) - relative;
                [before[0] + of(bead) / both * change, before[1] - of(other) / both * change]
            }
        };
        let gain = |mass_kg: f64, i: usize| 0.5 * mass_kg * ((after[i] - before[i]) * (after[i] + before[i]));
        let heat_j = &mut physics.rows().heat_mut(&mut state.extra)[bead];
        state.v_m_s[bead] = after[0];
        *heat_j += match other {
            None => gain(chain.mass_kg[bead], 0),
            Some(other) => {
                state.v_m_s[other] = after[1];
                gain(chain.mass_kg[bead], 0) + gain(chain.mass_kg[other], 1)
            }
        };
    }
}

/// A contact: overlap (m) at rest, force (N) at rest, stiffness, damping coefficient, stiffness in each term.
type Contact = (f64, f64, f64, f64, Vec<f64>);

/// All contacts from left to right, those with the walls first and last; in a ring both are the one that closes it.
fn contacts(chain: &Chain) -> Vec<Option<Contact>> {
    let coefficient = |c: usize| chain.damping.as_ref().map_or(0.0, |damping| damping.coefficient[c]);
    let wall = |side: usize| {
        let wall = chain.wall(side);
        let coefficient = chain.damping.as_ref().map_or(0.0, |damping| damping.wall_coefficient[side]);
        let of_terms = chain.terms.iter().map(|term| term.wall_stiffness[side]).collect();
        wall.is_there.then_some((
            wall.rest_overlap_m,
            wall.rest_force_n,
            wall.stiffness,
            coefficient,
            of_terms,
        ))
    };
    let between = |c: usize| {
        let of_terms = chain.terms.iter().map(|term| term.stiffness[c]).collect();
        Some((chain.rest_overlap_m[c], chain.rest_force_n[c], chain.stiffness[c], coefficient(c), of_terms))
    };
    let last = wall(usize::from(!chain.is_ring));
    [wall(0)].into_iter().chain((0..chain.contact_count()).map(between)).chain([last]).collect()
}

/// Force (N) beyond that at rest and dissipated power (W) of each contact, those with the walls first and last.
fn evaluate(chain: &Chain, u: &[f64], v: &[f64]) -> Vec<(f64, f64)> {
    let at = |values: &[f64], c: usize| {
        let count = values.len();
        if chain.is_ring && (c == 0 || c == count) {
            return values[count - 1] - values[0];
        }
        let left = if c > 0 { values[c - 1] } else { 0.0 };
        let right = if c < count { values[c] } else { 0.0 };
        left - right
    };
    let one = |(c, contact): (usize, Option<Contact>)| {
        let Some((rest_m, rest_n, stiffness, coefficient, of_terms)) = contact else { return (0.0, 0.0) };
        let (overlap, rate) = (at(u, c) + rest_m, at(v, c));
        let mut elastic = chain.law.force(stiffness, overlap);
        for (term, stiffness) in chain.terms.iter().zip(of_terms) {
            elastic += term.law.force(stiffness, overlap);
        }
        let is_cut = !chain.is_bonded && overlap <= chain.law.zero_up_to_m();
        if chain.damping.is_none() || is_cut {
            return (if chain.damping.is_some() { 0.0 } else { elastic } - rest_n, 0.0);
        }
        let raised = chain.law.force(1.0, overlap);
        let factor = match chain.damping.as_ref().map(|damping| damping.kind) {
            None | Some(Damping::ViscousNSPerM(_)) => 1.0,
            Some(Damping::Restitution(_)) => (raised / overlap).sqrt(),
            Some(Damping::KuwabaraKonoS(_) | Damping::Power(_)) => unreachable!("no variant has these"),
        };
        let damped = elastic + coefficient * factor * rate;
        let force = if chain.is_bonded || damped > 0.0 { damped } else { 0.0 };
        (force - rest_n, (force - elastic) * rate)
    };
    contacts(chain).into_iter().enumerate().map(one).collect()
}

/// Net force (N) on each bead.
fn net_forces(chain: &Chain, u: &[f64], v: &[f64]) -> Vec<f64> {
    let by_contacts = evaluate(chain, u, v);
    let net = |(i, pair): (usize, &[(f64, f64)])| {
        let net_n = pair[0].0 - pair[1].0;
        let Some(linear) = chain.sites.linear_n_per_m.get(i) else { return net_n };
        net_n - (linear * u[i] + chain.sites.cubic_n_per_m3[i] * (u[i] * u[i] * u[i]))
    };
    by_contacts.windows(2).enumerate().map(net).collect()
}

fn splitting_step(physics: &Physics, stages: Stages, state: &mut ChainState) {
    let chain = physics.chain();
    let kick = |h: f64, u: &[f64], v: &mut [f64]| {
        for (i, force) in net_forces(&chain, u, v).into_iter().enumerate() {
            v[i] += h * (1.0 / chain.mass_kg[i]) * force;
        }
    };
    for (b, a) in stages.kick_drift {
        kick(b * physics.dt_s, &state.u_m, &mut state.v_m_s);
        for (u, v) in state.u_m.iter_mut().zip(state.v_m_s.iter()) {
            *u += a * physics.dt_s * *v;
        }
    }
    kick(stages.last_kick * physics.dt_s, &state.u_m, &mut state.v_m_s);
}

fn gear_step(physics: &Physics, state: &mut ChainState) {
    let (chain, dt) = (physics.chain(), physics.dt_s);
    let n = chain.bead_count();
    // terms of up to 2^-900 m are zero
    let kept = |x: f64| if x.abs() > 2.0_f64.powi(-900) { x } else { 0.0 };
    let predicted: Vec<[f64; 6]> = (0..n)
        .map(|i| {
            let [q2, q3, q4, q5] = [0, 1, 2, 3].map(|k| state.extra[k * n + i]);
            let change = dt * state.v_m_s[i] + (((q5 + q4) + q3) + q2);
            let higher = 2.0 * q2 + (3.0 * q3 + (4.0 * q4 + 5.0 * q5));
            [
                state.u_m[i] + change,
                state.v_m_s[i] + 1.0 / dt * higher,
                (3.0 * q3 + (6.0 * q4 + 10.0 * q5)) + q2,
                (4.0 * q4 + 10.0 * q5) + q3,
                5.0 * q5 + q4,
                q5,
            ]
        })
        .collect();
    let column = |k: usize| predicted.iter().map(|p| p[k]).collect::<Vec<f64>>();
    for (i, force) in net_forces(&chain, &column(0), &column(1)).into_iter().enumerate() {
        let p = predicted[i];
        let q2 = (0.5 * (dt * dt) * (1.0 / chain.mass_kg[i])) * force;
        let miss = q2 - p[2];
        state.u_m[i] = p[0] + 3.0 / 20.0 * miss;
        state.v_m_s[i] = p[1] + 251.0 / 360.0 / dt * miss;
        state.extra[i] = q2;
        state.extra[n + i] = kept(p[3] + 11.0 / 18.0 * miss);
        state.extra[2 * n + i] = kept(p[4] + 1.0 / 6.0 * miss);
        state.extra[3 * n + i] = kept(p[5] + 1.0 / 60.0 * miss);
    }
}

/// Dormand and Prince, written down stage by stage.
fn runge_step(physics: &Physics, state: &mut ChainState) {
    const A: [&[f64]; 6] = [
        &[1.0 / 5.0],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
        &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
        &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
    ];
    let (chain, dt) = (physics.chain(), physics.dt_s);
    let n = chain.bead_count();
    let slopes_at = |y: &[Vec<f64>; 3]| {
        let found = evaluate(&chain, &y[0], &y[1]);
        let net = net_forces(&chain, &y[0], &y[1]);
        let accelerations = net.iter().zip(&chain.mass_kg).map(|(net, m)| 1.0 / m * net);
        let of_walls = found[0].1 + if chain.is_ring { 0.0 } else { found[n].1 };
        let powers = found[1..n].iter().map(|contact| contact.1).chain([of_walls]);
        [y[1].clone(), accelerations.collect(), powers.collect()]
    };
    let work = if chain.damping.is_some() { state.extra.to_vec() } else { vec![0.0; n] };
    let start = [state.u_m.to_vec(), state.v_m_s.to_vec(), work];
    let mut slopes = vec![slopes_at(&start)];
    let mut y = start.clone();
    for (stage, weights) in A.iter().enumerate() {
        for (part, values) in y.iter_mut().enumerate() {
            for i in 0..n {
                let terms = weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
                let sum = terms.map(|(s, weight)| weight * slopes[s][part][i]).reduce(|sum, term| sum + term);
                values[i] = start[part][i] + dt * sum.unwrap_or(0.0);
            }
        }
        if stage < 5 {
            slopes.push(slopes_at(&y));
        }
    }
    state.u_m.copy_from_slice(&y[0]);
    state.v_m_s.copy_from_slice(&y[1]);
    if chain.damping.is_some() {
        state.extra.copy_from_slice(&y[2]);
    }
}
