//! A live run on another host: two network namespaces, or loopback where the system grants none.

mod again;
mod bounds;
mod leaving;
mod strangers;

use crate::harness::{Ended, Place, Running, python, skip, wait_until};
use bus::RunInfo;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::Duration;

/// The end of a link where the run is.
const NEAR_ADDRESS: &str = "10.77.0.1";

/// Two hosts: each with a bus and files of its own, and a network that reaches the other one alone.
struct Hosts {
    near: Place,
    far: Place,
    network: Option<Network>,
    port: u16,
}

/// Two network namespaces.
struct Network {
    near: String,
    far: String,
}

impl Network {
    /// Namespaces without any link; none if the system grants none.
    fn new() -> Option<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("bl{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let network = Self { near: format!("{name}n"), far: format!("{name}f") };
        for namespace in [&network.near, &network.far] {
            if !ip(&format!("netns add {namespace}")) || !ip(&format!("-n {namespace} link set lo up")) {
                skip("two network namespaces need root and `ip`; loopback it is");
                return None;
            }
        }
        Some(network)
    }

    /// Joins both by a veth pair.
    fn join(&self) {
        let Self { near, far } = self;
        for words in [
            format!("-n {near} link add veth0 type veth peer name veth0 netns {far}"),
            format!("-n {near} addr add {NEAR_ADDRESS}/24 dev veth0"),
            format!("-n {far} addr add 10.77.0.2/24 dev veth0"),
            format!("-n {near} link set veth0 up"),
            format!("-n {far} link set veth0 up"),
        ] {
            assert!(ip(&words), "ip {words}");
        }
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        for namespace in [&self.near, &self.far] {
            ip(&format!("netns del {namespace}"));
        }
    }
}

fn ip(words: &str) -> bool {
    Command::new("ip").args(words.split_whitespace()).status().is_ok_and(|status| status.success())
}

impl Hosts {
    fn new() -> Self {
        let network = Network::new().inspect(Network::join);
        Self::on(network)
    }

    fn on(network: Option<Network>) -> Self {
        let port = if network.is_some() { 7447 } else { free_port() };
        Self { near: Place::new(), far: Place::new(), network, port }
    }

    fn on_loopback() -> Self {
        Self::on(None)
    }

    fn address(&self) -> String {
        let host = if self.network.is_some() { NEAR_ADDRESS } else { "127.0.0.1" };
        format!("{host}:{}", self.port)
    }

    fn endpoint(&self) -> String {
        format!("tcp/{}", self.address())
    }

    /// `beadline WORDS` on one of both.
    fn start(place: &Place, namespace: Option<&String>, words: &str) -> Running {
        let command = match namespace {
            None => place.command(words.split_whitespace()),
            Some(namespace) => {
                let program = ["netns", "exec", namespace, env!("CARGO_BIN_EXE_beadline")];
                place.foreign("ip", program.into_iter().chain(words.split_whitespace()))
            }
        };
        Running::start(words, command)
    }

    fn near(&self, words: &str) -> Running {
        Self::start(&self.near, self.network.as_ref().map(|network| &network.near), words)
    }

    fn far(&self, words: &str) -> Running {
        Self::start(&self.far, self.network.as_ref().map(|network| &network.far), words)
    }

    fn relay_from(&self, more: &str) -> Running {
        self.near(&format!("relay --from live --listen {} --json {more}", self.endpoint()))
    }

    fn relay_to(&self, more: &str) -> Running {
        self.far(&format!("relay --connect {} --json {more}", self.endpoint()))
    }

    /// Starts a run that waits for an analysis, and relays it; the analyses begin with its first frame.
    fn relay(&self, run: &str, near: &str, far: &str) -> [Running; 3] {
        // a relay that is lossless itself is one more to wait for
        let lossless = near.contains("--hold") || [near, far].concat().contains("--frames");
        let wait_for = if lossless { 2 } else { 1 };
        let run = self.near(&format!("run --no-record --name shock --wait-for {wait_for} {run}"));
        let near = self.relay_from(near);
        let far = self.relay_to(far);
        self.near.wait_for_run("shock", is_relayed);
        [run, near, far]
    }
}

fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

fn is_relayed(run: &RunInfo) -> bool {
    run.consumers.iter().any(|consumer| consumer.label == "relay")
}

/// Asserts that a far side has every frame of the run from its first one on.
#[track_caller]
fn has_all(near: &Ended, far: &Ended, frames: u64) {
    let (near, far) = (near.json(), far.json());
    assert_eq!((&near["end"], &far["end"]), (&"complete".into(), &"complete".into()));
    assert_eq!((far["first_frame"].as_u64(), far["frames"].as_u64()), (Some(0), Some(frames)), "{far}");
    assert_eq!(far["rows_lost"], 0);
}

/// The same table on both sides, of every frame from the first to the last one.
#[track_caller]
fn has_same_tables(
    hosts: &Hosts,
    run: &str,
    analysis: &str,
    near_flags: &str,
    far_flags: &str,
) -> (Ended, Ended) {
    let [running, near, far] = hosts.relay(run, near_flags, &format!("--wait-for 1 {far_flags}"));
    let words = format!("{analysis} live:shock --out table.csv --force");
    let there = hosts.far(&words);
    let here = hosts.near(&words);
    here.wait().exits(0);
    running.wait().exits(0);
    let (near, far) = (near.wait().exits(0), far.wait().exits(0));
    there.wait().exits(0);
    let table = hosts.near.read("table.csv");
    assert!(table == hosts.far.read("table.csv"), "{run}: {analysis} differs");
    has_all(&near, &far, table.lines().count() as u64 - 1);
    (near, far)
}

const SMALL: &str = "--beads 120 --impurity 60=0.6e-3 --duration 0.004";

#[test]
fn analyses_find_the_same_on_both_hosts() {
    let hosts = Hosts::new();
    for (run, analysis) in [
        (SMALL, "energies"),
        ("--beads 120 --impurity 60=0.6e-3 --duration 0.004 --method gear5", "contacts"),
        ("--preset driven-damped --duration 0.002", "energies"),
        ("--preset resonators --duration 0.001 --publish-every-steps 4", "impurity --bead 3"),
    ] {
        let (_, far) = has_same_tables(&hosts, run, analysis, "--every 100", "");
        let far = far.json();
        assert!(far["frames_proven"].as_u64() > Some(0), "{far}");
    }
}

#[test]
fn frames_themselves_can_be_sent() {
    let hosts = Hosts::new();
    let (_, far) = has_same_tables(&hosts, SMALL, "contacts", "--frames", "");
    assert!(far.json()["arrived_bytes"].as_u64() >= far.json()["frames_bytes"].as_u64());
    assert_eq!(far.json()["frames_proven"], 0);
    // the far side asks
    let (_, far) = has_same_tables(&hosts, SMALL, "contacts", "--hold", "--frames");
    assert_eq!(far.json()["frames_proven"], 0);
}

/// More frames than wait for their proof, and states as far apart as the run is long.
#[test]
fn one_state_for_the_whole_run_is_enough() {
    let hosts = Hosts::new();
    has_same_tables(&hosts, SMALL, "energies", "--every 1000000", "");
}

#[test]
fn results_that_come_along_are_published_there() {
    let hosts = Hosts::new();
    let [running, near, far] = hosts.relay(SMALL, "", "--wait-for 1");
    let recorder = hosts.far("record live:shock --out there.mcap --json");
    let here = hosts.near("energies live:shock --out here.csv");
    let here = here.wait().exits(0);
    running.wait().exits(0);
    let (near, far) = (near.wait().exits(0), far.wait().exits(0));
    let frames = hosts.near.read("here.csv").lines().count() as u64 - 1;
    has_all(&near, &far, frames);
    let recorded = recorder.wait().exits(0).json();
    assert_eq!(recorded["results"]["energies"]["rows"], frames, "{recorded}{}", here.stderr());
    assert_eq!(far.json()["rows"], frames);
}

