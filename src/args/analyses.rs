//! The analyses, from the list of them.

use super::figures::LookArgs;
use super::frames::FramesArgs;
use super::presets;
use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use consumers::analysis::{Offer, Setting, Settings, Takes};
use std::path::PathBuf;

/// Arguments of every analysis.
#[derive(Debug, Clone, Args)]
pub(crate) struct AnalysisArgs {
    #[command(flatten)]
    pub(crate) frames: FramesArgs,
    /// Draw a figure, repeatable
    #[arg(long, value_name = "FILE.svg|.pdf|.png")]
    pub(crate) figure: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    /// Do not publish the results on the bus; an analysis that publishes some has the flag.
    #[arg(skip)]
    pub(crate) no_publish: bool,
}

/// An analysis and all that is asked of it.
#[derive(Debug, Clone)]
pub(crate) struct AskedAnalysis {
    pub(crate) offer: &'static Offer,
    pub(crate) common: AnalysisArgs,
    pub(crate) settings: Settings,
    /// The files of each table.
    pub(crate) tables: Vec<Vec<PathBuf>>,
    /// A ready-made configuration in place of a source.
    pub(crate) preset: Option<String>,
    /// Nothing is recomputed, also where there are too few frames.
    pub(crate) as_recorded: bool,
}

impl AskedAnalysis {
    /// The figure alone.
    pub(crate) fn figure_of(offer: &'static Offer, common: AnalysisArgs) -> Self {
        let (settings, tables) = (Settings::default(), vec![Vec::new(); offer.tables.len()]);
        Self { offer, common, settings, tables, preset: None, as_recorded: false }
    }

    /// The analysis that the command line names, if it names one.
    pub(crate) fn of(matches: &ArgMatches) -> Option<Result<Self, clap::Error>> {
        let (name, matches) = matches.subcommand()?;
        analyses::named(name).map(|offer| Self::read(offer, matches))
    }

    fn read(offer: &'static Offer, matches: &ArgMatches) -> Result<Self, clap::Error> {
        let flag = |name: &str| matches!(matches.try_get_one::<bool>(name), Ok(Some(true)));
        let mut settings = Settings::default();
        for setting in offer.settings {
            if matches.value_source(setting.name) != Some(ValueSource::CommandLine) {
                continue;
            }
            let values = match setting.takes {
                Takes::Nothing if !flag(setting.name) => continue,
                Takes::Nothing => Vec::new(),
                _ => matches.get_many::<String>(setting.name).into_iter().flatten().cloned().collect(),
            };
            // the parser has checked them
            let _ = settings.set(setting, values);
        }
        let files = |name: &str| matches.get_many::<PathBuf>(name).into_iter().flatten().cloned().collect();
        Ok(Self {
            offer,
            common: AnalysisArgs {
                no_publish: flag("no-publish"),
                ..AnalysisArgs::from_arg_matches(matches)?
            },
            settings,
            tables: offer.tables.iter().map(|table| files(table.name)).collect(),
            preset: matches.try_get_one::<String>("preset").ok().flatten().cloned(),
            as_recorded: flag("as-recorded"),
        })
    }
}

/// The command of an analysis.
pub(super) fn command_of(offer: &'static Offer) -> Command {
    let command = Command::new(offer.name).after_help(offer.help);
    // the arguments have a line about them, too
    let mut command = AnalysisArgs::augment_args(command.allow_negative_numbers(true)).about(offer.about);
    let mut add = |argument: Arg| {
        let known = std::mem::take(&mut command);
        command = known.arg(argument);
    };
    if !offer.columns.is_empty() {
        add(switch("no-publish", "Do not publish the results on the bus"));
    }
    if offer.needs.takes_configurations {
        let help = "A ready-made configuration instead of SOURCE, which may be a CONFIG.toml, too";
        let preset = Arg::new("preset").long("preset").value_name("NAME").help(help);
        add(preset.value_parser(presets()).conflicts_with("source"));
    }
    if offer.needs.longest_interval_steps.is_some() {
        let help = "Recompute nothing, also where a recording has too few states";
        add(switch("as-recorded", help).conflicts_with_all(["every_step", "fill_gaps", "from_start"]));
    }
    offer.settings.iter().map(|setting| argument(setting, offer.settings)).for_each(&mut add);
    for (i, table) in offer.tables.iter().enumerate() {
        let argument = Arg::new(table.name).long(table.name).help(table.help);
        let argument = argument.value_parser(clap::value_parser!(PathBuf));
        add(if keeps_rows(offer, i) {
            argument.value_name("FILE.csv|.parquet|.mcap").action(ArgAction::Append)
        } else {
            argument.value_name("FILE.csv|.parquet")
        });
    }
    command
}

/// True where a table may also be a file of the rows that are published.
pub(crate) fn keeps_rows(offer: &Offer, table: usize) -> bool {
    table == 0 && offer.needs.takes_own_rows
}

fn switch(name: &'static str, help: &'static str) -> Arg {
    Arg::new(name).long(name).help(help).action(ArgAction::SetTrue)
}

/// The settings that `owner` excludes, or that exclude it: clap does not ask for an argument that another one rules out.
fn excluded(owner: &'static str, all: &'static [Setting]) -> Vec<&'static str> {
    let own = all.iter().filter(|setting| setting.name == owner).flat_map(|setting| setting.excludes);
    let others = all.iter().filter(|setting| setting.excludes.contains(&owner)).map(|setting| &setting.name);
    own.chain(others).copied().collect()
}

fn argument(setting: &'static Setting, all: &'static [Setting]) -> Arg {
    let argument = Arg::new(setting.name)
        .long(setting.name)
        .help(setting.help)
        .required(setting.required_unless.is_some_and(<[_]>::is_empty));
    let argument = argument.conflicts_with_all(setting.excludes);
    let argument = match setting.belongs_to {
        Some(owner) => argument.requires(owner).conflicts_with_all(excluded(owner, all)),
        None => argument,
    };
    let action = if setting.is_repeatable { ArgAction::Append } else { ArgAction::Set };
    let check = move |text: &str| setting.takes.check(text).map(|()| text.to_owned());
    match &setting.takes {
        Takes::Nothing => argument.action(ArgAction::SetTrue),
        Takes::Whole(name) | Takes::Text(name, _) => {
            argument.value_name(*name).value_parser(check).action(action)
        }
        Takes::Number { unit, default, .. } => {
            let argument = argument.value_name(placeholder(unit)).value_parser(check).action(action);
            default.map_or(argument.clone(), |default| argument.default_value(default))
        }
        Takes::Word(words) => {
            let values = words.iter().map(|(word, help)| PossibleValue::new(*word).help(*help));
            let argument = argument.value_parser(PossibleValuesParser::new(values)).action(action);
            words.first().map_or(argument.clone(), |(first, _)| argument.default_value(*first))
        }
    }
}

/// The letters that stand for a number of this unit in help.
fn placeholder(unit: &str) -> &'static str {
    match unit {
        "" => "X",
        "hz" => "HZ",
        "j" => "J",
        "m" => "M",
        "n" => "N",
        "s" => "S",
        _ => "VALUE",
    }
}
