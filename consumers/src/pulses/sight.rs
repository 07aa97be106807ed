//! Velocities that the tracker sees in a frame: of each bead or, where beads are not alike, the mean of several around
//! it.

use super::crest::{Crest, History};
use super::signed;
use super::surroundings::Surroundings;
use schemas::frame::Frame;
use std::ops::Range;

/// The velocities that pulses are found in, and the crests among them.
#[derive(Debug, Clone)]
pub(super) struct Sight {
    /// Velocities, or means of them.
    pub(super) history: History,
    candidates: Vec<usize>,
    /// Only in a chain that has a texture.
    own: Option<Own>,
}

/// The beads' own velocities, where others are followed.
#[derive(Debug, Clone)]
struct Own {
    history: History,
    /// The largest velocity (m/s) of each bead since the mean around it was smallest.
    largest_m_s: Vec<f64>,
}

impl Sight {
    /// Looks at some beads of a chain.
    pub(super) fn new(around: &Surroundings, beads: Range<usize>) -> Self {
        let own = around
            .texture
            .as_ref()
            .map(|_| Own { history: History::new(beads.clone()), largest_m_s: vec![0.0; beads.len()] });
        Self { history: History::new(beads), candidates: Vec::new(), own }
    }

    /// Takes the next frame.
    pub(super) fn push(&mut self, around: &Surroundings, frame: &Frame<'_>) {
        let (time_s, v_m_s, active) = (frame.time_s, frame.v_m_s, frame.moving());
        let copy = |beads: Range<usize>, to: &mut [f64]| to.copy_from_slice(&v_m_s[beads]);
        match (&around.texture, &mut self.own) {
            (Some(texture), Some(own)) => {
                own.history.push(time_s, active, copy);
                let average = |beads, to: &mut [f64]| texture.average(v_m_s, beads, to);
                self.history.push(time_s, texture.around(active), average);
            }
            _ => self.history.push(time_s, active, copy),
        }
    }

    /// Forgets all frames.
    pub(super) fn clear(&mut self) {
        self.history.clear();
        if let Some(own) = &mut self.own {
            own.history.clear();
            own.largest_m_s.fill(0.0);
        }
    }

    /// Puts into `crests` those above `threshold_m_s` in the middle frame that pulses may have, in no order.
    pub(super) fn crests(
        &mut self,
        around: &Surroundings,
        frame: &Frame<'_>,
        threshold_m_s: f64,
        crests: &mut Vec<(usize, Crest)>,
    ) {
        self.history.candidates(threshold_m_s, &mut self.candidates);
        let is_crest = |bead: &&usize| {
            // a bead at its fastest is pushed from both sides alike; one that nothing touches is no pulse
            !around.obstacles.contains(signed(**bead as u64))
                && around.is_pressed(frame, **bead)
                && self.is_coherent(around, **bead)
        };
        crests.clear();
        let found = self.candidates.iter().filter(is_crest);
        crests.extend(found.map(|bead| (*bead, self.history.crest(*bead))));
    }

    /// True if the beads around `bead` move together rather than against each other. Their mean velocity squared is
    /// this part of their mean squared velocity: 1 where all move alike, 0.6 to 0.8 in pulses through chains of dimers.
    fn is_coherent(&self, around: &Surroundings, bead: usize) -> bool {
        const TOGETHER: f64 = 0.3;
        let (Some(texture), Some(own)) = (&around.texture, &self.own) else { return true };
        let mean = self.history.at(2, signed(bead as u64)).unwrap_or_default();
        let squares = texture.parts(bead).map(|(bead, weight)| {
            let v = own.history.at(2, signed(bead as u64)).unwrap_or_default();
            weight * (v * v)
        });
        mean * mean >= TOGETHER * squares.sum::<f64>()
    }

    /// Puts into `crests` those of the beads' own velocities in the middle frame, where others are followed.
    pub(super) fn own_crests(
        &mut self,
        around: &Surroundings,
        threshold_m_s: f64,
        crests: &mut Vec<(usize, Crest)>,
    ) {
        crests.clear();
        let (Some(texture), Some(own)) = (&around.texture, &mut self.own) else { return };
        let first = self.history.range().start;
        for bead in self.history.moved().filter(|bead| self.history.is_least(*bead)) {
            own.largest_m_s[bead - first] = 0.0;
        }
        own.history.candidates(threshold_m_s, &mut self.candidates);
        for bead in self.candidates.iter().filter(|bead| texture.is_uneven(**bead)) {
            let crest = own.history.crest(*bead);
            let largest = &mut own.largest_m_s[bead - first];
            if crest.v_m_s.abs() > largest.abs() {
                *largest = crest.v_m_s;
            }
            crests.push((*bead, crest));
        }
    }

    /// The velocity (m/s) of `bead` itself in a `crest` that is followed there.
    pub(super) fn own_velocity_m_s(&self, around: &Surroundings, bead: usize, crest: &Crest) -> f64 {
        match &self.own {
            Some(own) if around.is_uneven(bead) => {
                let largest = own.largest_m_s[bead - self.history.range().start];
                if largest * crest.v_m_s > 0.0 { largest } else { crest.v_m_s }
            }
            _ => crest.v_m_s,
        }
    }
}
