//! Change of a quantity over the last time, in bounded memory.

/// The range of a quantity over the last one to two lengths of time.
///
/// Time is cut into blocks of that length from the first value on; kept are the extremes of the current
/// block and of the one before.
#[derive(Debug, Clone)]
pub(super) struct Window {
    length_s: f64,
    block: Option<Block>,
    before: Option<(f64, f64)>,
}

#[derive(Debug, Clone, Copy)]
struct Block {
    from_s: f64,
    range: (f64, f64),
}

impl Window {
    pub(super) fn new(length_s: f64) -> Self {
        Self { length_s, block: None, before: None }
    }

    /// Enters the value at `time_s` (s), later than all values before it.
    pub(super) fn push(&mut self, time_s: f64, value: f64) {
        match &mut self.block {
            Some(block) if time_s - block.from_s < self.length_s => block.range = joined(block.range, value),
            block => {
                // values more than a block back are forgotten
                self.before = block
                    .filter(|block| time_s - block.from_s < 2.0 * self.length_s)
                    .map(|block| block.range);
                *block = Some(Block { from_s: time_s, range: (value, value) });
            }
        }
    }

    /// The largest minus the smallest value, 0 if there is none.
    pub(super) fn range(&self) -> f64 {
        let Some(block) = &self.block else { return 0.0 };
        let (low, high) = match self.before {
            Some((low, high)) => joined(joined(block.range, low), high),
            None => block.range,
        };
        high - low
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        *self = Self::new(self.length_s);
    }
}

fn joined((low, high): (f64, f64), value: f64) -> (f64, f64) {
    (if value < low { value } else { low }, if value > high { value } else { high })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_remembered_for_one_to_two_lengths() {
        let mut window = Window::new(10.0);
        assert_eq!(window.range(), 0.0);
        window.push(0.0, 5.0);
        for second in 1..=19 {
            window.push(f64::from(second), 1.0);
            assert_eq!(window.range(), 4.0, "at {second} s");
        }
        window.push(20.0, 1.5);
        assert_eq!(window.range(), 0.5);
        // nothing came for long
        window.push(99.0, 7.0);
        assert_eq!(window.range(), 0.0);
        window.push(100.0, 6.0);
        window.clear();
        assert_eq!(window.range(), 0.0);
    }
}
