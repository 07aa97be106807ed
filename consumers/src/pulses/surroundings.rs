//! The chain that pulses travel in, and its effect on them.

use super::crest::History;
use super::origins::Origins;
use super::texture::Texture;
use super::track::{Measured, REACH, Track};
use super::{Obstacles, nearest, signed};
use crate::deformation::{Plain, common_velocity_m_s};
use crate::theory::{Coefficients, SolitaryWave, Strength};
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// The chain of a run.
#[derive(Debug, Clone)]
pub(super) struct Surroundings {
    pub(super) chain: Chain,
    pub(super) obstacles: Obstacles,
    /// Differences between beads, in a chain that is not even.
    pub(super) texture: Option<Texture>,
    /// Contacts bind or are loaded: where nothing pulls, pulses move the way their beads do.
    pub(super) pulls: bool,
    /// The velocity (m/s) that velocities count from: that of most beads at step 0.
    pub(super) drift_m_s: f64,
    pub(super) reach: Reach,
    /// The makers of pulses.
    pub(super) origins: Origins,
    /// Slope (N/m) of each contact at rest; none where resonators slow waves down.
    tangents_n_per_m: Vec<f64>,
    plain: Plain,
    /// The exact solitary wave, where there is one, of beads that rest before it comes.
    wave: Option<Coefficients>,
}

/// Distances (beads) within which things around a pulse matter to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// A pulse that ends so near to something has to do with it.
    pub(super) near: i64,
    /// A pulse that begins so near to something comes from it: weak ones get their crest only at a distance.
    pub(super) origin: i64,
    /// A pulse so far from the next thing ahead is undisturbed.
    pub(super) free: i64,
    /// A pulse may be out of sight for so long, as when two meet.
    pub(super) coast: i64,
}

impl Surroundings {
    pub(super) fn of(manifest: &RunManifest) -> Self {
        let chain = manifest.physics.chain();
        let drift_m_s = common_velocity_m_s(&manifest.physics);
        let wave = SolitaryWave::coefficients_of(manifest.physics.alpha).ok();
        Self {
            obstacles: Obstacles::of(&chain),
            texture: Texture::of(&chain, manifest.physics.scales().length_m),
            pulls: chain.is_loaded() || chain.is_bonded,
            drift_m_s: drift_m_s.unwrap_or(0.0),
            reach: Reach::of(wave.as_ref()),
            origins: Origins::of(&manifest.physics),
            tangents_n_per_m: if chain.sites.has_resonators() {
                Vec::new()
            } else {
                chain.tangents_n_per_m()
            },
            plain: Plain::of(&manifest.physics, false),
            wave: wave.filter(|_| drift_m_s.is_some()),
            chain,
        }
    }

    /// True if the tracker sees several beads together at `bead`.
    pub(super) fn is_uneven(&self, bead: usize) -> bool {
        self.texture.as_ref().is_some_and(|texture| texture.is_uneven(bead))
    }

    /// True if `bead` is not a light one among heavy ones.
    pub(super) fn carries(&self, bead: usize) -> bool {
        self.texture.as_ref().is_none_or(|texture| texture.carries(bead))
    }

    /// True if `bead` is pressed from both sides. Beads that are not alike are not all pressed at a time. Bonds hold it always.
    pub(super) fn is_pressed(&self, frame: &Frame<'_>, bead: usize) -> bool {
        let pressed = |contact: usize| self.chain.is_bonded || self.chain.overlap_m(frame.u_m, contact) > 0.0;
        let inner = bead > 0 && bead + 1 < self.chain.bead_count();
        match &self.texture {
            Some(texture) if texture.is_uneven(bead) => inner && texture.contacts(bead).any(pressed),
            _ => inner && pressed(bead - 1) && pressed(bead),
        }
    }

    /// Beads for which a pulse at `bead` may be out of sight. Tracks through the many weak waves behind a pulse in an
    /// uneven chain would jump from one to another.
    pub(super) fn coast(&self, bead: i64) -> i64 {
        const AMONG_OTHERS: i64 = 4;
        let uneven = self.is_uneven(usize::try_from(bead).unwrap_or_default());
        if uneven { AMONG_OTHERS } else { self.reach.coast }
    }

