//! Rows of our results, compared with the analyses of the recomputed states.

mod energies;
mod remade;

use crate::display::counted;
use crate::failure::{BadInput, Failure};
use crate::frames::{Frames, is_of_a_file};
use energies::EnergyRows;
use producer::resimulation::Lend;
use producer::verification::Verification;
use recording::{RecordedRow, RecordedRows};
use remade::RemadeRows;
use schemas::frame::{Frame, FrameSource, Received};
use schemas::manifest::RunManifest;
use schemas::results::RowValues;
use serde::Serialize;
use source::Source;
use std::num::NonZero;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The differences that are kept; more are only counted.
const MOST_DIFFERENCES: usize = 5;

/// Findings about the rows of one topic.
#[derive(Debug, Default, Serialize)]
pub(crate) struct RowsChecked {
    pub(crate) topic: String,
    /// Rows that are what the states give.
    #[serde(rename = "proven")]
    pub(crate) proven_count: u64,
    /// Rows that differ from the states; the first ones.
    pub(crate) differences: Vec<String>,
    pub(crate) difference_count: u64,
    /// Rows that could not be compared, and why.
    pub(crate) not_checked: Vec<String>,
    /// Rows that differ, perhaps because of frames before them that are not known.
    #[serde(skip)]
    unknown_count: u64,
}

/// A row beside the one that the states give.
enum Compared {
    Same,
    Differs(String),
    /// They differ, but the row depends on frames that are not known.
    Unknown,
}

impl From<Option<String>> for Compared {
    fn from(wrong: Option<String>) -> Self {
        wrong.map_or(Self::Same, Self::Differs)
    }
}

impl RowsChecked {
    fn compare(&mut self, frame: u64, compared: Compared) {
        let wrong = match compared {
            Compared::Same => return self.proven_count += 1,
            Compared::Unknown => return self.unknown_count += 1,
            Compared::Differs(wrong) => wrong,
        };
        self.difference_count += 1;
        if self.differences.len() < MOST_DIFFERENCES {
            self.differences.push(format!("the row of frame {frame} of {}: {wrong}", self.topic));
        }
    }
}

/// The rows of one topic, while the frames go by.
struct Reader {
    rows: RecordedRows,
    next: Option<RecordedRow>,
    /// Rows of frames of which there is no state.
    stateless_count: u64,
    checker: Checker,
    found: RowsChecked,
}

enum Checker {
    /// Rows that depend on the frames before.
    Energies(Box<EnergyRows>),
    /// Rows of any other analysis.
    Remade(RemadeRows),
}

/// Compares the rows of the recording `path`, in which `found` was found.
pub(crate) fn check(
    path: &Path,
    found: &Verification,
    threads: NonZero<usize>,
    stop: &Arc<AtomicBool>,
) -> Result<Vec<RowsChecked>, Failure> {
    let (mut readers, mut checked) = (Vec::new(), Vec::new());
    for (topic, rows) in &found.rows {
        let not_checked = |why: String| RowsChecked {
            topic: topic.clone(),
            not_checked: vec![format!("{} of `{topic}`, {why}", counted(rows.count, "row"))],
            ..RowsChecked::default()
        };
        if let Some(other) = &found.other_kernel {
            checked.push(not_checked(format!("which nothing is recomputed for: {other}")));
            continue;
        }
        if !found.has_sound_states() {
            checked.push(not_checked("because something is wrong with the file or its states".to_owned()));
            continue;
        }
        match Checker::of(topic, &found.manifest) {
            Some(checker) => readers.push(Reader::new(RecordedRows::open(path, topic).bad_input()?, checker)),
            None => checked.push(not_checked("which this program does not make again".to_owned())),
        }
    }
    if readers.is_empty() {
        return Ok(checked);
    }
    let pass = |readers: &mut [Reader]| -> Result<(), Failure> {
        let source = Source::recording(path, stop).bad_input()?;
        let mut frames = Frames::recomputed(source, Lend::Frames, false, 0, Some(threads))?;
        follow(&mut frames, readers)
    };
    pass(&mut readers)?;
    // rows of another split bead: made again with the one that they are of
    for reader in &mut readers {
        if let Checker::Energies(energies) = &reader.checker
            && let Some(split) = energies.other_split(&found.manifest)
        {
            let rows = RecordedRows::open(path, reader.rows.topic()).bad_input()?;
            let checker = Checker::Energies(Box::new(EnergyRows::new(&found.manifest, split)));
            let mut again = [Reader::new(rows, checker)];
            pass(&mut again)?;
            let [again] = again;
            if again.found.difference_count < reader.found.difference_count {
                *reader = again;
            }
        }
    }
    checked.extend(readers.into_iter().map(|reader| reader.found));
    Ok(checked)
}

