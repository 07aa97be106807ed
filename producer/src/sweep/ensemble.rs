//! Points that differ in one key alone, such as the seed: groups for statistics.

use super::Sweep;
use super::definition::{Axis, Definition, Over};

/// Groups of the points of a sweep: points of a group have the same value of every key but one.
///
/// Group `g` has the points whose index is `g` when that key is left out of the counting; groups are in the order of
/// their first points.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ensemble {
    /// The key that is left out, or `sample` for all that `[sample]` sets.
    pub over: String,
    /// Places in [`Sweep::parameters`] of the parameters that all points of a group share.
    pub shared: Vec<usize>,
    /// Distance between the indices of points that differ only in the key, as long as the key goes through its values.
    stride: u64,
    /// Values of the key.
    members: u64,
}

impl Ensemble {
    /// The group of point `index`.
    pub fn group(&self, index: u64) -> u64 {
        index / (self.stride * self.members) * self.stride + index % self.stride
    }

    /// Number of consecutive points that fill some groups completely.
    pub fn block(&self) -> u64 {
        self.stride * self.members
    }

    /// Number of points of a group.
    pub fn member_count(&self) -> u64 {
        self.members
    }
}

impl Sweep {
    /// The groups over which statistics are made, if the sweep file asks for them or sweeps the key `seed`.
    pub fn ensemble(&self) -> Option<Ensemble> {
        let Definition { samples, axes, over, .. } = &self.definition;
        let count = |axes: &[Axis]| axes.iter().fold(1, |count, axis| count * axis.count());
        let (keys, stride, members, over): (Vec<String>, _, _, _) = match over.as_ref()? {
            Over::Sample => (samples.keys().collect(), count(axes), samples.count(), "sample".to_owned()),
            Over::Axis(place) => {
                let axis = axes.get(*place)?;
                let key = axis.key.to_string();
                (vec![key.clone()], count(&axes[place + 1..]), axis.count(), key)
            }
        };
        let shared = (0..self.parameters.len()).filter(|place| !keys.contains(&self.parameters[*place].key));
        Some(Ensemble { over, shared: shared.collect(), stride, members })
    }
}
