//! The analyses that look at the frames of a point.

use crate::measures::Measures;
use crate::series::SeriesSums;
use analyses::energies::EnergyAnalysis;
use analyses::pulses::PulseAnalysis;
use consumers::analysis::{Analysis, Beginning, LastRow, Number, Settings};
use consumers::energies::Energies;
use consumers::pulses::{Direction, Pulse, Pulses};
use consumers::table::Cell;
use producer::sweep::{MeasureOf, Sweep};
use schemas::frame::{Frame, FrameSink};
use schemas::manifest::RunManifest;
use schemas::summary::Summarizer;
use std::convert::Infallible;

/// The analyses that look at the frames of a point: two in every sweep, and those whose numbers it asks for.
pub(crate) struct PointAnalyses {
    energies: EnergyAnalysis,
    pulses: PulseAnalysis,
    /// Forward and backward.
    pub(crate) leading: [Leading; 2],
    /// The numbers that the sweep asks for beside.
    measures: Measures,
    /// The first step that they look at.
    measure_from: u64,
    /// The columns over time that it asks for.
    series: SeriesSums,
    /// The last state, `[u | v | extra]`, and its step.
    pub(crate) state: Vec<f64>,
    pub(crate) step: u64,
}

impl PointAnalyses {
    /// The analyses that every sweep has.
    const STANDARD: [&str; 2] = ["energies", "pulses"];

    /// Begins to look at the run of `manifest` as a point of `sweep`.
    ///
    /// # Errors
    /// The key of what is asked for in vain, and what is wrong with it.
    pub(crate) fn new(sweep: &Sweep, manifest: &RunManifest) -> Result<Self, (String, String)> {
        let of = |kind: MeasureOf| move |(place, why)| (kind.key(place), why);
        let mut settings = Settings::default();
        if let (Some(bead), Some(setting)) = (sweep.split_bead(), analyses::energies::OFFER.settings.first())
        {
            // a whole number is one
            let _ = settings.set(setting, vec![bead.to_string()]);
        }
        let beginning = Beginning::whole(Self::STANDARD[0], manifest, &settings);
        let leading = |direction| Leading { direction, count: 0, strongest: None };
        Ok(Self {
            energies: EnergyAnalysis::begin(&beginning)
                .map_err(|refusal| ("split_bead".to_owned(), refusal.to_string()))?,
            pulses: PulseAnalysis::new(&beginning),
            leading: [Direction::Forward, Direction::Backward].map(leading),
            measures: Measures::new(sweep.measure(), &Self::STANDARD, manifest)
                .map_err(of(MeasureOf::Summary))?,
            measure_from: manifest.physics.step_at_or_after(sweep.measure_from_s()),
            series: SeriesSums::new(sweep, manifest, &settings).map_err(of(MeasureOf::Rows))?,
            state: Vec::new(),
            step: 0,
        })
    }

    /// The energies so far.
    pub(crate) fn energies(&self) -> &Energies {
        self.energies.energies()
    }

    /// The pulses so far.
    pub(crate) fn pulses(&self) -> &Pulses {
        self.pulses.pulses()
    }

    /// A number of one of [`Self::STANDARD`].
    fn value(&self, analysis: &str, name: &str, word: Option<&str>) -> Option<Number> {
        if analysis == Self::STANDARD[0] {
            self.energies.value(name, word)
        } else {
            self.pulses.value(name, word)
        }
    }

    /// There are no more frames.
    pub(crate) fn finish(&mut self) {
        // it wants no number of frames
        let _ = self.pulses.finish(&mut LastRow::default());
        self.take_pulses();
    }

    fn take_pulses(&mut self) {
        let split_bead = self.energies.energies().split_bead();
        for pulse in self.pulses.ended() {
            self.leading.iter_mut().for_each(|way| way.take(pulse, split_bead));
        }
    }

    /// The values that the sweep asks for, also over time, after [`Self::finish`].
    pub(crate) fn measured(&mut self, manifest: &RunManifest) -> Vec<Cell> {
        let measures = std::mem::take(&mut self.measures);
        let value = |analysis: &str, name: &str, word: Option<&str>| self.value(analysis, name, word);
        measures.finish(&self.last_frame(manifest), value).into_iter().chain(self.series.cells()).collect()
    }

    /// The front of the last state.
    pub(crate) fn front_bead(&self, manifest: &RunManifest) -> u64 {
        Summarizer::new(&manifest.physics).summarize(&self.last_frame(manifest)).front_bead
    }

    fn last_frame(&self, manifest: &RunManifest) -> Frame<'_> {
        let (u_m, rest) = self.state.split_at(manifest.contact_count() + 1);
        let (v_m_s, extra) = rest.split_at(u_m.len());
        let time_s = manifest.physics.time_s(self.step);
        Frame { frame: 0, step: self.step, time_s, u_m, v_m_s, extra, active: None }
    }
}

impl FrameSink for PointAnalyses {
    type Error = Infallible;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
        self.energies.observe(frame, &mut LastRow::default());
        self.pulses.observe(frame, &mut LastRow::default());
        self.take_pulses();
        if frame.step >= self.measure_from {
            self.measures.observe(frame);
        }
        self.series.observe(frame);
        self.step = frame.step;
        self.state.clear();
        for part in [frame.u_m, frame.v_m_s, frame.extra] {
            self.state.extend_from_slice(part);
        }
        Ok(())
    }
}

/// The pulses that leave the split bead in one direction: those that are measured beyond it.
#[derive(Debug, Clone)]
pub(crate) struct Leading {
    pub(crate) direction: Direction,
    pub(crate) count: u64,
    /// The one of the largest peak velocity.
    pub(crate) strongest: Option<Pulse>,
}

impl Leading {
    fn take(&mut self, pulse: &Pulse, split_bead: u64) {
        let bead = pulse.measured.point.bead;
        let is_beyond = match self.direction {
            Direction::Forward => bead > split_bead,
            Direction::Backward => bead < split_bead,
        };
        if pulse.direction != self.direction || !is_beyond {
            return;
        }
        self.count += 1;
        self.strongest = Pulse::stronger(self.strongest, Some(*pulse));
    }
}