/// A run of some seconds.
const SLOW: &str = "--beads 120 --impurity 60=0.6e-3 --duration 0.012 --pace 0.002";

/// A run of a minute, which is ended before.
const LONG: &str = "--beads 120 --impurity 60=0.6e-3 --duration 0.12 --pace 0.002";

#[test]
fn a_link_that_is_down_for_two_seconds_costs_nothing() {
    let Some(network) = Network::new() else { return };
    network.join();
    let hosts = Hosts::on(Some(network));
    let Some(network) = &hosts.network else { return };
    let [running, near, far] = hosts.relay(SLOW, "", "--wait-for 1");
    let words = "energies live:shock --out table.csv";
    let (there, here) = (hosts.far(words), hosts.near(words));
    hosts.far.wait_for_run("shock", |run| run.step > 200);
    assert!(ip(&format!("-n {} link set veth0 down", network.near)));
    let cut_at = hosts.near.wait_for_run("shock", |_| true).step;
    // the time is what is tested, and that the run does not wait meanwhile
    thread::sleep(Duration::from_secs(2));
    hosts.near.wait_for_run("shock", |run| run.step > cut_at);
    assert!(ip(&format!("-n {} link set veth0 up", network.near)));
    for process in [here, running, there] {
        process.wait().exits(0);
    }
    let (near, far) = (near.wait().exits(0), far.wait().exits(0));
    let table = hosts.near.read("table.csv");
    assert!(table == hosts.far.read("table.csv"));
    has_all(&near, &far, table.lines().count() as u64 - 1);
}

#[test]
fn a_receiver_that_is_killed_joins_again() {
    let hosts = Hosts::new();
    let [running, near, far] = hosts.relay(SLOW, "--hold", "");
    let here = hosts.near("energies live:shock --out table.csv");
    hosts.far.wait_for_run("shock", |run| run.step > 100);
    far.signal("KILL");
    assert_eq!(far.wait().killed_by(), Some(9));
    let far = hosts.relay_to("--wait-for 1");
    let there = hosts.far("energies live:shock --out table.csv");
    for process in [here, running, there] {
        process.wait().exits(0);
    }
    near.wait().exits(0);
    let far = far.wait().exits(0).json();
    let first = usize::try_from(far["first_frame"].as_u64().unwrap()).unwrap();
    assert!(first > 100, "{far}");
    // from its first frame on; what counts from the begin of a table differs
    let (near, far) = (hosts.near.read("table.csv"), hosts.far.read("table.csv"));
    let columns = |line: &str| line.split(',').take(6).map(str::to_owned).collect::<Vec<_>>();
    let near: Vec<_> = near.lines().skip(1 + first).map(columns).collect();
    let far: Vec<_> = far.lines().skip(1).map(columns).collect();
    assert!(!far.is_empty() && near == far, "{:?} {:?}", near.first(), far.first());
}

/// 5 ms each way, and 1 of 100 packets lost.
#[test]
fn a_slow_link_that_loses_packets_costs_nothing() {
    let (Some(python), Some(network)) = (python(), Network::new()) else { return };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/slow_link.py");
    let mut link = Command::new(python);
    link.arg(script).args([
        &network.near,
        &format!("{NEAR_ADDRESS}/24"),
        &network.far,
        "10.77.0.2/24",
        "0.005",
        "0.01",
    ]);
    let mut link = Running::start_with("slow_link.py", link, std::process::Stdio::piped());
    let stdin = link.stdin();
    assert_eq!(link.line(), "ready");
    let hosts = Hosts::on(Some(network));
    has_same_tables(&hosts, SMALL, "energies", "", "");
    has_same_tables(&hosts, SMALL, "contacts", "--frames", "");
    drop(stdin);
    let said = link.wait().exits(0).stdout();
    let lost: u64 = said.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!(lost > 0, "{said}");
}

