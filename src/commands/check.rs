//! `beadline check`: until when a run is determined, and to which digits.

use crate::args::CheckArgs;
use crate::configuration::{Asked, configure, replaced_key};
use crate::determining::{check_noise, explanation, json, table};
use crate::display;
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::{check_figures, check_place, check_tables, extension};
use crate::progress::Progress;
use crate::report::report;
use crate::signals;
use anyhow::anyhow;
use consumers::determination::{Determination, Quantity, verdict};
use consumers::table::Table;
use experiments::compare::{Compared, compare};
use producer::resimulation::check_kernel;
use recording::RecordingInfo;
use schemas::manifest::RunManifest;
use std::path::Path;

/// A run to be compared with its twins.
struct Subject {
    manifest: RunManifest,
    last_step: u64,
    /// The hash of the last state, if it was recorded.
    recorded_hash: Option<String>,
}

pub(crate) fn check(args: &CheckArgs) -> Result<Done, Failure> {
    check_figures(&args.figure, args.look)?;
    let tables: Vec<_> = args.out.iter().collect();
    check_tables(&tables)?;
    let outputs: Vec<_> = args.out.iter().chain(&args.figure).collect();
    let source = args.source.as_deref();
    outputs.iter().try_for_each(|path| check_place(path, source, args.force))?;
    let subject = subject(args)?;
    let (manifest, physics) = (&subject.manifest, &subject.manifest.physics);
    check_noise(physics)?;

    let stop = signals::bounded_stop_flag()?;
    let mut progress = Progress::new(subject.last_step, manifest.provenance.name.as_str());
    let compared = compare(manifest, None, (subject.last_step, args.tolerance), &stop, |step| {
        if progress.at(step) {
            progress.tell(&[&format!("t = {}", display::seconds(physics.time_s(step)))]);
        }
    });
    progress.finish();
    let Compared { determination, last_state_hash, stopped } = compared?;
    let outcome = determination.outcome().ok_or_else(|| anyhow!("nothing was compared"))?;

    args.out.as_ref().map(|path| write_table(path, args.force, &determination)).transpose()?;
    if !args.figure.is_empty() {
        let figure = plots::determination(manifest, &determination);
        args.figure.iter().try_for_each(|path| figure.write(path, args.look.options(), args.force))?;
    }
    let name = &manifest.provenance.name;
    let differs = !stopped && subject.recorded_hash.is_some_and(|recorded| recorded != last_state_hash);
    let mut found = json(physics, &outcome);
    found["run"] = name.as_str().into();
    found["figures"] = display::texts_of(&args.figure).into();
    report(args.json, &found, || {
        let title = format!("{name} is determined {}\n", verdict(physics, &outcome));
        title + &table(physics, &outcome) + &explanation(physics, &outcome)
    })?;
    if stopped {
        notice!("stopped before the end of the run; the rest was not compared");
    }
    if differs {
        notice!("the last recorded state is not the one that this program computes; see `beadline verify`");
    }
    Ok(Done::whole_if(outcome.first_lost().is_none() && !stopped && !differs))
}

/// The run that `args` name: a recording's up to its end, or a configuration's.
fn subject(args: &CheckArgs) -> Result<Subject, Failure> {
    let recording = args.source.as_ref().filter(|path| extension(path) != "toml");
    let Some(path) = recording else {
        let (config, preset, overrides) = (args.source.as_ref(), args.preset.as_str(), &args.overrides);
        let manifest = configure(&Asked { config, preset, name: None, credit: None, overrides })?.manifest;
        return Ok(Subject { last_step: manifest.physics.step_count, recorded_hash: None, manifest });
    };
    if let Some(key) = replaced_key(&args.overrides) {
        let path = path.display();
        return Err(bad_input!(
            "{path}: a recording has its {key} already; values are replaced in a CONFIG.toml"
        ));
    }
    let info = RecordingInfo::read(path).bad_input()?;
    display::notice_of_version(&info.manifest);
    check_kernel(&info.manifest)?;
    let last_step = info.last_step.unwrap_or(info.manifest.physics.step_count);
    let recorded_hash = info.end.and_then(|end| end.last_state_hash);
    Ok(Subject { manifest: info.manifest, last_step, recorded_hash })
}

/// The errors over time.
fn write_table(path: &Path, force: bool, determination: &Determination) -> Result<(), Failure> {
    let names = Quantity::ALL.map(Quantity::as_str);
    let columns = names.iter().flat_map(|name| [format!("{name}_step"), format!("{name}_rounding")]);
    let columns: Vec<_> = std::iter::once("time_s".to_owned()).chain(columns).collect();
    let mut table = Table::create(path, &columns, force)?;
    for sample in determination.trail().samples() {
        table.double(sample.time_s);
        for (step, rounding) in sample.step.iter().zip(&sample.rounding) {
            table.double(*step).double(*rounding);
        }
        table.end_row()?;
    }
    table.finish()?;
    Ok(())
}