    /// True if a pulse at `bead` has a free way: no obstacle, no end and no gap between beads near.
    pub(super) fn is_free(&self, frame: &Frame<'_>, track: &Track, bead: i64, v_m_s: f64) -> bool {
        /// A gap g takes the time g/v to close. One that takes this part of the time for a bead changes the
        /// speed by as much at most.
        const DELAY: f64 = 1e-5;
        let ahead = track.ahead;
        let Some(speed) = track.speed_beads_per_s() else { return false };
        if self.obstacles.ahead(bead, ahead).0 < self.reach.free {
            return false;
        }
        if self.chain.is_bonded || self.is_uneven(usize::try_from(bead).unwrap_or_default()) {
            // bonds have no gaps, and there are some in every uneven pulse
            return true;
        }
        let widest_m = DELAY * v_m_s.abs() / speed;
        let far = bead + ahead * self.reach.free;
        let contacts = if ahead > 0 { bead..far } else { far..bead };
        let closed = |contact| self.chain.overlap_m(frame.u_m, contact) >= -widest_m;
        contacts.map(|contact| usize::try_from(contact).unwrap_or_default()).all(closed)
    }

    /// Three times as long (s) as a solitary wave of this peak velocity, or sound, if that is faster, takes for a bead.
    pub(super) fn longest_step_s(&self, bead: i64, v_m_s: f64) -> f64 {
        let bead = usize::try_from(bead).unwrap_or_default().min(self.chain.contact_count() - 1);
        let (mass_kg, contacts) = match &self.texture {
            Some(texture) => (texture.mass_kg(bead), texture.contacts(bead)),
            None => (self.chain.mass_kg[bead], bead..bead + 1),
        };
        // C_V is between 0.78 and 1 for any exponent; α = 1 has no solitary wave, but this speed
        let solitary = |(alpha, stiffness): (f64, f64)| {
            let power = 1.0 / (alpha + 1.0);
            0.78 * (stiffness / mass_kg).powf(power) * v_m_s.abs().powf((alpha - 1.0) * power)
        };
        let speed = |contact: usize| {
            let terms = self.chain.terms.iter();
            let powers = terms.filter_map(|term| Some((term.law.exponent()?, term.stiffness_of(contact))));
            let law = (self.chain.law.alpha(), self.chain.stiffness[contact]);
            let sound = (self.tangent_n_per_m(contact) / mass_kg).sqrt();
            powers.chain([law]).map(solitary).fold(sound, f64::max)
        };
        3.0 / contacts.map(speed).fold(f64::INFINITY, f64::min)
    }

    fn tangent_n_per_m(&self, contact: usize) -> f64 {
        self.tangents_n_per_m.get(contact).copied().unwrap_or(0.0)
    }

    /// The longest time (s) that a pulse takes for each of several beads: where there is sound it never waits for gaps to close.
    pub(super) fn longest_wait_s(&self, bead: i64, v_m_s: f64) -> f64 {
        let sounds = self.tangent_n_per_m(usize::try_from(bead).unwrap_or_default()) > 0.0;
        if sounds { self.longest_step_s(bead, v_m_s) } else { f64::INFINITY }
    }

    /// Momentum (kg·m/s) and energy (J) of the hump around `bead`, from one minimum of the velocity in `history` to the
    /// next.
    pub(super) fn hump(&self, history: &History, frame: &Frame<'_>, bead: i64, sign: f64) -> (f64, f64) {
        /// The pulse is over where |v| has sunk to this part of the peak.
        const FADED: f64 = 1e-6;
        let height = |bead: usize| history.at(0, signed(bead as u64)).map_or(0.0, |v| sign * v);
        let last = self.chain.bead_count() - 1;
        let mut top = usize::try_from(bead).unwrap_or_default();
        while top < last && height(top + 1) > height(top) {
            top += 1;
        }
        while top > 0 && height(top - 1) > height(top) {
            top -= 1;
        }
        let over = FADED * height(top);
        let (mut low, mut high) = (top, top);
        while low > 0 && height(low - 1) < height(low) && height(low) > over {
            low -= 1;
        }
        while high < last && height(high + 1) < height(high) && height(high) > over {
            high += 1;
        }
        let momentum = (low..=high).map(|bead| self.chain.mass_kg[bead] * frame.v_m_s[bead]).sum();
        let contacts = low.saturating_sub(1)..(high + 1).min(last);
        let potential: f64 = contacts.map(|contact| self.chain.contact_energy_j(frame.u_m, contact)).sum();
        (momentum, self.chain.kinetic_j(frame.v_m_s, low..high + 1) + potential)
    }

