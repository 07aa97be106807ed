//! `beadline modes`.

use crate::analysis::{AnalysisError, ROW_HEAD, Session, begin_row, draw, table};
use crate::args::ModesArgs;
use crate::configuration::{origin, preset};
use crate::display::{self, count};
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::{check_outputs, check_tables, extension};
use crate::report::{Rows, report};
use anyhow::Context;
use consumers::follow::Analysis;
use consumers::series::Series;
use consumers::table::Table;
use plots::{ModeShape, ModesShown};
use schemas::config::{ConfigError, RunConfig};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use serde_json::{Value, json};
use source::Named;
use std::fs;
use std::path::Path;
use waves::dispersion::{Band, UnitCell};
use waves::linear::LinearChain;
use waves::modes::Modes;

/// Modes whose energies one run is asked for.
const MOST: usize = 64;
/// Modes outside of the bands that are shown.
const SHOWN: usize = 6;

/// The modes of a chain and its bands.
struct Linear {
    modes: Modes,
    /// Empty where the chain repeats no unit.
    bands_hz: Vec<Band>,
}

impl Linear {
    fn of(manifest: &RunManifest) -> Result<Self, Failure> {
        let chain = LinearChain::of(&manifest.physics.chain()).bad_input()?;
        let modes = Modes::of(&chain).bad_input()?;
        Ok(Self { modes, bands_hz: UnitCell::of(&chain).map_or_else(Vec::new, |cell| cell.bands_hz()) })
    }

    /// Whether waves of the frequency of a mode travel; not known where there are no bands.
    fn is_in_band(&self, mode: usize) -> Option<bool> {
        let carries = || UnitCell::carries(&self.bands_hz, self.modes.frequency_hz(mode));
        (!self.bands_hz.is_empty()).then(carries)
    }

    /// The modes that are asked for, counted from 0.
    fn chosen(&self, asked: &[u64], default: usize) -> Result<Vec<usize>, Failure> {
        let last = self.modes.count();
        if asked.is_empty() {
            return Ok((0..default.min(last)).collect());
        }
        if asked.len() > MOST {
            return Err(bad_input!("--mode: at most {MOST} modes at once"));
        }
        let index = |mode: &u64| {
            let index = usize::try_from(*mode).ok().and_then(|mode| mode.checked_sub(1));
            let refused = || bad_input!("--mode {mode}: the chain has modes 1 to {last}");
            index.filter(|index| *index < last).ok_or_else(refused)
        };
        asked.iter().map(index).collect()
    }
}

pub(crate) fn modes(args: &ModesArgs) -> Result<Done, Failure> {
    let tables: Vec<_> = args.out.iter().collect();
    check_tables(&tables)?;
    if !args.mode.is_empty() && !args.shapes && !args.energy {
        return Err(bad_input!("--mode chooses modes for --shapes or --energy; without them all are listed"));
    }
    if args.energy {
        return energies(args);
    }
    let manifest = match configured(args)? {
        Some(manifest) => {
            check_outputs(&args.common, &tables)?;
            manifest
        }
        None => Session::open(&args.common, "modes", &tables)?.manifest().clone(),
    };
    let linear = Linear::of(&manifest)?;
    if args.shapes { shapes(args, &manifest, &linear) } else { list(args, &manifest, &linear) }
}

/// The manifest of a configuration, if one is named.
fn configured(args: &ModesArgs) -> Result<Option<RunManifest>, Failure> {
    if let Some(name) = &args.preset {
        return Ok(Some(RunManifest::new(&preset(name)?.config(), name, origin()).bad_input()?));
    }
    match &args.common.frames.source {
        Named::File(path) if extension(path) == "toml" => read(path).map(Some),
        _ => Ok(None),
    }
}

fn read(path: &Path) -> Result<RunManifest, Failure> {
    let unreadable = || format!("{} cannot be read", path.display());
    let text = fs::read_to_string(path).with_context(unreadable).bad_input()?;
    let located = |error: ConfigError| error.located(&text, Some(path));
    let config = RunConfig::of_chain(&text).map_err(located).bad_input()?;
    let mut config = experiments::prepared(config, path.parent()).map_err(located).bad_input()?;
    let is_moved = !config.striker.is_none() || !config.initial.is_none() || !config.drive.is_empty();
    if !is_moved && config.load.is_none() {
        // what is no run: its modes are the same whatever strikes it
        config.striker.velocity_m_s = 1.0;
    }
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let mut manifest = RunManifest::new(&config, &stem, origin()).map_err(located).bad_input()?;
    if !is_moved {
        manifest.physics.striker.velocity_m_s = 0.0;
    }
    Ok(manifest)
}

