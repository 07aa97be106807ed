//! Heat baths in a run: the halves of a step in which they slow beads down and shake them.

use crate::tangents::Tangents;
use pulp::Arch;
use schemas::bath::Bath;
use schemas::chain::Chain;
use schemas::functions::{Moment, exp, exp_m1};
use schemas::manifest::Physics;
use schemas::philox::halves;
use schemas::random::normals;
use schemas::rows::Rows;
use schemas::simd::{LANES, vectorized};
use std::ops::Range;

/// Pushes that are drawn together.
const TOGETHER: usize = 64;

/// The baths of a run, or those of some runs whose states lie beside each other.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Baths {
    parts: Vec<Part>,
    rows: Rows,
}

/// A bath of one chain.
#[derive(Debug, Clone, PartialEq)]
struct Part {
    bath: Bath,
    seed: u64,
    dt_s: f64,
    /// `e^(−γ·dt/2)` and `√(1 − e^(−γ·dt))`.
    decay: f64,
    spread: f64,
    places: Vec<Place>,
    /// Half of the mass (kg) of the first bead of each place.
    half_kg: Vec<f64>,
    /// The standard deviations (m/s) of the pushes in both halves of some steps from `drawn` on, at each place, and the pushes.
    deviation_m_s: [Vec<f64>; 2],
    push_m_s: [Vec<f64>; 2],
    drawn: Option<Range<u64>>,
    /// The number of the step after the first (high word), and the place (low word), of each push.
    numbers: Vec<u64>,
    /// The numbers of a bead in the state, and that of this chain among them.
    width: usize,
    lane: usize,
}

/// A bead in a bath, or two neighbours in a bath of pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    /// The number of the bead, or of the contact.
    number: usize,
    /// The beads: one of them twice in a bath of single beads.
    beads: [usize; 2],
    /// Half of the mass (kg) of each.
    half_kg: [f64; 2],
    /// Variance of the velocity, or of the relative velocity, over `k_B·T` (1/kg).
    inverse_kg: f64,
    /// The change of each bead's velocity for a change of 1 of the relative one.
    shares: [f64; 2],
}

impl Place {
    fn bead(bead: usize, chain: &Chain) -> Self {
        let mass_kg = chain.mass_kg[bead];
        Self {
            number: bead,
            beads: [bead; 2],
            half_kg: [0.5 * mass_kg, 0.0],
            inverse_kg: 1.0 / mass_kg,
            shares: [1.0, 0.0],
        }
    }

    fn pair(contact: usize, chain: &Chain) -> Self {
        let beads = [contact, (contact + 1) % chain.bead_count()];
        let [left, right] = beads.map(|bead| 1.0 / chain.mass_kg[bead]);
        let inverse_kg = left + right;
        Self {
            number: contact,
            beads,
            half_kg: beads.map(|bead| 0.5 * chain.mass_kg[bead]),
            inverse_kg,
            shares: [left / inverse_kg, right / inverse_kg],
        }
    }
}

impl Baths {
    /// The baths of the run of `physics` and `chain`, if there are any.
    pub(crate) fn of(physics: &Physics, chain: &Chain) -> Option<Self> {
        let parts: Vec<_> = physics.baths.iter().map(|bath| Part::of(bath, physics, chain)).collect();
        (!parts.is_empty()).then_some(Self { parts, rows: physics.rows() })
    }

