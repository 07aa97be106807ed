//! `beadline reproduce`: the paper, figure by figure, claim by claim.

mod reflection;

use crate::args::ReproduceArgs;
use crate::configuration::origin;
use crate::display::{self, counted};
use crate::failure::{BadInput, Done, Failure};
use crate::report::Rows;
use crate::signals;
use crate::threads;
use anyhow::{Context, anyhow};
use figure::Figure;
use indicatif::ProgressBar;
use paper::cache::{self, Cached};
use paper::progress::Progress;
use paper::report::{Report, Studied, figure_path};
use paper::{Observations, Run, STUDIES, Study, Verdict, markdown, workers};
use schemas::manifest::RunManifest;
use schemas::whole_file;
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

pub(crate) fn reproduce(args: &ReproduceArgs) -> Result<Done, Failure> {
    if args.list {
        return list();
    }
    let studies = chosen(&args.figures).bad_input()?;
    refuse_to_overwrite(args, &studies)?;
    let start = Instant::now();
    let recordings = args.out.join("recordings");
    cache::create(&recordings)?;
    let runs = runs_of(&studies).into_values().map(|run| Cached::look(run, &recordings, origin()));
    let runs = runs.collect::<Result<Vec<_>, _>>()?;
    let manifests: Vec<RunManifest> = runs.iter().map(|cached| cached.manifest.clone()).collect();
    let stop = signals::bounded_stop_flag()?;
    let jobs = threads::or_cores(args.jobs).get();
    announce(&studies, &runs, jobs);
    let Some(done) = observe(args, &studies, runs, jobs, &stop)? else {
        notice!("stopped; what was finished stays in the cache and is not done again");
        return Ok(Done::Lossy);
    };

    let studied = studies.iter().map(|study| conclude(study, &done.observations, args));
    let studies = studied.collect::<Result<Vec<_>, _>>()?;
    let report = Report { studies, runs: manifests, determined: &done.determined, program: origin().program };
    // refuse_to_overwrite has asked whether these may be replaced
    let write = |name: &str, text: &str| whole_file::write(&args.out.join(name), text.as_bytes(), true);
    write("REPORT.md", &markdown::report(&report))?;
    write("GALLERY.md", &markdown::gallery(&report))?;
    let json = serde_json::to_string_pretty(&report.json())?;
    write("report.json", &format!("{json}\n"))?;
    print(&report, &done, args, start)?;
    for (claim, number) in report.contradictions() {
        let (value, reference) = (number.value, number.reference.map_or(f64::NAN, |found| found.value));
        notice!(
            "{}: {}: {value} {} contradicts the reference {reference}",
            claim.id,
            number.what,
            number.unit
        );
    }
    Ok(Done::whole_if(report.contradictions().is_empty()))
}

fn list() -> Result<Done, Failure> {
    for study in STUDIES {
        display::print(format_args!("{:22} {} ({})\n", study.slug, study.title, study.place))?;
    }
    Ok(Done::Whole)
}

/// The studies of these names, or all, in the order of the paper.
fn chosen(names: &[String]) -> Result<Vec<&'static Study>, anyhow::Error> {
    if let Some(unknown) = names.iter().find(|name| Study::find(name).is_none()) {
        let known: Vec<&str> = STUDIES.iter().map(|study| study.slug).collect();
        return Err(anyhow!("there is no figure `{unknown}`; there are: {}", known.join(", ")));
    }
    let wanted = |study: &&Study| names.is_empty() || names.iter().any(|name| name == study.slug);
    Ok(STUDIES.iter().filter(wanted).collect())
}