/// All modes: frequencies, participation, bands.
fn list(args: &ModesArgs, manifest: &RunManifest, linear: &Linear) -> Result<Done, Failure> {
    let modes = &linear.modes;
    let columns = ["mode", "frequency_hz", "participation_beads", "centre_bead", "place"];
    if let Some(mut table) = table(args.out.as_ref(), &columns, args.common.frames.force)? {
        for mode in 0..modes.count() {
            table.integer(mode as u64 + 1).double(modes.frequency_hz(mode));
            table.double(modes.participation_beads(mode)).integer(modes.centre_bead(mode) as u64);
            match linear.is_in_band(mode) {
                Some(true) => table.word("band"),
                Some(false) => table.word("gap"),
                None => table.empty(),
            };
            table.end_row()?;
        }
        table.finish()?;
    }
    draw(&args.common, || {
        let participation: Vec<f64> =
            (0..modes.count()).map(|mode| modes.participation_beads(mode)).collect();
        let frequencies: Vec<f64> = (0..modes.count()).map(|mode| modes.frequency_hz(mode)).collect();
        let shown = ModesShown {
            frequencies_hz: &frequencies,
            participation_beads: &participation,
            bands_hz: &linear.bands_hz,
        };
        Ok(plots::modes(manifest, &shown))
    })?;
    let outside: Vec<usize> =
        (0..modes.count()).filter(|mode| linear.is_in_band(*mode) == Some(false)).collect();
    let mut rows = Rows::default();
    let ends = [modes.frequency_hz(0), modes.frequency_hz(modes.count() - 1)];
    rows.add("modes", format_args!("{}, {}", count(modes.count() as u64), display::range(ends, "Hz")));
    rows.each("bands", linear.bands_hz.iter().map(|band| display::range(*band, "Hz")));
    if linear.bands_hz.is_empty() {
        rows.add("bands", "none: the chain repeats no unit");
    }
    rows.each("outside", outside.iter().take(SHOWN).map(|mode| outside_text(modes, *mode)));
    if outside.len() > SHOWN {
        rows.add("", format_args!("… {} more; --out has them", outside.len() - SHOWN));
    }
    let mode = |mode: usize| {
        json!({
            "mode": mode + 1,
            "frequency_hz": modes.frequency_hz(mode),
            "participation_beads": modes.participation_beads(mode),
            "centre_bead": modes.centre_bead(mode),
            "in_band": linear.is_in_band(mode),
        })
    };
    let all: Vec<Value> = (0..modes.count()).map(mode).collect();
    told(args, manifest, "modes", rows, &json!({ "bands_hz": linear.bands_hz, "modes": all }))
}

fn outside_text(modes: &Modes, mode: usize) -> String {
    format!(
        "mode {}: {}, around bead {}, shared by {:.1} beads",
        mode + 1,
        display::quantity(modes.frequency_hz(mode), "Hz"),
        modes.centre_bead(mode),
        modes.participation_beads(mode)
    )
}

fn shapes(args: &ModesArgs, manifest: &RunManifest, linear: &Linear) -> Result<Done, Failure> {
    let chosen = linear.chosen(&args.mode, 4)?;
    let shapes: Vec<Vec<f64>> = chosen.iter().map(|mode| linear.modes.shape(*mode)).collect();
    let names = chosen.iter().map(|mode| format!("u_mode_{}", mode + 1));
    let columns: Vec<String> = ["bead".to_owned()].into_iter().chain(names).collect();
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    if let Some(mut table) = table(args.out.as_ref(), &columns, args.common.frames.force)? {
        for bead in 0..shapes[0].len() {
            table.integer(bead as u64);
            for shape in &shapes {
                table.double(shape[bead]);
            }
            table.end_row()?;
        }
        table.finish()?;
    }
    let shown = |(mode, shape): (&usize, &Vec<f64>)| ModeShape {
        mode: mode + 1,
        frequency_hz: linear.modes.frequency_hz(*mode),
        shape: shape.clone(),
    };
    let shown: Vec<ModeShape> = chosen.iter().zip(&shapes).map(shown).collect();
    draw(&args.common, || Ok(plots::mode_shapes(manifest, &shown)))?;
    let mut rows = Rows::default();
    rows.each("shapes", shown.iter().map(mode_text));
    let json_of = |shape: &ModeShape| json!({ "mode": shape.mode, "frequency_hz": shape.frequency_hz, "displacement": shape.shape });
    let all: Vec<Value> = shown.iter().map(json_of).collect();
    told(args, manifest, "shapes of modes", rows, &json!({ "shapes": all }))
}

