//! States of a damaged file, compared with computed ones.

use super::{MOST_KEPT, Recovery, RecoveryError};
use crate::integrator::Integrator;
use crate::resimulation::{Difference, check_kernel, difference};
use crate::state::ChainState;
use crate::verification::{hash_of, is_affordable};
use recording::{BeginRecord, EndRecord, RecordingWriter};
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::RunManifest;
use std::collections::BTreeMap;

/// Number of recorded states ahead within which the salvager always looks for one without a checksum. The step of such
/// a state may be wrong like the rest of it, so the salvager looks for farther ones only if that costs no more than the
/// steps computed so far.
const NEAR_STATES: u64 = 64;

/// Steps between two questions to the caller about going on, while nothing is written.
const WATCH_STEPS: u64 = 1024;

/// Takes the states of a file in order and writes those that can be saved.
pub(super) struct Salvager<'a> {
    manifest: &'a RunManifest,
    writer: &'a mut RecordingWriter,
    watch: &'a mut dyn FnMut(u64) -> bool,
    /// Number of lost states that are still recomputed.
    fill_left: u64,
    /// The integrator; none for another kernel version, of which nothing is computed.
    integrator: Option<Integrator>,
    /// The last state that is proven, or believed until the next state proves it; none before the first.
    state: Option<ChainState>,
    /// True if the next state has yet to show that the last one was right.
    is_believed: bool,
    /// Step of the first state of the file.
    first_step: u64,
    /// Step from which on states are due, if the last proven one is not written.
    due_from: u64,
    /// State ahead of the last proven one, for states without a checksum.
    probe: Option<ChainState>,
    /// Steps computed with success, less those computed in vain.
    spare_steps: u64,
    /// Frame up to which a further lost range continues the last one.
    lost_until: Option<u64>,
    recovery: Recovery,
}

impl<'a> Salvager<'a> {
    pub(super) fn new(
        manifest: &'a RunManifest,
        begin: &BeginRecord,
        fill_most: u64,
        writer: &'a mut RecordingWriter,
        watch: &'a mut dyn FnMut(u64) -> bool,
    ) -> Self {
        let other_kernel = check_kernel(manifest).err();
        let from_start = other_kernel.is_none() && begin.first_step == 0;
        Self {
            manifest,
            writer,
            watch,
            fill_left: fill_most,
            integrator: other_kernel.is_none().then(|| Integrator::new(&manifest.physics)),
            state: from_start.then(|| ChainState::initial(&manifest.physics)),
            is_believed: false,
            first_step: begin.first_step,
            due_from: begin.first_step,
            probe: None,
            spare_steps: 0,
            lost_until: None,
            recovery: Recovery {
                kept_count: 0,
                kept_after_start_count: 0,
                proven_without_checksum_count: 0,
                recomputed: Vec::new(),
                recomputed_count: 0,
                differences: Vec::new(),
                difference_count: 0,
                unproven_count: 0,
                lost: Vec::new(),
                lost_count: 0,
                others: BTreeMap::new(),
                kept_records: Vec::new(),
                lost_records: Vec::new(),
                damages: Vec::new(),
                damage_count: 0,
                other_kernel,
                last_step: None,
                end: EndReason::Unfinished,
                end_was_read: false,
            },
        }
    }

    /// The writer of messages of other channels.
    pub(super) fn writer(&mut self) -> &mut RecordingWriter {
        self.writer
    }

    /// Takes a state whose checksum holds.
    pub(super) fn take(&mut self, frame: &Frame<'_>) -> Result<(), RecoveryError> {
        if self.integrator.is_none() {
            self.lose_before(frame.step);
            return self.keep(frame);
        }
        if self.is_believed && self.leads_to(frame)? == Some(false) {
            // one of the two is wrong, and this one may have more that follow from it
            if let Some(wrong) = self.state.take() {
                self.differs_from(&wrong, frame);
            }
        }
        self.confirm()?;
        if self.state.is_none() {
            self.state = Some(ChainState::of_frame(frame));
            self.is_believed = true;
            return Ok(());
        }
        self.advance(frame.step, Some(frame))
    }

    /// Takes a state with unknown contents: it counts if it follows from the states before it.
    pub(super) fn take_unchecked(&mut self, frame: &Frame<'_>) -> Result<(), RecoveryError> {
        let is_later =
            self.state.as_ref().is_some_and(|state| state.step < frame.step || self.due_from == frame.step);
        if !is_later {
            return Ok(());
        }
        let cost = self.cost_of(frame.step);
        let near = self.manifest.provenance.record_every_steps.saturating_mul(NEAR_STATES);
        let is_affordable = cost <= near || cost <= self.spare_steps;
        if !is_affordable || self.leads_to(frame)? != Some(true) {
            if is_affordable {
                self.spare_steps = self.spare_steps.saturating_sub(cost);
            }
            self.recovery.unproven_count += 1;
            return Ok(());
        }
        self.confirm()?;
        self.recovery.proven_without_checksum_count += 1;
        self.advance(frame.step, Some(frame))
    }

