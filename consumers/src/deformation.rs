//! The deformation of a contact while the first pulse passes it, compared with theory.
//!
//! The first pulse at a contact begins with the first frame in which its overlap is above [`CLOSED`] L. It ends when
//! the overlap is back below that, or, in a train of overlapping pulses, at the smallest overlap between two of them. A
//! deformation that stays below [`COUNTED`] L is no pulse. Later pulses are counted, not compared.
//!
//! Both theories have one free parameter, the strength of the wave. It is set so that their largest overlap is the
//! measured one, and their centre is put where the measured overlap is largest: width, tails, speed and impulse are
//! then predictions. The measure is the overlap rather than the velocity of a bead, because the theory gives the
//! overlap at the same place.
//!
//! ```text
//!     θ(t) = δ_peak·wave.overlap(V·(t − t_peak)),    v_max = √(k/m)·(δ_peak/C_δ)^((α+1)/2)
//!     L1 = ∫|δ − θ| dt / (δ_peak·w),   L2 = √(∫(δ − θ)² dt / w) / δ_peak,   L∞ = max|δ − θ| / δ_peak
//! ```
//!
//! with w the measured full width at half maximum, and integrals over all times: outside of the pulse δ counts as
//! 0, and so does a gap. Between frames δ is Hermite's
//! cubic through overlaps and their rates, which the velocities give.

mod curve;
mod first_pulse;
mod plain;

pub use curve::{Sample, Shape};
pub use first_pulse::{CLOSED, COUNTED, FirstPulse};
pub use plain::Plain;
pub(crate) use plain::common_velocity_m_s;

use crate::theory::{Coefficients, ContinuumWave, SolitaryWave, Strength, WaveScale};
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// Speeds are measured between the contacts this far before and behind.
pub const BASELINE: u64 = 5;

/// The times from one gauge to the contact and on to the other differ by less than this part of their mean where one pulse
/// passes all three. In a taper of 0.95 from bead to bead they differ by about 13 %; pulses from both sides differ by
/// more, unless they meet within half a contact of a gauge, where they are one.
const HALVES: f64 = 0.25;

/// Beads and contacts this far on either side of a contact must be equal for a theory of equal beads.
const ALIKE: usize = 3;

/// Follows the overlap of some contacts of one run.
#[derive(Debug, Clone)]
pub struct Deformations {
    chain: Chain,
    plain: Plain,
    /// Beads that are struck, or begin in motion, in ascending order.
    strikers: Vec<usize>,
    contacts: Vec<Followed>,
}

#[derive(Debug, Clone)]
struct Followed {
    contact: u64,
    pulse: FirstPulse,
    /// The contacts [`BASELINE`] before and behind, if the chain has them; in a ring around it.
    gauges: Option<[(u64, FirstPulse); 2]>,
}

/// The first pulse at a contact.
#[derive(Debug, Clone)]
pub struct Deformation {
    /// The contact.
    pub contact: u64,
    /// Its shape as measured, or why there is none.
    pub measured: Result<Shape, Untold>,
    /// Overlaps with their rates over time, at most [`FirstPulse::CAPACITY`].
    pub samples: Vec<Sample>,
    /// Pulses that began after the first; none where that is not known.
    pub later_pulse_count: Option<u64>,
    /// Speed of the pulse (beads/s) over [`BASELINE`] contacts on either side, if it was the first at both ends of them.
    pub speed_beads_per_s: Option<f64>,
    /// The shape and the speed from every second frame alone, if these determine them: the difference is more than the
    /// error between frames.
    pub halved: (Option<Shape>, Option<f64>),
    /// The exact solitary wave, or why there is none.
    pub exact: Result<Comparison, String>,
    /// The wave of the continuum, the paper's eq. (cos), or why there is none.
    pub continuum: Result<Comparison, String>,
}

/// Reason why the shape of a pulse is not known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Untold {
    /// No pulse came.
    #[error("no pulse has passed")]
    NoPulse,
    /// The frames end while the pulse passes, or what damps the contact keeps it closed.
    #[error("the contact is still pressed when the frames end; a pulse has passed once the contact opens")]
    Unfinished,
    /// Frames are missing, or begin, while it passes.
    #[error("frames of the pulse are missing")]
    Gap,
    /// A bond was stretched first.
    #[error("not defined: the bond is stretched before it is pressed, and only what presses is measured")]
    Stretched,
    /// Fewer than three frames hold it.
    #[error("too few frames hold the pulse")]
    Sparse,
    /// A load presses the chain together.
    #[error("not defined: the chain is loaded, its contacts are deformed at rest")]
    Loaded,
}

