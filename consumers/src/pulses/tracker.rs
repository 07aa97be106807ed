//! Crests become tracks, tracks become pulses.

use super::control::Control;
use super::crest::{Crest, ENOUGH_FRAMES, FEWEST_FRAMES};
use super::edges::Edges;
use super::found::{Counts, Happening, UnderWay, Unfollowed};
use super::heads::Heads;
use super::lead::Lead;
use super::passing;
use super::sight::Sight;
use super::surroundings::Surroundings;
use super::track::{FAR, Passed, REACH, Shape, Track};
use super::{Birth, Fate, Pulse, nearest, signed};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use std::mem;
use std::ops::Range;
use std::sync::Arc;

/// Finds the pulses in the frames of one run, and follows them.
#[derive(Debug, Clone)]
pub struct Pulses {
    around: Arc<Surroundings>,
    threshold_m_s: f64,
    sight: Sight,
    crests: Vec<(usize, Crest)>,
    own_crests: Vec<(usize, Crest)>,
    tracks: Vec<Track>,
    heads: Heads,
    /// Indices of the tracks near a crest, in their order.
    near: Vec<usize>,
    happenings: Vec<Happening>,
    /// None where only a part of the chain is looked at.
    control: Option<Control>,
    unfollowed: Vec<Unfollowed>,
    counts: Counts,
    last_step: Option<u64>,
    lead: Lead,
    /// A pulse has run into the left, and into the right end.
    met_ends: [bool; 2],
    /// Time (s) at which the frames began, or began again, and whether the chain had moved before.
    resumed: Option<(f64, bool)>,
    /// Room for velocities (m/s) less that of most beads.
    relative_m_s: Vec<f64>,
}

impl Pulses {
    /// Beads that a crest has to pass, one after the other, to count as a pulse.
    pub const SHORTEST_TRACK: u64 = 5;
    /// Beads that a clear pulse passes.
    pub const CLEAR_TRACK: u64 = 2 * Self::SHORTEST_TRACK;
    /// The speed at a bead is measured between those this far before and behind it.
    pub const REACH: u64 = REACH as u64;
    /// The threshold unless another is asked for, relative to [`Pulses::velocity_scale_m_s`].
    pub const DEFAULT_THRESHOLD: f64 = 1e-3;

    /// Looks for pulses in `manifest`'s run whose beads move faster than `threshold_m_s` (m/s).
    pub fn new(manifest: &RunManifest, threshold_m_s: f64) -> Self {
        let around = Arc::new(Surroundings::of(manifest));
        let bead_count = around.chain.bead_count();
        let control = Control::new(bead_count, threshold_m_s);
        Self { control: Some(control), ..Self::among(around, threshold_m_s, 0..bead_count) }
    }

    /// The same for the pulses among some beads, with nothing to control them.
    pub(super) fn among(around: Arc<Surroundings>, threshold_m_s: f64, beads: Range<usize>) -> Self {
        Self {
            threshold_m_s,
            sight: Sight::new(&around, beads),
            around,
            crests: Vec::new(),
            own_crests: Vec::new(),
            tracks: Vec::new(),
            heads: Heads::default(),
            near: Vec::new(),
            happenings: Vec::new(),
            control: None,
            unfollowed: Vec::new(),
            counts: Counts::default(),
            last_step: None,
            lead: Lead::default(),
            met_ends: [false; 2],
            resumed: None,
            relative_m_s: Vec::new(),
        }
    }

    /// Unit of the velocities of a run (m/s): L/T, the speed of a striker.
    pub fn velocity_scale_m_s(manifest: &RunManifest) -> f64 {
        manifest.physics.scales().speed_m_s()
    }

    /// Largest interval of frames, in steps, that shows a pulse of [`Pulses::velocity_scale_m_s`] to 1e-4: eight frames
    /// in the time that it takes to pass the bead that it passes fastest, by its full width at half maximum. On a load
    /// it is sound that passes. None if there is neither a solitary wave nor a load.
    pub fn longest_fine_interval_steps(manifest: &RunManifest) -> Option<u64> {
        Self::interval_steps(manifest, ENOUGH_FRAMES)
    }

