//! Descriptors of messages of rows, made from the names of their columns, and the columns that other descriptors
//! describe.

use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet, OneofDescriptorProto,
};

/// Number of the first field after those that begin every row.
pub(crate) const FIRST_COLUMN: u32 = 4;

const HEAD: [(&str, Type); 3] = [("frame", Type::Uint64), ("step", Type::Uint64), ("time_s", Type::Double)];

/// A message of rows.
pub(crate) struct Described<'a> {
    /// Package of its file.
    pub(crate) package: &'a str,
    pub(crate) message: &'a str,
    /// Name of the file with its directory.
    pub(crate) file: String,
    /// Name of the array with the numbers of the things, for arrays about things.
    pub(crate) number: Option<&'a str>,
    pub(crate) columns: Vec<&'a str>,
    /// True if each column is an array.
    pub(crate) are_arrays: bool,
}

impl Described<'_> {
    /// Self-contained `FileDescriptorSet`. For a message of ours it equals the compiled `.proto` file, byte for byte.
    pub(crate) fn encode(&self, is_ours: bool) -> Vec<u8> {
        let label = if self.are_arrays { Label::Repeated } else { Label::Optional };
        let mut fields = head();
        fields.extend(self.number.map(|name| field(FIRST_COLUMN, name, Type::Uint64, Label::Repeated)));
        let mut present = Vec::new();
        let first = FIRST_COLUMN + u32::from(self.number.is_some());
        for (number, name) in (first..).zip(&self.columns) {
            let mut column = field(number, name, Type::Double, label);
            if is_ours && !self.are_arrays {
                column.oneof_index = i32::try_from(present.len()).ok();
                column.proto3_optional = Some(true);
                present.push(OneofDescriptorProto { name: Some(format!("_{name}")), options: None });
            }
            fields.push(column);
        }
        if is_ours {
            for field in &mut fields {
                field.json_name = Some(json_name(field.name()));
            }
        }
        let name = Some(self.message.to_owned());
        let message =
            DescriptorProto { name, field: fields, oneof_decl: present, ..DescriptorProto::default() };
        let file = FileDescriptorProto {
            name: Some(self.file.clone()),
            package: Some(self.package.to_owned()),
            message_type: vec![message],
            syntax: Some("proto3".to_owned()),
            ..FileDescriptorProto::default()
        };
        FileDescriptorSet { file: vec![file] }.encode_to_vec()
    }
}

/// Names of the columns of the rows that `descriptor` describes as `message`, and true if it is one array; none if the
/// rows are no plain numbers.
pub(crate) fn columns_of(descriptor: &[u8], message: &str) -> Option<(Vec<String>, bool)> {
    let set = FileDescriptorSet::decode(descriptor).ok()?;
    let messages = set.file.into_iter().flat_map(|file| file.message_type);
    let fields = messages.into_iter().find(|found| found.name() == message)?.field;
    let columns = fields.get(HEAD.len()..)?;
    let is_array = columns.len() == 1 && columns[0].label() == Label::Repeated;
    let is_column = |(number, field): (u32, &FieldDescriptorProto)| {
        let label = if is_array { Label::Repeated } else { Label::Optional };
        i32::try_from(number) == Ok(field.number())
            && field.r#type() == Type::Double
            && field.label() == label
    };
    let are_plain = !columns.is_empty() && (FIRST_COLUMN..).zip(columns).all(is_column);
    are_plain.then(|| (columns.iter().map(|field| field.name().to_owned()).collect(), is_array))
}

/// The fields that begin every row.
fn head() -> Vec<FieldDescriptorProto> {
    (1..).zip(HEAD).map(|(number, (name, kind))| field(number, name, kind, Label::Optional)).collect()
}

fn field(number: u32, name: &str, kind: Type, label: Label) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: i32::try_from(number).ok(),
        label: Some(label.into()),
        r#type: Some(kind.into()),
        ..FieldDescriptorProto::default()
    }
}

/// JSON name of a field, as protobuf derives it: a letter after `_` is a capital one.
fn json_name(name: &str) -> String {
    let mut words = name.split('_');
    let first = words.next().unwrap_or_default().to_owned();
    words.fold(first, |name, word| {
        let (letter, rest) = word.split_at(word.len().min(1)); // integers
        name + &letter.to_ascii_uppercase() + rest
    })
}
