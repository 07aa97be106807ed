//! Tests through the built command, as a user meets it. Each test has a directory and a bus of its own.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs, reason = "a test that cannot go on says where")]

#[cfg(not(feature = "live"))]
mod absent;
mod any_chain;
mod any_input;
mod any_sweep;
mod catalogs;
mod check;
mod compatibility;
mod configuration;
mod crash;
mod credit;
mod ctrl_c;
mod deformation;
mod disk;
mod editors;
mod engines;
mod ensemble_physics;
mod ensembles;
mod export;
mod faults;
mod film;
mod golden;
mod guide;
mod harness;
mod honest_limits;
mod hostile_files;
mod hostile_manifests;
mod house;
mod kernel;
mod keys;
mod large_sweeps;
mod long_manifests;
mod long_runs;
mod lyapunov;
mod lying;
mod manners;
mod mcap_readers;
mod measures;
#[cfg(feature = "remote")]
mod object_store;
mod orbits;
mod origins;
mod other_tools;
mod own_analysis;
mod own_consumer;
mod page;
mod page_data;
mod page_manifests;
mod page_tools;
mod pipeline;
mod plot;
mod power;
mod proven;
mod pulses;
mod recomputing;
mod recording_live;
mod recordings;
mod recovering;
mod reference;
mod reflection;
#[cfg(feature = "relay")]
mod relay;
#[cfg(feature = "remote")]
mod remote;
mod replay;
mod reproduce;
mod resume;
#[cfg(feature = "live")]
mod resuming;
mod screens;
mod slurm;
mod spreading;
mod starts;
mod stops;
#[cfg(feature = "remote")]
mod strange_stores;
mod sweep;
mod tables;
mod thinning;
mod time_step;
mod top;
mod uncertainty;
#[cfg(feature = "remote")]
mod uploads;
mod verifying;
mod view;
mod waves;
