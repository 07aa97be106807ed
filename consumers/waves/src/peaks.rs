//! The peaks of a force over time.

use schemas::manifest::Physics;
use serde::Serialize;

/// A peak of a force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Peak {
    /// Time of its highest force (s), by a parabola through the three samples around.
    pub time_s: f64,
    /// Its height above the force at rest (N).
    pub force_n: f64,
    /// Its full width at half of its height (s), from where the force was last below half before it; none where the run begins or
    /// ends within it, or half is below the threshold.
    pub width_s: Option<f64>,
    /// Time for which the force was above the threshold around it (s); peaks share it if the force does not fall below the
    /// threshold between them.
    pub above_s: Option<f64>,
}

type Sample = (f64, f64);

/// Finds peaks in samples as they come. Two maxima are two peaks if the force falls below half of the lower one between
/// them. Where the samples begin in a falling force, or end in a rising one, there is none: its top is not among them.
#[derive(Debug, Clone)]
pub struct Peaks {
    threshold_n: f64,
    last: Option<Sample>,
    before: Option<Sample>,
    state: State,
    /// Time (s) at which the force rose above the threshold, if that was seen.
    rose_s: Option<f64>,
    is_above: bool,
    /// Peaks whose time above the threshold is not known yet.
    open: Vec<Peak>,
    found: Vec<Peak>,
}

#[derive(Debug, Clone)]
enum State {
    /// Below the threshold, or in a valley: the least force since the last peak, and the samples from there on.
    Low { least_n: f64, rise: Vec<Sample> },
    /// On a peak: the samples up to the highest, from the last one below half of it on, and those after it.
    Peak { highest: Sample, around: [Option<Sample>; 2], rise: Vec<Sample>, later: Vec<Sample> },
}

impl Peaks {
    /// Peaks that wait for the time above the threshold around them; if there are more, they have none.
    const MOST: usize = 10_000;
    /// Samples of a rise that are kept; of more each second one, again and again.
    const RISE: usize = 4096;

    /// The least height (N) of a peak unless another is asked for: a hundredth of the run's scale of forces m·L/T². None where
    /// nothing strikes and nothing is loaded, which has no such scale.
    pub fn default_threshold_n(physics: &Physics) -> Option<f64> {
        let scales = physics.scales();
        let scale_n = physics.bead_mass_kg * scales.length_m / (scales.time_s * scales.time_s);
        (scale_n.is_finite() && scale_n > 0.0).then_some(1e-2 * scale_n)
    }