/// A theory beside a measured pulse.
#[derive(Debug, Clone)]
pub struct Comparison {
    wave: Wave,
    /// The wave in units.
    pub scale: WaveScale,
    /// Full width at half maximum (s).
    pub width_s: f64,
    /// Impulse that passes the contact (N·s): the momentum of the wave.
    pub impulse_n_s: f64,
    /// Integral of the absolute error, relative to the peak times the width.
    pub l1: f64,
    /// Root of the integral of the squared error over the width, relative to the peak.
    pub l2: f64,
    /// Largest error, relative to the peak.
    pub l_infinity: f64,
    peak_s: f64,
}

#[derive(Debug, Clone)]
enum Wave {
    Exact(Box<SolitaryWave>),
    Continuum(ContinuumWave),
}

impl Wave {
    fn overlap(&self, xi_beads: f64) -> f64 {
        match self {
            Self::Exact(wave) => wave.overlap(xi_beads),
            Self::Continuum(wave) => wave.overlap(xi_beads),
        }
    }

    /// Half the length (beads) of the nonzero part.
    fn half_length_beads(&self) -> f64 {
        match self {
            Self::Exact(wave) => wave.half_length_beads(),
            Self::Continuum(wave) => wave.half_length_beads(),
        }
    }

    fn coefficients(&self) -> Coefficients {
        match self {
            Self::Exact(wave) => wave.coefficients(),
            Self::Continuum(wave) => wave.coefficients(),
        }
    }
}

impl Comparison {
    /// The overlap (m) that the theory expects at `time_s` (s).
    pub fn overlap_m(&self, time_s: f64) -> f64 {
        self.scale.overlap_m * self.wave.overlap(self.scale.speed_beads_per_s * (time_s - self.peak_s))
    }
}

impl Deformations {
    /// Follows `contacts` of `manifest`'s run, each a contact of the chain; contact N − 1 closes a ring.
    pub fn new(manifest: &RunManifest, contacts: &[u64]) -> Self {
        let physics = &manifest.physics;
        let chain = physics.chain();
        let count = chain.all_contact_count() as u64;
        let first_pulse = || FirstPulse::new(physics.scales().length_m, chain.is_bonded);
        let gauges = |contact: u64| {
            let ends = if chain.is_ring && count > 2 * BASELINE {
                [count - BASELINE, BASELINE].map(|on| (contact + on) % count)
            } else {
                let behind = contact.checked_add(BASELINE).filter(|behind| *behind < count)?;
                [contact.checked_sub(BASELINE)?, behind]
            };
            Some(ends.map(|contact| (contact, first_pulse())))
        };
        let follow = |contact: &u64| {
            let contact = (*contact).min(count - 1);
            Followed { contact, pulse: first_pulse(), gauges: gauges(contact) }
        };
        Self {
            contacts: contacts.iter().map(follow).collect(),
            plain: Plain::of(physics, true),
            strikers: plain::beads_in_motion(physics),
            chain,
        }
    }

    /// Looks at the next frame.
    pub fn observe(&mut self, frame: &Frame<'_>) {
        let chain = &self.chain;
        let sample = |contact: u64| {
            // contacts are below N, which is an index
            let c = usize::try_from(contact).unwrap_or(usize::MAX);
            let (overlap_m, rate_m_s) = (chain.overlap_m(frame.u_m, c), chain.across(frame.v_m_s, c));
            Sample { time_s: frame.time_s, overlap_m, rate_m_s }
        };
        for followed in &mut self.contacts {
            followed.pulse.push(sample(followed.contact));
            for (contact, pulse) in followed.gauges.iter_mut().flatten() {
                pulse.push(sample(*contact));
            }
        }
    }

    /// Frames are missing before the next one.
    pub fn gap(&mut self) {
        for followed in &mut self.contacts {
            followed.pulse.gap();
            followed.gauges.iter_mut().flatten().for_each(|(_, pulse)| pulse.gap());
        }
    }

    /// The result at each contact, in the order in which they were given.
    pub fn results(&self) -> Vec<Deformation> {
        self.contacts.iter().map(|followed| self.result(followed)).collect()
    }

