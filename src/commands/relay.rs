//! `beadline relay`: a live run on another host.

#[cfg(feature = "relay")]
mod far;
#[cfg(feature = "relay")]
mod near;

use crate::args::RelayArgs;
use crate::failure::{Done, Failure};

#[cfg(feature = "relay")]
pub(crate) fn relay(args: &RelayArgs) -> Result<Done, Failure> {
    match &args.connect {
        Some(endpoint) => far::far(args, endpoint),
        None => near::near(args),
    }
}

#[cfg(not(feature = "relay"))]
pub(crate) fn relay(_: &RelayArgs) -> Result<Done, Failure> {
    Err(bad_input!(
        "this beadline was built without `relay`, which takes longer to build than all the rest (that of the Python package \
         always is); with Rust from rustup.rs, `cargo install --git {} --features relay beadline` installs one that has it",
        env!("CARGO_PKG_REPOSITORY")
    ))
}

/// Parses an endpoint as the user named it.
#[cfg(feature = "relay")]
fn endpoint(flag: &str, text: &str) -> Result<::relay::wire::Endpoint, Failure> {
    text.parse().map_err(|error| bad_input!("{flag}: {error}"))
}

/// An error of the connection: that of a user's file is the user's.
#[cfg(feature = "relay")]
fn of_wire(error: ::relay::wire::WireError) -> Failure {
    match error {
        ::relay::wire::WireError::Config { .. } => Failure::BadInput(error.into()),
        error => error.into(),
    }
}
