//! Heat baths in a run: the halves of a step in which they slow beads down and shake them.

use crate::tangents::Tangents;
use pulp::Arch;
use schemas::bath::Bath;
use schemas::chain::Chain;
use schemas::functions::{Moment, exp, exp_m1};
use schemas::manifest::Physics;
use schemas::simd::vectorized;
use std::ops::Range;

/// Numbers of noise that are drawn together.
const TOGETHER: usize = 64;

/// The baths of a run, or those of some runs whose states lie beside each other.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Baths {
    parts: Vec<Part>,
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
    /// The noise of both halves of some steps from `drawn` on, at each place.
    noise: [Vec<f64>; 2],
    drawn: Option<Range<u64>>,
    /// The number of the step after the first, and the place, of each number of noise.
    numbers: [Vec<u32>; 2],
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
        (!parts.is_empty()).then_some(Self { parts })
    }

    /// The baths of runs whose states lie beside each other with `width` numbers a bead.
    pub(crate) fn beside<'a>(runs: impl Iterator<Item = &'a Self>, width: usize) -> Self {
        let in_lane = |(lane, baths): (usize, &'a Self)| {
            baths.parts.iter().map(move |part| Part { width, lane, ..part.clone() })
        };
        Self { parts: runs.enumerate().flat_map(in_lane).collect() }
    }

    /// The beads in each bath.
    pub(crate) fn beads(&self) -> impl Iterator<Item = Range<usize>> {
        self.parts.iter().map(|part| part.bath.beads.range())
    }

    /// Lets the baths act over the half before the step that begins at `state`; `heat_j` is the row of the heat.
    pub(crate) fn before(&mut self, [v_m_s, heat_j]: [&mut [f64]; 2], step: u64) {
        for part in &mut self.parts {
            part.draw(step);
            part.act([v_m_s, heat_j], step, 0);
        }
    }

    /// Lets the baths act over the half after the step `step` has been made.
    pub(crate) fn after(&mut self, [v_m_s, heat_j]: [&mut [f64]; 2], step: u64) {
        for part in self.parts.iter_mut().rev() {
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
        #[expect(clippy::cast_possible_truncation, reason = "below 2·10^7")]
        let numbers = [
            (0..drawn).map(|i| (i / count) as u32).collect(), // integers
            (0..drawn).map(|i| places[i % count].number as u32).collect(),
        ];
        Self {
            numbers,
            seed: bath.seed.unwrap_or(physics.seed),
            dt_s,
            decay: exp(-(bath.friction_per_s * (0.5 * dt_s))),
            spread: (0.0 - exp_m1(-(bath.friction_per_s * dt_s))).sqrt(),
            noise: [vec![0.0; drawn], vec![0.0; drawn]],
            drawn: None,
            places,
            bath: bath.clone(),
            width: 1,
            lane: 0,
        }
    }

    /// Draws the noise of step `step`, and of some after it: registers are filled by many numbers.
    fn draw(&mut self, step: u64) {
        if self.drawn.as_ref().is_some_and(|steps| steps.contains(&step)) {
            return;
        }
        let Self { noise: [before, after], numbers: [late, places], bath, seed, .. } = self;
        let (seed, count) = (*seed, late.len());
        let (before, after, places) = (&mut before[..count], &mut after[..count], &places[..count]);
        vectorized(
            Arch::new(),
            #[inline(always)]
            || {
                for i in 0..count {
                    [before[i], after[i]] = bath.noise(seed, step + u64::from(late[i]), places[i]);
                }
            },
        );
        self.drawn = Some(step..step + (count / self.places.len()) as u64); // integers
    }

    /// Acts over the half before (0) or after (1) step `step`: from the first place to the last, or the other way round.
    fn act(&self, [v_m_s, heat_j]: [&mut [f64]; 2], step: u64, half: usize) {
        let temperature_j = self.bath.temperature_j(Moment::new(step + half as u64, self.dt_s, 0.0));
        let (count, begun) = (self.places.len(), self.drawn.as_ref().map_or(step, |steps| steps.start));
        #[expect(clippy::cast_possible_truncation, reason = "some steps")]
        let noise = &self.noise[half][(step - begun) as usize * count..];
        for turn in 0..count {
            let at = if half == 0 { turn } else { count - 1 - turn };
            self.act_at(&self.places[at], temperature_j, noise[at], [v_m_s, heat_j]);
        }
    }

    #[inline(always)]
    fn act_at(&self, place: &Place, temperature_j: f64, noise: f64, [v_m_s, heat_j]: [&mut [f64]; 2]) {
        let deviation_m_s = self.spread * (temperature_j * place.inverse_kg).sqrt();
        let [left, right] = place.beads.map(|bead| bead * self.width + self.lane);
        let heat_j = &mut heat_j[place.number * self.width + self.lane];
        let gained_j =
            |half_kg: f64, before: f64, after: f64| half_kg * ((after - before) * (after + before));
        let (v, w) = (v_m_s[left], v_m_s[right]);
        if !self.bath.pairs {
            v_m_s[left] = (self.decay * v + deviation_m_s * noise) + 0.0;
            *heat_j += gained_j(place.half_kg[0], v, v_m_s[left]);
            return;
        }
        let relative = v - w;
        let change = (self.decay * relative + deviation_m_s * noise) - relative;
        v_m_s[left] = v + place.shares[0] * change;
        v_m_s[right] = w - place.shares[1] * change;
        let [of_left, of_right] = place.half_kg;
        *heat_j += gained_j(of_left, v, v_m_s[left]) + gained_j(of_right, w, v_m_s[right]);
    }
}
