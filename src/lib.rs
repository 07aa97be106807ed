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
#[cfg_attr(not(feature = "live"), expect(dead_code, reason = "`top` alone has a screen"))]
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
mod threads;
mod time_step;
mod uploading;

pub use configuration::origin;
pub use forecast::computing_s;

use args::{AskedAnalysis, Cli, Command};
use bus::RootError;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{ArgMatches, FromArgMatches};
use failure::{Done, Failure, Form};
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

pub mod own {
    //! Everything that an analysis of one's own needs: see `examples/own_analysis.rs`.

    pub use consumers::analysis::{
        Allowed, Analysis, Beginning, Kind, Meaning, Needs, Number, Offer, Outlet, Refusal, Remake, Report,
        RowValues, Setting, Settings, TableFlag, Takes, Whereabouts, Words, frame_columns,
    };
    pub use consumers::series::Series;
    pub use consumers::table::{Cell, Column};
    pub use figure::{Axis, Curve, Figure, FigureError, Panel};
    pub use schemas::chain::Chain;
    pub use schemas::frame::Frame;
    pub use schemas::manifest::RunManifest;
    pub use schemas::results::ResultColumns;
}

/// The command `beadline` with analyses of one's own in its list, for the arguments of this process.
///
/// ```no_run
/// use beadline::own::Offer;
/// static MINE: Offer = Offer { name: "mine", about: "Nothing yet", ..Offer::PLAIN };
/// fn main() -> std::process::ExitCode {
///     beadline::main_with(&[&MINE])
/// }
/// ```
pub fn main_with(offers: &[&'static own::Offer]) -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    for offer in offers {
        if let Err(why) = analyses::add(offer) {
            return failure::exit(Err(Failure::BadInput(anyhow::anyhow!(why))), Form::asked_for(&arguments))
                .into();
        }
    }
    ExitCode::from(command(&arguments, None))
}

/// Runs the command `beadline` with these arguments and gives its exit code. The first argument is the command's name.
///
/// It prints, takes over signals and may end the process, so it needs a process of its own. `program` starts such a
/// process; without it, the running program does.
pub fn command(arguments: &[OsString], program: Option<Vec<OsString>>) -> u8 {
    let form = Form::asked_for(arguments);
    limits::prepare(|message| form.line(message));
    bus::while_waiting(signals::while_waiting);
    child::set_program(program);
    let asked = args::command().try_get_matches_from(arguments).and_then(|matches| Asked::of(&matches));
    let asked = asked.unwrap_or_else(|error| failure::exit_of_usage(&error, form));
    // a library that panics, such as the one below the bus, must not take the exit code with it
    let ended = catch_unwind(AssertUnwindSafe(|| match asked {
        Asked::Analysis(asked) => commands::analyse::analyse(&asked),
        Asked::Command(command) => dispatch(command),
    }));
    failure::exit(ended.unwrap_or_else(|panic| Err(failure::of_panic(&*panic))), form)
}

/// A command line, as it was read.
#[expect(clippy::large_enum_variant, reason = "one for a process")]
enum Asked {
    Analysis(Box<AskedAnalysis>),
    Command(Command),
}

impl Asked {
    fn of(matches: &ArgMatches) -> Result<Self, clap::Error> {
        if let Some(("run", run)) = matches.subcommand().filter(|_| !bus::IS_THERE) {
            check_flags_of_run(run)?;
        }
        match AskedAnalysis::of(matches) {
            Some(asked) => Ok(Self::Analysis(Box::new(asked?))),
            None => Ok(Self::Command(Cli::from_arg_matches(matches)?.command)),
        }
    }
}

/// Refuses flags about consumers where there are none.
fn check_flags_of_run(run: &ArgMatches) -> Result<(), clap::Error> {
    let of_consumers =
        [("no_record", "--no-record"), ("wait_for", "--wait-for"), ("stall_timeout", "--stall-timeout")];
    let given = |id| run.value_source(id) == Some(ValueSource::CommandLine);
    let Some((_, flag)) = of_consumers.iter().find(|(id, _)| given(id)) else { return Ok(()) };
    let why = format!("{flag} is about consumers of a live run: {}\n", RootError::Absent);
    Err(clap::Error::raw(ErrorKind::ArgumentConflict, why))
}

fn dispatch(command: Command) -> Result<Done, Failure> {
    match command {
        Command::Demo(_) | Command::Record(_) | Command::Replay(_) if !bus::IS_THERE => {
            Err(RootError::Absent.into())
        }
        Command::Demo(args) => commands::demo::demo(&args),
        Command::Run(args) => commands::run::run(&args),
        Command::Check(args) => commands::check::check(&args),
        Command::Presets => commands::presets::list(),
        Command::Preset { name } => commands::presets::print(&name),
        Command::Schema { kind } => commands::schema::print(&kind),
        Command::Analyses { json } => commands::analyses::list(json),
        Command::Plot(args) => commands::plot::plot(&args),
        Command::Film(args) => commands::film::film(&args),
        Command::View(args) => commands::view::view(&args),
        Command::Share(args) => commands::share::share(&args),
        Command::Orbit(args) => commands::orbit::orbit(&args),
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
