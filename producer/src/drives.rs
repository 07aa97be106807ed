//! Actions of drives at a moment: the places of walls and beads, and the forces on beads.

use crate::kernel::Activity;
use schemas::drive::{Drive, Place, Quantity, Side};
use schemas::functions::Moment;

/// The drives of a run.
#[derive(Debug, Clone)]
pub(crate) struct Drives {
    drives: Vec<Drive>,
    dt_s: f64,
}

/// Action of a drive at a moment.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Now {
    /// The displacement (m) of the wall or bead that it moves.
    pub(crate) x_m: f64,
    /// Its velocity (m/s).
    pub(crate) v_m_s: f64,
    /// The force (N) with which it pushes.
    pub(crate) force_n: f64,
}

impl Now {
    /// Pushes a bead of velocity `v_m_s` (m/s) and `1/m` (1/kg) in a kick of `kick_s`; gives the work (J), by the velocity before the kick.
    pub(crate) fn push(&self, kick_s: f64, inverse_mass: f64, before_m_s: f64, v_m_s: &mut f64) -> f64 {
        *v_m_s += kick_s * inverse_mass * self.force_n;
        kick_s * self.force_n * (0.5 * (before_m_s + *v_m_s))
    }

    /// The work (J) in a kick of `kick_s` at the left (0) or the right (1) wall, by the forces (N) of both.
    pub(crate) fn work_at_wall(&self, side: usize, kick_s: f64, forces_n: [f64; 2]) -> f64 {
        let work_j = kick_s * (forces_n[side] * self.v_m_s);
        if side == 0 { work_j } else { -work_j }
    }
}

/// The wall or bead on which a drive acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Acts {
    /// It moves the left (0) or the right (1) wall.
    Wall(usize),
    /// It moves a bead.
    Moves(usize),
    /// It pushes a bead.
    Pushes(usize),
}

/// A moment of a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct When {
    /// The step that is made.
    pub(crate) step: u64,
    /// Time after the beginning of the step (s).
    pub(crate) after_s: f64,
    /// Beginning of the piece (s after the beginning of the step), and the time (s) since then.
    pub(crate) from_s: f64,
    pub(crate) since_s: f64,
    /// True at the end of the step, which is the beginning of the next one.
    pub(crate) is_end: bool,
    /// The delay (s) at which forces and velocities are evaluated: away from a knot, into the piece.
    pub(crate) beside_s: f64,
}

impl Drives {
    /// Makes the drives of a run with steps of `dt_s`, if there are any.
    pub(crate) fn of(drives: &[Drive], dt_s: f64) -> Option<Self> {
        (!drives.is_empty()).then(|| Self { drives: drives.to_vec(), dt_s })
    }

    /// The places (m) and the velocities (m/s) of the walls while they act as `now`.
    pub(crate) fn walls(&self, now: &[Now]) -> [[f64; 2]; 2] {
        let mut walls = [[0.0; 2]; 2];
        for (d, now) in now.iter().enumerate() {
            if let Acts::Wall(side) = self.acts(d) {
                (walls[0][side], walls[1][side]) = (now.x_m, now.v_m_s);
            }
        }
        walls
    }

    /// The beads that they push.
    pub(crate) fn pushed(&self) -> impl Iterator<Item = usize> {
        (0..self.count())
            .filter_map(|d| if let Acts::Pushes(bead) = self.acts(d) { Some(bead) } else { None })
    }

    /// True if one of them moves a bead.
    pub(crate) fn move_beads(&self) -> bool {
        (0..self.count()).any(|d| matches!(self.acts(d), Acts::Moves(_)))
    }

    /// Number of drives.
    pub(crate) fn count(&self) -> usize {
        self.drives.len()
    }

    /// The wall or bead on which drive `d` acts.
    pub(crate) fn acts(&self, d: usize) -> Acts {
        let drive = &self.drives[d];
        match drive.at {
            Place::Wall(Side::Left) => Acts::Wall(0),
            Place::Wall(Side::Right) => Acts::Wall(1),
            Place::Bead(bead) => {
                let bead = usize::try_from(bead).unwrap_or(usize::MAX);
                if drive.prescribes == Quantity::Force { Acts::Pushes(bead) } else { Acts::Moves(bead) }
            }
        }
    }

    /// Writes the action of each drive at `when` into `now`; `row` is the row of the drives in the state at the
    /// beginning of the step.
    pub(crate) fn at(&self, when: When, row: &[f64], now: &mut Vec<Now>) {
        let at = if when.is_end {
            Moment::new(when.step + 1, self.dt_s, 0.0)
        } else {
            Moment::new(when.step, self.dt_s, when.after_s)
        };
        let is_beside = when.beside_s != 0.0;
        let beside =
            if is_beside { Moment::new(when.step, self.dt_s, when.after_s + when.beside_s) } else { at };
        now.clear();
        now.extend(self.drives.iter().enumerate().map(|(d, drive)| {
            let (value, slope) = drive.waveform.value_and_slope(beside);
            // along the slope back to the knot
            let at_knot = if is_beside { value - slope * when.beside_s } else { value };
            match drive.prescribes {
                Quantity::Force => Now { force_n: at_knot, ..Now::default() },
                Quantity::Displacement => {
                    let x_m = if is_beside { drive.waveform.value(at) } else { value };
                    Now { x_m, v_m_s: slope, force_n: 0.0 }
                }
                Quantity::Velocity => {
                    let x_m = row[2 * d + 1] + self.way_m(drive, when);
                    Now { x_m, v_m_s: at_knot, force_n: 0.0 }
                }
            }
        }));
    }

    /// The distance (m) that a prescribed velocity covers from the beginning of a piece until `when`: Gauss's
    /// quadrature with three points, of sixth order.
    fn way_m(&self, drive: &Drive, when: When) -> f64 {
        // ½ ∓ √15/10
        const NODES: [f64; 3] = [0.112_701_665_379_258_31, 0.5, 0.887_298_334_620_741_7];
        const WEIGHTS: [f64; 3] = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0];
        let When { step, from_s, since_s: s, .. } = when;
        if s == 0.0 {
            return 0.0;
        }
        let value = |node: f64| drive.waveform.value(Moment::new(step, self.dt_s, from_s + s * node));
        let part = |i: usize| WEIGHTS[i] * value(NODES[i]);
        s * (part(0) + part(1) + part(2))
    }
}

impl Drives {
    /// `activity`, widened over the beads that drives may set in motion in a chain of `beads` beads.
    pub(crate) fn widen(&self, activity: Activity, beads: usize) -> Activity {
        (0..self.count()).fold(activity, |activity, d| match self.acts(d) {
            Acts::Wall(0) => activity.with(0),
            Acts::Wall(_) => activity.with(beads - 1),
            Acts::Moves(bead) | Acts::Pushes(bead) => activity.with(bead),
        })
    }

    /// The velocity (m/s) of the bead at which drive `d` acts, 0 at a wall.
    pub(crate) fn velocity_at(&self, d: usize, v_m_s: &[f64]) -> f64 {
        match self.acts(d) {
            Acts::Pushes(bead) | Acts::Moves(bead) => v_m_s[bead],
            Acts::Wall(_) => 0.0,
        }
    }
}