    /// Number of steps that lead to the state at `step` ahead.
    fn cost_of(&self, step: u64) -> u64 {
        let from = self.start_of(step).map_or(step, |state| state.step);
        step.saturating_sub(from)
    }

    /// The state from which that at `step` is computed ahead: the last one computed ahead, if it is not past `step`.
    fn start_of(&self, step: u64) -> Option<&ChainState> {
        let proven = self.state.as_ref()?;
        let is_between = |probe: &&ChainState| (proven.step..=step).contains(&probe.step);
        self.probe.as_ref().filter(is_between).or(Some(proven))
    }

    /// True if the last proven state leads to `frame`; none if `frame` comes before that state, or there is no proven
    /// state.
    fn leads_to(&mut self, frame: &Frame<'_>) -> Result<Option<bool>, RecoveryError> {
        Ok(self.probed(frame.step)?.map(|probe| difference(probe, frame, None).is_none()))
    }

    /// The state at `step`, computed from the last proven one; none if the proven one comes after `step`.
    fn probed(&mut self, step: u64) -> Result<Option<&ChainState>, RecoveryError> {
        let Some(start) = self.start_of(step).filter(|start| start.step <= step) else { return Ok(None) };
        let is_ahead = self.probe.as_ref().is_some_and(|probe| probe.step == start.step);
        if !is_ahead {
            self.probe = Some(start.clone());
        }
        let (Some(integrator), Some(probe)) = (&mut self.integrator, &mut self.probe) else {
            return Ok(None);
        };
        *integrator = Integrator::new(&self.manifest.physics);
        while probe.step < step {
            // looked at each time that a multiple is reached
            let watched = (probe.step / WATCH_STEPS + 1) * WATCH_STEPS;
            integrator.advance(probe, if watched < step { watched } else { step });
            if probe.step == watched && !(self.watch)(probe.step) {
                return Err(RecoveryError::Stopped);
            }
        }
        *integrator = Integrator::new(&self.manifest.physics);
        Ok(Some(probe))
    }

    /// Writes a first state that was believed, now that another one shows that it is right, or that no other one
    /// comes.
    fn confirm(&mut self) -> Result<(), RecoveryError> {
        if !std::mem::replace(&mut self.is_believed, false) {
            return Ok(());
        }
        let Some(state) = self.state.take() else { return Ok(()) };
        self.lose_before(state.step);
        self.keep(&state.as_frame(self.manifest, self.manifest.frame_at(state.step)))?;
        self.state = Some(state);
        Ok(())
    }

    /// Computes the states up to `step`, where `found` is in the file, and writes those that are due.
    fn advance(&mut self, step: u64, found: Option<&Frame<'_>>) -> Result<(), RecoveryError> {
        let Some(mut state) = self.state.take() else { return Ok(()) };
        self.spare_steps = self.spare_steps.saturating_add(step.saturating_sub(state.step));
        if self.is_nothing_due(state.step, step)
            && let Some(probe) = self.probe.take_if(|probe| probe.step == step)
        {
            state = probe;
            self.integrator = Some(Integrator::new(&self.manifest.physics));
        }
        loop {
            if state.step >= self.due_from {
                let is_found = found.is_some_and(|found| found.step == state.step);
                let frame = state.as_frame(self.manifest, self.manifest.frame_at(state.step));
                let wrong = found.filter(|_| is_found).and_then(|found| difference(&state, found, None));
                if let Some(wrong) = wrong {
                    self.differs(Difference { from_step: self.recovery.last_step, ..wrong });
                }
                if is_found && wrong.is_none() {
                    self.keep(&frame)?;
                } else if self.manifest.is_recorded(state.step) || (found.is_none() && state.step == step) {
                    self.write_recomputed(&frame)?;
                }
            }
            if state.step >= step {
                break;
            }
            if let Some(integrator) = &mut self.integrator {
                integrator.step(&mut state);
            }
            if state.step.is_multiple_of(WATCH_STEPS) && !(self.watch)(state.step) {
                return Err(RecoveryError::Stopped);
            }
        }
        self.state = Some(state);
        Ok(())
    }

    /// True if no state from step `from` on is due before `step`.
    fn is_nothing_due(&self, from: u64, step: u64) -> bool {
        from < self.due_from && self.next_due() >= step
    }

    /// Writes a state of the file.
    fn keep(&mut self, frame: &Frame<'_>) -> Result<(), RecoveryError> {
        self.recovery.kept_count += 1;
        self.recovery.kept_after_start_count += u64::from(frame.step > 0);
        self.write(frame)
    }

