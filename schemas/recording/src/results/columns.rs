//! Rows of columns as messages, described, encoded and read by the names of their columns alone.

use prost::encoding::{DecodeContext, decode_key, double, skip_field, uint64};
use prost::{DecodeError, Message as _};
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet, OneofDescriptorProto,
};
use schemas::results::{ENERGIES, MOTION_FIELDS, PULSE};

/// Number of the first field after those of [`RowHead`].
pub(crate) const FIRST_COLUMN: u32 = 4;

/// The fields that begin every row of results.
#[derive(Clone, Copy, PartialEq, prost::Message)]
pub(crate) struct RowHead {
    #[prost(uint64, tag = "1")]
    pub(crate) frame: u64,
    #[prost(uint64, tag = "2")]
    pub(crate) step: u64,
    #[prost(double, tag = "3")]
    pub(crate) time_s: f64,
}

const HEAD: [(&str, Type); 3] = [("frame", Type::Uint64), ("step", Type::Uint64), ("time_s", Type::Double)];

/// The frame of a row, its whole numbers, and the values of each column.
type DecodedRow = (u64, Vec<u64>, Vec<Vec<f64>>);

/// The columns of one of our messages, which begin with [`RowHead`].
#[derive(Debug)]
pub(crate) struct Columns {
    /// Of its `.proto` file, without the directory.
    file: &'static str,
    message: &'static str,
    /// What an array of whole numbers says of each entry of the others; without it each column is a number.
    numbers: Option<&'static str>,
    names: &'static [&'static str],
}

pub(crate) static ENERGY_COLUMNS: Columns =
    Columns { file: "energies", message: "Energies", numbers: None, names: &ENERGIES };

pub(crate) static MOTION_COLUMNS: Columns = Columns {
    file: "impurity_motion",
    message: "ImpurityMotion",
    numbers: Some("bead"),
    names: &MOTION_FIELDS,
};

pub(crate) static PULSE_COLUMNS: Columns =
    Columns { file: "pulses", message: "Pulses", numbers: Some(PULSE[0]), names: PULSE.split_at(1).1 };

impl Columns {
    /// What the compiled `.proto` file is, byte for byte.
    pub(crate) fn descriptor(&self) -> Vec<u8> {
        let mut fields = head();
        fields.extend(self.numbers.map(|name| field(FIRST_COLUMN, name, Type::Uint64, Label::Repeated)));
        let label = if self.numbers.is_some() { Label::Repeated } else { Label::Optional };
        let mut present = Vec::new();
        for (number, name) in (self.first()..).zip(self.names) {
            let mut column = field(number, name, Type::Double, label);
            if self.numbers.is_none() {
                column.oneof_index = i32::try_from(present.len()).ok();
                column.proto3_optional = Some(true);
                present.push(OneofDescriptorProto { name: Some(format!("_{name}")), options: None });
            }
            fields.push(column);
        }
        for field in &mut fields {
            field.json_name = Some(json_name(field.name()));
        }
        let file = format!("beadline/v1/{}.proto", self.file);
        described(file, "beadline.v1", self.message, fields, present)
    }

    /// Number of the first field with a column.
    fn first(&self) -> u32 {
        FIRST_COLUMN + u32::from(self.numbers.is_some())
    }

    /// Encodes the `rows` of columns about `numbers`, as arrays without those that are empty.
    pub(crate) fn encode_arrays<const N: usize>(
        &self,
        numbers: &[u64],
        rows: &[[f64; N]],
        message: &mut Vec<u8>,
    ) {
        uint64::encode_packed(FIRST_COLUMN, numbers, message);
        // whatever stands before the columns in a row is in the numbers
        for (number, column) in (self.first()..).zip(N - self.names.len()..N) {
            let values: Vec<_> = rows.iter().map(|row| row[column]).collect();
            double::encode_packed(number, &values, message);
        }
    }

