//! `beadline bench`: this machine's figures, each beside its limit.

use crate::args::BenchArgs;
use crate::bench::{Bench, GROUPS, Group, PEERS, Report};
use crate::failure::{Done, Failure};
use anyhow::anyhow;

pub(crate) fn bench(args: &BenchArgs) -> Result<Done, Failure> {
    let wanted = |group: &&Group| {
        let is_named = args.only.as_ref().is_none_or(|word| group.name.contains(word.as_str()));
        is_named && (args.peers || group.name != PEERS)
    };
    let groups: Vec<_> = GROUPS.iter().filter(wanted).collect();
    if groups.is_empty() {
        let names: Vec<_> = GROUPS.iter().map(|group| group.name).collect();
        let message = format!("--only: no such group; there are {}, the last with --peers", names.join(", "));
        return Err(Failure::BadInput(anyhow!(message)));
    }
    let bench = Bench::new(args.rounds)?;
    let mut report = Report::new(args.json);
    for group in groups {
        bench.measure(group, &mut report)?;
    }
    report.finish(args.rounds)?;
    Ok(Done::whole_if(report.is_met()))
}
