//! Contacts over space and time: compressed, touching or open.

use crate::space_time::Cell;
use pulp::Arch;
pub use recording::{COMPRESSED, OPEN, TOUCHING};
use schemas::active::Active;
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::simd::vectorized;

/// The tolerance (m) unless another is asked for: 1e-6 of the collision length L, 0.36 nm for the
/// light-impurity run.
pub fn default_tolerance_m(manifest: &RunManifest) -> f64 {
    1e-6 * manifest.physics.scales().length_m
}

/// Classifies the contacts of the frames of one run.
#[derive(Debug, Clone)]
pub struct Contacts {
    chain: Chain,
    tolerance_m: f64,
    /// True if all contacts touch at rest. In a ring nobody asks: the one that closes it may be far from those that moved.
    touch_at_rest: bool,
    classes: Vec<u8>,
    /// The beads that may have moved in the last frame.
    seen: Active,
}

/// Number of contacts of a frame in each class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ContactCounts {
    /// Compressed contacts.
    pub compressed: u64,
    /// Touching contacts.
    pub touching: u64,
    /// Open contacts.
    pub open: u64,
    /// First and last compressed contact.
    pub compressed_range: Option<(u64, u64)>,
}

impl Contacts {
    /// Makes one for the frames of `manifest`'s run; `tolerance_m` in m.
    pub fn new(manifest: &RunManifest, tolerance_m: f64) -> Self {
        let chain = manifest.physics.chain();
        let touch_at_rest =
            !chain.is_ring && chain.rest_overlap_m.iter().all(|m| class(*m, tolerance_m) == TOUCHING);
        let (classes, seen) = (vec![TOUCHING; chain.all_contact_count()], Active::all(chain.bead_count()));
        Self { chain, tolerance_m, touch_at_rest, classes, seen }
    }

    /// Number of beads.
    pub(crate) fn bead_count(&self) -> usize {
        self.chain.bead_count()
    }

    /// The tolerance (m).
    pub fn tolerance_m(&self) -> f64 {
        self.tolerance_m
    }

    /// The class of each contact of the frame observed last, in a ring with the one that closes it as the last; all touching before that.
    pub fn classes(&self) -> &[u8] {
        &self.classes
    }

    /// The first contact of that frame that need be looked at, and the classes from it on: all others touch.
    pub fn touched(&self) -> (usize, &[u8]) {
        let all = 0..self.classes.len();
        let contacts = if self.touch_at_rest { self.seen.contacts(all.end).within(all) } else { all };
        (contacts.start, &self.classes[contacts])
    }

    /// The class of each contact of `frame`.
    pub fn observe(&mut self, frame: &Frame<'_>) -> &[u8] {
        let all = self.chain.contact_count();
        if self.chain.is_ring {
            self.classes[all] = class(self.chain.overlap_m(frame.u_m, all), self.tolerance_m);
        }
        let places = self.seen.renew(frame.moving()).contacts(all).within(0..all);
        let contacts = places.len();
        let (left, right) = (&frame.u_m[places.clone()], &frame.u_m[places.start + 1..=places.end]);
        let rest = &self.chain.rest_overlap_m[places.clone()];
        let tolerance_m = self.tolerance_m;
        let classes = &mut self.classes[places];
        vectorized(
            Arch::new(),
            #[inline(always)]
            || {
                for c in 0..contacts {
                    classes[c] = class(left[c] - right[c] + rest[c], tolerance_m);
                }
            },
        );
        &self.classes
    }
}

/// The class of a contact of this overlap (m), without a branch.
#[inline(always)]
fn class(overlap_m: f64, tolerance_m: f64) -> u8 {
    u8::from(overlap_m > tolerance_m) + 2 * u8::from(overlap_m < -tolerance_m)
}

impl ContactCounts {
    /// Counts `classes`.
    pub fn of(classes: &[u8]) -> Self {
        Self::among(classes.len(), 0, classes)
    }

