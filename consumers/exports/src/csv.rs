//! CSV: a row for each state; the beads and the manifest in files beside it.

use super::{Excerpt, Export, ExportError, Format, beside, chain_table};
use consumers::table::{Column, Kind, Table};
use schemas::frame::Frame;
use schemas::whole_file::{WholeFile, WholeFileError};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Names of the files beside the table of states: those of the beads and of the manifest.
pub(super) const BESIDE: [&str; 2] = ["chain.csv", "manifest.json"];

/// The three files.
pub(super) struct Csv {
    excerpt: Excerpt,
    /// None once they are finished.
    tables: Option<Tables>,
    manifest: Option<WholeFile>,
}

struct Tables {
    states: Table,
    chain: Table,
}

impl Csv {
    pub(super) fn create(path: &Path, excerpt: &Excerpt, replace: bool) -> Result<Self, WholeFileError> {
        let [beads, manifest] = BESIDE.map(|name| beside(path, Format::Csv, name));
        let states = Table::create(path, &columns(excerpt), replace)?;
        let mut csv = Self { excerpt: excerpt.clone(), tables: None, manifest: None };
        let chain = match chain_table(&beads, excerpt, replace) {
            Ok(chain) => chain,
            Err(error) => {
                states.discard();
                return Err(error);
            }
        };
        // from here on an error removes both
        csv.tables = Some(Tables { states, chain });
        csv.manifest = Some(WholeFile::create(&manifest, replace)?);
        Ok(csv)
    }
}

/// `frame`, `step`, `time_s`, then the displacement of each bead, then the velocity of each.
fn columns(excerpt: &Excerpt) -> Vec<Column> {
    let mut columns = vec![
        Column::new("frame", Kind::Integer),
        Column::new("step", Kind::Integer),
        Column::new("time_s", Kind::Double),
    ];
    let beads = || excerpt.beads.clone();
    columns.extend(beads().map(|bead| Column::new(format!("u_{bead}_m"), Kind::Double)));
    columns.extend(beads().map(|bead| Column::new(format!("v_{bead}_m_s"), Kind::Double)));
    columns
}

impl Export for Csv {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), ExportError> {
        let Some(Tables { states, .. }) = &mut self.tables else { return Ok(()) };
        let (u_m, v_m_s) = self.excerpt.of(frame);
        match self.excerpt.frame_at(frame.step) {
            Some(frame) => states.integer(frame),
            None => states.empty(),
        };
        states.integer(frame.step).double(frame.time_s);
        for value in u_m.iter().chain(v_m_s) {
            states.double(*value);
        }
        Ok(states.end_row()?)
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<PathBuf>, ExportError> {
        let (Some(Tables { states, chain }), Some(manifest)) = (self.tables.take(), self.manifest.take())
        else {
            return Ok(Vec::new());
        };
        let json = self.excerpt.manifest.to_json();
        manifest
            .file()
            .as_ref()
            .write_all(json.as_bytes())
            .map_err(WholeFileError::io(manifest.partial()))?;
        // the states last: where they are the others are, too
        let (chain, manifest) = (chain.finish()?, manifest.publish()?);
        Ok(vec![states.finish()?, chain, manifest])
    }
}

impl Drop for Csv {
    fn drop(&mut self) {
        // tables of analyses stay if they are interrupted, an export does not
        if let Some(Tables { states, chain }) = self.tables.take() {
            states.discard();
            chain.discard();
        }
    }
}
