//! Finds results as they come.

use super::subscriber::ResultSubscriber;
use crate::Bus;
use crate::transport::Ipc;
use crate::transport::runs::results_of;
use crate::transport::services;
use crate::{BusError, Delivery, ResultsError};
use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use schemas::results::Topic;
use schemas::run_name::RunName;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Waits for publishers of any results of a run. They let this process subscribe before their first row.
pub struct ResultsWatch {
    bus: Bus,
    run: RunName,
    listener: Listener<Ipc>,
    _node: Node<Ipc>,
}

impl ResultsWatch {
    /// Looks out for results of `run`.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn create(bus: &Bus, run: &RunName) -> Result<Self, ResultsError> {
        let node = bus.node()?;
        let listener = services::announcements(&node, run)?.listener_builder().create();
        let text = format!("beadline/{run}/own");
        let listener = listener.map_err(|e| BusError::service(&text, "listen to", &e))?;
        Ok(Self { bus: bus.clone(), run: run.clone(), listener, _node: node })
    }

    /// The topics that have services, in order, with publishers or without.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn topics(&self) -> Result<Vec<Topic>, ResultsError> {
        Ok(results_of(&self.bus, &self.run)?.into_iter().map(Topic::Results).collect())
    }

    /// Attaches to the publisher of `topic`, if there is one, as [`ResultSubscriber::attach`] does.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn attach(
        &self,
        topic: Topic,
        delivery: Delivery,
        stop: Arc<AtomicBool>,
    ) -> Result<Option<ResultSubscriber>, ResultsError> {
        ResultSubscriber::attach(&self.bus, &self.run, topic, delivery, stop)
    }

    /// Waits until a publisher comes, or for `patience`; returns true if one came.
    pub fn wait(&self, patience: Duration) -> bool {
        let mut came = false;
        // a signal ends the wait early; the caller looks again
        let _ = self.listener.timed_wait(|_| came = true, patience);
        came
    }
}
