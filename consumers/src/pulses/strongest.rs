//! The strongest pulses of a run and their paths, in bounded memory, for summaries and figures.

use super::{Happening, Point, Pulse};
use std::collections::BTreeMap;

/// Path of a pulse: at most [`Path::CAPACITY`] points, evenly spread over its beads, and the last one.
#[derive(Debug, Clone)]
pub struct Path {
    kept: Vec<Point>,
    last: Point,
    stride: u64,
    offered: u64,
}

/// Keeps the strongest pulses.
#[derive(Debug, Clone, Default)]
pub struct Strongest {
    pulses: Vec<Pulse>,
    /// Paths of the pulses, by their numbers; only if a figure is to be drawn.
    paths: Option<BTreeMap<u64, Path>>,
}

impl Path {
    /// The largest number of points kept besides the last.
    pub const CAPACITY: usize = 256;

    fn new(point: Point) -> Self {
        Self { kept: Vec::new(), last: point, stride: 1, offered: 0 }
    }

    fn push(&mut self, point: Point) {
        if self.offered.is_multiple_of(self.stride) {
            if self.kept.len() == Self::CAPACITY {
                let mut stays = [true, false].into_iter().cycle();
                self.kept.retain(|_| stays.next() == Some(true));
                self.stride *= 2;
            }
            self.kept.push(point);
        }
        self.offered += 1;
        self.last = point;
    }

    /// The points, in the order of time.
    pub fn points(&self) -> impl Iterator<Item = &Point> {
        let last = self.kept.last().is_none_or(|kept| kept.bead != self.last.bead).then_some(&self.last);
        self.kept.iter().chain(last)
    }
}

impl Strongest {
    /// The largest number of pulses kept.
    pub const CAPACITY: usize = 500;

    /// Keeps pulses, and their paths `with_paths`.
    pub fn new(with_paths: bool) -> Self {
        Self { pulses: Vec::new(), paths: with_paths.then(BTreeMap::new) }
    }

    /// Takes the happenings of a frame.
    pub fn take(&mut self, happening: &Happening) {
        match happening {
            Happening::Passed(point) => {
                if let Some(paths) = &mut self.paths {
                    paths.entry(point.pulse).or_insert_with(|| Path::new(*point)).push(*point);
                }
            }
            Happening::Ended(pulse) => {
                self.pulses.push(*pulse);
                if self.pulses.len() > 2 * Self::CAPACITY {
                    self.thin();
                }
            }
        }
    }

    /// The pulses that have ended, the strongest first.
    pub fn pulses(&mut self) -> &[Pulse] {
        self.thin();
        &self.pulses
    }

    /// The path of a pulse.
    pub fn path(&self, number: u64) -> Option<&Path> {
        self.paths.as_ref()?.get(&number)
    }

    fn thin(&mut self) {
        let strength = |pulse: &Pulse| pulse.measured.point.v_peak_m_s.abs();
        self.pulses.sort_by(|a, b| strength(b).total_cmp(&strength(a)).then(a.number.cmp(&b.number)));
        let dropped = self.pulses.split_off(self.pulses.len().min(Self::CAPACITY));
        if let Some(paths) = &mut self.paths {
            for pulse in dropped {
                paths.remove(&pulse.number);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_paths_keep_their_ends() {
        for count in [1, 256, 257, 100_000] {
            let mut kept = Strongest::new(true);
            for bead in 0..count {
                let (time_s, v_peak_m_s) = (1e-4 * bead as f64, 1.0);
                let point =
                    Point { pulse: 7, bead, time_s, v_peak_m_s, speed_beads_per_s: None, shape: None };
                kept.take(&Happening::Passed(point));
            }
            let beads: Vec<_> = kept.path(7).unwrap().points().map(|point| point.bead).collect();
            assert!(beads.len() <= Path::CAPACITY + 1 && beads.is_sorted(), "{count}");
            assert_eq!((beads[0], beads[beads.len() - 1]), (0, count - 1));
        }
    }
}
