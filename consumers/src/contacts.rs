//! Which contacts are compressed, touching or open, over space and time.

use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
pub use schemas::recording::{COMPRESSED, OPEN, TOUCHING};

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
    classes: Vec<u8>,
}

/// How many contacts of a frame are in which class.
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
    /// For the frames of `manifest`'s run; `tolerance_m` in m.
    pub fn new(manifest: &RunManifest, tolerance_m: f64) -> Self {
        let chain = manifest.physics.chain();
        Self { classes: vec![TOUCHING; chain.contact_count()], tolerance_m, chain }
    }

    /// The tolerance (m).
    pub fn tolerance_m(&self) -> f64 {
        self.tolerance_m
    }

    /// The class of each contact of the frame observed last, N − 1 values; all touching before that.
    pub fn classes(&self) -> &[u8] {
        &self.classes
    }

    /// The class of each contact of `frame`, N − 1 values.
    pub fn observe(&mut self, frame: &Frame<'_>) -> &[u8] {
        let contacts = self.classes.len();
        let (left, right) = (&frame.u_m[..contacts], &frame.u_m[1..=contacts]);
        let rest = &self.chain.rest_overlap_m[..contacts];
        let tolerance_m = self.tolerance_m;
        for (c, class) in self.classes.iter_mut().enumerate() {
            let overlap_m = left[c] - right[c] + rest[c];
            *class = u8::from(overlap_m > tolerance_m) + 2 * u8::from(overlap_m < -tolerance_m);
        }
        &self.classes
    }
}

impl ContactCounts {
    /// Names of the columns of a table of counts.
    pub const COLUMNS: [&'static str; 5] = [
        "compressed_count",
        "touching_count",
        "open_count",
        "first_compressed_contact",
        "last_compressed_contact",
    ];

    /// Counts `classes`.
    pub fn of(classes: &[u8]) -> Self {
        let mut counts = [0_u64; 3];
        for class in classes {
            counts[usize::from(*class).min(2)] += 1;
        }
        let compressed = |class: &u8| *class == COMPRESSED;
        let first = classes.iter().position(compressed);
        let last = classes.iter().rposition(compressed);
        Self {
            compressed: counts[usize::from(COMPRESSED)],
            touching: counts[usize::from(TOUCHING)],
            open: counts[usize::from(OPEN)],
            compressed_range: first.zip(last).map(|(first, last)| (first as u64, last as u64)),
        }
    }
}

/// A picture of bounded size of the classes over contacts (across) and steps (along).
///
/// A cell that stands for several contacts or frames shows the rarest kind that occurs in it:
/// compressed before open before touching, so that no pulse is lost between pixels. Cells that no
/// frame fell into are touching.
#[derive(Debug, Clone)]
pub struct ContactRaster {
    step_count: u64,
    /// The column of each contact.
    column_of: Vec<usize>,
    columns: usize,
    rows: usize,
    cells: Vec<u8>,
}

impl ContactRaster {
    /// The largest number of columns and of rows.
    pub const MAX_SIDE: usize = 1000;

    /// An empty picture for `contact_count` contacts over the steps 0 to `step_count`.
    pub fn new(contact_count: usize, step_count: u64) -> Self {
        let columns = contact_count.clamp(1, Self::MAX_SIDE);
        let frames = usize::try_from(step_count.saturating_add(1)).unwrap_or(usize::MAX);
        let rows = frames.clamp(1, Self::MAX_SIDE);
        let column_of = (0..contact_count).map(|contact| contact * columns / contact_count).collect();
        Self { step_count, column_of, columns, rows, cells: vec![TOUCHING; columns * rows] }
    }

    /// Enters the classes at `step`.
    pub fn push(&mut self, step: u64, classes: &[u8]) {
        let last_row = self.rows as u64 - 1;
        let scaled = u128::from(step) * self.rows as u128 / (u128::from(self.step_count) + 1);
        let row = u64::try_from(scaled).unwrap_or(last_row).min(last_row);
        // rows ≤ 1000
        let start = usize::try_from(row).unwrap_or(0) * self.columns;
        let cells = &mut self.cells[start..start + self.columns];
        for (class, column) in classes.iter().zip(&self.column_of) {
            let cell = &mut cells[*column];
            if rank(*class) > rank(*cell) {
                *cell = *class;
            }
        }
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The classes, row by row, the earliest row first.
    pub fn cells(&self) -> &[u8] {
        &self.cells
    }
}

fn rank(class: u8) -> u8 {
    match class {
        COMPRESSED => 2,
        OPEN => 1,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    #[test]
    fn contacts_are_classified_by_their_overlap() {
        let mut config = PRESETS[2].config();
        config.chain.beads = 5;
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let m = RunManifest::new(&config, "run", origin).expect("valid");
        let u_m = [3e-9, 1e-9, 0.5e-9, 5e-9, 5e-9]; // overlaps 2, 0.5, −4.5, 0 nm
        let frame = Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &[0.0; 5], extra: &[] };
        let mut contacts = Contacts::new(&m, 1e-9);
        let classes = contacts.observe(&frame);
        assert_eq!(classes, [COMPRESSED, TOUCHING, OPEN, TOUCHING]);
        let expected = ContactCounts { compressed: 1, touching: 2, open: 1, compressed_range: Some((0, 0)) };
        assert_eq!(ContactCounts::of(classes), expected);
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
        let mut raster = ContactRaster::new(contacts, steps);
        let mut classes = vec![TOUCHING; contacts];
        classes[1234] = COMPRESSED;
        classes[1235] = OPEN;
        raster.push(29_999, &classes);
        raster.push(30_000, &vec![TOUCHING; contacts]);
        assert_eq!((raster.columns(), raster.rows()), (1000, 1000));
        let last_row = &raster.cells()[999 * 1000..];
        assert_eq!((last_row[246], last_row[247]), (COMPRESSED, OPEN));
        assert_eq!(raster.cells().iter().filter(|class| **class != TOUCHING).count(), 2);
    }
}