    /// Peaks above `threshold_n` (N).
    pub fn new(threshold_n: f64) -> Self {
        Self {
            threshold_n,
            last: None,
            before: None,
            state: State::BEGUN,
            rose_s: None,
            is_above: false,
            open: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Looks at the next sample: a force above that at rest (N).
    pub fn push(&mut self, time_s: f64, force_n: f64) {
        let sample = (time_s, force_n);
        let now_above = force_n > self.threshold_n;
        if now_above && !self.is_above {
            self.rose_s = self.last.map(|last| crossing_s(last, sample, self.threshold_n));
        }
        self.advance(sample, now_above);
        if !now_above && self.is_above {
            let fell_s = self.last.map(|last| crossing_s(last, sample, self.threshold_n));
            self.close(fell_s);
        }
        self.is_above = now_above;
        self.before = self.last.replace(sample);
    }

    /// Samples are missing, or there are no more: widths across the gap are not known.
    pub fn gap(&mut self) {
        if let State::Peak { highest, around: [Some(before), Some(after)], rise, .. } = &self.state {
            let peak = peak_of([*before, *highest, *after], rise, None);
            self.open.push(peak);
        }
        self.close(None);
        (self.last, self.before, self.is_above) = (None, None, false);
        self.state = State::BEGUN;
    }

    /// The peaks since they were last taken, those alone that are wholly known.
    pub fn take(&mut self) -> std::vec::Drain<'_, Peak> {
        self.found.drain(..)
    }

    fn advance(&mut self, sample: Sample, now_above: bool) {
        let force_n = sample.1;
        match &mut self.state {
            State::Low { least_n, rise } => {
                if force_n <= *least_n || !now_above {
                    rise.clear();
                }
                *least_n = if force_n < *least_n { force_n } else { *least_n };
                rise.push(sample);
                thin(rise);
                if now_above && force_n >= 2.0 * *least_n {
                    let (around, rise, later) = ([self.last, None], std::mem::take(rise), Vec::new());
                    self.state = State::Peak { highest: sample, around, rise, later };
                }
            }
            State::Peak { highest, around, rise, later } => {
                if force_n > highest.1 {
                    *around = [self.last, None];
                    *highest = sample;
                    rise.append(later);
                    rise.push(sample);
                    // what lies below half of the height is not needed, but for the last of it
                    let needed = rise.iter().rposition(|(_, force)| *force <= 0.5 * force_n).unwrap_or(0);
                    rise.drain(..needed);
                    thin(rise);
                    return;
                }
                let after = *around[1].get_or_insert(sample);
                if force_n >= 0.5 * highest.1 && now_above {
                    later.push(sample);
                    thin(later);
                    return;
                }
                // what falls from the first sample on may have been higher before
                if let Some(before) = around[0] {
                    let fell = self.last.map(|last| (last, sample));
                    self.open.push(peak_of([before, *highest, after], rise, fell));
                }
                self.state = State::Low { least_n: force_n, rise: vec![sample] };
                if self.open.len() > Self::MOST {
                    self.close(None);
                }
            }
        }
    }

    fn close(&mut self, fell_s: Option<f64>) {
        let above_s = fell_s.zip(self.rose_s.take()).map(|(fell_s, rose_s)| fell_s - rose_s);
        self.found.extend(self.open.drain(..).map(|peak| Peak { above_s, ..peak }));
    }
}

impl State {
    /// That before the first sample.
    const BEGUN: Self = Self::Low { least_n: 0.0, rise: Vec::new() };
}

/// Leaves each second one of too many samples.
fn thin(samples: &mut Vec<Sample>) {
    if samples.len() > Peaks::RISE {
        let mut stays = [true, false].into_iter().cycle();
        samples.retain(|_| stays.next() == Some(true));
    }
}

/// Time (s) at which the line between two samples has the value `force_n`.
fn crossing_s(from: Sample, to: Sample, force_n: f64) -> f64 {
    let part = (force_n - from.1) / (to.1 - from.1);
    from.0 + part.clamp(0.0, 1.0) * (to.0 - from.0)
}

/// The peak at the highest sample, between its neighbours; `fell` are the samples between which it fell below half of it.
fn peak_of([before, highest, after]: [Sample; 3], rise: &[Sample], fell: Option<(Sample, Sample)>) -> Peak {
    let (time_s, force_n) = top(before, highest, after);
    let half_n = 0.5 * force_n;
    let rose_s = rise.windows(2).rev().find_map(|pair| {
        (pair[0].1 <= half_n && pair[1].1 > half_n).then(|| crossing_s(pair[0], pair[1], half_n))
    });
    let fell_s = fell.filter(|(_, to)| to.1 <= half_n).map(|(from, to)| crossing_s(from, to, half_n));
    let width_s = fell_s.zip(rose_s).map(|(fell_s, rose_s)| fell_s - rose_s);
    Peak { time_s, force_n, width_s, above_s: None }
}

/// The top of the parabola through three samples, of which the middle one is the highest.
fn top(before: Sample, highest: Sample, after: Sample) -> Sample {
    let (left_s, right_s) = (highest.0 - before.0, after.0 - highest.0);
    let (left, right) = ((highest.1 - before.1) / left_s, (after.1 - highest.1) / right_s);
    let bend = (left - right) / (left_s + right_s);
    if bend.is_nan() || bend <= 0.0 {
        return highest;
    }
    // the slope at the middle sample
    let slope = (left * right_s + right * left_s) / (left_s + right_s);
    (highest.0 + slope / (2.0 * bend), highest.1 + slope * slope / (4.0 * bend))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn found(threshold_n: f64, force: impl Fn(f64) -> f64, count: u32) -> Vec<Peak> {
        let mut peaks = Peaks::new(threshold_n);
        (0..count).for_each(|i| peaks.push(f64::from(i) * 1e-3, force(f64::from(i) * 1e-3)));
        ended(peaks)
    }

    fn ended(mut peaks: Peaks) -> Vec<Peak> {
        peaks.gap();
        peaks.take().collect()
    }

    /// sin² has the width of half of its length at half of its height; samples are 1e-3 apart, and lines between them
    /// are off by (1e-3)²·π²/4.
    #[test]
    fn a_peak_has_its_time_height_and_width() {
        let force = |t: f64| if t < 1.0 { 5.0 * (PI * (t - 0.0003)).sin().powi(2) } else { 0.0 };
        let peaks = found(0.5, force, 1500);
        let [peak] = peaks[..] else { panic!("{peaks:?}") };
        assert!((peak.time_s - 0.5003).abs() < 1e-6 && (peak.force_n - 5.0).abs() < 1e-9, "{peak:?}");
        assert!((peak.width_s.expect("a width") - 0.5).abs() < 1e-5, "{peak:?}");
        let above = 1.0 - 2.0 / PI * 0.1_f64.sqrt().asin();
        assert!((peak.above_s.expect("a time") - above).abs() < 1e-5, "{peak:?} {above}");
    }

    #[test]
    fn peaks_are_parted_by_half_of_their_height() {
        // 1 + cos falls to 0 between, 1.5 + cos to a fifth, 4 + cos to three fifths
        for (least, expected) in [(1.0, 3), (1.5, 3), (4.0, 1)] {
            let peaks = found(0.1, |t| least - (2.0 * PI * t).cos(), 3000);
            assert_eq!(peaks.len(), expected, "{least}: {peaks:?}");
            // where the force stays above the threshold, nobody knows for how long
            assert_eq!(peaks[0].above_s.is_some(), least == 1.0);
        }
    }

    #[test]
    fn what_is_cut_off_has_no_width() {
        let peaks = found(0.1, |t| (PI * (t + 0.4)).sin().max(0.0), 700);
        let [peak] = peaks[..] else { panic!("{peaks:?}") };
        assert!(peak.width_s.is_none() && (peak.time_s - 0.1).abs() < 1e-6);
        // a top before the first sample, or behind the last one or a gap
        assert!(found(0.1, |t| (PI * (t + 0.6)).sin().max(0.0), 700).is_empty());
        assert!(found(0.1, |t| (PI * (t + 0.6)).sin().max(0.0), 100).is_empty());
        assert!(found(0.1, |t| (PI * t).sin(), 400).is_empty());
        let mut peaks = Peaks::new(0.1);
        peaks.push(0.0, 0.0);
        peaks.push(1.0, 1.0);
        peaks.gap();
        peaks.push(5.0, 0.8);
        peaks.push(6.0, 0.0);
        assert_eq!(ended(peaks), []);
    }

    /// 2 − cos has valleys of 1 between peaks of 3: half is passed a sixth of a period from a valley, where the force has not doubled yet.
    #[test]
    fn half_of_a_peak_may_lie_little_above_the_valley_before() {
        let peaks = found(0.1, |t| 2.0 - (2.0 * PI * t).cos(), 2000);
        assert_eq!(peaks.len(), 2, "{peaks:?}");
        for peak in peaks {
            assert!((peak.width_s.expect("a width") - 2.0 / 3.0).abs() < 1e-5, "{peak:?}");
        }
    }

    /// A dip on the rise: half is passed between the samples beside each other at which that last happens.
    #[test]
    fn a_width_is_that_around_the_top() {
        let mut peaks = Peaks::new(0.1);
        let samples = [0.0, 1.0, 0.6, 0.9, 1.2, 2.3, 0.2];
        samples.iter().zip(0_i32..).for_each(|(force_n, time)| peaks.push(f64::from(time), *force_n));
        let peaks = ended(peaks);
        let [peak] = peaks[..] else { panic!("{peaks:?}") };
        let half_n = 0.5 * peak.force_n;
        assert!((0.9..1.2).contains(&half_n), "{peak:?}");
        let expected = 5.0 + (2.3 - half_n) / 2.1 - (3.0 + (half_n - 0.9) / 0.3);
        assert!((peak.width_s.expect("a width") - expected).abs() < 1e-12, "{peak:?}");
    }
}