    /// Largest interval of frames, in steps, that shows that pulse at all: three frames in that time.
    pub fn longest_interval_steps(manifest: &RunManifest) -> Option<u64> {
        Self::interval_steps(manifest, FEWEST_FRAMES)
    }

    fn interval_steps(manifest: &RunManifest, frames: f64) -> Option<u64> {
        let physics = &manifest.physics;
        let passing_s = passing::shortest_s(physics, Self::velocity_scale_m_s(manifest))?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let steps = (passing_s / (frames * physics.dt_s)) as u64;
        Some(steps.max(1))
    }

    /// Looks at the next frame.
    pub fn observe(&mut self, frame: &Frame<'_>) -> &[Happening] {
        let drift_m_s = self.drift_m_s();
        if drift_m_s == 0.0 {
            self.look(frame);
        } else {
            let mut v_m_s = mem::take(&mut self.relative_m_s);
            v_m_s.clear();
            v_m_s.extend(frame.v_m_s.iter().map(|v| v - drift_m_s));
            self.look(&Frame { v_m_s: &v_m_s, active: None, ..*frame });
            self.relative_m_s = v_m_s;
        }
        &self.happenings
    }

    /// The velocity (m/s) that all velocities, momenta and energies count from: the one that more than half of the beads
    /// begin with, 0 if there is none.
    pub fn drift_m_s(&self) -> f64 {
        self.around.drift_m_s
    }

    fn look(&mut self, frame: &Frame<'_>) {
        self.happenings.clear();
        if let Some(last) = self.last_step.replace(frame.step) {
            let interval = frame.step.saturating_sub(last);
            let longest = &mut self.counts.longest_interval_steps;
            *longest = interval.max(*longest);
        }
        self.resumed.get_or_insert((frame.time_s, frame.step > 0));
        self.sight.push(&self.around, frame);
        if let Some(control) = &mut self.control {
            control.observe(&self.around, frame, &self.sight.history, &self.tracks);
        }
        if self.sight.history.is_full() {
            self.find_crests(frame);
            self.find_positions();
            self.hear_rattles();
            for track in &mut self.tracks {
                let head = track.head().bead;
                if let Some(edges) = &mut track.edges {
                    edges.advance(&self.sight.history, head);
                }
            }
            for i in 0..self.crests.len() {
                let (bead, crest) = self.crests[i];
                self.follow(frame, signed(bead as u64), &crest);
            }
            self.close(false);
        }
        self.explain();
    }

    /// Frames are missing: no crest is interpolated across the gap. Pulses are taken up again where they would
    /// be, if it was short.
    pub fn gap(&mut self) {
        self.sight.clear();
        if let Some(control) = &mut self.control {
            control.gap();
        }
        self.last_step = None;
        self.resumed = None;
        for track in &mut self.tracks {
            track.gap = true;
            track.edges = None;
        }
    }

    /// There are no more frames: pulses under way end here.
    pub fn finish(&mut self) -> &[Happening] {
        self.happenings.clear();
        self.tracks.sort_by_key(|track| track.number);
        self.heads.renumber(&self.tracks);
        self.find_positions();
        self.close(true);
        self.explain();
        if let Some(control) = &mut self.control {
            self.unfollowed = control.unfollowed(&self.around);
            self.counts.unfollowed = self.unfollowed.len() as u64;
        }
        &self.happenings
    }

    /// Disturbances that are in no pulse: first those that led a front, then the strongest; known at the end.
    pub fn unfollowed(&self) -> &[Unfollowed] {
        &self.unfollowed
    }

    /// Tells the control which pulses have passed.
    fn explain(&mut self) {
        let Some(control) = &mut self.control else { return };
        for happening in &self.happenings {
            if let Happening::Passed(point) = happening {
                control.explain(point, self.around.longest_step_s(signed(point.bead), point.v_peak_m_s));
            }
        }
    }

