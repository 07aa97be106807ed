//! The bus: what it promises, and the traps of its transport, each with its remedy switched off once.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails by panicking; a child process reports on stdout"
)]

mod attaching;
mod child;
mod delivery;
mod faults;
mod foreign;
mod leftovers;
mod results;
mod simulation;
mod support;
mod traps;