    fn result(&self, followed: &Followed) -> Deformation {
        let c = usize::try_from(followed.contact).unwrap_or(usize::MAX);
        let (samples, law) = (followed.pulse.samples(), &self.chain.law);
        let force = |overlap_m| self.chain.force_n(c, overlap_m);
        let measured =
            if self.chain.is_pressed() { Err(Untold::Loaded) } else { followed.pulse.shape(force) };
        let compare = |wave: Result<Wave, String>| {
            let shape = measured.map_err(|untold| untold.to_string())?;
            self.check_alike(c)?;
            self.compare(c, &shape, samples, wave?)
        };
        let is_counted = !matches!(measured, Err(Untold::Loaded | Untold::Gap | Untold::Stretched));
        let alpha = law.alpha();
        let exact = SolitaryWave::new(alpha).map(|wave| Wave::Exact(Box::new(wave)));
        let continuum = ContinuumWave::new(alpha).map(Wave::Continuum);
        Deformation {
            contact: followed.contact,
            exact: compare(exact.map_err(|error| error.to_string())),
            continuum: compare(continuum.map_err(|error| error.to_string())),
            speed_beads_per_s: speed(followed, 1),
            halved: (curve::shape(&one_of(2, samples), force).ok(), speed(followed, 2)),
            later_pulse_count: is_counted.then(|| followed.pulse.later_count()),
            samples: samples.to_vec(),
            measured,
        }
    }

    /// Checks that nothing acts on the beads around contact `c` but their contacts, all equal, and that neither an end of
    /// the chain nor a striker, nor another bead that begins in motion, is among them: ends reflect waves, and waves begin
    /// at strikers.
    fn check_alike(&self, c: usize) -> Result<(), String> {
        /// Beads around a contact.
        const BEADS: usize = 2 * ALIKE + 2;
        let (beads, is_ring) = (self.chain.bead_count(), self.chain.is_ring);
        if is_ring && beads < BEADS {
            return Err(format!("no theory: a ring of {beads} beads, fewer than {BEADS}, is too short"));
        }
        if !is_ring && (c < ALIKE || c + ALIKE >= self.chain.contact_count()) {
            return Err(format!("no theory: contact {c} is within {ALIKE} of an end of the chain"));
        }
        let around = |count: usize| (0..count).map(move |i| (c + beads + i - ALIKE) % beads);
        if around(BEADS).any(|bead| self.strikers.binary_search(&bead).is_ok()) {
            return Err(format!(
                "no theory: contact {c} is within {ALIKE} of a striker or of another bead that begins in motion"
            ));
        }
        let found = self.plain.check(&self.chain, &around(BEADS), &around(BEADS - 1));
        found.map_err(|what| format!("no theory: {what} within {ALIKE} of contact {c}"))
    }

    fn compare(&self, c: usize, shape: &Shape, samples: &[Sample], wave: Wave) -> Result<Comparison, String> {
        let coefficients = wave.coefficients();
        let (mass_kg, stiffness) = (self.chain.mass_kg[c], self.chain.stiffness_of(c));
        // δ_peak = C_δ·(m·v_max²/k)^(1/(α+1))
        let power = (shape.overlap_m / coefficients.overlap).powf(0.5 * (coefficients.alpha + 1.0));
        let strength = Strength::PeakVelocity { m_s: (stiffness / mass_kg).sqrt() * power };
        let scale = coefficients.scaled(mass_kg, stiffness, strength).map_err(|error| error.to_string())?;
        let mut comparison = Comparison {
            wave,
            scale,
            width_s: coefficients.overlap_fwhm_beads / scale.speed_beads_per_s,
            impulse_n_s: scale.momentum_kg_m_s,
            l1: 0.0,
            l2: 0.0,
            l_infinity: 0.0,
            peak_s: shape.peak_s,
        };
        let half_s = comparison.wave.half_length_beads() / scale.speed_beads_per_s;
        let extent_s = (shape.peak_s - half_s, shape.peak_s + half_s);
        let errors = curve::errors(samples, extent_s, |time_s| comparison.overlap_m(time_s));
        comparison.l1 = errors.integral / (shape.overlap_m * shape.width_s);
        comparison.l2 = (errors.square_integral / shape.width_s).sqrt() / shape.overlap_m;
        comparison.l_infinity = errors.largest / shape.overlap_m;
        Ok(comparison)
    }
}

/// One of each `stride` samples.
fn one_of(stride: usize, samples: &[Sample]) -> Vec<Sample> {
    samples.iter().step_by(stride).copied().collect()
}

