//! The edges of a pulse: where the velocity is half of its peak, ahead of the crest and behind it.

use super::crest::History;

/// The edges of one pulse, followed from bead to bead. Between beads an edge is where it will be at the
/// pulse's speed, so that the width of a pulse of one or two beads comes out as finely as that of a wide one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edges {
    sign: f64,
    /// Beads by which the pulse moves on: +1 or −1.
    ahead: i64,
    level_m_s: f64,
    /// The foremost bead that has risen above the level.
    front: Edge,
    /// The foremost bead behind the crest that has sunk below it.
    rear: Edge,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Edge {
    bead: i64,
    /// Time (s) at which the bead passed the level; none where that was not seen.
    time_s: Option<f64>,
}

impl Edges {
    /// The edges around the crest at `head` of a pulse whose beads move with `sign`, and which moves by `ahead`.
    pub(super) fn around(history: &History, head: i64, (sign, ahead): (f64, i64), level_m_s: f64) -> Self {
        let mut edges = Self {
            sign,
            ahead,
            level_m_s,
            front: Edge { bead: head, time_s: None },
            rear: Edge { bead: head, time_s: None },
        };
        while edges.height(history, edges.front.bead + ahead).is_some_and(|height| height >= level_m_s) {
            edges.front.bead += ahead;
        }
        while edges.height(history, edges.rear.bead).is_some_and(|height| height >= level_m_s) {
            edges.rear.bead -= ahead;
        }
        edges
    }

    /// The level is half of `crest_m_s` from now on; edges that are no longer ones, or those of `several`
    /// crests, are looked for anew.
    pub(super) fn renew(&mut self, history: &History, head: i64, crest_m_s: f64, several: bool) {
        /// Levels change a little from bead to bead, which moves an edge by a small part of a bead.
        const SLACK: f64 = 0.1;
        self.level_m_s = 0.5 * crest_m_s.abs();
        let low = (1.0 - SLACK) * self.level_m_s;
        let high = (1.0 + SLACK) * self.level_m_s;
        let front = self.height(history, self.front.bead).is_some_and(|height| height < low);
        let rear = self.height(history, self.rear.bead).is_some_and(|height| height > high);
        let behind = (head - self.front.bead) * self.ahead > 0 || (self.rear.bead - head) * self.ahead > 0;
        if several || front || rear || behind {
            *self = Self::around(history, head, (self.sign, self.ahead), self.level_m_s);
        }
    }

    /// Follows the edges through the middle frame of `history`.
    pub(super) fn advance(&mut self, history: &History, head: i64) {
        loop {
            let next = self.front.bead + self.ahead;
            if self.height(history, next).is_none_or(|height| height < self.level_m_s) {
                break;
            }
            self.front = self.crossed(history, next);
        }
        loop {
            let next = self.rear.bead + self.ahead;
            let passed = (head - next) * self.ahead >= 0;
            if !passed || self.height(history, next).is_none_or(|height| height >= self.level_m_s) {
                break;
            }
            self.rear = self.crossed(history, next);
        }
    }

    /// Distances (beads) of the edges ahead of and behind a crest that passes `bead` at `time_s`, at
    /// `speed_beads_per_s`.
    pub(super) fn half_widths_beads(
        &self,
        bead: i64,
        time_s: f64,
        speed_beads_per_s: f64,
    ) -> Option<[f64; 2]> {
        let place = |edge: Edge| {
            let beads = ((edge.bead - bead) * self.ahead) as f64;
            edge.time_s.map(|crossed_s| beads + speed_beads_per_s * (time_s - crossed_s))
        };
        let (front, rear) = (place(self.front)?, -place(self.rear)?);
        (front > 0.0 && rear > 0.0).then_some([front, rear])
    }

    /// Their beads, the lower one first.
    pub(super) fn beads(&self) -> [i64; 2] {
        let (front, rear) = (self.front.bead, self.rear.bead);
        [front.min(rear), front.max(rear)]
    }

    /// True if `bead` lies between the edges.
    pub(super) fn enclose(&self, bead: i64) -> bool {
        (self.front.bead - bead) * self.ahead >= 0 && (bead - self.rear.bead) * self.ahead >= 0
    }

    fn crossed(&self, history: &History, bead: i64) -> Edge {
        Edge { bead, time_s: history.crossing_s(bead, self.sign, self.level_m_s) }
    }

    /// Velocity times sign (m/s) in the middle frame; none beyond the beads that are looked at.
    fn height(&self, history: &History, bead: i64) -> Option<f64> {
        history.at(2, bead).map(|v| self.sign * v)
    }
}
