//! Arrays of `NumPy`: a ZIP file of `.npy` files, none of them pickled and none compressed.
//!
//! # Source
//! `NumPy`, `numpy.lib.format`: a magic, the version 1.0, a header as a Python literal, the values.

use super::spool::Spool;
use super::{Excerpt, Export, ExportError};
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::whole_file::{WholeFile, WholeFileError};
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Files from here on need the 64-bit form of ZIP; well below 4 GiB, for there is a header, too.
const LARGE_BYTES: u64 = 0xF000_0000;

/// Bytes that are copied into the ZIP file at a time.
const PIECE_BYTES: u64 = 16 << 20;

/// The arrays with a row for each state wait in spools, because a ZIP file has one behind the other.
pub(super) struct Npz {
    excerpt: Excerpt,
    states: u64,
    /// Displacements, velocities, times, steps and frames.
    rows: [Rows; 5],
    /// Number of arrays that are in the ZIP file.
    done: usize,
    copied_bytes: u64,
    zip: Zip,
    // after what writes to it
    file: WholeFile,
}

/// An array with a row for each state.
struct Rows {
    name: &'static str,
    dtype: &'static str,
    /// True if a row has a value for each bead.
    of_beads: bool,
    spool: Spool,
}

impl Npz {
    pub(super) fn create(path: &Path, excerpt: &Excerpt, replace: bool) -> Result<Self, WholeFileError> {
        let file = WholeFile::create(path, replace)?;
        let rows = |name, dtype, of_beads| {
            Ok::<_, WholeFileError>(Rows { name, dtype, of_beads, spool: Spool::beside(path)? })
        };
        let rows = [
            rows("displacement_m", "<f8", true)?,
            rows("velocity_m_s", "<f8", true)?,
            rows("time_s", "<f8", false)?,
            rows("step", "<i8", false)?,
            rows("frame", "<i8", false)?,
        ];
        let zip = Zip::new(&file);
        Ok(Self { excerpt: excerpt.clone(), states: 0, rows, done: 0, copied_bytes: 0, zip, file })
    }

    /// Copies a piece of the spools into the ZIP file, and returns the fraction done; none when all is done.
    fn copy_piece(&mut self) -> io::Result<Option<f64>> {
        let total: u64 = self.rows.iter().map(|rows| rows.spool.bytes()).sum();
        let Some(Rows { name, dtype, of_beads, spool }) = self.rows.get_mut(self.done) else {
            return Ok(None);
        };
        if !spool.is_being_read() {
            let shape = [self.states, self.excerpt.beads.len() as u64];
            let shape = if *of_beads { &shape[..] } else { &shape[..1] };
            self.zip.begin(name, dtype, shape, spool.bytes())?;
        }
        let copied = spool.copy(&mut self.zip.0, PIECE_BYTES)?;
        if copied == 0 {
            self.done += 1;
        }
        self.copied_bytes += copied;
        Ok(Some(self.copied_bytes as f64 / total.max(1) as f64))
    }

    fn write_rest(mut self) -> io::Result<WholeFile> {
        while self.copy_piece()?.is_some() {}
        let Self { excerpt, mut zip, file, .. } = self;
        zip.chain(&excerpt, &excerpt.manifest.physics.chain())?;
        zip.text("manifest", &excerpt.manifest.to_json())?;
        zip.0.finish()?.flush()?;
        Ok(file)
    }
}

impl Export for Npz {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), ExportError> {
        let (u_m, v_m_s) = self.excerpt.of(frame);
        let number = self.excerpt.frame_at(frame.step).map_or(-1, u64::cast_signed);
        let [displacements, velocities, times, steps, numbers] = &mut self.rows;
        displacements.spool.doubles(u_m)?;
        velocities.spool.doubles(v_m_s)?;
        times.spool.doubles(&[frame.time_s])?;
        steps.spool.integer(frame.step.cast_signed())?;
        numbers.spool.integer(number)?;
        self.states += 1;
        Ok(())
    }

    fn assemble(&mut self) -> Result<Option<f64>, ExportError> {
        let copied = self.copy_piece();
        Ok(copied.map_err(WholeFileError::removed(self.file.path()))?)
    }

    fn finish(self: Box<Self>) -> Result<Vec<PathBuf>, ExportError> {
        let path = self.file.path().to_owned();
        let file = self.write_rest().map_err(WholeFileError::removed(&path))?;
        Ok(vec![file.publish()?])
    }
}

/// The ZIP file.
struct Zip(ZipWriter<UntilError>);

