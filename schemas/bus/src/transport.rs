//! The bus itself, over iceoryx2.

mod backpressure;
mod board;
mod chain_values;
mod creating;
mod creator;
#[doc(hidden)]
pub mod delivery;
mod leftovers;
mod live;
mod manifest_file;
mod outlet;
mod position;
mod publisher;
mod results;
mod room;
mod root;
mod runs;
mod services;
mod shared_segment;
mod warden;
mod wire;

pub use creating::while_waiting;
pub use live::{HeldState, LiveSource};
pub use publisher::StatePublisher;
pub use results::{ResultPublisher, ResultSubscriber, ResultsWatch};
pub use room::MAX_BUFFER;
pub use runs::list_runs;
pub use wire::{
    FLAG_FOLLOWS, FLAG_LAST, JOIN_CONNECT, JOIN_READY, JoinAnswer, JoinRequest, ManifestText, RunStatus,
    STATE_DONE, STATE_FAILED, STATE_INTERRUPTED, STATE_RUNNING, STATE_WAITING, StateHeader,
};

use crate::{BusError, RootError};
use creating::CreationLock;
use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::node::{Node, NodeBuilder, NodeState};
use iceoryx2::prelude::{
    CallbackProgression, Config, LogLevel, PortFactory as _, SignalHandlingMode, set_log_level_from_env_or,
};
use leftovers::{HalfMade, Removed};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use warden::Warden;

/// Service type of the bus. Its ports may be used from any thread. Single-threaded programs use the same services.
type Ipc = iceoryx2::prelude::ipc_threadsafe::Service;

/// The bus of one user: a directory, and everything in shared memory that goes with it.
#[derive(Clone)]
pub struct Bus {
    root: PathBuf,
    prefix: String,
    config: Config,
    /// Started as soon as something waits for other processes.
    warden: Arc<OnceLock<Warden>>,
}

impl fmt::Debug for Bus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bus").field("root", &self.root).field("prefix", &self.prefix).finish_non_exhaustive()
    }
}

impl Bus {
    /// The bus in `$BEADLINE_ROOT`, or else in `$XDG_RUNTIME_DIR/beadline` (if the runtime directory is this user's
    /// alone), or else in `/tmp/beadline-<uid>`; the directory is created if it is missing.
    ///
    /// # Errors
    /// When the directory is not ours alone, or its path is too long.
    pub fn from_env() -> Result<Self, RootError> {
        Self::at(&root::default_root())
    }

    /// The bus in `root`; the directory is created if it is missing, its parent is not.
    ///
    /// # Errors
    /// As for [`Bus::from_env`].
    pub fn at(root: &Path) -> Result<Self, RootError> {
        // before anything else of iceoryx2, which otherwise prints about its missing configuration file
        set_log_level_from_env_or(LogLevel::Error);
        let root = root::prepare(root)?;
        let prefix = root::prefix(&root, &root::secret(&root)?);
        let config = root::config(&root, &prefix)?;
        Ok(Self { root, prefix, config, warden: Arc::default() })
    }

    /// The directory, with links resolved.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Start of the names of this bus in `/dev/shm`; `docs/FORMAT.md` has the rule.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// Notice of leftovers that were in this process's way and have been removed since the last call.
    pub fn take_notice(&self) -> Option<BusNotice> {
        let removed = self.warden.get()?.take_removed();
        (removed != Removed::default()).then_some(BusNotice(removed))
    }

    /// True if somebody has removed the directory, so that nobody finds the runs published here any more.
    fn is_gone(&self) -> bool {
        self.warden.get().is_some_and(Warden::root_is_gone)
    }

    /// Takes the lock, which is held while creating things that others may find half-made.
    fn lock(&self) -> Result<CreationLock, BusError> {
        CreationLock::take(&self.root)
    }

    /// The directory in which every service is described.
    fn services(&self) -> PathBuf {
        PathBuf::from(self.config.global.service_dir().to_string())
    }

    fn config(&self) -> &Config {
        &self.config
    }

    /// iceoryx2 configuration of this bus, with nothing in the way of its users. Programs that use the bus through iceoryx2
    /// alone need it, to be measured against this crate.
    #[doc(hidden)]
    pub fn bare_config(&self) -> Result<&Config, BusError> {
        self.clear_the_way()?;
        Ok(&self.config)
    }

    /// Registers this process, and cleans up the remains of dead ones.
    fn node(&self) -> Result<Node<Ipc>, BusError> {
        self.prepare()?;
        self.prepared_node()
    }

    /// Prepares for registering. The caller needs no lock.
    fn prepare(&self) -> Result<(), BusError> {
        // before anything that may wait for others
        self.warden();
        room::check_least(room::free_bytes()?)?;
        self.clear_the_way()
    }

