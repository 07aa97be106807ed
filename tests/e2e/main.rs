//! Tests through the built command, as a user meets it. Each test has a directory and a bus of its own.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs, reason = "a test that cannot go on says where")]

mod bench;
mod compatibility;
mod configuration;
mod crash;
mod deformation;
mod disk;
mod export;
mod faults;
mod golden;
mod guide;
mod harness;
mod hostile_files;
mod long_runs;
mod lying;
mod mcap_readers;
mod other_tools;
mod own_consumer;
mod pipeline;
mod plot;
mod pulses;
mod python;
mod recomputing;
mod recording_live;
mod recordings;
mod recovering;
mod reference;
mod reflection;
mod replay;
mod reproduce;
mod resume;
mod sweep;
mod thinning;
mod time_step;
mod verifying;
