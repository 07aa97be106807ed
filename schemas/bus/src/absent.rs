//! The face of `transport.rs` in a build without live streams: nobody gets a [`Bus`], and whoever would need one has
//! nothing to do.

#![expect(missing_docs, clippy::missing_errors_doc, reason = "`transport.rs` has the words for them")]

use crate::{
    AttachError, AttachOptions, BusError, ConsumerEvent, Delivery, LiveError, PublishCounts, PublishError,
    PublishOptions, ResultElement, ResultReceived, ResultsError, RootError, RunInfo, StreamId, WaitOutcome,
    Waiting,
};
use schemas::chain::Chain;
use schemas::frame::{EndReason, Frame, FrameSink, FrameSource, Received};
use schemas::manifest::RunManifest;
use schemas::results::{ResultColumns, Topic};
use schemas::run_name::RunName;
use std::fmt;
use std::marker::PhantomData;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// A type without a value, so that a value of a type which holds one is never there either.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Never {}

/// Declares a type without a value.
macro_rules! without_value {
    ($($name:ident)*) => { $(
        #[derive(Debug, Clone)]
        pub struct $name(Never);
    )* };
}

without_value! { Bus BusNotice StatePublisher LiveSource HeldState ResultSubscriber ResultsWatch }

/// Declares functions that nobody reaches, because a value without which they cannot be called is never there.
macro_rules! unreached {
    ($($name:ident($($parameter:tt)*) -> $result:ty = $never:expr;)*) => { $(
        pub fn $name($($parameter)*) -> $result {
            match $never {}
        }
    )* };
}

/// The flag that ends waiting.
type Stop = Arc<AtomicBool>;

#[derive(Debug)]
pub struct ResultPublisher<T: ResultElement>(Never, PhantomData<T>);

impl fmt::Display for BusNotice {
    fn fmt(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {}
    }
}

pub fn while_waiting(_: fn(&Waiting) -> ControlFlow<()>) {}

unreached! { list_runs(bus: &Bus) -> Result<Vec<RunInfo>, BusError> = bus.0; }

impl Bus {
    pub fn from_env() -> Result<Self, RootError> {
        Err(RootError::Absent)
    }

    pub fn at(_: &Path) -> Result<Self, RootError> {
        Err(RootError::Absent)
    }

    unreached! {
        root(&self) -> &Path = self.0;
        prefix(&self) -> &str = self.0;
        take_notice(&self) -> Option<BusNotice> = self.0;
    }
}

impl StatePublisher {
    unreached! {
        create(bus: &Bus, _: &RunManifest, _: &Chain, _: &PublishOptions) -> Result<Self, PublishError> = bus.0;
        stream(&self) -> StreamId = self.0;
        max_consumers(&self) -> usize = self.0;
        wait_for(&mut self, _: usize, _: &AtomicBool, _: Option<Duration>) -> Result<WaitOutcome, PublishError> = self.0;
        serve(&mut self) -> Result<(), PublishError> = self.0;
        counts(&self) -> PublishCounts = self.0;
        take_events(&mut self) -> Vec<ConsumerEvent> = self.0;
        finish(self, _: EndReason) -> Result<PublishCounts, PublishError> = self.0;
        finish_and_wait(self, _: EndReason, _: &AtomicBool, _: Duration) -> Result<PublishCounts, PublishError> = self.0;
    }
}

impl FrameSink for StatePublisher {
    type Error = PublishError;

    fn accept(&mut self, _: &Frame<'_>) -> Result<(), PublishError> {
        match self.0 {}
    }
}

impl LiveSource {
    unreached! {
        attach(bus: &Bus, _: Option<&RunName>, _: Delivery, _: &AttachOptions) -> Result<Self, AttachError> = bus.0;
        chain(&self) -> &Chain = self.0;
        stop(&self) -> &Stop = self.0;
        stream(&self) -> StreamId = self.0;
        first_frame(&self) -> u64 = self.0;
        hold(&mut self) -> Option<HeldState> = self.0;
        missed_count(&self) -> u64 = self.0;
        behind(&self) -> u64 = self.0;
        receive_soon(&mut self, _: Duration) -> Result<Option<Received<'_>>, LiveError> = self.0;
    }

    pub fn results<T: ResultElement>(
        &self,
        _: Topic,
        _: &ResultColumns,
    ) -> Result<ResultPublisher<T>, ResultsError> {
        match self.0 {}
    }
}

impl FrameSource for LiveSource {
    type Error = LiveError;

    fn manifest(&self) -> &RunManifest {
        match self.0 {}
    }

    fn receive(&mut self) -> Result<Received<'_>, LiveError> {
        match self.0 {}
    }
}

impl HeldState {
    unreached! { frame(&self) -> Frame<'_> = self.0; }
}

impl<T: ResultElement> ResultPublisher<T> {
    unreached! {
        create(bus: &Bus, _: &RunName, _: Topic, _: StreamId, _: &ResultColumns, _: Stop) -> Result<Self, ResultsError> = bus.0;
        publish(&mut self, _: u64, _: u64, _: f64, _: &[T]) -> Result<(), ResultsError> = self.0;
        publish_for(&mut self, _: &Frame<'_>, _: &[T]) -> Result<(), ResultsError> = self.0;
        finish(self) -> Result<(), ResultsError> = self.0;
        finish_short_of(self, _: Option<u64>) -> Result<(), ResultsError> = self.0;
        finish_and_wait(self, _: Duration) -> Result<(), ResultsError> = self.0;
    }
}

impl ResultSubscriber {
    unreached! {
        attach(bus: &Bus, _: &RunName, _: Topic, _: Delivery, _: Stop) -> Result<Option<Self>, ResultsError> = bus.0;
        columns(&self) -> &ResultColumns = self.0;
        receive(&mut self) -> Result<ResultReceived<'_>, ResultsError> = self.0;
        receive_soon(&mut self) -> Result<Option<ResultReceived<'_>>, ResultsError> = self.0;
    }
}

impl ResultsWatch {
    unreached! {
        create(bus: &Bus, _: &RunName) -> Result<Self, ResultsError> = bus.0;
        topics(&self) -> Result<Vec<Topic>, ResultsError> = self.0;
        attach(&self, _: Topic, _: Delivery, _: Stop) -> Result<Option<ResultSubscriber>, ResultsError> = self.0;
        wait(&self, _: Duration) -> bool = self.0;
    }
}