    /// The baths of runs whose states lie beside each other with `width` numbers a bead, and whose heat is all of their `extra`.
    pub(crate) fn beside<'a>(runs: impl Iterator<Item = &'a Self>, width: usize) -> Self {
        let in_lane = |(lane, baths): (usize, &'a Self)| {
            baths.parts.iter().map(move |part| Part { width, lane, ..part.clone() })
        };
        let rows = Rows { heat: true, ..Rows::default() };
        Self { parts: runs.enumerate().flat_map(in_lane).collect(), rows }
    }

    /// The beads in each bath.
    pub(crate) fn beads(&self) -> impl Iterator<Item = Range<usize>> {
        self.parts.iter().map(|part| part.bath.beads.range())
    }

    /// Lets the baths act on velocities (m/s), and on the heat in `extra`, over the half before step `step` is made.
    pub(crate) fn before(&mut self, v_m_s: &mut [f64], extra: &mut [f64], step: u64) {
        let heat_j = self.rows.heat_mut(extra);
        for part in &mut self.parts {
            part.draw(step);
            part.act([v_m_s, heat_j], step, 0);
        }
    }

    /// Lets them act over the half after step `step` has been made.
    pub(crate) fn after(&self, v_m_s: &mut [f64], extra: &mut [f64], step: u64) {
        let heat_j = self.rows.heat_mut(extra);
        for part in self.parts.iter().rev() {
            part.act([v_m_s, heat_j], step, 1);
        }
    }

    /// Carries tangents through what [`before`](Self::before) does, or, `backwards`, [`after`](Self::after): neighbouring runs have the same noise.
    pub(crate) fn slow(&self, tangents: &mut Tangents, backwards: bool) {
        for part in &self.parts {
            let slow = |place: &Place| {
                tangents.slow(place.beads, part.bath.pairs.then_some(place.shares), part.decay);
            };
            if backwards {
                part.places.iter().rev().for_each(slow);
            } else {
                part.places.iter().for_each(slow);
            }
        }
    }
}

impl Part {
    fn of(bath: &Bath, physics: &Physics, chain: &Chain) -> Self {
        let beads = bath.beads.range();
        let is_whole_ring = chain.is_ring && beads.len() == chain.bead_count();
        let places: Vec<_> = if bath.pairs {
            let last = if is_whole_ring { beads.end } else { beads.end - 1 };
            (beads.start..last).map(|contact| Place::pair(contact, chain)).collect()
        } else {
            beads.map(|bead| Place::bead(bead, chain)).collect()
        };
        let (dt_s, count) = (physics.dt_s, places.len());
        let drawn = count.max(TOGETHER / count * count); // integers
        let number = |i: usize| (((i / count) as u64) << 32) | places[i % count].number as u64; // integers
        let numbers = (0..drawn).map(number).collect();
        Self {
            numbers,
            seed: bath.seed.unwrap_or(physics.seed),
            dt_s,
            decay: exp(-(bath.friction_per_s * (0.5 * dt_s))),
            spread: (0.0 - exp_m1(-(bath.friction_per_s * dt_s))).sqrt(),
            half_kg: places.iter().map(|place| place.half_kg[0]).collect(),
            deviation_m_s: [vec![0.0; drawn], vec![0.0; drawn]],
            push_m_s: [vec![0.0; drawn], vec![0.0; drawn]],
            drawn: None,
            places,
            bath: bath.clone(),
            width: 1,
            lane: 0,
        }
    }

    /// Draws the pushes of step `step`, and of some after it: registers are filled by many numbers.
    fn draw(&mut self, step: u64) {
        if self.drawn.as_ref().is_some_and(|steps| steps.contains(&step)) {
            return;
        }
        if self.drawn.is_none() || !self.bath.is_steady() {
            self.find_deviations(step);
        }
        let Self { push_m_s: [before, after], numbers, bath, seed, .. } = self;
        let (seed, stream, numbers) = (*seed, bath.stream(), &numbers[..]);
        let (before, after) = (&mut before[..numbers.len()], &mut after[..numbers.len()]);
        vectorized(
            Arch::new(),
            #[inline(always)]
            move || {
                for i in 0..numbers.len() {
                    let [place, late] = halves(numbers[i]);
                    [before[i], after[i]] = normals(seed, step + u64::from(late), [place, stream]);
                }
            },
        );
        for (push_m_s, deviation_m_s) in self.push_m_s.iter_mut().zip(&self.deviation_m_s) {
            push_m_s.iter_mut().zip(deviation_m_s).for_each(|(push, deviation)| *push *= deviation);
        }
        self.drawn = Some(step..step + (self.numbers.len() / self.places.len()) as u64); // integers
    }