#[test]
fn only_a_relay_with_hold_holds_the_run_back() {
    let hosts = Hosts::new();
    let run = "--beads 120 --impurity 60=0.6e-3 --duration 0.1";
    for hold in [false, true] {
        let [running, near, far] = hosts.relay(run, if hold { "--hold" } else { "" }, "");
        let here = hosts.near("energies live:shock --out here.csv --force");
        hosts.far.wait_for_run("shock", |_| true);
        // a lossless consumer there takes nothing for a while
        let there = hosts.far("energies live:shock --out there.csv --force");
        hosts.far.wait_for_run("shock", |run| run.lossless > 0);
        there.signal("STOP");
        let ended = |run: &mut Running| !run.is_running();
        let mut running = running;
        if hold {
            let mut last = 0;
            let stands = |run: &RunInfo| std::mem::replace(&mut last, run.step) == run.step && run.step > 0;
            let mut stands = stands;
            let mut still = 0;
            hosts.near.wait_for_run("shock", |run| {
                still = if stands(run) { still + 1 } else { 0 };
                still > 100
            });
            assert!(!ended(&mut running), "it waits");
        } else {
            wait_until("the run to end", || ended(&mut running).then_some(()));
        }
        there.signal("CONT");
        for process in [running, here, near, far, there] {
            process.wait().exits(0);
        }
    }
}

#[test]
fn the_end_there_is_the_end_here() {
    let hosts = Hosts::new();
    // the run is interrupted
    let [running, near, far] = hosts.relay(LONG, "", "");
    let here = hosts.near("energies live:shock --out here.csv");
    hosts.far.wait_for_run("shock", |run| run.step > 100);
    let there = hosts.far("energies live:shock --out there.csv --json");
    hosts.far.wait_for_run("shock", |run| run.lossless > 0);
    running.signal("INT");
    running.wait().exits(3);
    here.wait();
    assert_eq!(near.wait().exits(0).json()["end"], "interrupted");
    assert_eq!(far.wait().exits(0).json()["end"], "interrupted");
    assert_eq!(there.wait().json()["end"], "interrupted");
    // the near side is stopped, and the run goes on
    let [running, near, far] = hosts.relay(LONG, "", "");
    let here = hosts.near("energies live:shock --out here.csv --force");
    hosts.far.wait_for_run("shock", |run| run.step > 100);
    near.signal("INT");
    assert_eq!(near.wait().exits(3).json()["end"], "stopped");
    assert_eq!(far.wait().exits(3).json()["end"], "stopped");
    running.signal("INT");
    running.wait().exits(3);
    here.wait();
}

#[test]
fn a_near_side_that_is_gone_is_given_up_after_a_stated_time() {
    let hosts = Hosts::new();
    let [_running, near, far] = hosts.relay(LONG, "", "--silence 2");
    let _here = hosts.near("energies live:shock --out here.csv");
    hosts.far.wait_for_run("shock", |run| run.step > 100);
    let there = hosts.far("energies live:shock --out there.csv --json");
    hosts.far.wait_for_run("shock", |run| run.lossless > 0);
    near.signal("KILL");
    let far = far.wait().exits(3).says(&["silent for 2 s", "lost"]);
    assert_eq!(far.json()["end"], "producer lost");
    assert_eq!(there.wait().json()["end"], "failed");
}

#[test]
fn who_speaks_no_zenoh_gets_a_clear_end() {
    let hosts = Hosts::on_loopback();
    let listener = TcpListener::bind(("127.0.0.1", hosts.port)).unwrap();
    let garbage = thread::spawn(move || {
        // the first one only looks whether anybody listens
        for stream in listener.incoming().take(2) {
            let mut stream = stream.unwrap();
            let _ = stream.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n");
            let _ = stream.read(&mut [0; 64]);
        }
    });
    let ended = hosts.relay_to("").wait().exits(1);
    ended.says(&["what listens at tcp/127.0.0.1:", "is no Zenoh 1.x", "relay --listen"]);
    garbage.join().unwrap();
}

