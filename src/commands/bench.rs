//! `beadline bench`: this machine's figures, each beside its limit.

use crate::args::BenchArgs;
use crate::bench::{Bench, GROUPS, Group, PEERS, Report};
use crate::failure::{Done, Failure};
use anyhow::anyhow;

pub(crate) fn bench(args: &BenchArgs) -> Result<Done, Failure> {
    let wanted = |group: &&Group| args.only.as_ref().is_none_or(|word| group.name.contains(word.as_str()));
    let groups: Vec<_> = GROUPS.iter().filter(wanted).collect();
    if groups.is_empty() {
        let names: Vec<_> = GROUPS.iter().map(|group| group.name).collect();
        let message = format!("--only: no group has such a name; there are {}", names.join(", "));
        return Err(Failure::BadInput(anyhow!(message)));
    }
    let bench = Bench::new(args.rounds)?;
    let mut report = Report::new(args.json);
    for group in groups.into_iter().filter(|group| args.peers || group.name != PEERS) {
        bench.measure(group, &mut report)?;
    }
    report.finish(args.rounds)?;
    Ok(Done::whole_if(report.is_met()))
}
