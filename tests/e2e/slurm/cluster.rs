//! A Slurm of two nodes: its daemons in process namespaces of their own, its files in the directory of a test.

use crate::harness::{Ended, Place, Running, skip, wait_until};
use std::fs::{self, File};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// The first process of a namespace takes all others with it, also when the test is killed; so a node can die like a machine.
const MACHINE: &str = "setpriv --pdeathsig KILL unshare --pid --fork --kill-child=KILL --mount-proc";

/// Without authentication, without accounting; a node is missed after 5 s, and a task begins again 6 s after it ended.
const CONFIGURATION: &str = "\
ClusterName=test
SlurmctldHost=localhost
SlurmctldPort=PORT_0
AuthType=auth/none
AuthInfo=cred_expire=5
CredType=cred/none
SlurmUser=root
SlurmdUser=root
StateSaveLocation=PLACE/state
SlurmdSpoolDir=PLACE/spool-%n
SlurmctldPidFile=PLACE/slurmctld.pid
SlurmdPidFile=PLACE/slurmd-%n.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
SchedulerParameters=batch_sched_delay=0,sched_interval=1,sched_min_interval=1
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
ReturnToService=2
SlurmdTimeout=5
NodeName=one NodeHostname=localhost NodeAddr=127.0.0.1 Port=PORT_1 CPUs=2 RealMemory=1000
NodeName=two NodeHostname=localhost NodeAddr=127.0.0.1 Port=PORT_2 CPUs=2 RealMemory=1000
PartitionName=all Nodes=one,two Default=YES PriorityTier=1
PartitionName=urgent Nodes=one,two PriorityTier=2
";

pub(super) struct Cluster<'a> {
    place: &'a Place,
    configuration: PathBuf,
    controller: Child,
    nodes: Vec<(&'static str, Child)>,
}

impl<'a> Cluster<'a> {
    /// None where Slurm cannot run, and that is said.
    pub(super) fn start(place: &'a Place) -> Option<Self> {
        let mut machine = Command::new("setpriv");
        machine.args(MACHINE.split(' ').skip(1)).arg("true").stderr(Stdio::null());
        if !machine.status().is_ok_and(|status| status.success()) {
            skip("no process namespaces here, which need root: Slurm is not tried");
            return None;
        }
        if !["/usr/sbin/slurmctld", "/usr/sbin/slurmd"].iter().all(|daemon| Path::new(daemon).exists()) {
            skip("no Slurm here: job arrays are not tried (see tests/setup)");
            return None;
        }
        let home = place.path("slurm");
        fs::create_dir_all(home.join("state")).unwrap();
        let mut text = CONFIGURATION.replace("PLACE", home.to_str().unwrap());
        // all are held until all are known, so that they differ
        let free = [(); 3].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
        for (number, listener) in free.iter().enumerate() {
            let port = listener.local_addr().unwrap().port().to_string();
            text = text.replace(&format!("PORT_{number}"), &port);
        }
        drop(free);
        let configuration = place.write("slurm/slurm.conf", &text);
        let controller = daemon(&configuration, "slurmctld");
        let mut cluster = Self { place, configuration, controller, nodes: Vec::new() };
        for node in ["one", "two"] {
            cluster.start_node(node);
        }
        Some(cluster)
    }

    pub(super) fn start_node(&mut self, name: &'static str) {
        self.nodes.push((name, daemon(&self.configuration, &format!("slurmd -N {name}"))));
        wait_until(&format!("node {name}"), || (self.node_state(name) == "idle").then_some(()));
    }

    /// Ends all processes of a node, as if its power had failed.
    pub(super) fn kill_node(&mut self, name: &str) {
        let at = self.nodes.iter().position(|(node, _)| *node == name).unwrap();
        end(&mut self.nodes.swap_remove(at).1);
    }

    /// `idle`, `down` and others, with marks behind them.
    pub(super) fn node_state(&self, name: &str) -> String {
        let said = self.ask(&format!("sinfo --noheader --Node --partition=all --nodes={name} --format=%T"));
        String::from_utf8_lossy(&said.stdout).trim().to_owned()
    }

    /// A job that takes a whole node at once, and leaves it.
    pub(super) fn run_urgent_job(&self) {
        let words = "sbatch --wait --partition=urgent --exclusive --nodes=1 --output=/dev/null --wrap=true";
        assert!(self.ask(words).status.success());
    }

    pub(super) fn wait_for_empty_queue(&self) {
        wait_until("an empty queue", || self.ask("squeue --noheader").stdout.is_empty().then_some(()));
    }

    /// Again and again: a task may just be asking to be requeued.
    pub(super) fn cancel_all(&self) {
        wait_until("an empty queue", || {
            assert!(self.ask("scancel --user=root").status.success());
            self.ask("squeue --noheader").stdout.is_empty().then_some(())
        });
    }

    /// `beadline` on this cluster.
    pub(super) fn beadline(&self, words: &str) -> Ended {
        let mut command = self.place.command(words.split_whitespace());
        Running::start(words, {
            command.env("SLURM_CONF", &self.configuration);
            command
        })
        .wait()
    }

    fn ask(&self, words: &str) -> Output {
        let mut words = words.split(' ');
        let mut command = self.place.foreign(words.next().unwrap(), words);
        command.env("SLURM_CONF", &self.configuration).output().unwrap()
    }
}

impl Drop for Cluster<'_> {
    #[expect(clippy::print_stdout, reason = "what a test that fails shows")]
    fn drop(&mut self) {
        let daemons = self.nodes.iter_mut().map(|(_, daemon)| daemon);
        daemons.chain([&mut self.controller]).for_each(end);
        if std::thread::panicking() {
            for daemon in ["slurmctld", "slurmd -N one", "slurmd -N two"] {
                let log = fs::read_to_string(log_of(&self.configuration, daemon)).unwrap_or_default();
                println!("== {daemon}\n{log}");
            }
        }
    }
}

fn log_of(configuration: &Path, words: &str) -> PathBuf {
    configuration.with_file_name(format!("{words}.log"))
}

fn daemon(configuration: &Path, words: &str) -> Child {
    let log = File::options().create(true).append(true).open(log_of(configuration, words)).unwrap();
    let mut command = Command::new("setpriv");
    command
        .args(MACHINE.split(' ').skip(1))
        .args(words.split(' '))
        .arg("-D")
        .env("SLURM_CONF", configuration);
    command.stdin(Stdio::null()).stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap()
}

fn end(machine: &mut Child) {
    let _ = machine.kill();
    let _ = machine.wait();
}
