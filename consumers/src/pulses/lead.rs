//! The pulses that lead the others, where crests come and go.
//!
//! In a chain of unlike beads a crest may be out of sight for several of them. Behind other pulses it could then be taken
//! for another one's; ahead of all others there is no other.

use super::surroundings::Surroundings;
use super::track::Track;

/// The farthest beads that pulses have passed.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Lead {
    /// The farthest bead that a pulse has passed forward and backward, that times −1.
    farthest: [Option<i64>; 2],
}

impl Lead {
    /// A pulse has passed the next bead.
    pub(super) fn goes_on(&mut self, track: &Track) {
        let come = track.head().bead * track.ahead;
        let farthest = &mut self.farthest[usize::from(track.ahead < 0)];
        if farthest.is_none_or(|farthest| come > farthest) {
            *farthest = Some(come);
        }
    }

    /// The one of the numbered `tracks` that leads in its direction and can go on to a crest of `crest_m_s` at a bead and a time (s), if there is
    /// one: a pulse rather than a track that may become one, and the nearest.
    pub(super) fn find<'a>(
        &self,
        around: &Surroundings,
        tracks: impl Iterator<Item = (usize, &'a Track)>,
        at: (i64, f64),
        crest_m_s: f64,
    ) -> Option<usize> {
        let leads = |track: &Track| {
            let come = track.head().bead * track.ahead;
            let farthest = self.farthest[usize::from(track.ahead < 0)];
            let is_young = i64::from(track.number == 0);
            farthest.is_none_or(|farthest| come - farthest >= is_young)
                && track.sign == crest_m_s.signum()
                && !around.obstacles.between(track.head().bead, at.0)
        };
        let fits = tracks
            .filter(|(_, track)| leads(track))
            .filter_map(|(i, track)| Some((track.number == 0, track.leads_to(at, crest_m_s)?, i)));
        fits.min().map(|(.., i)| i)
    }
}
