//! Common Data Representation, as ROS 2 has it: little-endian, each number aligned to its own size.

/// Four bytes that say which representation follows; alignment counts from their end.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// A message, field after field in the order of its definition. Keeps its buffer from message to message.
#[derive(Debug, Default)]
pub(super) struct Cdr {
    bytes: Vec<u8>,
}

impl Cdr {
    /// Begins a new message.
    pub(super) fn begin(&mut self) -> &mut Self {
        self.bytes.clear();
        self.bytes.extend(ENCAPSULATION);
        self
    }

    /// The message so far.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn align(&mut self, to: usize) {
        let length = self.bytes.len() - ENCAPSULATION.len();
        self.bytes.resize(ENCAPSULATION.len() + length.next_multiple_of(to), 0);
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) -> &mut Self {
        self.align(N);
        self.bytes.extend(bytes);
        self
    }

    pub(super) fn u32(&mut self, value: u32) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    pub(super) fn i32(&mut self, value: i32) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    pub(super) fn u64(&mut self, value: u64) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    pub(super) fn i64(&mut self, value: i64) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    pub(super) fn f64(&mut self, value: f64) -> &mut Self {
        self.put(value.to_le_bytes())
    }

    fn length(&mut self, length: usize) -> &mut Self {
        // no array of ours comes near 2^32 values
        self.u32(u32::try_from(length).unwrap_or(u32::MAX))
    }

    /// A string, with the zero byte at its end that counts.
    pub(super) fn string(&mut self, text: &str) -> &mut Self {
        self.length(text.len() + 1);
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
        self
    }

    /// A sequence of doubles.
    pub(super) fn f64s(&mut self, values: impl ExactSizeIterator<Item = f64>) -> &mut Self {
        self.sequence(values.map(f64::to_le_bytes))
    }

    /// A sequence of numbers.
    pub(super) fn u64s(&mut self, values: impl ExactSizeIterator<Item = u64>) -> &mut Self {
        self.sequence(values.map(u64::to_le_bytes))
    }

    /// An empty one is its length alone, without padding.
    fn sequence(&mut self, values: impl ExactSizeIterator<Item = [u8; 8]>) -> &mut Self {
        self.length(values.len());
        if values.len() > 0 {
            self.align(8);
        }
        self.bytes.extend(values.flatten());
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Worked out by hand from the rules: alignment from the end of the encapsulation.
    #[test]
    fn numbers_are_aligned_to_their_size() {
        let mut cdr = Cdr::default();
        cdr.begin().string("ab").u32(7).f64(1.0).f64s([].into_iter()).u64s([2].into_iter());
        let expected = [
            &[0, 1, 0, 0][..],
            &[3, 0, 0, 0, b'a', b'b', 0],
            &[0], // to a multiple of 4
            &[7, 0, 0, 0],
            &[0; 4], // to a multiple of 8
            &1.0_f64.to_le_bytes(),
            &[0; 4],
            &[1, 0, 0, 0],
            &2_u64.to_le_bytes(),
        ];
        assert_eq!(cdr.bytes(), expected.concat());
        assert_eq!(cdr.begin().bytes(), [0, 1, 0, 0]);
    }
}