    /// Counts `contacts` contacts, of which those from `first` on have these `classes` and all others touch.
    pub fn among(contacts: usize, first: usize, classes: &[u8]) -> Self {
        // in bytes, of which a register has many; 255 of them do not overflow
        let in_some = |some: &[u8], class: u8| {
            u64::from(some.iter().fold(0_u8, |n, found| n.wrapping_add(u8::from(*found == class))))
        };
        let count = |class| classes.chunks(255).map(|some| in_some(some, class)).sum::<u64>();
        let (compressed, touching) = (count(COMPRESSED), count(TOUCHING));
        let is_compressed = |class: &u8| *class == COMPRESSED;
        let left = classes.iter().position(is_compressed);
        let right = left.and_then(|_| classes.iter().rposition(is_compressed));
        Self {
            compressed,
            touching: touching + (contacts - classes.len()) as u64,
            open: classes.len() as u64 - compressed - touching,
            compressed_range: left
                .zip(right)
                .map(|(left, right)| ((first + left) as u64, (first + right) as u64)),
        }
    }
}

/// The class of a contact, as a cell of a [`Picture`](crate::space_time::Picture).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Class(pub u8);

/// The rarest kind is shown: compressed before open before touching, so that no pulse is lost between pixels.
impl Cell for Class {
    const MOST: usize = 1000;
    const REST: Self = Self(TOUCHING);

    fn outranks(self, other: Self) -> bool {
        self.rank() > other.rank()
    }
}

impl Class {
    fn rank(self) -> u8 {
        match self.0 {
            COMPRESSED => 2,
            OPEN => 1,
            _ => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space_time::{Extent, Picture};
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    #[test]
    fn contacts_are_classified_by_their_overlap() {
        let mut config = PRESETS[2].config();
        config.chain.beads = 5;
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let m = RunManifest::new(&config, "run", origin).expect("valid");
        let u_m = [3e-9, 1e-9, 0.5e-9, 5e-9, 5e-9]; // overlaps 2, 0.5, −4.5, 0 nm
        let frame =
            Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &[0.0; 5], extra: &[], active: None };
        let mut contacts = Contacts::new(&m, 1e-9);
        let classes = contacts.observe(&frame);
        assert_eq!(classes, [COMPRESSED, TOUCHING, OPEN, TOUCHING]);
        let expected = ContactCounts { compressed: 1, touching: 2, open: 1, compressed_range: Some((0, 0)) };
        assert_eq!(ContactCounts::of(classes), expected);
    }

    #[test]
    fn a_ring_is_closed_by_a_contact() {
        let mut config = PRESETS[2].config();
        config.chain.beads = 4;
        (config.ends.left, config.ends.right) =
            (schemas::config::End::Periodic, schemas::config::End::Periodic);
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let m = RunManifest::new(&config, "run", origin).expect("valid");
        let u_m = [0.0, 0.0, 1e-9, 3e-9]; // overlaps 0, −1, −2 and 3 nm
        let frame =
            Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &[0.0; 4], extra: &[], active: None };
        let mut contacts = Contacts::new(&m, 1.5e-9);
        assert_eq!(contacts.observe(&frame), [TOUCHING, TOUCHING, OPEN, COMPRESSED]);
        assert_eq!(contacts.touched(), (0, &[TOUCHING, TOUCHING, OPEN, COMPRESSED][..]));
    }

    #[test]
    fn the_default_tolerance_is_a_millionth_of_the_collision_length() {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let m = RunManifest::new(&PRESETS[0].config(), "run", origin).expect("valid");
        assert!((default_tolerance_m(&m) - 0.362_389_83e-9).abs() < 1e-16);
    }

    #[test]
    fn a_pulse_is_not_lost_between_pixels() {
        let (contacts, steps) = (5000, 30_000);
        let mut picture = Picture::new(Extent { places: 0..contacts, steps: 0..=steps });
        let mut classes = vec![Class(TOUCHING); contacts];
        classes[1234] = Class(COMPRESSED);
        classes[1235] = Class(OPEN);
        picture.push(29_999, classes);
        picture.push(30_000, vec![Class(TOUCHING); contacts]);
        let cells: Vec<Option<Class>> = picture.cells().collect();
        let last_row = &cells[999 * 1000..];
        assert_eq!((last_row[246], last_row[247]), (Some(Class(COMPRESSED)), Some(Class(OPEN))));
        assert_eq!(cells.iter().flatten().filter(|class| class.0 != TOUCHING).count(), 2);
    }
}
