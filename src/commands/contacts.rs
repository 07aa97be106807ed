//! `beadline contacts`.

use crate::analysis::{
    self, AnalysisError, ROW_HEAD, Session, begin_row, check_flags, check_publishing, draw, finish, publish,
};
use crate::args::ContactsArgs;
use crate::display::{self, count};
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::check_outputs;
use crate::report::{Rows, report};
use bus::ResultPublisher;
use consumers::contacts::{Class, ContactCounts, Contacts, default_tolerance_m};
use consumers::follow::Analysis;
use consumers::space_time::{Extent, Picture};
use consumers::table::Table;
use recording::{ContactsReader, ContactsRow, ContactsWriter, RecordingInfo, WriteOptions};
use schemas::frame::Frame;
use schemas::manifest::{Provenance, RunManifest};
use schemas::results::ResultColumns;
use serde_json::{Value, json};
use source::Named;
use std::path::{Path, PathBuf};

/// The analysis and its outputs.
struct Outputs {
    contacts: Contacts,
    picture: Option<Picture<Class>>,
    table: Option<Table>,
    map: Option<ContactsWriter>,
    publisher: Option<ResultPublisher<u8>>,
}

impl Analysis for Outputs {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        let tolerance_m = self.contacts.tolerance_m();
        let classes = self.contacts.observe(frame);
        if let Some(picture) = &mut self.picture {
            picture.push(frame.step, classes.iter().map(|class| Class(*class)));
        }
        if let Some(table) = &mut self.table {
            let counts = ContactCounts::of(classes);
            begin_row(table, frame);
            table.integer(counts.compressed).integer(counts.touching).integer(counts.open);
            match counts.compressed_range {
                Some((first, last)) => table.integer(first).integer(last),
                None => table.empty().empty(),
            };
            table.end_row()?;
        }
        if let Some(map) = &mut self.map {
            let (number, step, time_s) = (frame.frame, frame.step, frame.time_s);
            map.write(&ContactsRow { frame: number, step, time_s, tolerance_m, classes })?;
        }
        publish(self.publisher.as_mut(), frame, classes)
    }

    fn gap(&mut self) {
        if let Some(picture) = &mut self.picture {
            picture.gap();
        }
    }
}

pub(crate) fn contacts(args: &ContactsArgs) -> Result<Done, Failure> {
    let (table, map) = outputs(args)?;
    if let Named::File(path) = &args.common.frames.source
        && is_contact_map(path)
    {
        check_flags(&args.common.frames)?;
        check_publishing(&args.common)?;
        return redraw(args, ContactsReader::open(path).bad_input()?);
    }
    let mut session = Session::open(&args.common, "contacts", &args.out.iter().collect::<Vec<_>>())?;
    let manifest = session.manifest().clone();
    let tolerance_m = tolerance_m(args, &manifest)?;
    let contact_count = manifest.contact_count();
    let drawn = !args.common.figure.is_empty();
    let columns = [&ROW_HEAD[..], &ContactCounts::COLUMNS].concat();
    let force = args.common.frames.force;
    let published = ResultColumns::contacts(contact_count, tolerance_m);
    let mut outputs = Outputs {
        contacts: Contacts::new(&manifest, tolerance_m),
        picture: drawn.then(|| Picture::new(Extent { places: 0..contact_count, steps: session.steps() })),
        table: analysis::table(table, &columns, force)?,
        map: map
            .map(|path| {
                ContactsWriter::create(path, &manifest, &WriteOptions { force, ..WriteOptions::default() })
            })
            .transpose()?,
        publisher: session.results("contacts", &published)?,
    };
    let tally = session.follow(&mut outputs)?;

    let Outputs { contacts, picture, table, map, publisher } = outputs;
    let last = ContactCounts::of(contacts.classes());
    finish(publisher)?;
    table.map(Table::finish).transpose()?;
    map.map(|map| map.finish(tally.end)).transpose()?;
    if let Some(picture) = picture {
        draw(&args.common, || Ok(plots::contact_map(&manifest, tolerance_m, &picture)?))?;
    }
    session.report(&tally, "contacts", summary(tolerance_m, &last), results(tolerance_m, &last))
}

