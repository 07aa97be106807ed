//! Footage of a run: all that the pictures of a film show, in bounded memory.

use crate::energies::{Energies, EnergyRow, default_split_bead};
use crate::fields::Field;
use crate::follow::FrameObserver;
use crate::series::Series;
use crate::space_time::{Extent, Picture, singles};
use schemas::chain::Chain;
use schemas::frame::{Frame, HeldFrame};
use schemas::manifest::RunManifest;
use std::collections::VecDeque;
use std::convert::Infallible;

/// Stretches of a chain of which a shot keeps the least and the largest value; more than a picture has dots for.
const MOST_STRETCHES: usize = 2048;

/// One moment of a film.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// The step.
    pub step: u64,
    /// Its time (s).
    pub time_s: f64,
    /// Beads or contacts, and differences of their values from those at rest, in the order of the chain.
    pub profile: Vec<(f32, f32)>,
    /// The energies, in the order of [`EnergyRow::COLUMNS`].
    pub energies: [f64; EnergyRow::COLUMNS.len()],
}

/// The frames of a run, reduced to a map, to energies over time and to the shots of a film.
#[derive(Debug)]
pub struct Footage {
    /// The quantity that is shown.
    pub field: Field,
    /// It over space and time.
    pub map: Picture<f32>,
    /// Energies over time.
    pub energies: Series<{ EnergyRow::COLUMNS.len() }>,
    /// The moments that came, in the order of time. The last one is that of the last frame.
    pub shots: Vec<Shot>,
    chain: Chain,
    watch: Energies,
    /// Steps of shots that have not come yet.
    due: VecDeque<u64>,
    last: Option<(HeldFrame, [f64; EnergyRow::COLUMNS.len()])>,
    /// Frames were missed before the next one, or it is the first.
    is_behind: bool,
}

impl Footage {
    /// Footage for `count` shots of the part `extent` of a run: from its first frame to its last one at an even pace, or, of
    /// `every_step`, from the first step to the last one.
    pub fn new(manifest: &RunManifest, field: Field, extent: Extent, count: u64, every_step: bool) -> Self {
        let (first, last) = extent.steps.clone().into_inner();
        // a frame before the part begins is not in it
        let begins = if every_step || manifest.is_frame(first) {
            first
        } else {
            manifest.step_of_frame(manifest.frame_at(first) + 1)
        };
        let frame = |step| {
            if every_step { step } else { manifest.step_of_frame(manifest.frame_at(step)).max(begins) }
        };
        let step = |shot: u64| {
            let passed = u128::from(last - first) * u128::from(shot) / u128::from((count - 1).max(1));
            frame(first + u64::try_from(passed).unwrap_or(u64::MAX))
        };
        Self {
            field,
            due: (0..count.saturating_sub(1)).map(step).chain([frame(last)]).collect(),
            map: Picture::new(extent),
            energies: Series::default(),
            shots: Vec::new(),
            chain: manifest.physics.chain(),
            watch: Energies::new(manifest, default_split_bead(manifest)),
            last: None,
            is_behind: true,
        }
    }

    /// Adds the last frame, where it is none of the shots: the frames ended early.
    pub fn end(&mut self) {
        let Some((held, energies)) = self.last.take() else { return };
        let frame = held.frame();
        if self.shots.last().is_none_or(|shot| shot.step < frame.step) {
            self.shots.push(self.shot(&frame, energies));
        }
    }

    /// The bead that divides the energies.
    pub fn split_bead(&self) -> u64 {
        self.watch.split_bead()
    }

    fn shot(&self, frame: &Frame<'_>, energies: [f64; EnergyRow::COLUMNS.len()]) -> Shot {
        let places = self.map.extent().places.clone();
        let values = self.field.deviations(&self.chain, frame).skip(places.start).take(places.len());
        let profile = places.map(|place| place as f64).zip(values);
        #[expect(clippy::cast_possible_truncation, reason = "seven digits are enough for a dot")]
        let profile: Vec<(f32, f32)> = profile.map(|(place, value)| (place as f32, value as f32)).collect();
        Shot { step: frame.step, time_s: frame.time_s, profile: thinned(profile), energies }
    }
}

impl FrameObserver for Footage {
    type Error = Infallible;

    /// Looks at the next frame: the first one at or after the step of a shot is that shot.
    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
        self.map.push(frame.step, singles(self.field.deviations(&self.chain, frame)));
        let energies = self.watch.observe(frame).values();
        self.energies.push(frame.time_s, energies);
        while self.due.front().is_some_and(|due| *due < frame.step && self.is_behind) {
            self.due.pop_front();
        }
        self.is_behind = false;
        while self.due.front().is_some_and(|due| *due <= frame.step) {
            self.due.pop_front();
            self.shots.push(self.shot(frame, energies));
        }
        let (held, _) = self.last.get_or_insert_with(|| (HeldFrame::default(), energies));
        held.hold(frame);
        if let Some((_, last)) = &mut self.last {
            *last = energies;
        }
        Ok(())
    }

    /// Frames are missing before the next one: there are no shots of them.
    fn gap(&mut self) {
        self.map.gap();
        self.is_behind = true;
    }
}

