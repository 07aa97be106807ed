//! Origins and ends of pulses: strikers, drives, walls, free ends, the seam of a ring.

use super::{Birth, Fate, signed};
use schemas::config::End;
use schemas::drive::{Place, Side};
use schemas::manifest::Physics;

/// The places of a chain that make pulses.
#[derive(Debug, Clone)]
pub(super) struct Origins {
    last_bead: i64,
    /// Beads that are struck.
    strikers: Vec<i64>,
    /// Beads that are driven, and those beside a wall that moves.
    drives: Vec<i64>,
    /// Beyond the left and the right end.
    beyond: [End; 2],
}

impl Origins {
    pub(super) fn of(physics: &Physics) -> Self {
        let last_bead = signed(physics.beads - 1);
        let strikers = std::iter::once(&physics.striker).chain(&physics.strikers);
        let strikers = strikers.filter(|striker| striker.velocity_m_s != 0.0);
        let driven = |place| match place {
            Place::Wall(Side::Left) => 0,
            Place::Wall(Side::Right) => last_bead,
            Place::Bead(bead) => signed(bead),
        };
        Self {
            last_bead,
            strikers: strikers.map(|striker| signed(striker.bead)).collect(),
            drives: physics.drives.iter().map(|drive| driven(drive.at)).collect(),
            beyond: [physics.ends.left, physics.ends.right],
        }
    }

    /// The maker of pulses within `near` beads of `bead`, if there is one; no striker at an end to which pulses have `come_back` since: it
    /// strikes once.
    pub(super) fn maker(&self, bead: i64, near: i64, come_back: [bool; 2]) -> Option<Birth> {
        let is_near = |place: &i64| (bead - place).abs() <= near;
        let is_over = |place: &i64| {
            let ends = [0, self.last_bead];
            ends.iter().zip(come_back).any(|(end, come_back)| come_back && (place - end).abs() <= near)
        };
        if self.strikers.iter().any(|place| is_near(place) && !is_over(place)) {
            return Some(Birth::Striker);
        }
        self.drives.iter().any(is_near).then_some(Birth::Drive)
    }

    /// The origin of a pulse that begins near the left or the right end.
    pub(super) fn birth_at(&self, is_left: bool) -> Birth {
        match self.beyond[usize::from(!is_left)] {
            End::Fixed => Birth::Wall,
            End::Periodic => Birth::Seam,
            End::Free | End::Absorbing => Birth::End,
        }
    }

    /// The fate of a pulse that reaches the end in the direction `ahead`.
    pub(super) fn fate_at(&self, ahead: i64) -> Fate {
        match self.beyond[usize::from(ahead > 0)] {
            End::Fixed => Fate::Wall,
            End::Periodic => Fate::Seam,
            End::Free | End::Absorbing => Fate::End,
        }
    }
}