/// The speed (beads/s) between the gauges, from one of each `stride` samples; none if other pulses than the one at the contact
/// were first there.
fn speed(followed: &Followed, stride: usize) -> Option<f64> {
    let [(_, before), (_, behind)] = followed.gauges.as_ref()?;
    let peak_s = |pulse: &FirstPulse| {
        pulse.shape(|_| 0.0).ok()?;
        curve::shape(&one_of(stride, pulse.samples()), |_| 0.0).ok().map(|shape| shape.peak_s)
    };
    let (before_s, here_s, behind_s) = (peak_s(before)?, peak_s(&followed.pulse)?, peak_s(behind)?);
    let duration_s = (behind_s - before_s).abs();
    // halves that are so alike have the same sign: the peaks are in order
    let apart_s = ((here_s - before_s) - (behind_s - here_s)).abs();
    let is_one = apart_s < HALVES * 0.5 * duration_s;
    is_one.then(|| (2 * BASELINE) as f64 / duration_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::Preset;

    fn manifest(change: impl FnOnce(&mut schemas::config::RunConfig)) -> RunManifest {
        let mut config = Preset::find("homogeneous").expect("preset").config();
        change(&mut config);
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        RunManifest::new(&config, "run", origin).expect("valid")
    }

    /// Lets exact waves of 2 m/s pass all contacts, from these places in these directions; none of it is simulated. The chain
    /// begins at bead `first`, as a ring may.
    fn passed(
        manifest: &RunManifest,
        contacts: &[u64],
        waves: &[(f64, f64)],
        first: usize,
    ) -> Vec<Deformation> {
        let wave = SolitaryWave::new(manifest.physics.alpha).expect("wave");
        let scale =
            wave.coefficients().scaled(1e-3, 1e7, Strength::PeakVelocity { m_s: 2.0 }).expect("units");
        let mut deformations = Deformations::new(manifest, contacts);
        let bead = |i: usize| (first + i) % 60;
        for step in 0..4000_u32 {
            let time_s = f64::from(step) * 1e-6;
            // overlaps from the last bead backwards, so that their differences are the waves'
            let (mut u_m, mut v_m_s) = (vec![0.0; 60], vec![0.0; 60]);
            for i in (0..59).rev() {
                u_m[bead(i)] = u_m[bead(i + 1)];
                for (from, sign) in waves {
                    let xi = i as f64 + 0.5 - (from + sign * scale.speed_beads_per_s * time_s);
                    u_m[bead(i)] += scale.overlap_m * wave.overlap(xi);
                    v_m_s[bead(i)] += sign * scale.velocity_m_s * wave.velocity(xi - 0.5);
                }
            }
            let step = u64::from(step);
            deformations.observe(&Frame {
                frame: step,
                step,
                time_s,
                u_m: &u_m,
                v_m_s: &v_m_s,
                extra: &[],
                active: None,
            });
        }
        deformations.results()
    }

    /// An exact wave is found to be one, in either direction, and the continuum's wave is not.
    #[test]
    fn a_wave_is_compared_with_itself() {
        let m = manifest(|config| config.chain.beads = 60);
        for (from, sign) in [(10.0, 1.0), (50.0, -1.0)] {
            let results = passed(&m, &[35], &[(from, sign)], 0);
            let deformation = &results[0];
            let (shape, exact) =
                (deformation.measured.expect("passed"), deformation.exact.as_ref().expect("α"));
            // frames of 1 µs, h = 0.014 standard deviations: the parabola through rates misses the peak by
            // 3/16·h³ of one, 5e-7; all else is better
            assert!((exact.scale.velocity_m_s - 2.0).abs() < 1e-6, "{exact:?}");
            assert!(exact.l_infinity < 1e-6 && exact.l2 < 1e-6 && exact.l1 < 1e-6, "{exact:?}");
            assert!((shape.width_s / exact.width_s - 1.0).abs() < 1e-6);
            assert!((shape.impulse_n_s / exact.impulse_n_s - 1.0).abs() < 1e-6);
            assert!(shape.asymmetry.abs() < 1e-6);
            let speed = deformation.speed_beads_per_s.expect("both gauges");
            assert!((speed / exact.scale.speed_beads_per_s - 1.0).abs() < 1e-6);
            let continuum = deformation.continuum.as_ref().expect("α");
            assert!(continuum.l_infinity > 0.01, "{continuum:?}");
            assert_eq!(deformation.later_pulse_count, Some(0));
        }
    }

    /// Waves that meet at bead 38.5 come to contacts 30, 35 and 40 after the ways 20.5, 25.5 and, the other one, 26.5: ten
    /// contacts in the time of six.
    #[test]
    fn pulses_from_both_sides_have_no_speed_between_them() {
        let m = manifest(|config| config.chain.beads = 60);
        let results = passed(&m, &[35, 25], &[(10.0, 1.0), (67.0, -1.0)], 0);
        assert!(results[0].measured.is_ok() && results[0].speed_beads_per_s.is_none(), "{results:?}");
        let scale = results[1].exact.as_ref().expect("α").scale;
        let speed = results[1].speed_beads_per_s.expect("both gauges before the other wave");
        assert!((speed / scale.speed_beads_per_s - 1.0).abs() < 1e-6, "{speed}");
    }

    /// Contact 59 of a ring of 60 joins beads 59 and 0, and contacts 54 and 4 are as far from it as 30 and 40 from 35.
    #[test]
    fn the_contact_that_closes_a_ring_is_one_like_others() {
        let ring = |striker: u64| {
            manifest(|config| {
                (config.chain.beads, config.striker.bead) = (60, striker);
                let periodic = schemas::config::End::Periodic;
                (config.ends.left, config.ends.right) = (periodic, periodic);
            })
        };
        let chain = manifest(|config| config.chain.beads = 60);
        let waves = [(10.0, 1.0)];
        let (in_ring, in_chain) =
            (passed(&ring(30), &[59, 0], &waves, 24), passed(&chain, &[35, 36], &waves, 0));
        for (found, expected) in in_ring.iter().zip(&in_chain) {
            assert_eq!(found.measured, expected.measured);
            assert_eq!(found.speed_beads_per_s, expected.speed_beads_per_s);
            let [found, expected] = [found, expected].map(|at| at.exact.as_ref().expect("α"));
            assert_eq!((found.l2, found.impulse_n_s), (expected.l2, expected.impulse_n_s));
            assert!(found.l2 < 1e-6);
        }
        let near_striker = Deformations::new(&ring(2), &[]);
        let why = near_striker.check_alike(59).expect_err("beads 56 to 3");
        assert!(why.contains("striker"), "{why}");
        assert_eq!(near_striker.check_alike(6), Ok(()));
    }

    #[test]
    fn what_cannot_be_compared_is_said() {
        let impurity = schemas::config::Impurity { bead: 37, mass_kg: 2e-3 };
        let m = manifest(|config| {
            config.chain.beads = 60;
            config.chain.impurities = vec![impurity];
        });
        let results = passed(&m, &[35, 44], &[(10.0, 1.0)], 0);
        assert!(
            results[0].measured.is_ok() && results[0].exact.as_ref().is_err_and(|why| why.contains("35"))
        );
        assert!(results[1].measured.is_ok() && results[1].exact.is_ok());

        let m = manifest(|config| {
            config.chain.beads = 60;
            config.striker.bead = 35;
        });
        let deformations = Deformations::new(&m, &[]);
        for contact in [3, 30, 39, 55] {
            assert_eq!(deformations.check_alike(contact), Ok(()));
        }
        for (contact, reason) in [(2, "end"), (31, "striker"), (38, "striker"), (56, "end")] {
            let why = deformations.check_alike(contact).expect_err("not far enough");
            assert!(why.contains(reason), "{contact}: {why}");
        }

        let second = schemas::config::StrikerConfig { bead: 20, velocity_m_s: 1.0 };
        let m = manifest(|config| config.striker.more = vec![second]);
        let why = Deformations::new(&m, &[]).check_alike(20).expect_err("struck");
        assert!(why.contains("striker"), "{why}");

        for drift in [0.0, 1.0] {
            let m = manifest(|config| {
                config.chain.beads = 60;
                config.striker.velocity_m_s = 0.0;
                config.initial.velocities_m_s = vec![drift; 60];
                config.initial.velocities_m_s[29] = 5.0;
            });
            let deformations = Deformations::new(&m, &[]);
            assert_eq!(deformations.check_alike(40), Ok(()), "{drift}");
            let why = deformations.check_alike(30).expect_err("bead 29 begins in motion");
            assert!(why.contains("begins in motion"), "{why}");
        }

        let linear = manifest(|config| config.chain.alpha = Some(1.0));
        let results = Deformations::new(&linear, &[100]).results();
        assert_eq!(results[0].measured, Err(Untold::NoPulse));
    }
}