fn mode_text(shape: &ModeShape) -> String {
    format!("mode {}: {}", shape.mode, display::quantity(shape.frequency_hz, "Hz"))
}

/// Reports what no frame was needed for.
fn told(
    args: &ModesArgs,
    manifest: &RunManifest,
    title: &str,
    mut rows: Rows,
    results: &Value,
) -> Result<Done, Failure> {
    let name = &manifest.provenance.name;
    rows.each("figure", args.common.figure.iter().map(|path| path.display()));
    let all = json!({ "run": name, "figures": args.common.figure, "results": results });
    report(args.common.frames.json, &all, || rows.under(format_args!("{title} of {name}")))?;
    Ok(Done::whole_if(true))
}

/// The energies of some modes, as frames come.
struct Energies {
    modes: Modes,
    chosen: Vec<usize>,
    row: Vec<f64>,
    table: Option<Table>,
    curves: Vec<Series<1>>,
    /// The largest energy of each.
    largest_j: Vec<f64>,
}

impl Analysis for Energies {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        self.row.clear();
        let energies = self.chosen.iter().map(|mode| self.modes.energy_j(*mode, frame.u_m, frame.v_m_s));
        self.row.extend(energies);
        for ((energy_j, largest_j), curve) in self.row.iter().zip(&mut self.largest_j).zip(&mut self.curves) {
            *largest_j = if *energy_j > *largest_j { *energy_j } else { *largest_j };
            curve.push(frame.time_s, [*energy_j]);
        }
        if let Some(table) = &mut self.table {
            begin_row(table, frame);
            for energy_j in &self.row {
                table.double(*energy_j);
            }
            table.end_row()?;
        }
        Ok(())
    }
}

fn energies(args: &ModesArgs) -> Result<Done, Failure> {
    if configured(args)?.is_some() {
        return Err(bad_input!(
            "--energy is about what happens in a run: name a recording or a live run, not a configuration"
        ));
    }
    let tables: Vec<_> = args.out.iter().collect();
    let mut session = Session::open(&args.common, "modes", &tables)?;
    let manifest = session.manifest().clone();
    let linear = Linear::of(&manifest)?;
    let chosen = linear.chosen(&args.mode, 8)?;
    let names = chosen.iter().map(|mode| format!("energy_mode_{}_j", mode + 1));
    let columns: Vec<String> = ROW_HEAD.into_iter().map(str::to_owned).chain(names).collect();
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut found = Energies {
        row: Vec::new(),
        table: table(args.out.as_ref(), &columns, args.common.frames.force)?,
        curves: vec![Series::default(); chosen.len()],
        largest_j: vec![0.0; chosen.len()],
        modes: linear.modes,
        chosen,
    };
    let tally = session.follow(&mut found)?;

    let Energies { modes, chosen, row, table, curves, largest_j } = found;
    table.map(Table::finish).transpose()?;
    let numbers: Vec<usize> = chosen.iter().map(|mode| mode + 1).collect();
    draw(&args.common, || Ok(plots::mode_energies(&manifest, &numbers, &curves)))?;
    let mut rows = Rows::default();
    let joule = |value: f64| display::quantity(value, "J");
    let text = |index: usize| {
        let (number, hertz) = (numbers[index], display::quantity(modes.frequency_hz(chosen[index]), "Hz"));
        let last = row.get(index).copied().unwrap_or(0.0);
        format!("mode {number} ({hertz}): at most {}, last {}", joule(largest_j[index]), joule(last))
    };
    rows.each("energy", (0..chosen.len()).map(text));
    let mode = |index: usize| {
        json!({
            "mode": numbers[index],
            "frequency_hz": modes.frequency_hz(chosen[index]),
            "largest_j": largest_j[index],
            "last_j": row.get(index),
        })
    };
    let results = json!({ "modes": (0..chosen.len()).map(mode).collect::<Vec<_>>() });
    session.report(&tally, "energies of modes", rows, results)
}