/// Takes bytes until one is refused, and then pretends to take the rest: a ZIP file that is given up tries to write its
/// end, and would say on stderr that it could not.
struct UntilError {
    out: BufWriter<Arc<File>>,
    position: u64,
    has_failed: bool,
}

impl UntilError {
    fn checked<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        self.has_failed |= result.is_err();
        result
    }
}

impl Write for UntilError {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = if self.has_failed { Ok(bytes.len()) } else { self.out.write(bytes) };
        let count = self.checked(written)?;
        self.position += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = if self.has_failed { Ok(()) } else { self.out.flush() };
        self.checked(flushed)
    }
}

impl Seek for UntilError {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let sought = match to {
            _ if !self.has_failed => self.out.seek(to),
            SeekFrom::Start(position) => Ok(position),
            SeekFrom::Current(by) => Ok(self.position.saturating_add_signed(by)),
            SeekFrom::End(_) => Ok(self.position),
        };
        self.position = self.checked(sought)?;
        Ok(self.position)
    }
}

impl Zip {
    fn new(file: &WholeFile) -> Self {
        let out = BufWriter::with_capacity(1 << 18, Arc::clone(file.file()));
        Self(ZipWriter::new(UntilError { out, position: 0, has_failed: false }))
    }

    /// Writes the constant arrays: one number for each bead and each contact.
    fn chain(&mut self, excerpt: &Excerpt, chain: &Chain) -> io::Result<()> {
        let (beads, contacts) = (excerpt.beads.clone(), excerpt.contacts());
        let numbers: Vec<u8> = beads.clone().flat_map(|bead| (bead as u64).to_le_bytes()).collect();
        self.array("bead", "<i8", &[beads.len() as u64], &numbers)?;
        self.doubles("mass_kg", &chain.mass_kg[beads])?;
        let stiffness: Vec<f64> = contacts.clone().map(|contact| chain.own_stiffness(contact)).collect();
        self.doubles("stiffness", &stiffness)?;
        self.doubles("rest_overlap_m", &chain.rest_overlap_m[contacts])
    }

    fn doubles(&mut self, name: &str, values: &[f64]) -> io::Result<()> {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.array(name, "<f8", &[values.len() as u64], &bytes)
    }

    /// A text as an array without dimensions.
    fn text(&mut self, name: &str, text: &str) -> io::Result<()> {
        let bytes: Vec<u8> = text.chars().flat_map(|char| u32::from(char).to_le_bytes()).collect();
        self.array(name, &format!("<U{}", bytes.len() / 4), &[], &bytes)
    }

    fn array(&mut self, name: &str, dtype: &str, shape: &[u64], values: &[u8]) -> io::Result<()> {
        self.begin(name, dtype, shape, values.len() as u64)?;
        self.0.write_all(values)
    }

    /// Begins an array; this many bytes of values come next.
    fn begin(&mut self, name: &str, dtype: &str, shape: &[u64], bytes: u64) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(bytes >= LARGE_BYTES);
        self.0.start_file(format!("{name}.npy"), options)?;
        self.0.write_all(&npy_header(dtype, shape))
    }
}

/// Everything before the values, in a multiple of 64 bytes.
fn npy_header(dtype: &str, shape: &[u64]) -> Vec<u8> {
    // a tuple of one has a comma, too
    let shape: Vec<_> = shape.iter().map(|length| format!("{length},")).collect();
    let shape = shape.join(" ");
    let literal = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({shape}), }}");
    let head = b"\x93NUMPY\x01\x00";
    let length = (head.len() + 2 + literal.len() + 1).next_multiple_of(64);
    let padded = length - head.len() - 2;
    // a name of a type and two lengths are far shorter than 64 KiB
    let padded_length = u16::try_from(padded).unwrap_or(u16::MAX);
    let mut header = head.to_vec();
    header.extend(padded_length.to_le_bytes());
    header.extend(literal.bytes());
    header.resize(length - 1, b' ');
    header.push(b'\n');
    header
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_those_that_numpy_writes() {
        let header = npy_header("<f8", &[3, 2]);
        assert_eq!(header.len(), 128);
        assert!(header.starts_with(
            b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2,), }  "
        ));
        assert_eq!(header.last(), Some(&b'\n'));
        let text = |shape: &[u64]| String::from_utf8_lossy(&npy_header("<i8", shape)).into_owned();
        assert!(text(&[7]).contains("'shape': (7,), }"));
        assert!(text(&[]).contains("'shape': (), }"));
    }
}