/// Hands every frame to the rows of it.
fn follow(frames: &mut Frames, readers: &mut [Reader]) -> Result<(), Failure> {
    let manifest = frames.manifest().clone();
    loop {
        match frames.receive() {
            Ok(Received::Frame(frame)) => {
                for reader in &mut *readers {
                    reader.take(&frame, &manifest);
                }
            }
            Ok(Received::Missed { .. }) => {}
            // the wrong state was found before; the rows after it cannot be compared with anything
            Ok(Received::End(_)) => break,
            Err(error) if is_of_a_file(&error) => break,
            Err(error) => return Err(error.into()),
        }
    }
    for reader in readers {
        while reader.next.is_some() {
            reader.stateless_count += 1;
            reader.advance();
        }
        reader.close();
    }
    Ok(())
}

impl Checker {
    /// The analysis whose rows `topic` has; none if they cannot be made again.
    fn of(topic: &str, manifest: &RunManifest) -> Option<Self> {
        if topic == "/energies" {
            return Some(Self::Energies(Box::new(EnergyRows::of(manifest))));
        }
        RemadeRows::of(topic).map(Self::Remade)
    }
}

impl Reader {
    fn new(rows: RecordedRows, checker: Checker) -> Self {
        let found = RowsChecked { topic: rows.topic().to_owned(), ..RowsChecked::default() };
        let mut reader = Self { rows, next: None, stateless_count: 0, checker, found };
        reader.advance();
        reader
    }

    /// Goes to the next row; nothing after an invalid row is looked at.
    fn advance(&mut self) {
        self.next = match self.rows.next_row() {
            Ok(next) => next,
            Err(error) => {
                self.found.difference_count += 1;
                self.found.differences.push(error.to_string());
                None
            }
        };
    }

    fn take(&mut self, frame: &Frame<'_>, manifest: &RunManifest) {
        while self.next.as_ref().is_some_and(|row| row.frame < frame.frame) {
            self.stateless_count += 1;
            self.advance();
        }
        let row = self.next.as_ref().filter(|row| row.frame == frame.frame);
        let compared = match (&mut self.checker, row.map(|row| row.values.lend())) {
            // they know what was before the first row
            (Checker::Energies(energies), None) => energies.take(frame, None).into(),
            (Checker::Energies(energies), Some(RowValues::Numbers(values))) => {
                energies.take_named(frame, &self.rows.names(), values).into()
            }
            (Checker::Energies(_), Some(_)) => Compared::Differs("its values are of another type".to_owned()),
            (Checker::Remade(remade), _) => {
                let Some(next) = &self.next else { return };
                let Some(compared) = remade.take(manifest, frame, &self.rows.names(), next) else { return };
                compared
            }
        };
        if row.is_some() {
            self.found.compare(frame.frame, compared);
            self.advance();
        }
    }

    /// No more frames come.
    fn close(&mut self) {
        if let Checker::Energies(energies) = &self.checker
            && let Some((frame, is_wrong)) = energies.inconsistent_from()
        {
            let what = format!("the corrected energies of `/energies` from frame {frame} on");
            if is_wrong {
                self.found.difference_count += 1;
                self.found.differences.push(format!("{what} are those of no analysis"));
            } else {
                self.found
                    .not_checked
                    .push(format!("{what}: they depend on frames that are not here, or that have no row"));
            }
        }
        let topic = &self.found.topic;
        if self.found.unknown_count > 0 {
            let rows = counted(self.found.unknown_count, "row");
            let why =
                "they depend on frames before them that are not here, or on a threshold that is not told";
            self.found.not_checked.push(format!("{rows} of `{topic}`: {why}"));
        }
        if self.stateless_count > 0 {
            let rows = counted(self.stateless_count, "row");
            self.found.not_checked.push(format!("{rows} of `{topic}`: of frames before or after the states"));
        }
    }
}

/// The same bits; one NaN is as good as another.
fn is_same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}