/// Each run that the studies need, once.
fn runs_of(studies: &[&'static Study]) -> BTreeMap<String, Run> {
    studies.iter().flat_map(|study| (study.runs)()).map(|run| (run.name().to_owned(), run)).collect()
}

/// Refuses before anything is computed to overwrite existing files, unless they may be replaced.
fn refuse_to_overwrite(args: &ReproduceArgs, studies: &[&'static Study]) -> Result<(), Failure> {
    let figures = studies.iter().flat_map(|study| ["svg", "png"].map(|end| figure_path(study, end)));
    let pages = ["REPORT.md", "GALLERY.md", "report.json"].map(str::to_owned);
    for name in pages.into_iter().chain(figures) {
        let path = args.out.join(name);
        if !args.force && path.symlink_metadata().is_ok() {
            let path = path.display();
            return Err(bad_input!(
                "{path} exists already; choose another --out, or replace the report with --force (recordings are \
                 kept and used again either way)"
            ));
        }
    }
    Ok(())
}

/// Simulates and observes everything that the studies need; none if `stop` was set.
fn observe(
    args: &ReproduceArgs,
    studies: &[&'static Study],
    runs: Vec<Cached>,
    jobs: usize,
    stop: &AtomicBool,
) -> Result<Option<workers::Done>, Failure> {
    let mut shown = Shown { bar: display::progress_bar(1000, "reproduce"), tenths: 0 };
    let done = workers::observe_all(runs, jobs, stop, |progress| shown.show(progress));
    shown.bar.finish_and_clear();
    let Some(mut done) = done? else { return Ok(None) };
    if studies.iter().any(|study| study.sweep) {
        let Some(points) = reflection::points(&args.out, jobs, stop)? else { return Ok(None) };
        done.observations.insert_reflected(points);
    }
    Ok(Some(done))
}

fn announce(studies: &[&'static Study], runs: &[Cached], jobs: usize) {
    let recorded = runs.iter().filter(|cached| cached.recorded).count();
    notice!(
        "{} from {}, {recorded} of them recorded before; {jobs} at a time",
        counted(studies.len() as u64, "figure"),
        counted(runs.len() as u64, "run"),
    );
}

/// Draws the figure of a study and judges its claims.
fn conclude(study: &'static Study, seen: &Observations, args: &ReproduceArgs) -> Result<Studied, Failure> {
    let of_study = || study.slug.to_owned();
    let figure = (study.draw)(seen).with_context(of_study)?;
    write_figure(&figure, study, args)?;
    let judged = study.claims.iter().map(|claim| Ok((claim, (claim.judge)(seen)?)));
    let claims = judged.collect::<Result<Vec<_>, anyhow::Error>>().with_context(of_study)?;
    Ok(Studied { study, claims })
}

fn write_figure(figure: &Figure, study: &Study, args: &ReproduceArgs) -> Result<(), Failure> {
    for extension in ["svg", "png"] {
        let path = args.out.join(figure_path(study, extension));
        if let Some(directory) = path.parent() {
            cache::create(directory)?;
        }
        figure.write(&path, args.look.options(), true)?;
    }
    Ok(())
}

/// Progress of the runs: a bar on a terminal, a line for each tenth elsewhere.
struct Shown {
    bar: ProgressBar,
    tenths: u32,
}

impl Shown {
    fn show(&mut self, progress: &Progress) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 1000")]
        self.bar.set_position((1000.0 * progress.part()) as u64);
        let [done, left] = progress.parts();
        display::tell(&self.bar, &[&done, &left]);
        if self.bar.is_hidden() && progress.tenths() > self.tenths {
            self.tenths = progress.tenths();
            notice!("reproduce: {}", display::joined(&[&done, &left]));
        }
    }
}

/// Prints the summary of the command, in numbers.
fn print(
    report: &Report<'_>,
    done: &workers::Done,
    args: &ReproduceArgs,
    start: Instant,
) -> Result<(), anyhow::Error> {
    if args.json {
        let mut summary = report.summary();
        summary["simulated"] = done.simulated.clone().into();
        summary["reused"] = done.reused.clone().into();
        summary["wall_s"] = start.elapsed().as_secs_f64().into();
        return display::print_json(&summary);
    }
    let out = args.out.display();
    let (simulated, reused) = (done.simulated.len(), done.reused.len());
    let (references, against) = (report.reference_count(), report.contradictions().len());
    let mut rows = Rows::default();
    rows.add("figures", format_args!("{} in {out}/img/paper", report.studies.len()));
    rows.add("report", format_args!("{out}/REPORT.md, {out}/report.json"));
    rows.add("runs", format_args!("{simulated} simulated, {reused} from the cache"));
    for verdict in [Verdict::Reproduced, Verdict::Corrected, Verdict::NotSo] {
        rows.add(verdict.as_str(), report.count(verdict));
    }
    rows.add("against references", format_args!("{references} numbers, {against} contradicted"));
    rows.add("wall time", display::duration(start.elapsed()));
    display::print(rows.under("the paper"))
}