    /// Does the rest of [`Bus::node`], after [`Bus::prepare`].
    fn prepared_node(&self) -> Result<Node<Ipc>, BusError> {
        let lock = self.lock()?;
        let family = root::family(&self.root);
        if !leftovers::may_be_there(&self.root, &self.prefix, &family, &self.config) {
            return self.node_with(&self.config_without_cleanup());
        }
        let node = self.node_with(&self.config)?;
        if lock.is_exclusive() {
            let mut removed = leftovers::remove_orphans(&self.root, &self.prefix, &self.config);
            removed.add(leftovers::remove_earlier(&self.prefix, &family));
            self.warden().note(removed);
            position::remove_dead(&self.root);
        }
        Ok(node)
    }

    /// Registers this process and touches nothing else, so that the remains of a dead producer can be seen.
    fn observer(&self) -> Result<Node<Ipc>, BusError> {
        self.prepare()?;
        self.node_with(&self.config_without_cleanup())
    }

    /// Configuration that does not look at all other nodes each time that something is made, opened or left: with a hundred
    /// processes these looks would take most of the time of each process.
    fn config_without_cleanup(&self) -> Config {
        let mut config = self.config.clone();
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        config
    }

    fn warden(&self) -> &Warden {
        self.warden.get_or_init(|| {
            Warden::start(self.root.clone(), root::secret_path(&self.root), self.prefix.clone())
        })
    }

    fn node_with(&self, config: &Config) -> Result<Node<Ipc>, BusError> {
        let start = Instant::now();
        loop {
            let builder =
                NodeBuilder::new().config(config).signal_handling_mode(SignalHandlingMode::Disabled);
            let error = match builder.create::<Ipc>() {
                Ok(node) => return Ok(node),
                Err(e) => e,
            };
            if start.elapsed() > Duration::from_secs(1) {
                let root = self.root.display().to_string();
                return Err(BusError::Node { root, cause: format!("{error:?}") });
            }
            std::thread::sleep(Duration::from_millis(2));
            self.clear_the_way()?;
        }
    }

    /// Removes everything that iceoryx2 would wait for; the warden removes later things of this kind.
    fn clear_half_made(&self) {
        self.warden().note(HalfMade::default().remove(&self.prefix));
    }

    /// Does the same, and repairs the segment that all processes share.
    fn clear_the_way(&self) -> Result<(), BusError> {
        self.clear_half_made();
        if !shared_segment::is_ready(&self.prefix) {
            let _lock = self.lock()?;
            let spoilt = shared_segment::ensure(&self.prefix, &root::secret_path(&self.root))?;
            self.warden().note(Removed { half_made: u64::from(spoilt), ..Removed::default() });
        }
        Ok(())
    }

    /// True if the process behind `node_id` lives, or if the nodes cannot be listed.
    fn is_alive(&self, node_id: [u8; 16]) -> bool {
        let id = u128::from_le_bytes(node_id);
        let mut alive = false;
        let listed = Node::<Ipc>::list(&self.config, |node| {
            let found = node.node_id().value() == id;
            alive = alive || (found && !matches!(node, NodeState::Dead(_)));
            if found { CallbackProgression::Stop } else { CallbackProgression::Continue }
        });
        // the directory cannot be read: assume nothing
        alive || listed.is_err()
    }

    /// True if a publisher of `service` belongs to a living process.
    fn has_live_publisher<T>(&self, service: &services::SliceService<T>) -> bool
    where
        T: std::fmt::Debug + iceoryx2::prelude::ZeroCopySend,
    {
        let mut nodes = Vec::new();
        service.dynamic_config().list_publishers(|publisher| {
            nodes.push(publisher.node_id.value().to_le_bytes());
            CallbackProgression::Continue
        });
        nodes.into_iter().any(|node| self.is_alive(node))
    }
}

/// Notice of leftovers that were in the way and have been removed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusNotice(Removed);

impl fmt::Display for BusNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Removed { half_made, orphans, bytes } = self.0;
        let files = half_made + orphans;
        let s = if files == 1 { "" } else { "s" };
        write!(f, "removed {files} file{s} ({bytes} bytes) that killed processes had left on the bus")?;
        match half_made {
            0 => Ok(()),
            _ => write!(f, ", {half_made} of them half-made, so that whoever needed it waited"),
        }
    }
}

/// The process that registered this node.
fn process_of(node: UniqueNodeId) -> Option<i32> {
    node.pid::<Ipc>().ok().map(|process| process.value())
}

fn node_bytes(node: &Node<Ipc>) -> [u8; 16] {
    node.id().value().to_le_bytes()
}
