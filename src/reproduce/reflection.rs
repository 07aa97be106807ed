//! The points of the energy figures, by a sweep.

use crate::display::counted;
use crate::failure::Failure;
use crate::sweep::{self, Options};
use anyhow::anyhow;
use consumers::table::{Cell, Column};
use consumers::uncertain::Uncertain;
use paper::{Reflected, refined_sweep, reflection_sweep};
use producer::sweep::Sweep;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Computes the points that have no row yet, below `out`, `threads` at a time: those of the figures, and those between
/// them that show whether curves cross there. Nothing if `stop` was set.
pub(crate) fn points(
    out: &Path,
    threads: usize,
    stop: &AtomicBool,
) -> Result<Option<Vec<Reflected>>, Failure> {
    let mut points = Vec::new();
    let mut next = Some(reflection_sweep());
    while let Some(text) = next {
        let Some(more) = points_of(&text, out, threads, stop)? else { return Ok(None) };
        points.extend(more);
        next = refined_sweep(&points);
    }
    Ok(Some(points))
}

/// The points of one sweep.
fn points_of(
    text: &str,
    out: &Path,
    threads: usize,
    stop: &AtomicBool,
) -> Result<Option<Vec<Reflected>>, Failure> {
    let no_files = |path: &Path| Err(std::io::Error::other(format!("{} is not read", path.display())));
    let sweep = Sweep::from_toml(text, Path::new("reflection.toml"), no_files)?;
    // rows of another version of this program stay beside these
    let identity = recording::hex(&sweep.identity()[..6]);
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
    let columns = experiments::columns(&sweep);
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
        Ok(Reflected {
            alpha: self.double("chain.alpha")?,
            mass_g: self.double("chain.impurities[0].mass_kg")? * 1e3,
            over_total: self.uncertain("reflected_over_total")?,
            over_transmitted: self.uncertain("reflected_over_transmitted")?,
            stationary_since_s: self.double("stationary_since_s")?,
            corrected_over_total: self.uncertain("corrected_over_total")?,
            corrected: self.uncertain("corrected_over_incident")?,
            backward_m_s: self.double("backward_v_peak_m_s")?,
            backward_beads_per_s: self.double("backward_speed_beads_per_s")?,
            drift: self.double("max_abs_relative_drift")?,
        })
    }

    /// A double with what it may be off by.
    fn uncertain(&self, name: &str) -> Result<Uncertain, Failure> {
        Ok(Uncertain::new(self.double(name)?, self.double(&format!("{name}_uncertainty"))?))
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
