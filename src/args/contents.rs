//! `beadline --help` as a table of contents: the commands under headings, in the order of use.

use super::Cli;
use clap::{Command, CommandFactory};
use std::fmt::Write;

/// Heading of the analyses, which are listed before what stands there.
const ANALYSE: &str = "Analyse, while a run goes or from its recording";

const CONTENTS: [(&str, &[&str]); 7] = [
    ("Begin", &["demo"]),
    ("Simulate", &["run", "check", "presets", "preset", "sweep", "orbit", "schema"]),
    (ANALYSE, &["plot", "analyses"]),
    ("Look", &["view", "film", "share", "top", "ls"]),
    (
        "Record, prove, share",
        &[
            "record", "replay", "relay", "info", "catalog", "verify", "recover", "thin", "expand", "export",
            "upload",
        ],
    ),
    ("The paper", &["reproduce"]),
    ("This machine", &["completions", "man"]),
];

/// The whole command line, with its table of contents.
pub(crate) fn command() -> Command {
    let command = full();
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n{}\n{}\n{{options}}{{after-help}}",
        contents(&command),
        heading(&command, "Options"),
    );
    command.help_template(template)
}

/// The command line: what is written in types, and a command for each analysis.
fn full() -> Command {
    Cli::command().subcommands(analyses::all().map(super::analyses::command_of))
}

/// The headings, each with the names of its commands.
fn chapters() -> Vec<(&'static str, Vec<&'static str>)> {
    let with_analyses = |title: &'static str, names: &[&'static str]| {
        let analyses = analyses::all().filter(|_| title == ANALYSE).map(|offer| offer.name);
        (title, analyses.chain(names.iter().copied()).collect())
    };
    CONTENTS.iter().map(|(title, names)| with_analyses(title, names)).collect()
}

fn contents(command: &Command) -> String {
    let literal = command.get_styles().get_literal();
    let chapters = chapters();
    let names = chapters.iter().flat_map(|(_, names)| names);
    let width = names.map(|name| name.len()).max().unwrap_or(0);
    let mut text = String::new();
    // writing to a String cannot fail
    for (title, names) in chapters {
        let _ = write!(text, "\n{}\n", heading(command, title));
        for name in names {
            let about = command.find_subcommand(name).and_then(Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(text, "  {literal}{name:width$}{literal:#}  {about}");
        }
    }
    text
}

fn heading(command: &Command, title: &str) -> String {
    let style = command.get_styles().get_header();
    format!("{style}{title}:{style:#}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_command_is_listed_once() {
        let command = full();
        let mut expected: Vec<&str> =
            command.get_subcommands().filter(|each| !each.is_hide_set()).map(Command::get_name).collect();
        let mut listed: Vec<&str> = chapters().into_iter().flat_map(|(_, names)| names).collect();
        expected.sort_unstable();
        listed.sort_unstable();
        assert_eq!(listed, expected);
    }

    #[test]
    fn the_command_line_is_consistent() {
        command().debug_assert();
    }

    #[test]
    fn examples_fit_on_a_line() {
        for each in command().get_subcommands() {
            let help = each.get_after_help().map(ToString::to_string).unwrap_or_default();
            let example = |line: &&str| line.starts_with("  ");
            for line in help.lines().filter(example) {
                assert!(line.chars().count() <= 100, "{}: {line}", each.get_name());
            }
        }
    }

    #[test]
    fn every_command_with_flags_of_its_own_shows_examples() {
        for each in full().get_subcommands().filter(|each| !each.is_hide_set()) {
            let flags = each.get_arguments().filter(|argument| argument.get_id() != "json").count();
            let help = each.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(flags == 0 || help.contains("Example"), "{} shows no example", each.get_name());
        }
    }
}
