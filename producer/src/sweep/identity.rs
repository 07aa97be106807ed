//! Identity of a sweep's rows, and the points that are checked before the first is computed.

use super::definition::{Axis, Definition};
use super::{Sweep, index_of};
use schemas::config::{ConfigError, DRAWS, RunConfig};
use schemas::manifest::KERNEL_VERSION;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;

/// Most points that are checked before the first is computed.
pub const MOST_CHECKED: u64 = 10_000;

/// Number of checked points that lie evenly among all, if there are more points than [`MOST_CHECKED`].
const SPREAD: u64 = 1000;

impl Sweep {
    /// Makes every point that is to be checked once, and returns the identity of the sweep.
    pub(super) fn check_points(&self) -> Result<[u8; 32], ConfigError> {
        let Definition { base, cases, samples, axes, .. } = &self.definition;
        let mut hash = Sha256::new();
        let mut base = base.clone();
        base.remove("name");
        base.remove("provenance");
        hash.update(format!("kernel {KERNEL_VERSION}\n{base}\n"));
        hash.update(format!("{:?} {:?} {:?}\n", self.parameters, self.until(), self.split_bead()));
        if self.check() {
            hash.update("check\n");
        }
        if !self.measure().is_empty() {
            hash.update(format!("measure {:?}\n", self.measure()));
        }
        if self.measure_from_s() > 0.0 {
            hash.update(format!("measure from {}\n", self.measure_from_s()));
        }
        if !self.series().measure.is_empty() {
            hash.update(format!("series {}\n", self.series().meaning()));
        }
        for case in cases {
            let settings: Vec<_> = case.iter().map(|set| format!("{} = {}", set.key, set.value)).collect();
            hash.update(format!("case {}\n", settings.join(", ")));
        }
        hash.update(format!("sample {}\n", samples.meaning()));
        for axis in axes {
            hash.update(format!("{}\n", axis.meaning()));
        }
        // a reference without disorder may stand among points that have some
        let seed = self.settings(0)?.into_iter().find(|setting| setting.key.to_string() == "seed");
        let mut draws = seed.is_none();
        for index in self.checked_points() {
            let point = self.point(index)?;
            draws = draws || RunConfig::from_table(&self.document(&self.settings(index)?)?)?.draws();
            hash.update(format!("{index} {}\n", point.config.stream.publish_every_steps));
            hash.update(point.physics.hash());
        }
        match seed.filter(|_| !draws) {
            None => Ok(hash.finalize().into()),
            Some(seed) => Err(ConfigError {
                path: Some(self.path.clone()),
                line: Some(seed.line),
                ..ConfigError::value("seed", seed.value, DRAWS)
            }),
        }
    }

    /// All points, if they are few. Else some that lie evenly among them, the first of each case, and those with each
    /// value of a list or at the ends of a range and the first value of all else.
    fn checked_points(&self) -> BTreeSet<u64> {
        let count = self.point_count();
        if count <= MOST_CHECKED {
            return (0..count).collect();
        }
        let Definition { cases, samples, axes, .. } = &self.definition;
        let spread = (0..SPREAD).map(|i| i * (count - 1) / (SPREAD - 1));
        let stride = |after: &[Axis]| after.iter().map(Axis::count).product::<u64>(); // integers
        let of_cases = (0..cases.len() as u64).map(|case| case * samples.count() * stride(axes));
        let of_grid = (0..axes.len())
            .flat_map(|place| axes[place].telling().map(move |value| value * stride(&axes[place + 1..])));
        spread.chain(of_cases).chain(of_grid).take(index_of(MOST_CHECKED)).collect()
    }
}
