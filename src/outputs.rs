//! Outputs: every command refuses before any work those that could not be written in the end.

use crate::args::{AnalysisArgs, FramesArgs, LookArgs};
use crate::failure::{BadInput, Failure};
use anyhow::Context;
use std::fs;
use std::path::{Path, PathBuf};

/// Refuses outputs of an analysis that could not be written in the end.
pub(crate) fn check_outputs(args: &AnalysisArgs, outputs: &[&PathBuf]) -> Result<(), Failure> {
    check_figures(&args.figure, args.look)?;
    let outputs: Vec<&PathBuf> = outputs.iter().copied().chain(&args.figure).collect();
    check_places(&outputs, &args.frames)
}

/// Refuses figures in other formats than SVG, PDF and PNG, and a size or resolution without a figure that has it.
pub(crate) fn check_figures(figures: &[PathBuf], look: LookArgs) -> Result<(), Failure> {
    for path in figures {
        check_extension(path, &["svg", "pdf", "png"], "a figure is written as .svg, .pdf or .png")?;
    }
    if figures.is_empty() && (look.size.is_some() || look.dpi.is_some()) {
        return Err(bad_input!("--size and --dpi are for a figure; name one with --figure"));
    }
    if look.dpi.is_some() && !figures.iter().any(|path| extension(path) == "png") {
        return Err(bad_input!("--dpi is for PNG files; an SVG or a PDF has no resolution"));
    }
    Ok(())
}

/// Refuses outputs that are named twice, are taken or have no directory.
pub(crate) fn check_places(outputs: &[&PathBuf], args: &FramesArgs) -> Result<(), Failure> {
    let place = |path: &&PathBuf| std::path::absolute(path).ok();
    for (i, path) in outputs.iter().enumerate() {
        if outputs[..i].iter().any(|other| place(other) == place(path)) {
            return Err(bad_input!("{} is named for two outputs", path.display()));
        }
        check_place(path, args.source.file(), args.force)?;
    }
    Ok(())
}

/// The extension of a path, in lower case.
pub(crate) fn extension(path: &Path) -> String {
    path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// Refuses tables that are written neither as CSV nor as Parquet.
pub(crate) fn check_tables(tables: &[&PathBuf]) -> Result<(), Failure> {
    let rule = "a table is written as .csv or .parquet";
    tables.iter().try_for_each(|path| check_extension(path, &["csv", "parquet"], rule))
}

/// Refuses a path with another extension than those `allowed`.
fn check_extension(path: &Path, allowed: &[&str], rule: &str) -> Result<(), Failure> {
    if allowed.contains(&extension(path).as_str()) {
        return Ok(());
    }
    Err(bad_input!("{}: {rule}", path.display()))
}

/// Refuses a path that is the source itself, that is taken, or that has no directory.
pub(crate) fn check_place(path: &Path, source: Option<&Path>, force: bool) -> Result<(), Failure> {
    let resolved = |path: &Path| path.canonicalize().ok();
    if resolved(path).is_some_and(|path| Some(path) == source.and_then(resolved)) {
        return Err(bad_input!("{} is the source itself; choose another name", path.display()));
    }
    check_free(path, force)
}

/// Refuses a path that is taken or that has no directory.
pub(crate) fn check_free(path: &Path, force: bool) -> Result<(), Failure> {
    if path.exists() && !path.is_file() {
        return Err(bad_input!("{} is no file that could be replaced; choose another name", path.display()));
    }
    if path.exists() && !force {
        return Err(bad_input!(
            "{} exists already; choose another name, or replace it with --force",
            path.display()
        ));
    }
    check_directory(path)
}

/// Refuses a path that has no directory.
pub(crate) fn check_directory(path: &Path) -> Result<(), Failure> {
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let message = || format!("{}: its directory cannot be used", path.display());
    let found = fs::metadata(directory).with_context(message).bad_input()?;
    if found.is_dir() { Ok(()) } else { Err(bad_input!("{}: not a directory", directory.display())) }
}