    /// The pulses under way at `time_s`, the time of the last frame, in no order.
    pub fn under_way(&self, time_s: f64) -> impl Iterator<Item = UnderWay> {
        self.tracks.iter().filter(|track| track.number > 0).map(move |track| UnderWay {
            number: track.number,
            position_beads: track.position_beads(time_s),
            v_peak_m_s: track.head().v_peak_m_s,
            velocity_beads_per_s: track.speed_beads_per_s().unwrap_or_default() * track.ahead as f64,
            fwhm_beads: track.head().shape.map(|shape| shape.fwhm_beads),
        })
    }

    /// Counts so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Listens to single beads while a pulse passes them that is followed by the mean of several.
    fn hear_rattles(&mut self) {
        self.sight.own_crests(&self.around, self.threshold_m_s, &mut self.own_crests);
        for (bead, crest) in &self.own_crests {
            let bead = signed(*bead as u64);
            let around_m_s = self.sight.history.at(2, bead).unwrap_or_default();
            for i in self.heads.around(bead..=bead) {
                self.tracks[i].rattle(bead, crest.v_m_s, around_m_s);
            }
        }
    }

    /// The crests in the middle frame of the history, in the order of their times.
    fn find_crests(&mut self, frame: &Frame<'_>) {
        let Self { around, sight, crests, counts, .. } = self;
        sight.crests(around, frame, self.threshold_m_s, crests);
        crests.retain(|(_, crest)| {
            counts.coarse_crests += u64::from(crest.frames < ENOUGH_FRAMES);
            counts.unresolved_crests += u64::from(crest.frames < FEWEST_FRAMES);
            crest.frames >= FEWEST_FRAMES
        });
        crests.sort_by(|(_, a), (_, b)| a.time_s.total_cmp(&b.time_s));
    }

    /// Gives the heads the times for which positions will be asked: those of the crests and of the middle frame.
    fn find_positions(&mut self) {
        let now_s = self.sight.history.time_s(2);
        let time_s = |crest: Option<&(usize, Crest)>| crest.map_or(now_s, |(_, crest)| crest.time_s);
        let times_s = [now_s.min(time_s(self.crests.first())), now_s.max(time_s(self.crests.last()))];
        self.heads.look(&self.tracks, times_s);
    }

    /// Adds a crest to the track that it fits best, or begins one.
    fn follow(&mut self, frame: &Frame<'_>, bead: i64, crest: &Crest) {
        let longest_s = self.around.longest_step_s(bead, crest.v_m_s);
        let ahead = if self.around.pulls {
            0
        } else if crest.v_m_s > 0.0 {
            1
        } else {
            -1
        };
        let wait_s = self.around.longest_wait_s(bead, crest.v_m_s);
        let coast = self.around.coast(bead);
        let fits = self.heads.at(bead - coast..=bead + coast).filter_map(|i| {
            let track = &self.tracks[i];
            let same = track.sign == crest.v_m_s.signum();
            let free = same && !self.around.obstacles.between(track.head().bead, bead);
            let fit = || track.fit_beads((bead, crest.time_s, crest.v_m_s), coast, [longest_s, wait_s]);
            free.then(fit).flatten().map(|fit| (i, fit))
        });
        // of tracks that it fits alike the one that began first
        let best = fits.min_by(|(i, a), (j, b)| a.total_cmp(b).then(i.cmp(j))).map(|(i, _)| i);
        let (time_s, crest_m_s) = (crest.time_s, crest.v_m_s);
        let mut passed = self.passed(frame, bead, crest);
        let best = match best.filter(|i| self.tracks[*i].number > 0) {
            None if self.around.texture.is_some() => {
                let near = self.heads.at(bead - FAR..=bead + FAR).map(|i| (i, &self.tracks[i]));
                let leading = self.lead.find(&self.around, near, (bead, crest.time_s), crest_m_s);
                if leading.is_none() {
                    self.near.clear();
                    self.near.extend(self.heads.around(bead..=bead));
                    self.near.sort_unstable();
                    if self.near.iter().any(|i| self.tracks[*i].pass_late(passed)) {
                        return;
                    }
                }
                leading.or(best)
            }
            _ => best,
        };
        let Some(i) = best else {
            let birth = self.birth((bead, ahead), crest);
            let track = Track::new(passed, ahead, birth);
            self.heads.add(self.tracks.len(), &track);
            self.tracks.push(track);
            return;
        };
        let several = self.encloses_another(i, time_s);
        passed.shape = if several { None } else { self.shape(i, bead, time_s) };
        passed.free = self.around.is_free(frame, &self.tracks[i], bead, crest_m_s);
        let uneven = self.around.is_uneven(usize::try_from(bead).unwrap_or_default());
        let track = &mut self.tracks[i];
        self.heads.remove(i, track);
        track.pass(passed);
        // from a light bead to a heavy one the crest changes more than from one heavy bead to the next
        let crest_m_s = if uneven { track.mean_crest_m_s() } else { crest_m_s };
        if track.number == 0 && track.bead_count >= Self::SHORTEST_TRACK {
            self.counts.pulses += 1;
            track.number = self.counts.pulses;
        }
        self.heads.add(i, track);
        if track.number > 0 {
            self.lead.goes_on(track);
            let way = (track.sign, track.ahead);
            match &mut track.edges {
                Some(edges) => edges.renew(&self.sight.history, bead, crest_m_s, several),
                none => *none = Some(Edges::around(&self.sight.history, bead, way, 0.5 * crest_m_s.abs())),
            }
            while let Some(point) = track.next_point(false) {
                self.happenings.push(Happening::Passed(point));
            }
        }
    }

