"""Attaches to a Beadline run that is under way and hands its frames out as numpy arrays, without copying them.

    from beadline_live import Run

    with Run("light-impurity") as run:      # Run() takes the only run there is, and waits for one
        for frame in run:
            print(frame.step, frame.time_s, frame.v.max())

Needs `pip install iceoryx2==0.10.0 numpy`. docs/python/7-without-the-package.md says how to use it, docs/FORMAT.md is the contract that it
keeps: every name, layout and number here stands on that page. Copy this file into a project of your own as it is.
"""

import ctypes
import fcntl
import hashlib
import json
import os
import random
import re
import stat
import string
import time
from typing import NamedTuple

import iceoryx2 as iox2
import numpy as np

SCHEMA_MAJOR = "1"
WAITING, RUNNING, DONE, INTERRUPTED, FAILED = range(5)
ENDS = {DONE: "complete", INTERRUPTED: "interrupted", FAILED: "failed"}
CONNECT, READY = 1, 2
MANIFEST_KEY, STATUS_KEY, PREVIOUS_KEY = 0, 1, 2
MOST_ROOT_BYTES = 44  # sockets lie in it, and their paths are short
SHARED_SEGMENT = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt"
SHARED_VERSION = 10 << 16  # iceoryx2 0.10.0
LOCK_PATIENCE_S = 15
WAIT = iox2.Duration.from_millis(50)  # longest wait for a notification
ANSWER_WAIT = iox2.Duration.from_millis(10)
LIVENESS_PERIOD_S = 0.5  # how often a silent producer is checked
UNSETTLED = ("ServiceInCorruptedState", "HangsInCreation", "IsMarkedForDestruction", "Interrupt")


class RunError(Exception):
    """A run cannot be read, or can no longer be read."""


class NoRun(RunError):
    """There is no such run, or it is not clear which one is meant."""


class Lost(RunError):
    """The frames ended before the run said that they do: what was computed of them is not all of the run."""


def shared(type_name, *fields):
    """A struct that lies in shared memory, under the name by which iceoryx2 knows it."""
    about = {"_fields_": fields, "type_name": staticmethod(lambda: type_name)}
    return type(type_name.split(".")[1], (ctypes.Structure,), about)


Bytes16, u64, f64 = ctypes.c_uint8 * 16, ctypes.c_uint64, ctypes.c_double
STREAM = ("run_id", Bytes16), ("stream_id", u64)
StateHeader = shared(
    "beadline.StateHeader.v1", *STREAM,
    ("frame", u64), ("step", u64), ("time_s", f64), ("flags", u64), ("reserved", u64),
)  # fmt: skip
JoinRequest = shared(
    "beadline.JoinRequest.v1", ("subscriber_id", Bytes16), ("phase", u64), ("reserved", u64)
)
JoinAnswer = shared(
    "beadline.JoinAnswer.v1", *STREAM, ("first_frame", u64), ("phase", u64), ("reserved", u64)
)
ManifestText = shared(
    "beadline.ManifestText.v1", *STREAM, ("length_bytes", u64), ("json", ctypes.c_uint8 * 65504)
)
RunStatus = shared(
    "beadline.RunStatus.v1", *STREAM,
    ("state", u64), ("frames", u64), ("first_frame", u64), ("step", u64), ("time_s", f64), ("written_unix_ns", u64),
    ("lossless", u64), ("latest", u64), ("evicted", u64), ("pid", u64), ("node_id", Bytes16), 
    ("began_unix_ns", u64), ("reserved", u64 * 3),
)  # fmt: skip


def stream_of(struct):
    """Which publishing of which run."""
    return bytes(struct.run_id), struct.stream_id


class Frame(NamedTuple):
    """One frame. The arrays lie in shared memory and cannot be written to; copy what you keep (`frame.u.copy()`)."""

    frame: int  # number of the frame
    step: int
    time_s: float
    u: np.ndarray  # displacement of each bead (m)
    v: np.ndarray  # velocity of each bead (m/s)
    extra: np.ndarray  # what else the method needs, see docs/FORMAT.md
    missed: int  # how many frames right before this one did not come; 0 unless `latest`


class Wall(NamedTuple):
    """The contact of an end of the chain with its wall; all 0 at a free end."""

    stiffness: float
    rest_overlap: float
    rest_force: float
    damping: float