/// The points; of long chains the least and the largest one of each stretch.
fn thinned(points: Vec<(f32, f32)>) -> Vec<(f32, f32)> {
    if points.len() <= 2 * MOST_STRETCHES {
        return points;
    }
    let stretches = points.chunks(points.len().div_ceil(MOST_STRETCHES));
    let ends = stretches.flat_map(|stretch| {
        let of = |is_beyond: fn(f32, f32) -> bool| {
            let farther = |found: (f32, f32), point: &(f32, f32)| {
                if is_beyond(point.1, found.1) { *point } else { found }
            };
            stretch.iter().fold(stretch[0], farther)
        };
        let (least, largest) = (of(|a, b| a < b), of(|a, b| a > b));
        if least.0 <= largest.0 { [least, largest] } else { [largest, least] }
    });
    ends.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    fn manifest(step_count: u64, publish_every_steps: u64) -> RunManifest {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let mut manifest = RunManifest::new(&PRESETS[0].config(), "run", origin).expect("valid");
        manifest.physics.step_count = step_count;
        manifest.provenance.publish_every_steps = publish_every_steps;
        manifest
    }

    /// Steps of the shots of frames at `steps`, none standing for a gap.
    fn shots(manifest: &RunManifest, count: u64, steps: &[Option<u64>]) -> Vec<u64> {
        shots_from(manifest, 0, count, steps)
    }

    /// The same of the part that begins at step `first`.
    fn shots_from(manifest: &RunManifest, first: u64, count: u64, steps: &[Option<u64>]) -> Vec<u64> {
        let extent = Extent { places: 0..1000, steps: first..=manifest.physics.step_count };
        let mut footage = Footage::new(manifest, Field::Velocity, extent, count, false);
        let doubles = vec![0.0; 2000];
        for step in steps {
            match step {
                Some(step) => {
                    let time_s = manifest.physics.time_s(*step);
                    let Ok(()) = footage.observe(&Frame::of_doubles(
                        (manifest.frame_at(*step), *step, time_s),
                        1000,
                        &doubles,
                    ));
                }
                None => footage.gap(),
            }
        }
        footage.end();
        footage.shots.iter().map(|shot| shot.step).collect()
    }

    #[test]
    fn shots_are_at_an_even_pace_and_the_last_frame_is_the_last_one() {
        let whole: Vec<_> = (0..=10).map(|frame| Some(10 * frame)).collect();
        let run = manifest(100, 10);
        assert_eq!(shots(&run, 3, &whole), [0, 50, 100]);
        assert_eq!(shots(&run, 1, &whole), [100]);
        // a moment between two frames shows the earlier one, as the map does
        assert_eq!(shots(&run, 4, &whole), [0, 30, 60, 100]);
        // few frames stand longer
        assert_eq!(shots(&manifest(1, 10), 4, &[Some(0), Some(1)]), [0, 0, 0, 1]);
        // the frames end early, begin late, or some are missed
        assert_eq!(shots(&run, 11, &whole[..4]), [0, 10, 20, 30]);
        assert_eq!(shots(&run, 3, &whole[..8]), [0, 50, 70]);
        assert_eq!(shots(&run, 11, &whole[7..]), [70, 80, 90, 100]);
        assert_eq!(shots(&run, 6, &[Some(0), Some(20), None, Some(70), Some(80)]), [0, 20, 80]);
        assert!(shots(&run, 6, &[]).is_empty());
        // a part that begins between two frames begins with the later one
        assert_eq!(shots_from(&run, 25, 3, &whole[3..]), [30, 60, 100]);
        assert_eq!(shots_from(&run, 30, 3, &whole[3..]), [30, 60, 100]);
        assert_eq!(shots_from(&run, 95, 2, &whole[10..]), [100, 100]);
    }

    #[test]
    fn a_long_profile_keeps_its_extremes_in_their_order() {
        let mut points: Vec<_> = (0..100_000).map(|place: i32| (place as f32, 0.0)).collect();
        (points[777].1, points[778].1, points[99_999].1) = (-2.0, 3.0, 1.0);
        let thin = thinned(points.clone());
        assert!(thin.len() <= 2 * MOST_STRETCHES && thin.is_sorted_by_key(|point| point.0));
        assert!([777, 778, 99_999].iter().all(|place: &usize| thin.contains(&points[*place])));
        assert_eq!(thinned(points[..4096].to_vec()), points[..4096]);
    }
}
