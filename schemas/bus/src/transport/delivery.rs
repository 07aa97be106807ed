//! Decisions of the two sides of a run: whom a frame waits for and for how long, who has joined from which frame on,
//! what a consumer is told, and when the stream is over.
//!
//! This module does not wait, look at a clock or know the transport. `publisher`, `backpressure` and `live` carry out its
//! decisions; `tests/bus/simulation` does so too, on a transport of its own, in a million different orders.

mod following;
mod holding;
mod joining;
mod offering;
mod publishing;

pub use following::{Following, Turn};
pub use holding::{Full, Holding, Repeats, Verdict};
pub use joining::{JoinTurn, Joining};
pub use publishing::{Asked, Publishing};

use std::time::Duration;

/// Time without news after which a consumer asks if the producer lives.
pub(crate) const LIVENESS_PERIOD: Duration = Duration::from_millis(500);
