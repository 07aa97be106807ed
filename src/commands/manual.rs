//! `beadline completions SHELL` and `beadline man`: what shells and `man` want to know about the command line.

use crate::args::{self, ManArgs};
use crate::display;
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::check_free;
use anyhow::{Context, anyhow};
use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;
use schemas::whole_file;
use std::fs;
use std::path::Path;

pub(crate) fn completions(shell: Shell) -> Result<Done, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut args::command(), "beadline", &mut script);
    display::print(with_runs(shell, String::from_utf8(script)?))?;
    Ok(Done::Whole)
}

/// The script, which asks `beadline ls --names` for the live runs each time.
fn with_runs(shell: Shell, script: String) -> String {
    match shell {
        Shell::Bash => script + &with_analyses(include_str!("manual/runs.bash"), " | "),
        Shell::Fish => script + &with_analyses(include_str!("manual/runs.fish"), " "),
        Shell::Zsh => {
            let script = script
                .replace("or a recording:_default'", "or a recording:_beadline_sources'")
                .replace("RUN`:_default'", "RUN`:_beadline_sources'");
            let head = script.find("_beadline() {").unwrap_or(0);
            let (before, after) = script.split_at(head);
            format!("{before}{}\n{after}", include_str!("manual/runs.zsh"))
        }
        _ => script,
    }
}

/// A part of a script with the names of the analyses.
fn with_analyses(part: &str, between: &str) -> String {
    let names: Vec<&str> = analyses::all().map(|offer| offer.name).collect();
    part.replace("@ANALYSES@", &names.join(between))
}

pub(crate) fn man(args: &ManArgs) -> Result<Done, Failure> {
    let mut command = args::command();
    command.build();
    match &args.out {
        Some(directory) => write_all(&command, directory, args.force),
        None => print_one(&command, args.command.as_deref()),
    }
}

fn print_one(command: &Command, name: Option<&str>) -> Result<Done, Failure> {
    let found = name.map_or(Some(command), |name| command.find_subcommand(name));
    let unknown =
        || anyhow!("there is no command `{}`; `beadline --help` lists them", name.unwrap_or_default());
    display::print(String::from_utf8(page(found.ok_or_else(unknown).bad_input()?)?)?)?;
    Ok(Done::Whole)
}

fn write_all(command: &Command, directory: &Path, force: bool) -> Result<Done, Failure> {
    let commands: Vec<&Command> = std::iter::once(command)
        .chain(command.get_subcommands().filter(|each| !each.is_hide_set()))
        .collect();
    let path = |command: &Command| directory.join(format!("{}.1", full_name(command)));
    if directory.is_dir() {
        commands.iter().try_for_each(|command| check_free(&path(command), force))?;
    }
    let message = || format!("{}: this directory cannot be made", directory.display());
    fs::create_dir_all(directory).with_context(message)?;
    for command in &commands {
        whole_file::write(&path(command), &page(command)?, force)?;
    }
    display::print(format_args!("{} pages in {}\n", commands.len(), directory.display()))?;
    Ok(Done::Whole)
}

/// `beadline`, or `beadline-run`.
fn full_name(command: &Command) -> &str {
    command.get_display_name().unwrap_or(command.get_name())
}

fn page(command: &Command) -> std::io::Result<Vec<u8>> {
    let mut page = Vec::new();
    Man::new(command.clone()).manual("Beadline").render(&mut page)?;
    Ok(page)
}
