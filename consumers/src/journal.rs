//! Rows of a table that are computed in any order, by several processes, and outlive each of them.
//!
//! Every process has a journal of its own: a text file with a line a row, each with its checksum. A row is with the operating
//! system as soon as it is computed, which is enough against a kill, and soon on the disk, with others. A row that a kill has
//! torn is found, removed and computed again. When all journals of a table are read, their rows make the table in the order of
//! their numbers.

use crate::table::{Cell, Column, Kind};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use storage::open_file;

/// So many rows, or as many as come in so much time, are synced together.
const SYNCED_ROWS: u64 = 1000;
const SYNCED_AFTER: Duration = Duration::from_secs(1);

/// Bytes of the checksum of a line and of the space behind it.
pub const CHECKSUM_BYTES: usize = 9;

/// Longest line that is read.
const MAX_LINE_BYTES: u64 = 1 << 20;

/// Table that a journal belongs to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JournalHead {
    /// Identity of the rows' origin; two tables of one identity have the same rows.
    pub identity: String,
    /// The columns, each of a kind.
    pub columns: Vec<Column>,
}

/// A row with its number.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Number of the row in the table.
    pub index: u64,
    /// Wall time that the row took (s): no part of the table.
    pub wall_s: f64,
    /// A value for each column.
    pub cells: Vec<Cell>,
}

/// Reason why a journal cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// It belongs to another table.
    #[error("{} belongs to another table, of {found}", path.display())]
    Foreign {
        /// The journal.
        path: PathBuf,
        /// The identity in it, or its other columns.
        found: String,
    },
    /// Its first line, which says to which table its rows belong, was changed.
    #[error(
        "the first line of {} is damaged, so that the table of its rows is unknown: put the first line of another \
         journal of the same table in its place, or move the file away to compute its rows again",
        path.display()
    )]
    Damaged {
        /// The journal.
        path: PathBuf,
    },
    /// Another process writes it.
    #[error("{} is being written by another process", path.display())]
    Busy {
        /// The journal.
        path: PathBuf,
    },
    /// The operating system refused.
    #[error("{} cannot be read or written", path.display())]
    Io {
        /// The journal.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

impl JournalError {
    fn io(path: &Path) -> impl Fn(io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}

/// A journal that this process writes; locked until it is dropped.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    unsynced: Mutex<Unsynced>,
}

/// Rows that a power failure may take.
#[derive(Debug)]
struct Unsynced {
    count: u64,
    /// Time at which the first of them was written.
    since: Instant,
}

#[derive(Serialize, Deserialize)]
struct HeadLine {
    identity: String,
    columns: Vec<String>,
}

#[derive(Serialize, Deserialize)]
struct EntryLine {
    index: u64,
    wall_s: f64,
    cells: Vec<Value>,
}

/// A row whose values are not needed.
#[derive(Deserialize)]
struct Skimmed {
    index: u64,
    wall_s: f64,
    cells: Vec<IgnoredAny>,
}

/// Findings on the way through a journal.
#[derive(Debug, Default)]
struct Walked {
    /// Lines that are damaged, the torn last one not counted.
    damaged_count: u64,
    /// End of the last whole line.
    whole_bytes: u64,
}

impl Journal {
    /// Opens the journal `path` of the table `head` to go on with it, or begins it, and tells `each` the number of every row
    /// that it has. A torn last line is removed.
    ///
    /// # Errors
    /// When it belongs to another table, when its first line is damaged, when another process writes it, or when the
    /// operating system refuses. The journal is left as it is then.
    pub fn open(path: &Path, head: &JournalHead, mut each: impl FnMut(u64)) -> Result<Self, JournalError> {
        let io = JournalError::io(path);
        if path.exists() {
            // nobody waits for whoever writes into a pipe
            open_file(path).map_err(&io)?;
        }
        let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).clone();
        let mut file = options.open(path).map_err(&io)?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(JournalError::Busy { path: path.to_owned() });
        }
        let walked = walk(&mut BufReader::new(&file), path, Some(head), |json| {
            let row = skimmed(json, head);
            if let Some(row) = &row {
                each(row.index);
            }
            Ok::<_, JournalError>(row.is_some())
        })?;
        file.set_len(walked.whole_bytes).map_err(&io)?;
        file.seek(SeekFrom::End(0)).map_err(&io)?;
        let unsynced = Mutex::new(Unsynced { count: 0, since: Instant::now() });
        let journal = Self { path: path.to_owned(), file, unsynced };
        if walked.whole_bytes == 0 {
            (&journal.file).write_all(head_line(head).as_bytes()).map_err(&io)?;
            journal.sync()?;
            // the name must outlive a crash as well as the rows
            let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty());
            let synced = File::open(directory.unwrap_or(Path::new("."))).and_then(|file| file.sync_all());
            synced.map_err(io)?;
        }
        Ok(journal)
    }

    /// Adds a row; on return it outlives this process, and after [`Self::sync`] a power failure.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn append(&self, entry: &Entry) -> Result<(), JournalError> {
        let line = line_of(entry);
        // whoever panicked while holding it has not written half a row that the next would not notice
        let mut unsynced = self.unsynced.lock().unwrap_or_else(PoisonError::into_inner);
        (&self.file).write_all(line.as_bytes()).map_err(JournalError::io(&self.path))?;
        if unsynced.count == 0 {
            unsynced.since = Instant::now();
        }
        unsynced.count += 1;
        Ok(())
    }

    /// Syncs the rows that were added, if they are many or the first of them was added a while ago. Rows can be added meanwhile.
    ///
    /// # Errors
    /// When the disk does not take them.
    pub fn sync_if_due(&self) -> Result<(), JournalError> {
        let is_due = {
            let unsynced = self.unsynced.lock().unwrap_or_else(PoisonError::into_inner);
            unsynced.count >= SYNCED_ROWS || (unsynced.count > 0 && unsynced.since.elapsed() >= SYNCED_AFTER)
        };
        if is_due { self.sync() } else { Ok(()) }
    }

    /// Syncs the rows that were added.
    ///
    /// # Errors
    /// When the disk does not take them.
    pub fn sync(&self) -> Result<(), JournalError> {
        self.unsynced.lock().unwrap_or_else(PoisonError::into_inner).count = 0;
        self.file.sync_data().map_err(JournalError::io(&self.path))
    }
}

