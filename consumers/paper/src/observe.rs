//! Observations of a run.

use super::front::Front;
use super::judgement::{Number, StudyError};
use super::reflection::Reflected;
use super::runs::{FrontBy, Run, Watch};
use consumers::contacts::{Class, ContactCounts, Contacts, default_tolerance_m};
use consumers::deformation::{Deformation, Deformations};
use consumers::follow::FrameObserver;
use consumers::impurity::{Event, EventKind, Followed, Motion};
use consumers::pulses::{Passage, Probes, Pulses};
use consumers::series::Series;
use consumers::space_time::{Extent, Picture};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::summary::Summarizer;
use std::collections::BTreeMap;
use std::convert::Infallible;

/// A leading pulse is stronger than this part of the striker's speed.
const LEADING: f64 = 0.05;

/// A frame that was kept: the whole state at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct KeptFrame {
    /// Time (s).
    pub time_s: f64,
    /// Displacement (m) of each bead.
    pub u_m: Vec<f64>,
    /// Velocity (m/s) of each bead.
    pub v_m_s: Vec<f64>,
    /// Number of contacts in each class.
    pub counts: ContactCounts,
    /// The class of each contact.
    pub classes: Vec<u8>,
}

/// Observations of a run.
#[derive(Debug, Clone)]
pub struct Observed {
    /// The run.
    pub manifest: RunManifest,
    /// The frames asked for.
    pub kept_frames: Vec<KeptFrame>,
    /// The pulses that passed the probes, in the order of arrival.
    pub passages: Vec<Passage>,
    /// The contacts that were compared with theory.
    pub deformations: Vec<Deformation>,
    /// The motion of the first bead followed.
    pub motion: Series<{ Motion::QUANTITIES.len() }>,
    /// Events of the followed beads.
    pub events: Vec<Event>,
    /// The classes of the contacts over space and time.
    pub map: Option<Picture<Class>>,
    /// The largest overlap or gap (m) that counts as touching.
    pub tolerance_m: f64,
    /// The leading pulse in each frame.
    pub fronts: Vec<Front>,
    /// The largest `|E − E0|/E0` of any frame.
    pub max_abs_drift: f64,
}

/// Looks at the frames of one run.
#[derive(Debug)]
pub struct Observer {
    watch: Watch,
    probes: Probes,
    pulses: Pulses,
    deformations: Deformations,
    followed: Followed,
    contacts: Contacts,
    summarizer: Summarizer,
    /// The step at which the map ends.
    map_until: u64,
    seen: Observed,
}

impl Observer {
    /// Makes one for the frames of `run`, whose manifest is `manifest`.
    pub fn new(run: &Run, manifest: &RunManifest) -> Self {
        let tolerance_m = default_tolerance_m(manifest);
        let physics = &manifest.physics;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let map_until = run.watch.map_until_s.map_or(0, |until_s| (until_s / physics.dt_s).round() as u64);
        let map_until = map_until.min(physics.step_count);
        let extent = Extent { places: 0..manifest.contact_count(), steps: 0..=map_until };
        let map = run.watch.map_until_s.map(|_| Picture::new(extent));
        Self {
            probes: Probes::new(manifest, &run.watch.probes),
            pulses: Pulses::new(manifest, LEADING * Pulses::velocity_scale_m_s(manifest)),
            deformations: Deformations::new(manifest, &run.watch.deformed),
            followed: Followed::new(manifest, &run.watch.followed),
            contacts: Contacts::new(manifest, tolerance_m),
            summarizer: Summarizer::new(physics),
            map_until,
            watch: run.watch.clone(),
            seen: Observed {
                manifest: manifest.clone(),
                kept_frames: Vec::new(),
                passages: Vec::new(),
                deformations: Vec::new(),
                motion: Series::default(),
                events: Vec::new(),
                map,
                tolerance_m,
                fronts: Vec::new(),
                max_abs_drift: 0.0,
            },
        }
    }

    /// The observations.
    pub fn finish(mut self) -> Observed {
        self.seen.passages = self.probes.passages();
        self.seen.deformations = self.deformations.results();
        self.seen
    }

    fn keep_due_frame(&mut self, frame: &Frame<'_>) {
        let due = self.watch.kept_frames_s.get(self.seen.kept_frames.len());
        // a time that was asked for and the time of a frame may differ by a rounding
        if due.is_none_or(|due_s| frame.time_s < due_s * (1.0 - 1e-12)) {
            return;
        }
        let classes = self.contacts.observe(frame).to_vec();
        self.seen.kept_frames.push(KeptFrame {
            time_s: frame.time_s,
            u_m: frame.u_m.to_vec(),
            v_m_s: frame.v_m_s.to_vec(),
            counts: ContactCounts::of(&classes),
            classes,
        });
    }
}

