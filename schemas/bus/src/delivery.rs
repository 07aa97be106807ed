//! What the two sides of a run decide: whom a frame waits for and for how long, who has joined from which frame on, what
//! a consumer is told, and when it is all over.
//!
//! Nothing here waits, looks at a clock or knows the transport. `publisher`, `backpressure` and `live` do what these say;
//! `tests/bus/simulation` does so too, on a transport of its own, in a million different orders.

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

/// How long nothing comes before a consumer asks whether the producer lives.
pub(crate) const LIVENESS_PERIOD: Duration = Duration::from_millis(500);