/// Tells `each` the number and the JSON of every row of the journal `path` of the table `head`, which another process may be
/// writing, in the order in which they were written; [`entry`] reads the JSON. Gives how many lines are damaged.
///
/// # Errors
/// When it belongs to another table, when its first line is damaged, when it cannot be read, or when `each` fails.
pub fn read<E: From<JournalError>>(
    path: &Path,
    head: &JournalHead,
    mut each: impl FnMut(u64, &[u8]) -> Result<(), E>,
) -> Result<u64, E> {
    let file = open_file(path).map_err(JournalError::io(path))?;
    let walked = walk(&mut BufReader::new(file), path, Some(head), |json| match skimmed(json, head) {
        Some(row) => each(row.index, json).map(|()| true),
        None => Ok(false),
    })?;
    Ok(walked.damaged_count)
}

/// Tells `each` the number of every row of the journal `path`, of whatever table, and how long it took (s). Gives how many lines
/// are damaged.
///
/// # Errors
/// When it cannot be read.
pub fn scan(path: &Path, mut each: impl FnMut(u64, f64)) -> Result<u64, JournalError> {
    let file = open_file(path).map_err(JournalError::io(path))?;
    let walked = walk(&mut BufReader::new(file), path, None, |json| {
        let row = serde_json::from_slice::<Skimmed>(json).ok();
        if let Some(row) = &row {
            each(row.index, row.wall_s);
        }
        Ok::<_, JournalError>(row.is_some())
    })?;
    Ok(walked.damaged_count)
}

fn skimmed(json: &[u8], head: &JournalHead) -> Option<Skimmed> {
    serde_json::from_slice::<Skimmed>(json).ok().filter(|row| row.cells.len() == head.columns.len())
}

/// The line of a row: [`CHECKSUM_BYTES`], its JSON, the end of the line.
pub fn line_of(entry: &Entry) -> String {
    let cells = entry.cells.iter().map(to_json).collect();
    line(&EntryLine { index: entry.index, wall_s: entry.wall_s, cells })
}

/// A line with its checksum.
fn line(content: &impl Serialize) -> String {
    // plain structs of numbers and words always serialise
    let json = serde_json::to_string(content).unwrap_or_default();
    format!("{:08x} {json}\n", crc32fast::hash(json.as_bytes()))
}

fn head_line(head: &JournalHead) -> String {
    line(&HeadLine { identity: head.identity.clone(), columns: names(head) })
}

fn names(head: &JournalHead) -> Vec<String> {
    head.columns.iter().map(|column| column.name.clone()).collect()
}

/// Tells `row` the JSON of each line whose checksum is right, but for the first, which is to be that of `head`; it says whether
/// that is a row.
fn walk<E: From<JournalError>>(
    reader: &mut impl BufRead,
    path: &Path,
    head: Option<&JournalHead>,
    mut row: impl FnMut(&[u8]) -> Result<bool, E>,
) -> Result<Walked, E> {
    let mut walked = Walked::default();
    let (mut line, mut position) = (Vec::new(), 0);
    loop {
        line.clear();
        let read = reader.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut line);
        position += read.map_err(JournalError::io(path))? as u64;
        // without its end it is torn, or endless
        let Some(line) = line.strip_suffix(b"\n") else { return Ok(walked) };
        if walked.whole_bytes == 0 {
            if let Some(head) = head
                && !begins(reader, (line, position), path, head)?
            {
                return Ok(walked);
            }
        } else {
            let is_row = checked(line).map_or(Ok(false), &mut row)?;
            walked.damaged_count += u64::from(!is_row);
        }
        walked.whole_bytes = position;
    }
}

