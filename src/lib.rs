//! The `beadline` command: parse, compose, print, exit codes. No physics, no formats. The Python package carries it, too.

#[macro_use]
mod display;
#[macro_use]
mod failure;

mod analysis;
mod args;
mod child;
mod commands;
mod configuration;
mod determining;
mod forecast;
mod frames;
mod keyboard;
mod limits;
mod links;
mod outputs;
mod pace;
mod progress;
mod publishing;
mod report;
mod resumption;
mod signals;
mod stage;
mod sweep;
mod time_step;
mod uploading;

pub use configuration::origin;
pub use forecast::computing_s;

use args::{Cli, Command};
use clap::FromArgMatches;
use failure::{Done, Failure, Form};
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What the command `beadline` does with these arguments, of which the first one is its name; gives its exit code.
///
/// It prints, takes over signals and may end the process: for a process of its own. `program` is how to start such a
/// process; without it, it is the running program.
pub fn command(arguments: &[OsString], program: Option<Vec<OsString>>) -> u8 {
    let form = Form::asked_for(arguments);
    limits::prepare(form);
    bus::while_waiting(signals::while_waiting);
    child::set_program(program);
    let arguments = args::command().try_get_matches_from(arguments);
    let cli = arguments.and_then(|arguments| Cli::from_arg_matches(&arguments));
    let cli = cli.unwrap_or_else(|error| failure::exit_of_usage(&error, form));
    // a library that panics, such as the one below the bus, must not take the exit code with it
    let ended = catch_unwind(AssertUnwindSafe(|| dispatch(cli.command)));
    failure::exit(ended.unwrap_or_else(|panic| Err(failure::of_panic(&*panic))), form)
}

fn dispatch(command: Command) -> Result<Done, Failure> {
    match command {
        Command::Demo(args) => commands::demo::demo(&args),
        Command::Run(args) => commands::run::run(&args),
        Command::Check(args) => commands::check::check(&args),
        Command::Presets => commands::presets::list(),
        Command::Preset { name } => commands::presets::print(&name),
        Command::Energies(args) => commands::energies::energies(&args),
        Command::Impurity(args) => commands::impurity::impurity(&args),
        Command::Contacts(args) => commands::contacts::contacts(&args),
        Command::Deformation(args) => commands::deformation::deformation(&args),
        Command::Spreading(args) => commands::spreading::spreading(&args),
        Command::Pulses(args) => commands::pulses::pulses(&args),
        Command::Spectrum(args) => commands::spectrum::spectrum(&args),
        Command::Modes(args) => commands::modes::modes(&args),
        Command::Forces(args) => commands::forces::forces(&args),
        Command::Plot(args) => commands::plot::plot(&args),
        Command::View(args) => commands::view::view(&args),
        Command::Share(args) => commands::share::share(&args),
        Command::Sweep(args) => commands::sweep::sweep(&args),
        Command::Reproduce(args) => commands::reproduce::reproduce(&args),
        Command::Record(args) => commands::record::record(&args),
        Command::Replay(args) => commands::replay::replay(&args),
        Command::Relay(args) => commands::relay::relay(&args),
        Command::Ls { place, json, names } => commands::ls::ls(place.as_deref(), json, names),
        Command::Top(args) => commands::top::top(&args),
        Command::Thin(args) => commands::thin::thin(&args),
        Command::Expand(args) => commands::thin::expand(&args),
        Command::Export(args) => commands::export::export(&args),
        Command::Verify(args) => commands::verify::verify(&args),
        Command::Recover(args) => commands::recover::recover(&args),
        Command::Upload(args) => commands::upload::upload(&args),
        Command::Catalog(args) => commands::catalog::catalog(&args),
        Command::Info { file, json } => commands::info::info(&file, json),
        Command::Completions { shell } => commands::manual::completions(shell),
        Command::Man(args) => commands::manual::man(&args),
    }
}
