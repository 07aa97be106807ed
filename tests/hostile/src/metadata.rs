//! Metadata records as texts.

use crate::records::take_string;

/// A metadata record: its name, and keys with their values, in the order of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Metadata {
    /// Such as `beadline.run`.
    pub name: String,
    /// Keys and values.
    pub entries: Vec<(String, String)>,
}

impl Metadata {
    /// Reads the contents of a record.
    pub fn read(body: &[u8]) -> Option<Self> {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let (name, entries) = take_string(body)?;
        let (mut rest, _) = take_string(entries)?;
        let mut entries = Vec::new();
        while let Some((key, after)) = take_string(rest) {
            let (value, after) = take_string(after)?;
            entries.push((text(key), text(value)));
            rest = after;
        }
        Some(Self { name: text(name), entries })
    }

    /// The value of a key.
    pub fn value(&mut self, key: &str) -> Option<&mut String> {
        self.entries.iter_mut().find(|(found, _)| found == key).map(|(_, value)| value)
    }

    /// The contents of the record.
    pub fn write(&self) -> Vec<u8> {
        let mut entries = Vec::new();
        for (key, value) in &self.entries {
            put_string(key.as_bytes(), &mut entries);
            put_string(value.as_bytes(), &mut entries);
        }
        let mut body = Vec::new();
        put_string(self.name.as_bytes(), &mut body);
        put_string(&entries, &mut body);
        body
    }
}

/// Bytes with their length before them.
pub fn put_string(text: &[u8], to: &mut Vec<u8>) {
    to.extend(u32::try_from(text.len()).unwrap_or(u32::MAX).to_le_bytes());
    to.extend(text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_is_written_again() {
        let entries = [("a", "1"), ("checksum", ""), ("physics", "{\"α\":1}")];
        let entries = entries.map(|(key, value)| (key.to_owned(), value.to_owned())).to_vec();
        let metadata = Metadata { name: "beadline.run".into(), entries };
        let body = metadata.write();
        assert_eq!(Metadata::read(&body), Some(metadata));
        assert_eq!(Metadata::read(&body[..body.len() - 1]), None);
    }
}