#[test]
fn an_endpoint_that_is_none_is_refused() {
    let place = Place::new();
    place.run("relay --connect here").exits(2).says(&["--connect", "`here`", "tcp/HOST:PORT"]);
    place.run("relay --from live --listen udp/0.0.0.0:1").exits(2).says(&["--listen", "tcp/HOST:PORT"]);
    place.run("relay --from run.mcap").exits(2).says(&["beadline replay"]);
    place.run("relay --connect tcp/127.0.0.1:1 --config none.json5").exits(2).says(&["none.json5"]);
}

/// Certificates of an authority of our own, checked on both sides.
#[test]
fn tls_by_zenohs_own_configuration() {
    let hosts = Hosts::on_loopback();
    let Some(keys) = certificates(&hosts.near) else { return };
    let side = |place: &Place, name: &str| {
        let file = |name: &str| format!("\"{}\"", keys.join(name).display());
        let (authority, certificate, key) =
            (file("ca.pem"), file(&format!("{name}.pem")), file(&format!("{name}.key")));
        let (own, others) = if name == "near" { ("listen", "connect") } else { ("connect", "listen") };
        place.write(
            "zenoh.json5",
            &format!(
                "{{ transport: {{ link: {{ tls: {{ root_ca_certificate: {authority}, enable_mtls: true, \
                 {own}_private_key: {key}, {own}_certificate: {certificate} }} }} }} }} // {others}: nobody"
            ),
        );
    };
    side(&hosts.near, "near");
    side(&hosts.far, "far");
    let endpoint = format!("tls/localhost:{}", hosts.port);
    let running = hosts.near(&format!("run --no-record --name shock --wait-for 1 {SMALL}"));
    let near = hosts.near(&format!("relay --from live --listen {endpoint} --config zenoh.json5 --json"));
    // one without a certificate is not let in
    let nobody = Place::new();
    nobody.write(
        "zenoh.json5",
        &fs::read_to_string(hosts.far.path("zenoh.json5")).unwrap().replace("connect_", "listen_"),
    );
    wait_until("the near side to listen", || std::net::TcpStream::connect(("127.0.0.1", hosts.port)).ok());
    nobody
        .run(&format!("relay --connect {endpoint} --config zenoh.json5"))
        .exits(1)
        .says(&["does not let us in"]);
    let far = hosts.far(&format!("relay --connect {endpoint} --config zenoh.json5 --json"));
    hosts.near.wait_for_run("shock", is_relayed);
    hosts.near("energies live:shock --out here.csv").wait().exits(0);
    running.wait().exits(0);
    let frames = hosts.near.read("here.csv").lines().count() as u64 - 1;
    has_all(&near.wait().exits(0), &far.wait().exits(0), frames);
}

/// An authority and two certificates for `localhost`; none without OpenSSL's command.
fn certificates(place: &Place) -> Option<std::path::PathBuf> {
    let script = "set -e; mkdir keys; cd keys
        new() { openssl req -newkey rsa:2048 -nodes -keyout $1.key -subj /CN=$2 \"${@:3}\" 2>/dev/null; }
        new ca beadline -x509 -days 2 -out ca.pem -addext basicConstraints=critical,CA:TRUE
        for side in near far; do
            new $side localhost -out $side.csr
            openssl x509 -req -in $side.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 -out $side.pem \
                -extfile <(printf 'subjectAltName=DNS:localhost\nextendedKeyUsage=serverAuth,clientAuth') 2>/dev/null
        done";
    let made = place.foreign("bash", ["-c", script]).status().is_ok_and(|status| status.success());
    if !made {
        skip("no `openssl` here, which makes certificates: install it");
    }
    made.then(|| place.path("keys"))
}