/// True if the journal has a head. `line` is its first line, which ends at `position`.
fn begins(
    reader: &mut impl BufRead,
    (line, position): (&[u8], u64),
    path: &Path,
    head: &JournalHead,
) -> Result<bool, JournalError> {
    let found = check_head(line, path, head);
    if matches!(found, Err(JournalError::Damaged { .. })) && checked(line).is_none() {
        // a power failure may leave holes in a head that was not synced, and no row comes before that
        let most = head_line(head).len() as u64;
        let rest = io::copy(&mut reader.by_ref().take(most), &mut io::sink());
        if position + rest.map_err(JournalError::io(path))? <= most {
            return Ok(false);
        }
    }
    found.map(|()| true)
}

/// Refuses a journal that begins with `line` unless it is one of the table `head`.
fn check_head(line: &[u8], path: &Path, head: &JournalHead) -> Result<(), JournalError> {
    let found = checked(line).and_then(|json| serde_json::from_slice::<HeadLine>(json).ok());
    let found = found.ok_or_else(|| JournalError::Damaged { path: path.to_owned() })?;
    let is_same = found.identity == head.identity;
    if is_same && found.columns == names(head) {
        return Ok(());
    }
    let found = if is_same { "other columns".to_owned() } else { format!("identity {}", found.identity) };
    Err(JournalError::Foreign { path: path.to_owned(), found })
}

/// The JSON of a line whose checksum is right.
fn checked(line: &[u8]) -> Option<&[u8]> {
    let (checksum, json) = line.split_at_checked(CHECKSUM_BYTES)?;
    let checksum = std::str::from_utf8(checksum.strip_suffix(b" ")?).ok()?;
    (u32::from_str_radix(checksum, 16).ok()? == crc32fast::hash(json)).then_some(json)
}

/// The row that `json` is, as [`read`] tells it.
pub fn entry(json: &[u8], columns: &[Column]) -> Option<Entry> {
    let line: EntryLine = serde_json::from_slice(json).ok()?;
    if line.cells.len() != columns.len() {
        return None;
    }
    let cells = line.cells.into_iter().zip(columns).map(|(value, column)| from_json(value, column.kind));
    Some(Entry { index: line.index, wall_s: line.wall_s, cells: cells.collect::<Option<_>>()? })
}

fn to_json(cell: &Cell) -> Value {
    match cell {
        Cell::Integer(value) => Value::from(*value),
        Cell::Double(value) if value.is_finite() => Value::from(*value),
        // JSON has no word for these
        Cell::Double(value) => Value::from(value.to_string()),
        Cell::Word(word) => Value::from(word.as_str()),
        Cell::Empty => Value::Null,
    }
}

