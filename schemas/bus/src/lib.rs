//! Runs on the bus: frames through shared memory between processes of one user, over iceoryx2.
//!
//! A producer makes a [`StatePublisher`]; consumers attach a [`LiveSource`] whenever they like. `docs/FORMAT.md`
//! describes the contents of shared memory, and the contract that programs in other languages follow; the code here is its
//! only implementation in this project.
//!
//! Without the feature `live` there is no bus: `absent.rs` takes the place of `transport.rs`, nobody gets a [`Bus`], and
//! the compiler knows that code which needs one is never reached. So users of this crate are the same in both builds.
//!
//! Architecture invariant: nothing outside this crate names iceoryx2. Nothing here prints.
//!
//! Signals: iceoryx2 is told to leave them alone, so the caller's handlers stay in charge; a flag in the
//! options ends every wait.

#[cfg(all(feature = "live", not(unix)))]
compile_error!("live streams need a Unix system; build with --no-default-features, without them");

mod errors;
mod looking;
#[cfg_attr(not(feature = "live"), path = "absent.rs")]
mod transport;
mod values;

pub use errors::{
    AttachError, BusError, LiveError, PublishError, ResultsError, RoomError, RootError, SharedSegmentError,
};
pub use looking::Looking;
pub use transport::{
    Bus, BusNotice, HeldState, LiveSource, ResultPublisher, ResultSubscriber, ResultsWatch, StatePublisher,
    list_runs, while_waiting,
};
#[cfg(feature = "live")]
pub use transport::{
    FLAG_FOLLOWS, FLAG_LAST, JOIN_CONNECT, JOIN_READY, JoinAnswer, JoinRequest, ManifestText, RunStatus,
    STATE_DONE, STATE_FAILED, STATE_INTERRUPTED, STATE_RUNNING, STATE_WAITING, StateHeader,
};
#[doc(hidden)]
#[cfg(feature = "live")]
pub use transport::{MAX_BUFFER, delivery};
#[doc(hidden)]
#[cfg(feature = "faults")]
pub use values::Remedies;
pub use values::{
    AttachNotice, AttachOptions, BORROWED, ConsumerEvent, ConsumerInfo, Delivery, PublishCounts,
    PublishOptions, ResultElement, ResultReceived, Row, RunInfo, RunState, StreamId, WaitOutcome, Waiting,
};

/// True if this build has live streams.
pub const IS_THERE: bool = cfg!(feature = "live");
