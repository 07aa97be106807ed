//! HDF5 in the layout of H5MD, for everything that reads molecular dynamics.
//!
//! # Source
//! P. de Buyl, P. H. Colberg, F. Höfling, H5MD: A structured, efficient, and portable file format for molecular
//! data, Comput. Phys. Commun. 185, 1546 (2014), doi:10.1016/j.cpc.2014.01.018; version 1.1,
//! <https://www.nongnu.org/h5md/h5md.html>.

use super::{Excerpt, Export, ExportError};
use rust_hdf5::types::{H5Type, VarLenUnicode};
use rust_hdf5::{H5Dataset, H5File, H5Group, Hdf5Error};
use schemas::frame::Frame;
use schemas::whole_file::{WholeFile, WholeFileError};
use std::io;
use std::path::{Path, PathBuf};

/// What a chunk of a dataset has at most, unless a single state has more.
const CHUNK_BYTES: usize = 1 << 20;

/// Values in a chunk of a dataset with one value for each state.
const CHUNK_STATES: usize = 1 << 13;

/// The file, with a dataset that grows for each quantity.
pub(super) struct Hdf5 {
    position: Growing<f64>,
    velocity: Growing<f64>,
    time: Growing<f64>,
    step: Growing<i64>,
    // after its datasets and before its file: it completes itself when it is dropped
    h5: H5File,
    file: WholeFile,
    excerpt: Excerpt,
}

impl Hdf5 {
    pub(super) fn create(path: &Path, excerpt: &Excerpt, replace: bool) -> Result<Self, WholeFileError> {
        let file = WholeFile::create(path, replace)?;
        match Self::begin(&file, excerpt) {
            Ok((h5, [position, velocity, time], step)) => {
                Ok(Self { position, velocity, time, step, h5, file, excerpt: excerpt.clone() })
            }
            Err(error) => Err(error_of(&file, &error)),
        }
    }

    #[expect(clippy::type_complexity, reason = "taken apart at once")]
    fn begin(
        file: &WholeFile,
        excerpt: &Excerpt,
    ) -> Result<(H5File, [Growing<f64>; 3], Growing<i64>), Hdf5Error> {
        // the file is locked already
        let h5 = H5File::options().no_locking().create(file.partial())?;
        describe_file(&h5)?;
        describe_run(&h5, excerpt)?;
        let particles = h5.create_group("particles")?.create_group("chain")?;
        describe_chain(&particles, excerpt)?;

        let beads = excerpt.beads.len();
        let position = particles.create_group("position")?;
        let velocity = particles.create_group("velocity")?;
        let step = Growing::create(&position, "step", None)?;
        let time = Growing::create(&position, "time", None)?.with_unit("s")?;
        velocity.link("step", "/particles/chain/position/step")?;
        velocity.link("time", "/particles/chain/position/time")?;
        let position = Growing::create(&position, "value", Some(beads))?.with_unit("m")?;
        let velocity = Growing::create(&velocity, "value", Some(beads))?.with_unit("m s-1")?;
        Ok((h5, [position, velocity, time], step))
    }
}

impl Export for Hdf5 {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), ExportError> {
        let (u_m, v_m_s) = self.excerpt.of(frame);
        let mut take = || {
            self.position.push(u_m)?;
            self.velocity.push(v_m_s)?;
            self.time.push(&[frame.time_s])?;
            self.step.push(&[frame.step.cast_signed()])
        };
        let taken: Result<(), Hdf5Error> = take();
        taken.map_err(|error| error_of(&self.file, &error).into())
    }

    fn finish(self: Box<Self>) -> Result<Vec<PathBuf>, ExportError> {
        let Self { position, velocity, time, step, h5, file, .. } = *self;
        let close = || {
            for values in [position, velocity, time] {
                values.finish()?;
            }
            step.finish()?;
            // it is synced with its name
            h5.close_no_sync()
        };
        close().map_err(|error| error_of(&file, &error))?;
        Ok(vec![file.publish()?])
    }
}

fn error_of(file: &WholeFile, error: &Hdf5Error) -> WholeFileError {
    WholeFileError::io(file.partial())(io::Error::other(error.to_string()))
}

