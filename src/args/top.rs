//! The screen in the terminal.

use super::values::one_of;
use clap::Args;
use screen::Field;
use source::Named;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline top                                     all live runs; waits for one if there is none\n  \
    beadline top live:long --field energy            one of them, with its energy\n  \
    ssh -t cluster beadline top --rate 2             two screens a second, over a slow line\n\n\
    Keys: ↑ ↓ or k j choose a run, f and F a field, l linear or logarithmic colours, p pauses the screen but not the \
    run, ? shows the keys, q ends. The run never waits for the screen. The map shows the run since `top` first saw it; \
    its oldest rows are merged and keep the values farthest from 0. Colours follow COLORTERM and \
    TERM; programs read `beadline ls --json`.")]
pub(crate) struct TopArgs {
    /// `live:RUN` [default: the first live run]
    #[arg(value_name = "SOURCE", default_value = "live", hide_default_value = true)]
    pub(crate) source: Named,
    /// Field along the chain and over time
    #[arg(long, default_value = "velocity", value_parser = one_of(Field::ALL, |field| field.name().into()))]
    pub(crate) field: Field,
    /// Screens a second, at most
    #[arg(long, value_name = "N", default_value = "10", value_parser = parse_rate)]
    pub(crate) rate: f64,
}

fn parse_rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| (0.1..=60.0).contains(rate));
    rate.ok_or_else(|| "expected 0.1 to 60 screens a second".to_owned())
}