    /// A crest passes `bead`.
    fn passed(&self, frame: &Frame<'_>, bead: i64, crest: &Crest) -> Passed {
        let (momentum_kg_m_s, energy_j) =
            self.around.hump(&self.sight.history, frame, bead, crest.v_m_s.signum());
        let number = usize::try_from(bead).unwrap_or_default();
        Passed {
            bead,
            time_s: crest.time_s,
            crest_m_s: crest.v_m_s,
            v_peak_m_s: self.sight.own_velocity_m_s(&self.around, number, crest),
            shape: None,
            momentum_kg_m_s,
            energy_j,
            free: false,
            carries: self.around.carries(number),
            clear: crest.v_m_s.abs() >= 2.0 * self.threshold_m_s,
        }
    }

    /// The shape of a track whose crest passes `bead`.
    fn shape(&self, track: usize, bead: i64, time_s: f64) -> Option<Shape> {
        let track = &self.tracks[track];
        let speed = track.speed_beads_per_s()?;
        let [front, rear] = track.edges?.half_widths_beads(bead, time_s, speed)?;
        Some(Shape { fwhm_beads: front + rear, asymmetry: (rear - front) / (rear + front) })
    }

    /// True if the crest of another pulse lies between the edges of a track.
    fn encloses_another(&self, track: usize, time_s: f64) -> bool {
        let Some(edges) = self.tracks[track].edges else { return false };
        let [low, high] = edges.beads();
        let others = self.heads.around(low..=high).filter(|i| *i != track).map(|i| &self.tracks[i]);
        others
            .filter(|other| other.number > 0)
            .any(|other| edges.enclose(nearest(other.position_beads(time_s))))
    }

