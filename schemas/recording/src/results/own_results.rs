//! Rows of somebody else's topics, as messages that describe themselves.

use crate::results::columns::{FIRST_COLUMN, described, encode_numbers, field, head};
use crate::results::kind::{ResultRow, RowValues};
use prost::encoding::{double, uint64};
use prost_types::field_descriptor_proto::{Label, Type};
use schemas::results::{OwnTopic, ResultColumns};

const PACKAGE: &str = "beadline.own";

/// The rows of somebody else's topic.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnResults {
    /// With a slash in front, as in a file.
    topic: String,
    /// Name of the message, without its package.
    message: String,
    /// One for each value of a row, or one for all of them.
    fields: Vec<String>,
    width: usize,
}

impl OwnResults {
    /// Rows of `columns`.
    pub(crate) fn new(topic: OwnTopic, columns: &ResultColumns) -> Result<Self, String> {
        let fields = columns.fields()?.into_iter().map(str::to_owned).collect();
        let name = topic.name().replace('-', "_");
        let begins_with_letter = name.starts_with(|first: char| first.is_ascii_alphabetic());
        let message = if begins_with_letter { name } else { format!("_{name}") };
        Ok(Self { topic: format!("/{}", topic.as_str()), message, fields, width: columns.width })
    }

    /// Topic of the channel.
    pub(crate) fn topic(&self) -> &str {
        &self.topic
    }

    /// Full name of the message.
    pub(crate) fn message(&self) -> String {
        format!("{PACKAGE}.{}", self.message)
    }

    /// One name for all values of a row.
    fn is_array(&self) -> bool {
        self.fields.len() != self.width
    }

    /// Self-contained `FileDescriptorSet` of the message.
    pub(crate) fn descriptor(&self) -> Vec<u8> {
        let label = if self.is_array() { Label::Repeated } else { Label::Optional };
        let mut fields = head();
        let columns = (FIRST_COLUMN..).zip(&self.fields);
        fields.extend(columns.map(|(number, name)| field(number, name, Type::Double, label)));
        let file = format!("beadline/own/{}.proto", self.message);
        described(file, PACKAGE, &self.message, fields, Vec::new())
    }

    /// Encodes `row` into `message`, which is empty. No zero is left out, so that −0 keeps its sign.
    pub(crate) fn encode(&self, row: &ResultRow<'_>, message: &mut Vec<u8>) -> Result<(), String> {
        let RowValues::Numbers(values) = row.values else {
            return Err("its values are of another type".to_owned());
        };
        if values.len() != self.width {
            return Err(format!("it has {} values, not {}", values.len(), self.width));
        }
        uint64::encode(1, &row.frame, message);
        uint64::encode(2, &row.step, message);
        double::encode(3, &row.time_s, message);
        if self.is_array() {
            double::encode_packed(FIRST_COLUMN, values, message);
        } else {
            encode_numbers(values, message);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message as _;
    use prost_types::FileDescriptorSet;

    fn results(columns: &ResultColumns) -> OwnResults {
        OwnResults::new("2d-map".parse().expect("a name"), columns).expect("columns")
    }

    #[test]
    fn the_descriptor_names_the_columns() {
        let own = results(&ResultColumns::named(&["momentum_n_s", "front_bead"]));
        assert_eq!((own.topic(), &*own.message()), ("/own/2d-map", "beadline.own._2d_map"));
        let set = FileDescriptorSet::decode(&*own.descriptor()).expect("a descriptor");
        let message = &set.file[0].message_type[0];
        let fields: Vec<_> = message.field.iter().map(|field| (field.number(), field.name())).collect();
        assert_eq!(
            fields,
            [(1, "frame"), (2, "step"), (3, "time_s"), (4, "momentum_n_s"), (5, "front_bead")]
        );
        assert!(message.field.iter().all(|field| field.label() == Label::Optional));

        let array = results(&ResultColumns::array("energy_j", 3));
        let set = FileDescriptorSet::decode(&*array.descriptor()).expect("a descriptor");
        let field = &set.file[0].message_type[0].field[3];
        assert_eq!((field.name(), field.label()), ("energy_j", Label::Repeated));
    }

    #[test]
    fn values_keep_their_bits() {
        let values = [-0.0, f64::NAN];
        let row = ResultRow { frame: 0, step: 300, time_s: 0.5, values: RowValues::Numbers(&values) };
        let (mut columns, mut array) = (Vec::new(), Vec::new());
        results(&ResultColumns::named(&["a_m", "b_m"])).encode(&row, &mut columns).expect("a row");
        results(&ResultColumns::array("a_m", 2)).encode(&row, &mut array).expect("a row");
        let [zero, nan] = values.map(f64::to_le_bytes);
        let head = [&[8, 0, 16, 0xac, 2, 25][..], &0.5_f64.to_le_bytes()].concat();
        assert_eq!(columns, [&head[..], &[33], &zero, &[41], &nan].concat());
        assert_eq!(array, [&head[..], &[34, 16], &zero, &nan].concat());
        let short = ResultRow { values: RowValues::Numbers(&values[..1]), ..row };
        assert!(results(&ResultColumns::array("a_m", 2)).encode(&short, &mut columns).is_err());
    }

    #[test]
    fn columns_that_are_no_fields_are_refused() {
        let refused = |columns: &ResultColumns| {
            OwnResults::new("x".parse().expect("a name"), columns).expect_err("no fields")
        };
        for names in
            [&["a b"][..], &["step"], &["2x"], &["a", "a"], &["x_m", "xM"], &["TimeS"], &[""], &["é"]]
        {
            refused(&ResultColumns::named(names));
        }
        refused(&ResultColumns::array("a", 0));
        refused(&ResultColumns { width: 3, ..ResultColumns::named(&["a", "b"]) });
        let many: Vec<_> = (0..100).map(|at| format!("c{at}")).collect();
        refused(&ResultColumns::named(&many.iter().map(String::as_str).collect::<Vec<_>>()));
    }
}