class Chain(NamedTuple):
    """The resolved chain: what the dynamics is computed with, of a chain of one power law."""

    mass: np.ndarray  # of each bead (kg), N
    stiffness: np.ndarray  # of each contact (N/m^alpha), N - 1, as all that follow
    rest_overlap: np.ndarray  # (m)
    rest_force: np.ndarray  # (N)
    damping: np.ndarray  # 0 without damping
    left_wall: Wall
    right_wall: Wall

    @classmethod
    def of(cls, values, beads):
        """From the payload of `/chain`."""
        *arrays, walls = np.split(values, np.cumsum([beads] + 4 * [beads - 1]))
        return cls(*arrays, Wall(*walls[:4].tolist()), Wall(*walls[4:8].tolist()))


def default_root():
    """`$BEADLINE_ROOT`, or else `beadline` in the runtime directory if that is ours alone, or else one in /tmp."""
    runtime = os.path.realpath(os.environ.get("XDG_RUNTIME_DIR") or "/")
    inside = os.path.join(runtime, "beadline")
    fits = os.path.isabs(os.environ.get("XDG_RUNTIME_DIR", "")) and len(os.fsencode(inside)) <= MOST_ROOT_BYTES
    fallback = f"/tmp/beadline-{os.getuid()}"
    return os.environ.get("BEADLINE_ROOT") or (inside if fits and is_ours_alone(runtime) else fallback)


def is_ours_alone(path):
    """Whether it is a directory of this user that nobody else may enter."""
    try:
        found = os.lstat(path)
    except OSError:
        return False
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077


