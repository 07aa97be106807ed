//! `beadline bench`: this machine's figures, each beside its limit.

mod report;

use crate::args::{BenchArgs, PartArgs};
use crate::display;
use crate::failure::{Done, Failure};
use anyhow::{Error, anyhow};
use bench::{Bench, GROUPS, Group, part};
use report::Report;

pub(crate) fn bench(args: &BenchArgs) -> Result<Done, Failure> {
    let wanted = |group: &&Group| args.only.as_ref().is_none_or(|word| group.name.contains(word.as_str()));
    let groups: Vec<_> = GROUPS.iter().filter(wanted).collect();
    if groups.is_empty() {
        let names: Vec<_> = GROUPS.iter().map(|group| group.name).collect();
        let message = format!("--only: no group has such a name; there are {}", names.join(", "));
        return Err(Failure::BadInput(anyhow!(message)));
    }
    let bench = Bench::new(args.rounds)?;
    let mut report = Report::new(args.json, args.rounds);
    for group in groups {
        bench.measure(group, &mut report)?;
    }
    report.finish()?;
    Ok(Done::whole_if(report.is_met()))
}

/// One of the bench's other processes.
pub(crate) fn part(args: &PartArgs) -> Result<Done, Failure> {
    let mut say = |line: &str| -> Result<(), Error> { display::print(format_args!("{line}\n")) };
    match args {
        PartArgs::Sum { name, count } => part::sum_slices(name, *count, &mut say)?,
        PartArgs::Listen { name } => part::listen(name, &mut say)?,
        PartArgs::Receive { name } => part::receive(name, &mut say)?,
    }
    Ok(Done::Whole)
}
