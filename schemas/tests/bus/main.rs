//! The bus: what it promises, and the traps of its transport, each with its remedy switched off once.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails by panicking; a child reports on stdout"
)]

mod bench;
mod child;
mod delivery;
mod support;
