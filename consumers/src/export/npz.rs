//! Arrays of `NumPy`: a ZIP file of `.npy` files, none of them pickled and none compressed.
//!
//! # Source
//! `NumPy`, `numpy.lib.format`: a magic, version 1.0 or 2.0, a header as a Python literal, the values.

use super::spool::Spool;
use super::{Excerpt, Export, ExportError};
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::whole_file::{WholeFile, WholeFileError};
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Files from here on need the 64-bit form of ZIP; well below 4 GiB, for there is a header, too.
const LARGE_BYTES: u64 = 0xF000_0000;

/// The arrays that have a row for each state, spooled one by one because a ZIP file has them one behind the other.
pub(super) struct Npz {
    file: WholeFile,
    excerpt: Excerpt,
    states: u64,
    displacement_m: Spool,
    velocity_m_s: Spool,
    time_s: Spool,
    step: Spool,
    frame: Spool,
}

impl Npz {
    pub(super) fn create(path: &Path, excerpt: &Excerpt, replace: bool) -> Result<Self, WholeFileError> {
        let file = WholeFile::create(path, replace)?;
        let spool = || Spool::beside(path);
        let [displacement_m, velocity_m_s, time_s, step, frame] =
            [spool()?, spool()?, spool()?, spool()?, spool()?];
        let excerpt = excerpt.clone();
        Ok(Self { file, excerpt, states: 0, displacement_m, velocity_m_s, time_s, step, frame })
    }

    fn write(self) -> io::Result<WholeFile> {
        let Self { file, excerpt, states, .. } = self;
        let mut arrays = Arrays::new(&file);
        let beads = excerpt.beads.len() as u64;
        arrays.spooled("displacement_m", "<f8", &[states, beads], self.displacement_m)?;
        arrays.spooled("velocity_m_s", "<f8", &[states, beads], self.velocity_m_s)?;
        arrays.spooled("time_s", "<f8", &[states], self.time_s)?;
        arrays.spooled("step", "<i8", &[states], self.step)?;
        arrays.spooled("frame", "<i8", &[states], self.frame)?;
        arrays.chain(&excerpt, &excerpt.manifest.physics.chain())?;
        arrays.text("manifest", &excerpt.manifest.to_json())?;
        arrays.finish()?;
        Ok(file)
    }
}

impl Export for Npz {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), ExportError> {
        let (u_m, v_m_s) = self.excerpt.of(frame);
        self.displacement_m.doubles(u_m)?;
        self.velocity_m_s.doubles(v_m_s)?;
        self.time_s.doubles(&[frame.time_s])?;
        self.step.integer(frame.step.cast_signed())?;
        self.frame.integer(self.excerpt.frame_at(frame.step).map_or(-1, u64::cast_signed))?;
        self.states += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Vec<PathBuf>, ExportError> {
        let partial = self.file.partial().to_owned();
        let file = self.write().map_err(WholeFileError::io(&partial))?;
        Ok(vec![file.publish()?])
    }
}

/// The ZIP file.
struct Arrays {
    zip: ZipWriter<BufWriter<Arc<File>>>,
}

impl Arrays {
    fn new(file: &WholeFile) -> Self {
        Self { zip: ZipWriter::new(BufWriter::with_capacity(1 << 18, Arc::clone(file.file()))) }
    }

    /// What does not change: one number for each bead and each contact.
    fn chain(&mut self, excerpt: &Excerpt, chain: &Chain) -> io::Result<()> {
        let (beads, contacts) = (excerpt.beads.clone(), excerpt.contacts());
        let numbers: Vec<u8> = beads.clone().flat_map(|bead| (bead as u64).to_le_bytes()).collect();
        self.array("bead", "<i8", &[beads.len() as u64], numbers.len() as u64, &*numbers)?;
        self.doubles("mass_kg", &chain.mass_kg[beads])?;
        self.doubles("stiffness", &chain.stiffness[contacts.clone()])?;
        self.doubles("rest_overlap_m", &chain.rest_overlap_m[contacts])
    }

    fn doubles(&mut self, name: &str, values: &[f64]) -> io::Result<()> {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.array(name, "<f8", &[values.len() as u64], bytes.len() as u64, &*bytes)
    }

    /// A text as an array without dimensions.
    fn text(&mut self, name: &str, text: &str) -> io::Result<()> {
        let bytes: Vec<u8> = text.chars().flat_map(|char| u32::from(char).to_le_bytes()).collect();
        self.array(name, &format!("<U{}", bytes.len() / 4), &[], bytes.len() as u64, &*bytes)
    }

    fn spooled(&mut self, name: &str, dtype: &str, shape: &[u64], spool: Spool) -> io::Result<()> {
        let bytes = spool.bytes();
        self.array(name, dtype, shape, bytes, spool.read()?)
    }

    fn array(
        &mut self,
        name: &str,
        dtype: &str,
        shape: &[u64],
        bytes: u64,
        mut values: impl Read,
    ) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(bytes >= LARGE_BYTES);
        self.zip.start_file(format!("{name}.npy"), options)?;
        self.zip.write_all(&npy_header(dtype, shape))?;
        let copied = io::copy(&mut values, &mut self.zip)?;
        assert_eq!(copied, bytes, "a spool gives back what it was given");
        Ok(())
    }

    fn finish(self) -> io::Result<()> {
        self.zip.finish()?.flush()
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