/// The group `h5md`, which names the layout.
fn describe_file(h5: &H5File) -> Result<(), Hdf5Error> {
    let h5md = h5.create_group("h5md")?;
    h5md.set_attr_array_numeric("version", &[1_i32, 1])?;
    // the user is unknown, and need not be known
    h5md.create_group("author")?.set_attr_string("name", "unknown")?;
    let creator = h5md.create_group("creator")?;
    creator.set_attr_string("name", "beadline")?;
    creator.set_attr_string("version", env!("CARGO_PKG_VERSION"))?;
    let units = h5md.create_group("modules")?.create_group("units")?;
    units.set_attr_array_numeric("version", &[1_i32, 0])?;
    units.set_attr_string("system", "SI")
}

/// The group `parameters`: the manifest, and its values that are looked up most.
fn describe_run(h5: &H5File, excerpt: &Excerpt) -> Result<(), Hdf5Error> {
    let parameters = h5.create_group("parameters")?;
    parameters.write_vlen_strings("manifest", &[&excerpt.manifest.to_json()])?;
    let physics = &excerpt.manifest.physics;
    parameters.set_attr_numeric("alpha", &physics.alpha)?;
    parameters.set_attr_numeric("dt_s", &physics.dt_s)?;
    parameters.set_attr_numeric("step_count", &physics.step_count)?;
    parameters.set_attr_string("method", &physics.method.to_string())?;
    let (chain, contacts) = (physics.chain(), excerpt.contacts());
    let unit = format!("N m-{}", physics.alpha);
    fixed(&parameters, "stiffness", &chain.stiffness[contacts.clone()], &unit)?;
    fixed(&parameters, "rest_overlap", &chain.rest_overlap_m[contacts], "m")
}

/// What of the beads does not change.
fn describe_chain(particles: &H5Group, excerpt: &Excerpt) -> Result<(), Hdf5Error> {
    let space = particles.create_group("box")?;
    space.set_attr_numeric("dimension", &1_i32)?;
    space.set_attr_string_array("boundary", &["none"])?;
    let beads: Vec<i64> = excerpt.beads.clone().map(|bead| (bead as u64).cast_signed()).collect();
    particles.new_dataset::<i64>().shape([beads.len()]).create("id")?.write_raw(&beads)?;
    let mass_kg = &excerpt.manifest.physics.chain().mass_kg[excerpt.beads.clone()];
    fixed(particles, "mass", mass_kg, "kg")
}

/// A dataset of which all values are known.
fn fixed(group: &H5Group, name: &str, values: &[f64], unit: &str) -> Result<(), Hdf5Error> {
    let dataset = group.new_dataset::<f64>().shape([values.len()]).create(name)?;
    // one bead has no contact
    if !values.is_empty() {
        dataset.write_raw(values)?;
    }
    set_unit(&dataset, unit)
}

fn set_unit(dataset: &H5Dataset, unit: &str) -> Result<(), Hdf5Error> {
    let attribute = dataset.new_attr::<VarLenUnicode>().shape(()).create("unit")?;
    attribute.write_scalar(&VarLenUnicode(unit.to_owned()))
}

/// A dataset that gets a row with each state, written a chunk at a time.
struct Growing<T> {
    dataset: H5Dataset,
    /// The next chunk, as far as it is known.
    pending: Vec<T>,
    chunk_values: usize,
}

impl<T: H5Type> Growing<T> {
    /// With a value for each state, or with vectors of one component for each of `beads`.
    fn create(group: &H5Group, name: &str, beads: Option<usize>) -> Result<Self, Hdf5Error> {
        let row = beads.unwrap_or(1);
        let rows = (CHUNK_BYTES / (row * T::element_size())).clamp(1, CHUNK_STATES);
        let dataset = group.new_dataset::<T>();
        let dataset = match beads {
            None => dataset.shape([0]).chunk(&[rows]).max_shape(&[None]),
            Some(beads) => {
                let max = [None, Some(beads), Some(1)];
                dataset.shape([0, beads, 1]).chunk(&[rows, beads, 1]).max_shape(&max)
            }
        };
        Ok(Self { dataset: dataset.create(name)?, pending: Vec::new(), chunk_values: rows * row })
    }

    fn with_unit(self, unit: &str) -> Result<Self, Hdf5Error> {
        set_unit(&self.dataset, unit)?;
        Ok(self)
    }

    fn push(&mut self, row: &[T]) -> Result<(), Hdf5Error> {
        self.pending.extend_from_slice(row);
        if self.pending.len() < self.chunk_values {
            return Ok(());
        }
        let written = self.dataset.append(&self.pending);
        self.pending.clear();
        written
    }

    fn finish(self) -> Result<(), Hdf5Error> {
        if self.pending.is_empty() { Ok(()) } else { self.dataset.append(&self.pending) }
    }
}
