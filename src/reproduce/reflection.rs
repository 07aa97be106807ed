//! The points of the energy figures, by a sweep.

use crate::display::counted;
use crate::failure::Failure;
use crate::sweep::{self, Options};
use anyhow::anyhow;
use consumers::paper::{Reflected, reflection_sweep};
use consumers::table::{Cell, Column};
use producer::sweep::Sweep;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Computes the points that have no row yet, below `out`, `threads` at a time; nothing if `stop` was set.
pub(crate) fn points(
    out: &Path,
    threads: usize,
    stop: &AtomicBool,
) -> Result<Option<Vec<Reflected>>, Failure> {
    let no_files = |path: &Path| Err(std::io::Error::other(format!("{} is not read", path.display())));
    let sweep = Sweep::from_toml(&reflection_sweep(), Path::new("reflection.toml"), no_files)?;
    // rows of another version of this program stay beside these
    let identity = schemas::recording::hex(&sweep.identity()[..6]);
    let version = env!("CARGO_PKG_VERSION");
    let directory = out.join(format!("reflection-{identity}-{version}"));
    let outcome = sweep::compute(&sweep, &directory, &Options { threads, ..Options::default() }, stop)?;
    if stop.load(Ordering::Relaxed) {
        return Ok(None);
    }
    let path = directory.display();
    if let Some(index) = outcome.failed.first() {
        return Err(anyhow!("point {index} of the sweep in {path} failed; its row says why").into());
    }
    if outcome.missing > 0 {
        return Err(anyhow!("the sweep in {path} has no row of {}", counted(outcome.missing, "point")).into());
    }
    let columns = sweep::columns(&sweep);
    let points = outcome.rows.values().map(|entry| Row { columns: &columns, cells: &entry.cells }.point());
    points.collect::<Result<Vec<_>, _>>().map(Some)
}

/// A row with the names of its cells.
struct Row<'a> {
    columns: &'a [Column],
    cells: &'a [Cell],
}

impl Row<'_> {
    fn point(&self) -> Result<Reflected, Failure> {
        let total_j = self.double("total_j")?;
        Ok(Reflected {
            alpha: self.double("chain.alpha")?,
            mass_g: self.double("chain.impurities[0].mass_kg")? * 1e3,
            over_total: self.double("reflected_over_total")?,
            over_transmitted: self.double("reflected_over_transmitted")?,
            uncertainty: self.double("reflected_uncertainty_j")? / total_j,
            stationary_since_s: self.double("stationary_since_s")?,
            recoil: self.double("recoil_j")? / total_j,
            recoil_uncertainty: self.double("recoil_uncertainty_j")? / total_j,
            corrected: self.double("corrected_over_incident")?,
            backward_m_s: self.double("backward_v_peak_m_s")?,
            backward_beads_per_s: self.double("backward_speed_beads_per_s")?,
            drift: self.double("max_abs_relative_drift")?,
        })
    }

    /// A double; NaN where there is none in this row.
    fn double(&self, name: &str) -> Result<f64, Failure> {
        let place = self.columns.iter().position(|column| column.name == name);
        match place.and_then(|place| self.cells.get(place)) {
            Some(Cell::Double(value)) => Ok(*value),
            Some(Cell::Empty) => Ok(f64::NAN),
            _ => {
                Err(anyhow!("a sweep's rows have no column `{name}` of doubles; this is a fault of ours")
                    .into())
            }
        }
    }
}