    /// Writes a state that is not in the file, or counts it as lost.
    fn write_recomputed(&mut self, frame: &Frame<'_>) -> Result<(), RecoveryError> {
        let Some(left) = self.fill_left.checked_sub(1) else {
            self.lose(frame.frame, Some(frame.frame));
            self.due_from = frame.step + 1;
            return Ok(());
        };
        self.fill_left = left;
        self.recovery.recomputed_count += 1;
        let goes_on = self.recovery.last_step.is_some_and(|step| self.is_recomputed(step));
        let ranges = &mut self.recovery.recomputed;
        if let Some((_, to)) = ranges.last_mut().filter(|_| goes_on) {
            *to = frame.frame;
        } else if ranges.len() < MOST_KEPT {
            ranges.push((frame.frame, frame.frame));
        }
        self.write(frame)
    }

    /// True if the state of `step` is the last of the last range of recomputed ones.
    fn is_recomputed(&self, step: u64) -> bool {
        let last = self.recovery.recomputed.last().map(|(_, to)| *to);
        last == Some(self.manifest.frame_at(step))
    }

    fn write(&mut self, frame: &Frame<'_>) -> Result<(), RecoveryError> {
        self.writer.accept(frame)?;
        self.recovery.last_step = Some(frame.step);
        self.lost_until = None;
        self.due_from = frame.step + 1;
        if (self.watch)(frame.step) { Ok(()) } else { Err(RecoveryError::Stopped) }
    }

    fn lose(&mut self, from: u64, to: Option<u64>) {
        let goes_on = self.lost_until.is_some_and(|until| from <= until);
        let every =
            self.manifest.provenance.record_every_steps / self.manifest.provenance.publish_every_steps;
        self.lost_until = to.map(|to| to + every);
        if let Some((_, last)) = self.recovery.lost.last_mut().filter(|_| goes_on) {
            *last = to;
            return;
        }
        self.recovery.lost_count += 1;
        if self.recovery.lost.len() < MOST_KEPT {
            self.recovery.lost.push((from, to));
        }
    }

    /// Step of the next state that is due: the first of the file, or one of the schedule.
    fn next_due(&self) -> u64 {
        let every = self.manifest.provenance.record_every_steps;
        let last = self.manifest.physics.step_count;
        let scheduled = self.due_from.div_ceil(every).saturating_mul(every);
        match scheduled {
            _ if self.due_from == self.first_step => self.first_step,
            step if step > last => last,
            step => step,
        }
    }

    /// Counts the frames that are due before `step` as lost.
    fn lose_before(&mut self, step: u64) {
        let every = self.manifest.provenance.record_every_steps;
        let first = self.next_due();
        if first >= step {
            return;
        }
        let scheduled = (step - 1) / every * every;
        let last = if scheduled > first { scheduled } else { first };
        self.lose(self.manifest.frame_at(first), Some(self.manifest.frame_at(last)));
    }

    fn differs(&mut self, wrong: Difference) {
        self.recovery.difference_count += 1;
        if self.recovery.differences.len() < MOST_KEPT {
            self.recovery.differences.push(wrong);
        }
    }

    /// Notes that the state `wrong` does not lead to `frame`, and that nothing proves `wrong`.
    fn differs_from(&mut self, wrong: &ChainState, frame: &Frame<'_>) {
        let found = self.probe.take().and_then(|probe| difference(&probe, frame, Some(wrong.step)));
        if let Some(found) = found {
            self.differs(found);
        }
        self.lose_before(wrong.step);
        let number = self.manifest.frame_at(wrong.step);
        self.lose(number, Some(number));
        self.due_from = wrong.step + 1;
    }

    /// Ends after the last state of the file, which ended as `end` says; `loses_tail` if the file had more.
    pub(super) fn finish(
        mut self,
        end: Option<&EndRecord>,
        loses_tail: bool,
    ) -> Result<Recovery, RecoveryError> {
        self.confirm()?;
        let last_step = self.manifest.physics.step_count;
        let said = end.and_then(|end| Some((end.last_step?, end.last_state_hash.as_ref()?)));
        if let Some((step, hash)) = said.filter(|(step, _)| *step >= self.due_from && *step <= last_step) {
            // the hash of the last state proves what is computed up to there
            let due = step.saturating_sub(self.due_from) / self.manifest.provenance.record_every_steps;
            let is_affordable =
                due <= self.fill_left && is_affordable(self.cost_of(step), self.spare_steps, self.manifest);
            let is_proven = is_affordable && self.probed(step)?.is_some_and(|probe| hash_of(probe) == *hash);
            if is_proven {
                self.advance(step, None)?;
            } else {
                let last = self.manifest.frame_at(step);
                let due = self.manifest.frame_at(self.next_due());
                // the last state of a run that was interrupted is due by no schedule
                self.lose(if due < last { due } else { last }, Some(last));
            }
        } else if end.is_none() && loses_tail && self.due_from <= last_step {
            self.lose(self.manifest.frame_at(self.next_due()), None);
        }
        Ok(self.recovery)
    }
}

#[cfg(test)]
mod tests;