    /// The origin of a crest that begins a track at `bead`, in the direction `ahead`, or 0 where that is not known.
    fn birth(&self, (bead, ahead): (i64, i64), crest: &Crest) -> Birth {
        let around = &self.around;
        let near = around.reach.origin;
        let to_obstacle = |sign| around.obstacles.ahead(bead, sign);
        let (left, right) = (to_obstacle(-1), to_obstacle(1));
        let close = |track: &&Track| {
            track.number > 0 && (track.position_beads(crest.time_s) - bead as f64).abs() <= near as f64
        };
        let opposite = |track: &Track| track.sign != crest.v_m_s.signum();
        let around_it = self.heads.around(bead - near..=bead + near).map(|i| &self.tracks[i]);
        let neighbour = around_it.filter(close).map(opposite).max();
        let resumed = self.resumed.is_some_and(|(since_s, moving)| {
            moving && crest.time_s - since_s < around.longest_step_s(bead, crest.v_m_s)
        });
        if resumed {
            return Birth::UnderWay;
        }
        if let Some(maker) = around.origins.maker(bead, near, self.come_back(near)) {
            return maker;
        }
        let reached = |place: i64| self.has_moved(place, crest.v_m_s);
        let from_obstacle = |((distance, is_obstacle), outward): ((i64, bool), i64)| {
            // the obstacle itself may be too heavy to move; the bead before it is not
            is_obstacle && distance <= near && reached(bead + outward * (distance - 1))
        };
        // a ring goes on beyond its seam: what runs towards that does not come from it
        let from_end = |((distance, is_obstacle), outward): ((i64, bool), i64)| {
            let birth = around.origins.birth_at(outward < 0);
            let can_be = !is_obstacle && distance <= near && (birth != Birth::Seam || ahead != outward);
            (can_be && reached(bead + outward * distance)).then_some(birth)
        };
        let sides = [(left, -1), (right, 1)];
        if sides.into_iter().any(from_obstacle) {
            return Birth::Impurity;
        }
        sides.into_iter().find_map(from_end).unwrap_or_else(|| {
            neighbour.map_or(Birth::Chain, |opposite| if opposite { Birth::Collision } else { Birth::Split })
        })
    }

    /// True if `bead` has moved by the time of a crest of `v_m_s` (m/s): nothing comes from a place that nothing has reached.
    fn has_moved(&self, bead: i64, v_m_s: f64) -> bool {
        /// Part of the crest's speed. The tails of a pulse are weaker four beads ahead of it, and a bead beside a wall is no
        /// slower in any but long waves.
        const REACHED: f64 = 0.01;
        self.control.as_ref().is_none_or(|control| control.largest_m_s(bead) >= REACHED * v_m_s.abs())
    }

    /// True where a pulse has come within `near` beads of the left, and of the right end, on its way there. In a ring what runs into one
    /// end comes back at the other.
    fn come_back(&self, near: i64) -> [bool; 2] {
        let ends = if self.around.chain.is_ring { [(1, 1), (0, -1)] } else { [(0, -1), (1, 1)] };
        ends.map(|(side, ahead)| {
            let arrives = |track: &Track| {
                let (distance, is_obstacle) = self.around.obstacles.ahead(track.head().bead, ahead);
                track.number > 0 && track.ahead == ahead && !is_obstacle && distance <= near
            };
            let last = signed(self.around.chain.bead_count() as u64) - 1;
            let beads = if ahead < 0 { 0..=near } else { last - near..=last };
            self.met_ends[side] || self.heads.at(beads).any(|i| arrives(&self.tracks[i]))
        })
    }

    /// Ends the tracks that have not gone on for too long; with `all` every one.
    fn close(&mut self, all: bool) {
        let now_s = self.sight.history.time_s(2);
        let is_lost = |track: &Track| all || self.is_lost(track, now_s);
        if !self.tracks.iter().any(is_lost) {
            return;
        }
        let lost: Vec<bool> = self.tracks.iter().map(is_lost).collect();
        for i in (0..lost.len()).filter(|i| lost[*i]) {
            self.heads.remove(i, &self.tracks[i]);
            if self.tracks[i].number > 0 {
                self.end(i, now_s, all);
            }
        }
        let mut lost = lost.into_iter();
        self.tracks.retain(|_| lost.next() != Some(true));
        self.heads.renumber(&self.tracks);
    }

    fn is_lost(&self, track: &Track, now_s: f64) -> bool {
        let (head, coast) = (track.head(), self.around.reach.coast as f64);
        let since_s = now_s - head.time_s;
        match track.speed_beads_per_s() {
            None => since_s > self.around.longest_step_s(head.bead, head.crest_m_s),
            Some(speed) if track.number == 0 => since_s * speed > 3.0,
            Some(speed) => {
                let wait_s = self.around.longest_wait_s(head.bead, head.crest_m_s);
                since_s * speed > 1.5 * coast + 1.0 || since_s > wait_s * coast
            }
        }
    }

