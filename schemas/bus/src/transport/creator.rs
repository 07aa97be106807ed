//! Finds the creator of a file of the bus by the numbers in the file's name.

use rustix::time::{ClockId, clock_gettime};
use std::collections::HashMap;
use std::path::Path;

/// Ticks a second in `/proc/*/stat`, on every Linux.
const TICKS_PER_S: u64 = 100;
/// Fewest digits of an id: its process number is not 0, and stands above the 64 low bits.
const LEAST_DIGITS: usize = 20;

/// The id of a node, a port or a service: seconds and nanoseconds of the monotonic clock, process and counter,
/// 32 bits each from the lowest on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Id(pub(super) u128);

impl Id {
    /// Ids in the name of a file: the numbers between `_` at the end of the part before the first `.`.
    pub(super) fn all_in(name: &str) -> Vec<Self> {
        let stem = name.split('.').next().unwrap_or_default();
        let number = |part: &str| {
            let is_id = part.len() >= LEAST_DIGITS && part.bytes().all(|byte| byte.is_ascii_digit());
            is_id.then(|| part.parse().ok()).flatten().map(Self)
        };
        // a connection has those of both of its ends; before them stands a hash of 40 digits
        stem.rsplit('_').map_while(number).take(2).collect()
    }

    #[expect(clippy::cast_possible_truncation, reason = "32 bits of 128")]
    fn process(self) -> u32 {
        (self.0 >> 64) as u32
    }

    #[expect(clippy::cast_possible_truncation, reason = "32 bits of 128")]
    fn made_at_s(self) -> u64 {
        u64::from(self.0 as u32)
    }

    /// True if the process that made this id lives; also true in doubt.
    pub(super) fn creator_lives(self) -> bool {
        Processes::default().has_creator_of(self)
    }
}

/// Processes looked up so far, each with the time at which it began (s of the monotonic clock); none if it is dead.
#[derive(Default)]
pub(super) struct Processes(HashMap<u32, Option<u64>>);

impl Processes {
    /// As [`Id::creator_lives`], but looks at each process only once.
    pub(super) fn has_creator_of(&mut self, id: Id) -> bool {
        let began_at_s = *self.0.entry(id.process()).or_insert_with(|| {
            match std::fs::read_to_string(format!("/proc/{}/stat", id.process())) {
                Ok(stat) => began_at_s(&stat),
                // without /proc nobody is known to be dead
                Err(_) => (!Path::new("/proc/self/stat").exists()).then_some(0),
            }
        });
        // a later process may have the same number
        began_at_s.is_some_and(|at| at <= id.made_at_s() + 1)
    }
}

/// Time at which the process of `/proc/PID/stat` began (s of the monotonic clock); none if it is dead and not yet buried.
fn began_at_s(stat: &str) -> Option<u64> {
    let mut fields = stat.rsplit(')').next()?.split_ascii_whitespace();
    if matches!(fields.next()?, "Z" | "X") {
        return None;
    }
    let ticks: u64 = fields.nth(18)?.parse().ok()?;
    // that clock also counts the time that the machine slept
    let slept = clock_gettime(ClockId::Boottime).tv_sec - clock_gettime(ClockId::Monotonic).tv_sec;
    Some((ticks / TICKS_PER_S).saturating_sub(u64::try_from(slept).unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id_of(process: u32, made_at_s: i64) -> Id {
        Id((u128::from(process) << 64) | u128::from(u32::try_from(made_at_s).expect("a few seconds")))
    }

    #[test]
    fn ids_stand_at_the_end_of_names() {
        let hash = "1124370000000000000000000000000000000000";
        let ids = |name: &str| Id::all_in(name).into_iter().map(|id| id.0).collect::<Vec<_>>();
        let (one, two) = ("158456872771393743968331105368", "79228710257098616931063170136");
        let (first, second): (u128, u128) = (one.parse().expect("u128"), two.parse().expect("u128"));
        assert_eq!(ids(&format!("blx_{hash}_{one}.dynamic")), [first]);
        assert_eq!(ids(&format!("blx_{hash}_{two}_{one}.connection")), [first, second]);
        assert_eq!(ids(&format!("blx_{hash}_node.0_10_0.global_mgmt")), [] as [u128; 0]);
        assert_eq!(Id(first).process(), 29_693);
    }

    #[test]
    fn a_process_lives_until_it_ends_and_its_number_is_not_its_successors() {
        let now = clock_gettime(ClockId::Monotonic).tv_sec;
        let (own, long_ago) = (std::process::id(), 0);
        assert!(id_of(own, now).creator_lives());
        let mut child = std::process::Command::new("sleep").arg("60").spawn().expect("started");
        let id = id_of(child.id(), now + 1);
        assert!(id.creator_lives());
        assert!(!id_of(child.id(), long_ago).creator_lives() || now < 5, "made before the process began");
        child.kill().expect("killed");
        while id.creator_lives() {
            std::thread::yield_now();
        }
        child.wait().expect("buried");
        assert!(!id.creator_lives());
    }
}
