//! Records whose lengths are checked before `mcap` believes them: it reserves the length that a string claims, up to
//! 4 GiB, and panics on short attachments.

use mcap::records::{Record, op};

/// Longest record that becomes a structure in memory, such as a manifest. A chain of a million listed masses takes
/// 20 MB.
pub(crate) const MAX_STRUCTURE_BYTES: usize = 64 << 20;

/// A part of a record.
#[derive(Debug, Clone, Copy)]
enum Part {
    /// That many bytes.
    Fixed(usize),
    /// A string with its length in four bytes before it.
    Text,
    /// Pairs of strings, with the length of them all before them.
    Texts,
    /// Bytes with their length in four bytes before them.
    Bytes,
    /// Pairs of two and eight bytes, with the length of them all before them.
    Pairs,
}

/// The record, or the reason why `body` is not one.
pub(crate) fn parse_record(opcode: u8, body: &[u8]) -> Result<Record<'_>, String> {
    use Part::{Bytes, Fixed, Pairs, Text, Texts};
    let parts: &[Part] = match opcode {
        op::HEADER => &[Text, Text],
        op::SCHEMA => &[Fixed(2), Text, Text, Bytes],
        op::CHANNEL => &[Fixed(4), Text, Text, Texts],
        op::CHUNK => &[Fixed(28), Text],
        op::CHUNK_INDEX => &[Fixed(32), Pairs, Fixed(8), Text],
        op::ATTACHMENT_INDEX => &[Fixed(40), Text, Text],
        op::METADATA => &[Text, Texts],
        op::METADATA_INDEX => &[Fixed(16), Text],
        op::MESSAGE | op::ATTACHMENT => return Err(format!("one of the opcode {opcode}, out of place")),
        // numbers only, or not known
        _ => &[],
    };
    if opcode != op::CHUNK && body.len() > MAX_STRUCTURE_BYTES {
        return Err(format!("{} bytes long, more than {MAX_STRUCTURE_BYTES}", body.len()));
    }
    let mut rest = body;
    for part in parts {
        rest = after(*part, rest).ok_or("a text or a map in it is longer than the record")?;
    }
    mcap::parse_record(opcode, body).map_err(|error| error.to_string())
}

/// The bytes after the part, if it is whole.
fn after(part: Part, bytes: &[u8]) -> Option<&[u8]> {
    if let Part::Fixed(count) = part {
        return bytes.get(count..);
    }
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    let (content, rest) = rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)?;
    match part {
        // half a pair would be completed from what is behind the map, and all that follows misread
        Part::Pairs if !content.len().is_multiple_of(10) => return None,
        Part::Texts => {
            let mut content = content;
            while !content.is_empty() {
                content = after(Part::Text, after(Part::Text, content)?)?;
            }
        }
        Part::Pairs | Part::Text | Part::Bytes | Part::Fixed(_) => {}
    }
    Some(rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::records::Metadata;
    use std::io::Cursor;

    #[test]
    fn what_mcap_writes_is_read() {
        let mut writer =
            mcap::WriteOptions::new().create(Cursor::new(Vec::new())).expect("a writer into memory");
        let metadata = [("key".to_owned(), "value".to_owned())].into();
        writer.write_metadata(&Metadata { name: "name".into(), metadata }).expect("written");
        let schema = writer.add_schema("schema", "protobuf", b"descriptor").expect("written");
        writer
            .add_channel(schema, "/topic", "protobuf", &[("a".into(), "b".into())].into())
            .expect("written");
        writer.finish().expect("written");
        let bytes = writer.into_inner().into_inner();
        let (mut rest, mut opcodes) = (&bytes[mcap::MAGIC.len()..], Vec::new());
        while rest.len() > mcap::MAGIC.len() {
            let length = u64::from_le_bytes(*rest[1..].first_chunk().expect("whole"));
            let (body, after) = rest[9..].split_at(usize::try_from(length).expect("small"));
            opcodes.push(rest[0]);
            parse_record(rest[0], body).expect("what mcap wrote");
            for end in 0..body.len().min(60) {
                // no panic, no abort
                let _ = parse_record(rest[0], &body[..end]);
            }
            rest = after;
        }
        assert!(opcodes.contains(&op::METADATA_INDEX) && opcodes.contains(&op::CHANNEL), "{opcodes:?}");
    }

    #[test]
    fn a_text_is_not_believed_to_be_longer_than_its_record() {
        // mcap would reserve 4 GiB
        for (opcode, before) in [(op::HEADER, 0), (op::METADATA, 0), (op::CHANNEL, 4), (op::CHUNK, 28)] {
            let mut body = vec![0; before];
            body.extend([0xff; 4]);
            body.extend([0; 40]);
            let error = parse_record(opcode, &body).expect_err("not whole");
            assert!(error.contains("longer than"), "{error}");
        }
    }

    #[test]
    fn a_pair_that_its_map_cuts_off_is_not_completed_from_behind() {
        let metadata = [&[0; 4][..], &[5, 0, 0, 0, 1, 0, 0, 0, b'k'], &[0xff; 8]].concat();
        let chunk_index = [&[0; 32][..], &[4, 0, 0, 0], &[0; 12], &[0; 4], &[0xff; 24]].concat();
        for (opcode, body) in [(op::METADATA, metadata), (op::CHUNK_INDEX, chunk_index)] {
            let error = parse_record(opcode, &body).expect_err("not whole");
            assert!(error.contains("longer than"), "{error}");
        }
    }
}