fn from_json(value: Value, kind: Option<Kind>) -> Option<Cell> {
    match (kind?, value) {
        (_, Value::Null) => Some(Cell::Empty),
        (Kind::Integer, value) => value.as_u64().map(Cell::Integer),
        (Kind::Double, Value::String(word)) => word.parse().ok().map(Cell::Double),
        (Kind::Double, value) => value.as_f64().map(Cell::Double),
        (Kind::Word, Value::String(word)) => Some(Cell::Word(word)),
        (Kind::Word, _) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn head() -> JournalHead {
        let columns = [("steps", Kind::Integer), ("total_j", Kind::Double), ("error", Kind::Word)];
        let columns = columns.map(|(name, kind)| Column::new(name, kind)).to_vec();
        JournalHead { identity: "abc".into(), columns }
    }

    fn row(index: u64) -> Entry {
        let value = 0.1 + 1e-17 * index as f64;
        let cells =
            vec![Cell::Integer(u64::MAX), Cell::Double(value), Cell::Word(format!("\"é\", {index}\n"))];
        Entry { index, wall_s: 0.25, cells }
    }

    fn open(path: &Path) -> Result<Journal, JournalError> {
        Journal::open(path, &head(), |_| ())
    }

    /// The rows of a journal, and how many are damaged.
    fn rows(path: &Path) -> Result<(Vec<Entry>, u64), JournalError> {
        let mut rows = Vec::new();
        let damaged = read(path, &head(), |_, json| {
            rows.extend(entry(json, &head().columns));
            Ok::<_, JournalError>(())
        })?;
        Ok((rows, damaged))
    }

    /// A journal with the rows 0 to `count − 1`.
    fn written(path: &Path, count: u64) -> Vec<u8> {
        let journal = open(path).expect("opens");
        (0..count).for_each(|index| journal.append(&row(index)).expect("disk"));
        fs::read(path).expect("written")
    }

    #[test]
    fn rows_read_back_as_they_were() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("rows");
        written(&path, 3);
        assert_eq!(rows(&path).expect("ours"), ([0, 1, 2].map(row).to_vec(), 0));
        let mut numbers = Vec::new();
        assert_eq!(scan(&path, |index, wall_s| numbers.push((index, wall_s))).expect("readable"), 0);
        assert_eq!(numbers, [(0, 0.25), (1, 0.25), (2, 0.25)]);
        for value in [-0.0, f64::INFINITY, f64::NEG_INFINITY, 5e-324, f64::MAX] {
            let cell = from_json(to_json(&Cell::Double(value)), Some(Kind::Double));
            let Some(Cell::Double(back)) = cell else { panic!("{cell:?}") };
            assert_eq!(back.to_bits(), value.to_bits());
        }
    }

    /// A kill may tear the last line at any byte: the rows before it stay, and it is written again.
    #[test]
    fn a_torn_row_is_removed_wherever_it_is_torn() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("rows");
        let (two, three) = (written(&dir.path().join("two"), 2), written(&path, 3));
        assert!(three.starts_with(&two));
        for length in two.len()..three.len() {
            fs::write(&path, &three[..length]).expect("disk");
            let (found, damaged) = rows(&path).expect("while it is being written");
            assert_eq!((found.len(), damaged), (2, 0), "torn at byte {length}");
            let mut numbers = Vec::new();
            let journal = Journal::open(&path, &head(), |index| numbers.push(index)).expect("repaired");
            assert_eq!(numbers, [0, 1]);
            journal.append(&row(2)).expect("disk");
            assert_eq!(fs::read(&path).expect("whole"), three);
        }
    }

    /// A torn head is a journal that was never begun, also with holes in it.
    #[test]
    fn a_torn_head_is_written_again() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("rows");
        let whole = written(&path, 0);
        for length in 0..whole.len() {
            let holes = [vec![b'\n'; length], whole[length..].to_vec()].concat();
            for torn in [&whole[..length], &holes[..holes.len() - usize::from(length == 0)]] {
                fs::write(&path, torn).expect("disk");
                drop(open(&path).expect("repaired"));
                assert_eq!(fs::read(&path).expect("whole"), whole);
            }
        }
    }

    #[test]
    fn a_damaged_row_is_left_out_and_counted() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("rows");
        let two = written(&dir.path().join("two"), 2).len();
        let one = written(&dir.path().join("one"), 1).len();
        let whole = written(&path, 3);
        for byte in one..two - 1 {
            let mut damaged = whole.clone();
            damaged[byte] ^= 1;
            if damaged[byte] == b'\n' {
                continue; // two lines then
            }
            fs::write(&path, &damaged).expect("disk");
            assert_eq!(rows(&path).expect("ours"), (vec![row(0), row(2)], 1), "byte {byte}");
        }
    }

    /// Whole rows are not lost when the line that names their table is damaged.
    #[test]
    fn a_damaged_head_is_refused_and_nothing_is_lost() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("rows");
        let head_bytes = written(&dir.path().join("none"), 0).len();
        let whole = written(&path, 2);
        let damaged = |byte: usize| {
            let mut bytes = whole.clone();
            bytes[byte] ^= 1;
            bytes
        };
        // the head is not there at all in the last
        for bytes in (0..head_bytes).map(damaged).chain([whole[head_bytes..].to_vec()]) {
            fs::write(&path, &bytes).expect("disk");
            assert!(matches!(open(&path), Err(JournalError::Damaged { .. })));
            assert!(matches!(rows(&path), Err(JournalError::Damaged { .. })));
            assert_eq!(fs::read(&path).expect("left alone"), bytes);
        }
    }

    #[test]
    fn a_journal_of_another_table_is_refused() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("rows");
        written(&path, 1);
        let other = JournalHead { identity: "other".into(), ..head() };
        let foreign = |head| match Journal::open(&path, head, |_| ()) {
            Err(JournalError::Foreign { found, .. }) => found,
            opened => panic!("{opened:?}"),
        };
        assert_eq!(foreign(&other), "identity abc");
        let mut columns = head();
        columns.columns.truncate(2);
        assert_eq!(foreign(&columns), "other columns");
    }

    #[test]
    fn one_process_writes_at_a_time() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("rows");
        let _first = open(&path).expect("opens");
        assert!(matches!(open(&path), Err(JournalError::Busy { .. })));
    }
}