    /// A row in any valid encoding.
    pub(crate) fn decode(&self, mut message: &[u8]) -> Result<DecodedRow, DecodeError> {
        let (mut head, mut numbers) = (RowHead::default(), Vec::new());
        let mut columns = vec![Vec::new(); self.names.len()];
        while !message.is_empty() {
            let (tag, wire_type) = decode_key(&mut message)?;
            let (buf, context) = (&mut message, DecodeContext::default());
            let at = tag.checked_sub(self.first()).and_then(|at| usize::try_from(at).ok());
            let (name, merged) = match (tag, at.and_then(|at| self.names.get(at).zip(columns.get_mut(at)))) {
                (1, _) => (HEAD[0].0, uint64::merge(wire_type, &mut head.frame, buf, context)),
                (2, _) => (HEAD[1].0, uint64::merge(wire_type, &mut head.step, buf, context)),
                (3, _) => (HEAD[2].0, double::merge(wire_type, &mut head.time_s, buf, context)),
                (_, Some((name, column))) if self.numbers.is_none() => {
                    column.resize(1, 0.0);
                    (*name, double::merge(wire_type, &mut column[0], buf, context))
                }
                (_, Some((name, column))) => (*name, double::merge_repeated(wire_type, column, buf, context)),
                (FIRST_COLUMN, None) => {
                    let name = self.numbers.unwrap_or_default();
                    (name, uint64::merge_repeated(wire_type, &mut numbers, buf, context))
                }
                _ => ("", skip_field(wire_type, tag, buf, context)),
            };
            merged.map_err(|mut error| {
                if !name.is_empty() {
                    error.push(self.message, name);
                }
                error
            })?;
        }
        Ok((head.frame, numbers, columns))
    }
}

/// Encodes numbers as one field each. No zero is left out, so that −0 keeps its sign.
pub(crate) fn encode_numbers(values: &[f64], message: &mut Vec<u8>) {
    (FIRST_COLUMN..).zip(values).for_each(|(number, value)| double::encode(number, value, message));
}

/// The fields that begin every row.
pub(crate) fn head() -> Vec<FieldDescriptorProto> {
    (1..).zip(HEAD).map(|(number, (name, kind))| field(number, name, kind, Label::Optional)).collect()
}

pub(crate) fn field(number: u32, name: &str, kind: Type, label: Label) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: i32::try_from(number).ok(),
        label: Some(label.into()),
        r#type: Some(kind.into()),
        ..FieldDescriptorProto::default()
    }
}

/// Self-contained `FileDescriptorSet` of the message `name`; `present` are the fields that may be absent.
pub(crate) fn described(
    file: String,
    package: &str,
    name: &str,
    field: Vec<FieldDescriptorProto>,
    present: Vec<OneofDescriptorProto>,
) -> Vec<u8> {
    let name = Some(name.to_owned());
    let message = DescriptorProto { name, field, oneof_decl: present, ..DescriptorProto::default() };
    let file = FileDescriptorProto {
        name: Some(file),
        package: Some(package.to_owned()),
        message_type: vec![message],
        syntax: Some("proto3".to_owned()),
        ..FileDescriptorProto::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

/// As protobuf derives it: a letter after `_` is a capital one.
fn json_name(name: &str) -> String {
    let mut words = name.split('_');
    let first = words.next().unwrap_or_default().to_owned();
    words.fold(first, |name, word| {
        let (letter, rest) = word.split_at(word.len().min(1)); // integers
        name + &letter.to_ascii_uppercase() + rest
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `proto/` has what others compile.
    #[test]
    fn the_messages_are_those_of_the_published_files() {
        let published: [(&Columns, &[u8]); 3] = [
            (&ENERGY_COLUMNS, include_bytes!(concat!(env!("OUT_DIR"), "/energies.binpb"))),
            (&MOTION_COLUMNS, include_bytes!(concat!(env!("OUT_DIR"), "/impurity_motion.binpb"))),
            (&PULSE_COLUMNS, include_bytes!(concat!(env!("OUT_DIR"), "/pulses.binpb"))),
        ];
        for (columns, compiled) in published {
            let (made, compiled) = (columns.descriptor(), compiled.to_vec());
            let said = |bytes: &[u8]| FileDescriptorSet::decode(bytes).expect("a descriptor set");
            assert_eq!(said(&made), said(&compiled));
            assert_eq!(made, compiled);
        }
    }
}