impl FrameObserver for Observer {
    type Error = Infallible;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
        self.probes.observe(frame);
        self.deformations.observe(frame);
        if !self.watch.followed.is_empty() {
            let (motions, events) = self.followed.observe(frame);
            self.seen.motion.push(frame.time_s, motions[0].values());
            self.seen.events.extend_from_slice(events);
        }
        if let Some(map) = self.seen.map.as_mut().filter(|_| frame.step <= self.map_until) {
            map.push(frame.step, self.contacts.observe(frame).iter().map(|class| Class(*class)));
        }
        match self.watch.front {
            FrontBy::Nothing => {}
            FrontBy::Space => self.seen.fronts.extend(Front::in_space(frame)),
            FrontBy::Time => {
                let happenings = self.pulses.observe(frame);
                self.seen.fronts.extend(happenings.iter().filter_map(Front::in_time));
            }
        }
        let drift = self.summarizer.summarize(frame).relative_drift.abs();
        self.seen.max_abs_drift = self.seen.max_abs_drift.max(drift);
        self.keep_due_frame(frame);
        Ok(())
    }

    fn gap(&mut self) {
        self.probes.gap();
        self.pulses.gap();
        self.deformations.gap();
        self.followed.gap();
    }
}

/// Observations of all runs.
#[derive(Debug, Default)]
pub struct Observations {
    runs: BTreeMap<String, Observed>,
    reflected: Vec<Reflected>,
}

impl Observations {
    /// Adds the observations of a run.
    pub fn insert(&mut self, run: &Run, observed: Observed) {
        self.runs.insert(run.name().to_owned(), observed);
    }

    /// Adds the points of the sweep of [`super::reflection_sweep`].
    pub fn insert_reflected(&mut self, points: Vec<Reflected>) {
        self.reflected = points;
    }

    /// The points of that sweep.
    pub fn reflected(&self) -> &[Reflected] {
        &self.reflected
    }

    /// The observations of `run`.
    ///
    /// # Errors
    /// When it was not observed.
    pub fn of(&self, run: &Run) -> Result<&Observed, StudyError> {
        self.runs.get(run.name()).ok_or_else(|| StudyError::NotObserved { run: run.name().to_owned() })
    }

    /// Something of `run`, and of its partner with twice the step.
    pub(super) fn both<T>(
        &self,
        run: &Run,
        of: impl Fn(&Observed) -> Result<T, StudyError>,
    ) -> Result<(T, T), StudyError> {
        Ok((of(self.of(run)?)?, of(self.of(&run.clone().with_step_times(2))?)?))
    }

    /// The events of a kind in `run`, with the same ones in its partner with twice the step.
    pub(super) fn events(&self, run: &Run, kind: EventKind) -> Result<Vec<(Event, Event)>, StudyError> {
        let of_kind = |seen: &Observed| -> Result<Vec<Event>, StudyError> {
            Ok(seen.events.iter().filter(|event| event.kind == kind).copied().collect())
        };
        let (fine, coarse) = self.both(run, of_kind)?;
        Ok(fine.into_iter().zip(coarse).collect())
    }

    /// A quantity of `run`, by [`Number::stepped`].
    pub(super) fn stepped(
        &self,
        run: &Run,
        what: impl Into<String>,
        unit: &'static str,
        of: impl Fn(&Observed) -> Result<f64, StudyError>,
    ) -> Result<Number, StudyError> {
        Ok(Number::stepped(what, self.both(run, of)?, unit, self.of(run)?.max_abs_drift))
    }
}

impl Observed {
    /// The kept frame number `index`.
    pub(super) fn kept_frame(&self, index: usize) -> Result<&KeptFrame, StudyError> {
        self.kept_frames.get(index).ok_or_else(|| self.absent(format!("kept frame {index}")))
    }

    /// The leading pulse in the first frame in which it is at `bead` or beyond.
    pub(super) fn front_at(&self, bead: f64) -> Result<Front, StudyError> {
        let front = self.fronts.iter().find(|front| front.bead >= bead);
        front.copied().ok_or_else(|| self.absent(format!("pulse at bead {bead}")))
    }

    /// The error that something does not occur in this run.
    pub(super) fn absent(&self, what: impl Into<String>) -> StudyError {
        StudyError::absent(self.manifest.provenance.name.as_str(), what)
    }

    /// The first pulse that passed `bead` on its way to the end of the chain.
    pub(super) fn first_pulse_past(&self, bead: u64) -> Result<Passage, StudyError> {
        let first = self.pulses_past(bead, true).into_iter().next();
        first.ok_or_else(|| self.absent(format!("pulse at bead {bead}")))
    }

    /// The pulses that passed `bead` in one direction, in the order of arrival.
    pub(super) fn pulses_past(&self, bead: u64, forward: bool) -> Vec<Passage> {
        let same = |passage: &&Passage| passage.bead == bead && (passage.v_peak_m_s > 0.0) == forward;
        self.passages.iter().filter(same).copied().collect()
    }
}