    /// Speed and width over those of the exact solitary wave of the same peak velocity, in a chain that is
    /// even there and not loaded, without resonators and drives, and whose beads began with one velocity. Damping makes a
    /// pulse weaker, not another one.
    pub(super) fn beside_theory(&self, measured: &Measured) -> (Option<f64>, Option<f64>) {
        let point = &measured.point;
        let bead = usize::try_from(point.bead).unwrap_or_default();
        let around = bead.saturating_sub(REACH)..(bead + REACH + 1).min(self.chain.bead_count());
        let (mass_kg, stiffness) = (self.chain.mass_kg[bead], self.chain.stiffness[around.start]);
        let contacts = around.start..around.end - 1;
        let plain = self.plain.check(&self.chain, &around, &contacts).is_ok();
        let Some(wave) = self.wave.filter(|_| plain && !self.pulls) else { return (None, None) };
        let strength = Strength::PeakVelocity { m_s: point.v_peak_m_s.abs() };
        let scale = wave.scaled(mass_kg, stiffness, strength).ok();
        let speed = point.speed_beads_per_s.zip(scale).map(|(speed, scale)| speed / scale.speed_beads_per_s);
        (speed, point.shape.map(|shape| shape.fwhm_beads / wave.velocity_fwhm_beads))
    }
}

impl Reach {
    fn of(wave: Option<&Coefficients>) -> Self {
        // near α = 1 solitary waves are hundreds of beads wide, but no pulse in a chain that long has become one
        const WIDEST: f64 = 20.0;
        let width = wave.map_or(WIDEST, |wave| wave.velocity_fwhm_beads).min(WIDEST);
        Self {
            near: 3 + nearest(width),
            origin: 8 + nearest(2.0 * width),
            free: 2 + nearest(2.0 * width),
            coast: 4 + nearest(3.0 * width),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pulses::{Point, Shape};
    use schemas::config::{Profile, Resonators, RunConfig};
    use schemas::manifest::Origin;
    use schemas::presets::Preset;

    #[test]
    fn the_solitary_wave_is_that_of_beads_that_nothing_else_acts_on() {
        let told = |bead: u64, change: &dyn Fn(&mut RunConfig)| {
            let mut config = Preset::find("homogeneous").unwrap().config();
            change(&mut config);
            let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
            let around = Surroundings::of(&RunManifest::new(&config, "run", origin).unwrap());
            let shape = Some(Shape { fwhm_beads: 1.6, asymmetry: 0.0 });
            let point =
                Point { pulse: 1, bead, time_s: 0.0, v_peak_m_s: 2.0, speed_beads_per_s: Some(1e4), shape };
            let (momentum_kg_m_s, energy_j, undisturbed) = (1.0, 1.0, true);
            let (speed, width) =
                around.beside_theory(&Measured { point, momentum_kg_m_s, energy_j, undisturbed });
            assert_eq!(speed.is_some(), width.is_some());
            speed.is_some()
        };
        let resonators = |config: &mut RunConfig| {
            let (mass_kg, stiffness_n_per_m) = (Profile::Same(1e-4), Profile::Same(1e5));
            config.resonators = Some(Resonators { mass_kg, stiffness_n_per_m });
        };
        assert!(told(100, &|_| {}) && told(199, &|_| {}));
        assert!(!told(100, &resonators));
    }
}