/// Whether a file holds contacts and no states. An unreadable file is reported when it is opened.
fn is_contact_map(path: &Path) -> bool {
    let info = RecordingInfo::read(path);
    info.is_ok_and(|info| info.messages("/contacts") > 0 && info.messages("/state") == 0)
}

/// Draws and counts a map that was kept.
fn redraw(args: &ContactsArgs, mut map: ContactsReader) -> Result<Done, Failure> {
    if !args.out.is_empty() {
        return Err(bad_input!(
            "--out: the source is a map of contacts already; give the recording of the run instead"
        ));
    }
    let common = &args.common;
    let of_states = [
        ("--from", common.frames.from > 0.0),
        ("--until", common.frames.until.is_some()),
        ("--from-start", common.frames.from_start),
        ("--fill-gaps", common.frames.fill_gaps),
        ("--every-step", common.frames.every_step),
        ("--jobs", common.frames.jobs.is_some()),
        ("--tolerance", args.tolerance.is_some()),
    ];
    if let Some((flag, _)) = of_states.iter().find(|(_, is_given)| *is_given) {
        return Err(bad_input!(
            "{flag}: the source is a map of contacts; give the recording of the run instead"
        ));
    }
    check_outputs(common, &[])?;
    let manifest = map.manifest().clone();
    let steps = 0..=manifest.physics.step_count;
    let mut picture = Picture::new(Extent { places: 0..manifest.contact_count(), steps });
    let (mut rows, mut last, mut tolerance_m) = (0, ContactCounts::default(), default_tolerance_m(&manifest));
    while let Some(row) = map.next_row().bad_input()? {
        picture.push(row.step, row.classes.iter().map(|class| Class(*class)));
        last = ContactCounts::of(row.classes);
        tolerance_m = row.tolerance_m;
        rows += 1;
    }
    draw(&args.common, || Ok(plots::contact_map(&manifest, tolerance_m, &picture)?))?;
    let end = map.end_reason();
    let Provenance { name, run_id, .. } = &manifest.provenance;
    let found = json!({
        "run": name,
        "run_id": run_id,
        "rows": rows,
        "end": end.as_str(),
        "results": results(tolerance_m, &last),
    });
    report(args.common.frames.json, &found, || {
        let mut all = Rows::default();
        all.add("frames", count(rows));
        all.append(summary(tolerance_m, &last));
        all.each("figure", args.common.figure.iter().map(|path| path.display()));
        all.under(format_args!("map of contacts of {name} ({end})"))
    })?;
    Ok(Done::whole_if(end.is_orderly()))
}

fn summary(tolerance_m: f64, last: &ContactCounts) -> Rows {
    let [compressed, touching, open] = [last.compressed, last.touching, last.open].map(count);
    let mut rows = Rows::default();
    rows.add("tolerance", display::quantity(tolerance_m, "m"));
    rows.add("last frame", format_args!("{compressed} compressed, {touching} touching, {open} open"));
    rows
}

fn results(tolerance_m: f64, last: &ContactCounts) -> Value {
    json!({
        "tolerance_m": tolerance_m,
        "last": { "compressed": last.compressed, "touching": last.touching, "open": last.open },
    })
}

/// The table and the map among the outputs.
fn outputs(args: &ContactsArgs) -> Result<(Option<&PathBuf>, Option<&PathBuf>), Failure> {
    let (mut table, mut map) = (None, None);
    for path in &args.out {
        let place = match path.extension().and_then(|extension| extension.to_str()) {
            Some("csv" | "parquet") => &mut table,
            Some("mcap") => &mut map,
            _ => {
                return Err(bad_input!(
                    "--out {}: expected .csv or .parquet for counts, .mcap for the map",
                    path.display()
                ));
            }
        };
        if place.replace(path).is_some() {
            return Err(bad_input!("--out {}: one table and one map at most", path.display()));
        }
    }
    Ok((table, map))
}

fn tolerance_m(args: &ContactsArgs, manifest: &RunManifest) -> Result<f64, Failure> {
    match args.tolerance {
        None => Ok(default_tolerance_m(manifest)),
        Some(tolerance_m) if tolerance_m >= 0.0 && tolerance_m.is_finite() => Ok(tolerance_m),
        Some(other) => Err(bad_input!("--tolerance {other}: expected a length in m, 0 or more")),
    }
}