class Bus:
    """The bus of this user: `$BEADLINE_ROOT`, or else `$XDG_RUNTIME_DIR/beadline`, or else `/tmp/beadline-<uid>`."""

    def __init__(self, root=None):
        iox2.set_log_level_from_env_or(iox2.LogLevel.Error)
        root = root or default_root()
        try:
            os.mkdir(root, 0o700)
        except FileExistsError:
            pass
        if not is_ours_alone(root):
            raise RunError(f"the bus directory {root} is not a directory of this user alone; expected mode 700")
        root = os.path.realpath(root)
        if len(os.fsencode(root)) > MOST_ROOT_BYTES:
            raise RunError(f"the bus directory {root} has a name of more than {MOST_ROOT_BYTES} bytes; "
                           "set BEADLINE_ROOT to a shorter one")  # fmt: skip
        self.root = root
        with open(os.path.join(root, "creating.lock"), "a") as lock:
            self._take(lock)
            prefix = "bl" + hashlib.sha256(os.fsencode(root)).hexdigest()[:6] + self._secret(root) + "_"
            self._share(prefix)
            self.config = iox2.config.default()
            self.config.global_cfg.root_path = iox2.Path.new(root)
            self.config.global_cfg.prefix = iox2.FileName.new(prefix)
            # with signal handling of its own iceoryx2 would keep Ctrl-C from Python
            builder = iox2.NodeBuilder.new().config(self.config)
            builder = builder.signal_handling_mode(iox2.SignalHandlingMode.Disabled)
            self.node = self._register(builder)

    @staticmethod
    def _take(lock):
        """Whoever registers holds this lock; who is killed loses it."""
        start = time.monotonic()
        while True:
            try:
                return fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() - start > LOCK_PATIENCE_S:
                    raise RunError(f"another process has held {lock.name} for {LOCK_PATIENCE_S} s") from None
                time.sleep(0.002)

    @staticmethod
    def _secret(root):
        """What makes names in shared memory unknown to other users; made if there is none."""
        path = os.path.join(root, "secret")
        try:
            with open(path) as file:
                secret = file.read()
        except FileNotFoundError:
            secret = ""
        if not re.fullmatch("[a-z2-7]{8}", secret):
            secret = "".join(random.SystemRandom().choices(string.ascii_lowercase + "234567", k=8))
            with open(path + ".new", "w") as file:
                file.write(secret)
            os.rename(path + ".new", path)
        return secret

    @staticmethod
    def _share(prefix):
        """The segment that all processes share: iceoryx2 itself would make it writable for every user."""
        path = f"/dev/shm/{prefix}{SHARED_SEGMENT}"
        if not os.path.lexists(path):
            new = os.open(path + ".new", os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o600)
            os.write(new, SHARED_VERSION.to_bytes(8, "little") + bytes(8))
            os.close(new)
            os.rename(path + ".new", path)

    @staticmethod
    def _register(builder):
        """Others may be making or removing what all processes share."""
        start = time.monotonic()
        while True:
            try:
                return builder.create(iox2.ServiceType.Ipc)
            except iox2.NodeCreationFailure as error:
                if time.monotonic() - start > 1:
                    raise RunError(f"cannot register on the bus: {error}") from error
                time.sleep(0.002)

    def runs(self):
        """The names of the runs that consumers can attach to."""
        names = set()
        for service in iox2.Service.list(self.config, iox2.ServiceType.Ipc):
            parts = service.name().to_string().split("/")
            if len(parts) == 3 and parts[0] == "beadline" and parts[2] == "manifest":
                names.add(parts[1])
        return sorted(name for name in names if (board := Board.find(self, name)) and self.is_live(board.status()))

    def is_live(self, status):
        """Whether a run of this status goes on."""
        return status.state <= RUNNING and self.is_alive(status)

    def is_alive(self, status):
        """Whether the process lives that wrote this status."""
        node_id = int.from_bytes(status.node_id, "little")
        for state in iox2.Node.list(iox2.ServiceType.Ipc, self.config):
            if getattr(state[0], "id", state[0]).value == node_id:
                return not isinstance(state, iox2.NodeState.Dead)
        return False

    def open(self, run, topic, choose):
        """Opens a service of a run; None if there is none. `choose` says which pattern it has."""
        name, start = f"beadline/{run}/{topic}", time.monotonic()
        while True:
            try:
                service = choose(self.node.service_builder(iox2.ServiceName.new(name))).open()
            except Exception as error:  # each pattern has an error of its own
                if str(error) == "DoesNotExist":
                    return None
                if str(error) not in UNSETTLED:
                    raise RunError(f"cannot open {name}: {error}") from error
                if time.monotonic() - start > 0.2:
                    return None
                time.sleep(0.002)  # it is being made or taken away
                continue
            self.check_version(name, service)
            return service

    @staticmethod
    def check_version(name, service):
        attributes = {entry.key.to_string(): entry.value.to_string() for entry in service.attributes.values}
        found = attributes.get("beadline.schema", "none")
        if found.split(".")[0] != SCHEMA_MAJOR:
            raise RunError(f"{name} has schema version {found}, this program speaks {SCHEMA_MAJOR}.x")

    def slices(self, run, topic, overflows=False):
        """`/state` or `/chain`."""
        def choose(builder):
            builder = builder.publish_subscribe(iox2.Slice[f64]).user_header(StateHeader)
            return builder.enable_safe_overflow(overflows)
        return self.open(run, topic, choose)

    def events(self, run, topic):
        """The event service that goes with a topic."""
        return self.open(run, topic, lambda builder: builder.event())


class Board:
    """The blackboard of a run: its manifest, and how far it is."""

    @classmethod
    def find(cls, bus, run):
        service = bus.open(run, "manifest", lambda builder: builder.blackboard_opener(u64))
        return service and cls(bus.root, service)

    def __init__(self, root, service):
        reader = service.reader_builder().create()
        self._root, self._service, self._reader = root, service, reader
        self._manifest = reader.entry(u64(MANIFEST_KEY), ManifestText)
        self._status = [reader.entry(u64(key), RunStatus) for key in (STATUS_KEY, PREVIOUS_KEY)]

    def status(self):
        """That of the stream that was published last."""
        return self._status[0].get().decode_as(RunStatus)

    def status_of(self, stream):
        """That of `stream`, which may be the one before; None if it is neither."""
        found = (entry.get().decode_as(RunStatus) for entry in self._status)
        return next((status for status in found if stream_of(status) == stream), None)

    def manifest(self, stream):
        """The manifest of `stream`; None if another one has begun."""
        text = self._manifest.get().decode_as(ManifestText)
        if stream_of(text) != stream:
            return None
        if text.length_bytes <= len(text.json):
            return json.loads(bytes(text.json[: text.length_bytes]))
        # a long one lies in a file, which is gone with its producer
        name = bytes(text.json).split(b"\0")[0].decode()
        try:
            with open(os.path.join(self._root, os.path.basename(name)), "rb") as file:
                return json.loads(file.read(text.length_bytes))
        except FileNotFoundError:
            return None


