//! A live run on another host.
//!
//! The near side, where the run is, sends the run and not its frames: its manifest, a state now and then, results, the
//! end. The far side recomputes every frame, proves it by the next state that arrives, and only then publishes it.
//!
//! [`message`] is what is said, [`log`] what the near side has to say and who has heard it, [`near`] and [`far`] are the
//! two sides on their buses: none of them knows a transport. `wire`, with the feature `zenoh`, is the only importer of
//! zenoh. `docs/SCALE.md` describes the bytes. Nothing here prints.

pub mod far;
pub mod log;
pub mod message;
pub mod near;
pub mod recompute;
#[cfg(feature = "zenoh")]
pub mod wire;
