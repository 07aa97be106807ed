//! Arguments of `beadline top` in a build without live streams: any, and all of them are refused.

use clap::Args;

#[derive(Debug, Args)]
pub(crate) struct TopArgs {
    /// Arguments of a build with live streams
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    _any: Vec<String>,
}