    fn end(&mut self, i: usize, now_s: f64, at_last: bool) {
        let fate = self.fate(&self.tracks[i], now_s, at_last);
        let track = &mut self.tracks[i];
        if matches!(fate, Fate::End | Fate::Wall | Fate::Seam) {
            self.met_ends[usize::from(track.ahead > 0)] = true;
        }
        while let Some(point) = track.next_point(true) {
            self.happenings.push(Happening::Passed(point));
        }
        let Some((measured, _)) = track.measured else { return };
        self.counts.clear_pulses += u64::from(track.clear_bead_count >= Self::CLEAR_TRACK);
        let (speed_over_solitary, fwhm_over_solitary) = self.around.beside_theory(&measured);
        self.happenings.push(Happening::Ended(Pulse {
            number: track.number,
            direction: track.direction(),
            birth_time_s: track.first.time_s,
            birth_bead: track.first.bead.unsigned_abs(),
            birth: track.birth,
            end_time_s: track.head().time_s,
            end_bead: track.head().bead.unsigned_abs(),
            fate,
            bead_count: track.bead_count,
            measured,
            speed_over_solitary,
            fwhm_over_solitary,
        }));
    }

    fn fate(&self, track: &Track, now_s: f64, at_last: bool) -> Fate {
        let wide = track.head().shape.map_or(0, |shape| nearest(shape.fwhm_beads));
        let near = self.around.reach.near + wide;
        let (distance, is_obstacle) = self.around.obstacles.ahead(track.head().bead, track.ahead);
        let place = track.position_beads(now_s);
        let merged = |other: &Track| {
            let apart = (other.position_beads(now_s) - place).abs();
            other.number > 0 && other.ahead == track.ahead && apart <= (2 * near) as f64
        };
        // what is merely out of sight for a moment when the frames end is under way
        let out_of_sight = (place - track.head().bead as f64).abs() > 2.0;
        let beads = nearest(place).saturating_sub(2 * near)..=nearest(place).saturating_add(2 * near);
        match (distance <= near, is_obstacle) {
            _ if at_last && !(out_of_sight && distance <= near) => Fate::UnderWay,
            (true, true) => Fate::Impurity,
            (true, false) => self.around.origins.fate_at(track.ahead),
            _ if track.gap => Fate::Gap,
            _ if self.heads.around(beads).any(|i| merged(&self.tracks[i])) => Fate::Merged,
            _ => Fate::Faded,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::config::Impurity;
    use schemas::manifest::Origin;
    use schemas::presets::Preset;

    /// A bump begins at bead 52, runs to the impurity at bead 60 and goes on behind it; none of it is simulated.
    #[test]
    fn nothing_comes_from_an_impurity_that_nothing_has_reached() {
        let mut config = Preset::find("homogeneous").unwrap().config();
        config.chain.beads = 100;
        config.chain.impurities = vec![Impurity { bead: 60, mass_kg: 2e-3 }];
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let mut pulses = Pulses::new(&RunManifest::new(&config, "run", origin).unwrap(), 5e-3);
        let u_m: Vec<f64> = (0..100_u8).map(|bead| -1e-6 * f64::from(bead)).collect();
        let mut births = Vec::new();
        let mut take = |happenings: &[Happening]| {
            births.extend(happenings.iter().filter_map(|happening| match happening {
                Happening::Ended(pulse) => Some(pulse.birth),
                Happening::Passed(_) => None,
            }));
        };
        for step in 0..1000_u32 {
            let time_s = 1e-5 * f64::from(step);
            let v_m_s: Vec<f64> = (0..100_u8)
                .map(|bead| {
                    let x = f64::from(bead) - (51.5 + 4000.0 * time_s);
                    2.0 * (-0.5 * (x / 1.5).powi(2)).exp()
                })
                .collect();
            let step = u64::from(step);
            take(pulses.observe(&Frame {
                frame: step,
                step,
                time_s,
                u_m: &u_m,
                v_m_s: &v_m_s,
                extra: &[],
                active: None,
            }));
        }
        take(pulses.finish());
        assert_eq!(births, [Birth::Chain, Birth::Impurity]);
    }
}