    /// Finds the standard deviations of the pushes from step `step` on.
    fn find_deviations(&mut self, step: u64) {
        let places = &self.places;
        for (half, deviation_m_s) in self.deviation_m_s.iter_mut().enumerate() {
            for (of_step, number) in deviation_m_s.chunks_exact_mut(places.len()).zip(step + half as u64..) {
                let temperature_j = self.bath.temperature_j(Moment::new(number, self.dt_s, 0.0));
                for (deviation_m_s, place) in of_step.iter_mut().zip(places) {
                    *deviation_m_s = self.spread * (temperature_j * place.inverse_kg).sqrt();
                }
            }
        }
    }

    /// Acts over the half before (0) or after (1) step `step`.
    fn act(&self, [v_m_s, heat_j]: [&mut [f64]; 2], step: u64, half: usize) {
        let (count, begun) = (self.places.len(), self.drawn.as_ref().map_or(step, |steps| steps.start));
        #[expect(clippy::cast_possible_truncation, reason = "some steps")]
        let push_m_s = &self.push_m_s[half][(step - begun) as usize * count..][..count];
        let number = |number: usize| number * self.width + self.lane;
        if self.bath.pairs {
            // from the first to the last, or the other way round
            for turn in 0..count {
                let at = if half == 0 { turn } else { count - 1 - turn };
                let place = &self.places[at];
                let heat_j = &mut heat_j[number(place.number)];
                self.act_on_pair(place, push_m_s[at], v_m_s, place.beads.map(number), heat_j);
            }
            return;
        }
        let numbers = number(self.places[0].number)..number(self.places[count - 1].number) + 1;
        let (v_m_s, heat_j) = (&mut v_m_s[numbers.clone()], &mut heat_j[numbers]);
        if self.width == 1 && count >= LANES {
            vectorized(
                Arch::new(),
                #[inline(always)]
                || self.act_on_beads(v_m_s.iter_mut().zip(heat_j), push_m_s),
            );
        } else {
            let beads = v_m_s.iter_mut().zip(heat_j).step_by(self.width);
            self.act_on_beads(beads, push_m_s);
        }
    }

    /// Acts on beads with these velocities (m/s) and heats (J).
    #[inline(always)]
    fn act_on_beads<'a>(&self, beads: impl Iterator<Item = (&'a mut f64, &'a mut f64)>, push_m_s: &[f64]) {
        for ((v_m_s, heat_j), (half_kg, push_m_s)) in beads.zip(self.half_kg.iter().zip(push_m_s)) {
            let before = *v_m_s;
            *v_m_s = (self.decay * before + push_m_s) + 0.0;
            *heat_j += gained_j(*half_kg, before, *v_m_s);
        }
    }

    /// Acts on the pair of `place`, whose velocities (m/s) have these numbers.
    fn act_on_pair(
        &self,
        place: &Place,
        push_m_s: f64,
        v_m_s: &mut [f64],
        [left, right]: [usize; 2],
        heat_j: &mut f64,
    ) {
        let (v, w) = (v_m_s[left], v_m_s[right]);
        let relative = v - w;
        let change = (self.decay * relative + push_m_s) - relative;
        v_m_s[left] = v + place.shares[0] * change;
        v_m_s[right] = w - place.shares[1] * change;
        let [of_left, of_right] = place.half_kg;
        *heat_j += gained_j(of_left, v, v_m_s[left]) + gained_j(of_right, w, v_m_s[right]);
    }
}

/// The kinetic energy (J) that a bead gains between two velocities (m/s), by half of its mass (kg).
#[inline(always)]
fn gained_j(half_kg: f64, before: f64, after: f64) -> f64 {
    half_kg * ((after - before) * (after + before))
}