class Run:
    """A consumer of one run; iterating over it gives its frames as they come, until the run ends.

    It waits for the run `name`, or for the only run there is, at most for `timeout` seconds (None: for ever). By default
    it gets every frame from `first_frame` on, and holds the run back where it is slower. With `latest=True` it never
    does, and gets what there is: what it misses is counted in `missed`, and in `Frame.missed` where it happened.

    A run that ends in order ends the loop, and `end` is "complete" or "interrupted". Otherwise `Lost` is raised: the run
    failed, its producer was killed, or it has dropped a consumer that took nothing for too long.
    """

    def __init__(self, name=None, *, latest=False, timeout=None, label="python", root=None):
        self.bus, self.latest, self.label = Bus(root), latest, label
        self.name = self.manifest = self.chain = self.first_frame = None
        self.end, self.missed = None, 0
        self._stashed = self._closing = self._last = None
        start = time.monotonic()
        while not self._attach(name):
            if timeout is not None and time.monotonic() - start >= timeout:
                wanted = f"run {name}" if name else "run"
                raise NoRun(f"no {wanted} was published within {timeout} s; start one with `beadline run`")
            time.sleep(0.05)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        """Leaves the run. If that goes on, it takes the memory of arrays that are still held back: they may change."""
        self._stashed = self._subscriber = self._listener = self._board = None

    def status(self):
        """How far the run is, as the producer last said; None if it is not known any more."""
        return self._board and self._board.status_of(self._stream)

    def __iter__(self):
        return self

    def __next__(self):
        if self.end is not None:
            self.close()
            raise StopIteration
        while True:
            sample = self._next_sample()
            if sample is not None:
                return self._take(sample)
            if self._closing is not None:
                self._close_with(self._closing)
            self._closing = self._look_for_the_end()
            if self._closing is None:
                self._listen(WAIT)

    # attaching

    def _attach(self, name):
        """Tries once; False if the run is not there, or left meanwhile."""
        if name is None:
            names = self.bus.runs()
            if len(names) > 1:
                raise NoRun(f"several runs are being published, name one: {', '.join(names)}")
            if not names:
                return False
            name = names[0]
        board = Board.find(self.bus, name)
        status = board and board.status()
        if not status or not self.bus.is_live(status):
            return False
        self.name, self._board, self._stream = name, board, stream_of(status)
        self.manifest = board.manifest(self._stream)
        if self.manifest is None or not self._subscribe() or not self._join():
            self.close()
            return False
        return True

    def _subscribe(self):
        state, events = self.bus.slices(self.name, "state"), self.bus.events(self.name, "state")
        if state is None or events is None:
            return False
        builder = state.subscriber_builder()
        kind = "latest" if self.latest else "lossless"
        builder = builder.name(iox2.PortName.new(f"{kind}.{self.label[:30]}.{os.getpid()}"))
        if self.latest:
            builder = builder.buffer_size(2)  # with a longer queue it would see older frames
        self._subscriber = builder.create()
        self._listener = events.listener_builder().create()
        return True

    def _join(self):
        """The handshake. From its answer on every frame is ours."""
        join = self.bus.open(self.name, "join", lambda b: b.request_response(JoinRequest, JoinAnswer))
        bell, chains = self.bus.events(self.name, "join"), self.bus.slices(self.name, "chain", overflows=True)
        if join is None or bell is None or chains is None:
            return False
        client, bell = join.client_builder().create(), bell.notifier_builder().create()
        chains = chains.subscriber_builder().create()
        subscriber_id = Bytes16(*self._subscriber.id.value.to_bytes(16, "little"))
        for phase in (CONNECT, READY):
            pending = client.send_copy(JoinRequest(subscriber_id, phase, 0))
            bell.notify()
            answer = self._answer(pending)
            if answer is None or stream_of(answer) != self._stream:
                return False
            if phase == CONNECT:
                self._stashed = None
                self._subscriber.receive()  # connects us; the producer has connected already
        self.first_frame = self._expected = answer.first_frame
        self._checked_at = time.monotonic()
        return self._read_chain(chains)

    def _answer(self, pending):
        """The answer of the producer; None if it left. Meanwhile what comes is thrown away, so that it is not held
        back. A sample that came when the answer was there already is kept: it may be the first that is ours."""
        checked_at = time.monotonic()
        while True:
            answer = pending.receive()
            if answer is None:
                sample = self._subscriber.receive()
                if sample is not None:
                    answer = pending.receive()
                    self._stashed = sample if answer is not None else None
            if answer is not None:
                return JoinAnswer.from_buffer_copy(answer.payload().contents)
            if sample is not None:
                continue
            if time.monotonic() - checked_at >= LIVENESS_PERIOD_S:
                checked_at = time.monotonic()
                status = self._board.status()
                # of another stream: nobody answers what its producer was not asked
                if stream_of(status) != self._stream or not self.bus.is_live(status):
                    return None
            self._listen(ANSWER_WAIT)

    def _read_chain(self, chains):
        while (sample := chains.receive()) is not None:
            if stream_of(sample.user_header().contents) == self._stream:
                self.chain = Chain.of(values_of(sample).copy(), self.manifest["physics"]["beads"])
                return True
        return False

    # receiving

    def _next_sample(self):
        """The next sample of our stream that we do not have yet."""
        while True:
            sample, self._stashed = self._stashed, None
            if sample is None:
                try:
                    sample = self._subscriber.receive()
                except iox2.ReceiveError as error:
                    if "ExceedsMaxBorrows" in str(error):
                        raise RunError("too many frames are held: copy what you keep, as in frame.u.copy()") from None
                    raise RunError(f"run {self.name}: {error}") from error
            if sample is None:
                return None
            header = sample.user_header().contents
            if stream_of(header) != self._stream:
                # a new producer has this name, and ours is over
                status = self.status()
                self._closing = self._closing or ENDS.get(status.state if status else None, "producer lost")
            elif header.frame >= self._expected:
                return sample

    def _take(self, sample):
        header = sample.user_header().contents
        gap = header.frame - self._expected
        if gap > 0 and not self.latest:
            # frames are skipped only for a consumer that was dropped
            self._close_with("dropped", at_least=header.frame)
        self.missed += gap
        self._expected = header.frame + 1
        self._checked_at = time.monotonic()
        beads, values = self.manifest["physics"]["beads"], values_of(sample)
        u, v, extra = values[:beads], values[beads : 2 * beads], values[2 * beads :]
        return Frame(header.frame, header.step, header.time_s, u, v, extra, gap)

    def _look_for_the_end(self):
        """Called when the queue was empty. What is found counts after the queue was emptied once more."""
        status = self.status()
        self._last = status or self._last
        if status is None:
            return "producer lost"
        if status.state not in ENDS and time.monotonic() - self._checked_at >= LIVENESS_PERIOD_S:
            self._checked_at = time.monotonic()
            if not self.bus.is_alive(status):
                return "producer lost"
        return ENDS.get(status.state)

    def _close_with(self, end, at_least=None):
        """The stream is over: counts what is missing at its end, and leaves the loop."""
        status = self.status() or self._last  # later producers push ours out
        if end == "producer lost":  # or it has ended in order just before
            end = ENDS.get(status.state if status else None, end)
        last = status.first_frame + status.frames - 1 if status and status.frames else self._expected - 1
        tail = max(last, self._expected - 1 if at_least is None else at_least) - self._expected + 1
        if tail > 0 and not self.latest and end != "producer lost":
            end = "dropped"
        self.missed += tail
        self.end = end
        self.close()
        if end in ("complete", "interrupted"):
            raise StopIteration
        raise Lost(f"run {self.name}: {end} at frame {self._expected}, {self.missed} frames missed")

    def _listen(self, patience):
        """Sleeps until the producer rings, or for `patience`; whether it rang. Takes all notifications there are."""
        try:
            return bool(self._listener.timed_wait(patience))
        except iox2.ListenerWaitError:
            return False  # a signal came; Python acts on it now


def values_of(sample):
    """The payload as an array that cannot be written to. The sample is given back when no array needs it any more."""
    # not the length of payload(), which iceoryx2 0.10 gives in bytes
    memory = (f64 * sample.header.number_of_elements).from_address(sample.payload_ptr)
    memory.sample = sample
    values = np.frombuffer(memory, dtype="<f8")
    values.flags.writeable = False
    return values
