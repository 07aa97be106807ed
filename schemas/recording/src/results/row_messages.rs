//! Rows of results as messages, which are made from their columns.

use crate::proto::{self, ContactClasses};
use crate::read::contents::Channel;
use crate::results::contacts::{ContactsRow, check_row, unpack};
use crate::results::descriptor::{Described, FIRST_COLUMN, columns_of};
use crate::write::channel_writer::{ChannelId, ChannelWriter};
use crate::{OPEN, WriteError};
use prost::encoding::{DecodeContext, decode_key, double, skip_field, uint64};
use prost::{DecodeError, Message as _};
use schemas::manifest::RunManifest;
use schemas::results::{
    KeptValues, ResultColumns, ResultRow, ResultsName, RowValues, Things, ThingsNumbers, Topic,
};
use std::ops::RangeInclusive;

const OURS: &str = "beadline.v1";
const OWN: &str = "beadline.own";

/// Key of the threshold in the metadata of a channel.
const THRESHOLD: &str = "threshold";

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

/// Head of a row, the numbers of its things, and the values of each of its columns.
type Fields = (RowHead, Vec<u64>, Vec<Vec<f64>>);

/// Layout of the messages for the rows of one topic in a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RowMessages {
    /// The topic with a slash in front, as in a file.
    topic: String,
    is_ours: bool,
    /// Name of the message, without its package.
    message: String,
    layout: Layout,
}

#[derive(Debug, Clone, PartialEq)]
enum Layout {
    /// A field for each value.
    Columns(Vec<String>),
    /// One array of all values, with its length where that is known.
    Array(String, Option<usize>),
    /// An array for each quantity of things. The numbers are those of the things, for rows that do not carry them. The
    /// threshold decided which things there are, if it is known.
    Things(&'static Things, Option<Vec<u64>>, Option<f64>),
    /// The class of each contact.
    Classes { tolerance_m: f64 },
}

/// A row that was read back.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedRow {
    /// Its frame.
    pub frame: u64,
    /// Its step.
    pub step: u64,
    /// Its time (s).
    pub time_s: f64,
    /// The values, as on the bus, without the NaN that fill a row up.
    pub values: KeptValues,
    /// Numbers of the things that the values are about, such as beads; empty for other rows.
    pub things: Vec<u64>,
    /// The largest overlap or gap (m) that counted as touching, for rows of classes.
    pub tolerance_m: Option<f64>,
    /// The threshold that decided which things there are, such as pulses; none if the channel does not tell it.
    pub threshold: Option<f64>,
}

/// The name of the results in the channel, if its messages are rows of results: of our analyses or of somebody else's.
pub(crate) fn name_of_results(channel: &Channel) -> Option<ResultsName> {
    let name: ResultsName = channel.topic.strip_prefix('/')?.parse().ok()?;
    let (package, _) = channel.schema.name.rsplit_once('.')?;
    (package == if name.is_own() { OWN } else { OURS }).then_some(name)
}

impl RowMessages {
    /// Messages for rows of `topic` with these columns.
    ///
    /// # Errors
    /// The expected and the found layout, when a recording cannot hold such rows.
    pub fn new(topic: Topic, columns: &ResultColumns, manifest: &RunManifest) -> Result<Self, String> {
        let Topic::Results(name) = topic else { return Err("this topic has no rows of results".to_owned()) };
        let width = columns.width;
        let layout = if let Some(tolerance_m) = columns.tolerance_m {
            let contacts = manifest.all_contact_count();
            if width != contacts {
                return Err(format!("{width} classes, the run has {contacts} contacts"));
            }
            Layout::Classes { tolerance_m }
        } else if let Some(things) = Things::of_topic(name.as_str()) {
            let impurities: Vec<_> =
                manifest.physics.impurities.iter().map(|impurity| impurity.bead).collect();
            Layout::Things(things, things.numbers_of(columns, &impurities)?, columns.threshold())
        } else {
            let fields = columns.fields()?;
            match fields[..] {
                [array] if width != 1 => Layout::Array(array.to_owned(), Some(width)),
                _ => Layout::Columns(fields.into_iter().map(str::to_owned).collect()),
            }
        };
        Ok(Self::named(name, message_name(name, &layout), layout))
    }

    fn named(name: ResultsName, message: String, layout: Layout) -> Self {
        Self { topic: format!("/{}", name.as_str()), is_ours: !name.is_own(), message, layout }
    }

    /// The rows of a channel of a file; none if they cannot be read.
    pub(crate) fn of_channel(channel: &Channel) -> Option<Self> {
        let name = name_of_results(channel)?;
        let (_, message) = channel.schema.name.rsplit_once('.')?;
        let things = Things::of_topic(name.as_str()).filter(|things| things.message == message);
        let layout = if channel.schema.name == proto::CONTACTS.message {
            Layout::Classes { tolerance_m: f64::NAN }
        } else if let Some(things) = things {
            let threshold = channel.metadata.get(THRESHOLD).and_then(|text| text.parse().ok());
            Layout::Things(things, None, threshold)
        } else {
            match columns_of(&channel.schema.text, message)? {
                (columns, true) => Layout::Array(columns.concat(), None),
                (columns, false) => Layout::Columns(columns),
            }
        };
        Some(Self::named(name, message.to_owned(), layout))
    }

    /// Topic of the channel.
    pub(crate) fn topic(&self) -> &str {
        &self.topic
    }

    /// Adds the channel to `file`.
    pub(crate) fn add_to(&self, file: &mut ChannelWriter) -> Result<ChannelId, WriteError> {
        let package = if self.is_ours { OURS } else { OWN };
        let message = format!("{package}.{}", self.message);
        let threshold = |threshold: f64| (THRESHOLD.to_owned(), format!("{threshold:e}"));
        let metadata = self.threshold().map(threshold).into_iter().collect();
        let schema = file.add_schema(&message, "protobuf", &self.descriptor())?;
        file.define_channel(schema, &self.topic, "protobuf", &metadata)
    }

    fn threshold(&self) -> Option<f64> {
        if let Layout::Things(_, _, threshold) = self.layout { threshold } else { None }
    }

    /// Difference that keeps the rows of `other` out of a channel of these rows, in words; none if there is none.
    pub(crate) fn difference(&self, other: &Self) -> Option<String> {
        let say = |it: &Self| {
            let threshold = it.threshold().map(|threshold| format!(", threshold {threshold:e}"));
            it.names().join(",") + &threshold.unwrap_or_default()
        };
        let is_same = self.names() == other.names() && self.threshold() == other.threshold();
        (!is_same).then(|| format!("rows of `{}` after rows of `{}`", say(other), say(self)))
    }

    /// Names of the values of a row: of all values, or of the values of each thing.
    pub(crate) fn names(&self) -> Vec<&str> {
        match &self.layout {
            Layout::Columns(names) => names.iter().map(String::as_str).collect(),
            Layout::Array(name, _) => vec![name],
            Layout::Things(things, ..) => things.fields.to_vec(),
            Layout::Classes { .. } => Vec::new(),
        }
    }

    /// Self-contained `FileDescriptorSet` of the message.
    pub(crate) fn descriptor(&self) -> Vec<u8> {
        let things = match self.layout {
            Layout::Classes { .. } => return proto::CONTACTS.descriptor.to_vec(),
            Layout::Things(things, ..) => Some(things),
            _ => None,
        };
        let (package, directory) = if self.is_ours { (OURS, "v1") } else { (OWN, "own") };
        let name = self.topic.trim_start_matches('/').replace('-', "_");
        let plain = if self.is_ours { &name } else { &self.message };
        let file = things.map_or(plain.as_str(), |things| things.file);
        let described = Described {
            package,
            message: &self.message,
            file: format!("beadline/{directory}/{file}.proto"),
            number: things.map(|things| things.number),
            columns: self.names(),
            are_arrays: !matches!(self.layout, Layout::Columns(_)),
        };
        described.encode(self.is_ours)
    }

    /// Encodes `row` into `message`, which is empty. No column that is zero is left out, so that −0 keeps its sign.
    ///
    /// # Errors
    /// The expected and the found layout, when the row is of another kind.
    pub(crate) fn encode(&self, row: &ResultRow<'_>, message: &mut Vec<u8>) -> Result<(), String> {
        let ResultRow { frame, step, time_s, values } = *row;
        let numbers = match (&self.layout, values) {
            (Layout::Classes { tolerance_m }, RowValues::Classes(classes)) => {
                if let Some(class) = classes.iter().find(|class| **class > OPEN) {
                    return Err(format!("{class} is no class of a contact"));
                }
                let row = ContactsRow { frame, step, time_s, tolerance_m: *tolerance_m, classes };
                row.message(Vec::new()).encode_raw(message);
                return Ok(());
            }
            (Layout::Columns(_) | Layout::Array(..) | Layout::Things(..), RowValues::Numbers(numbers)) => {
                numbers
            }
            _ => return Err("its values are of another type".to_owned()),
        };
        let wide = |width| match numbers.len() {
            found if found == width => Ok(()),
            found => Err(format!("it has {found} values, not {width}")),
        };
        if self.is_ours {
            RowHead { frame, step, time_s }.encode_raw(message);
        } else {
            uint64::encode(1, &frame, message);
            uint64::encode(2, &step, message);
            double::encode(3, &time_s, message);
        }
        match &self.layout {
            Layout::Things(things, named, _) => encode_things(things, named.as_deref(), numbers, message)?,
            Layout::Array(_, width) => {
                wide(width.unwrap_or(numbers.len()))?;
                double::encode_packed(FIRST_COLUMN, numbers, message);
            }
            _ => {
                wide(self.names().len())?;
                (FIRST_COLUMN..).zip(numbers).for_each(|(tag, value)| double::encode(tag, value, message));
            }
        }
        Ok(())
    }

    /// Decodes a row in any valid encoding, of a run with rows of classes of these [`widths`](super::contacts::widths).
    pub(crate) fn decode(
        &self,
        message: &[u8],
        widths: &RangeInclusive<usize>,
    ) -> Result<RecordedRow, String> {
        let not = |error| format!("a row of {} that is none: {error}", self.topic);
        if let Layout::Classes { .. } = self.layout {
            let row = ContactClasses::decode(message).map_err(not)?;
            check_row(&row, widths, None)?;
            let mut classes = Vec::new();
            unpack(&row, &mut classes);
            let (values, tolerance_m) = (KeptValues::Classes(classes), Some(row.tolerance_m));
            let ContactClasses { frame, step, time_s, .. } = row;
            let (things, threshold) = (Vec::new(), None);
            return Ok(RecordedRow { frame, step, time_s, values, things, tolerance_m, threshold });
        }
        let (RowHead { frame, step, time_s }, things, columns) = self.fields(message).map_err(not)?;
        let whole = |length: usize| {
            let lacks = || format!("the row of {} of frame {frame} lacks a value", self.topic);
            columns.iter().all(|column| column.len() == length).then_some(()).ok_or_else(lacks)
        };
        let numbers = match self.layout {
            Layout::Columns(_) => whole(1).map(|()| columns.concat())?,
            Layout::Things(layout, ..) => {
                whole(things.len())?;
                let mut numbers = Vec::new();
                for (at, thing) in things.iter().enumerate() {
                    // 53 bits are enough for what was a double on the bus
                    numbers.extend((layout.numbers == ThingsNumbers::InRows).then_some(*thing as f64));
                    numbers.extend(columns.iter().map(|column| column[at]));
                }
                numbers
            }
            _ => columns.concat(),
        };
        let values = KeptValues::Numbers(numbers);
        let (tolerance_m, threshold) = (None, self.threshold());
        Ok(RecordedRow { frame, step, time_s, values, things, tolerance_m, threshold })
    }

    fn fields(&self, mut message: &[u8]) -> Result<Fields, DecodeError> {
        let (mut head, mut things) = (RowHead::default(), Vec::new());
        let mut columns = vec![Vec::new(); self.names().len()];
        let has_things = matches!(self.layout, Layout::Things(..));
        while !message.is_empty() {
            let (tag, wire_type) = decode_key(&mut message)?;
            let (buf, context) = (&mut message, DecodeContext::default());
            let at = tag.checked_sub(FIRST_COLUMN + u32::from(has_things));
            let column = at.and_then(|at| columns.get_mut(usize::try_from(at).ok()?));
            match (tag, column) {
                (1, _) => uint64::merge(wire_type, &mut head.frame, buf, context),
                (2, _) => uint64::merge(wire_type, &mut head.step, buf, context),
                (3, _) => double::merge(wire_type, &mut head.time_s, buf, context),
                (FIRST_COLUMN, None) if has_things => {
                    uint64::merge_repeated(wire_type, &mut things, buf, context)
                }
                (_, Some(column)) if matches!(self.layout, Layout::Columns(_)) => {
                    column.resize(1, 0.0);
                    double::merge(wire_type, &mut column[0], buf, context)
                }
                (_, Some(column)) => double::merge_repeated(wire_type, column, buf, context),
                _ => skip_field(wire_type, tag, buf, context),
            }?;
        }
        Ok((head, things, columns))
    }
}

/// Name of the message for rows of this name.
fn message_name(name: ResultsName, layout: &Layout) -> String {
    let words = name.name().split('-');
    let plain = match layout {
        Layout::Classes { .. } => return "ContactClasses".to_owned(),
        Layout::Things(things, ..) => return things.message.to_owned(),
        _ if name.is_own() => name.name().replace('-', "_"),
        _ => words.map(|word| word[..1].to_ascii_uppercase() + &word[1..]).collect(),
    };
    let begins_with_letter = plain.starts_with(|first: char| first.is_ascii_alphabetic());
    if begins_with_letter { plain } else { format!("_{plain}") }
}

/// Encodes the values of things, one thing after the other, as an array of each quantity. Empty arrays are left out.
fn encode_things(
    layout: &Things,
    named: Option<&[u64]>,
    values: &[f64],
    message: &mut Vec<u8>,
) -> Result<(), String> {
    let each = values.chunks_exact(layout.width());
    let is_whole = each.remainder().is_empty() && named.is_none_or(|named| named.len() == each.len());
    if !is_whole {
        let many = named.map_or_else(String::new, |named| format!(" for {}", named.len()));
        let (count, number, width) = (values.len(), layout.number, layout.width());
        return Err(format!("it has {count} values{many}, not {width} for each {number}"));
    }
    let (numbers, each): (Vec<u64>, Vec<&[f64]>) = if let Some(named) = named {
        (named.to_vec(), each.collect())
    } else {
        // the bus fills a row up with NaN
        let there = each.filter(|values| !values[0].is_nan());
        let split = there.map(|values| whole(values[0], layout.number).map(|number| (number, &values[1..])));
        split.collect::<Result<Vec<_>, _>>()?.into_iter().unzip()
    };
    uint64::encode_packed(FIRST_COLUMN, &numbers, message);
    for (tag, column) in (FIRST_COLUMN + 1..).zip(0..layout.fields.len()) {
        let values: Vec<_> = each.iter().map(|values| values[column]).collect();
        double::encode_packed(tag, &values, message);
    }
    Ok(())
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole numbers below 2^53")]
fn whole(value: f64, number: &str) -> Result<u64, String> {
    let is_whole = value >= 0.0 && value < 2.0_f64.powi(53) && value.fract() == 0.0;
    is_whole.then_some(value as u64).ok_or_else(|| format!("{value} is no number of a {number}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost_types::FileDescriptorSet;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;
    use schemas::results::ENERGIES;

    fn manifest() -> RunManifest {
        let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 0 };
        RunManifest::new(&PRESETS[0].config(), "test", origin).expect("valid")
    }

    fn rows(topic: &str, columns: &ResultColumns) -> RowMessages {
        RowMessages::new(Topic::Results(topic.parse().expect("a name")), columns, &manifest()).expect("rows")
    }

    fn encoded(rows: &RowMessages, values: RowValues<'_>) -> Result<Vec<u8>, String> {
        let mut message = Vec::new();
        rows.encode(&ResultRow { frame: 0, step: 300, time_s: 0.5, values }, &mut message).map(|()| message)
    }

    fn bits(values: RowValues<'_>) -> Vec<u64> {
        match values {
            RowValues::Numbers(numbers) => numbers.iter().map(|value| value.to_bits()).collect(),
            RowValues::Classes(classes) => classes.iter().map(|class| u64::from(*class)).collect(),
        }
    }

    /// Every kind of double, in one row.
    const DOUBLES: [f64; 11] = [
        1e-310,
        -0.0,
        0.0,
        5e-324,
        f64::INFINITY,
        f64::from_bits(0x7ff8_dead_beef_0001),
        -1.5,
        f64::NAN,
        1e300,
        2.0,
        -0.0,
    ];

    /// `proto/` has the files that others compile.
    #[test]
    fn the_messages_are_those_of_the_published_files() {
        let published: [(RowMessages, &[u8]); 3] = [
            (
                rows("energies", &ResultColumns::named(&ENERGIES)),
                include_bytes!("../../proto/made/energies.binpb"),
            ),
            (
                rows("impurity", &ResultColumns::motion(&[1])),
                include_bytes!("../../proto/made/impurity_motion.binpb"),
            ),
            (
                rows("pulses", &ResultColumns::pulses(2, 1e-3)),
                include_bytes!("../../proto/made/pulses.binpb"),
            ),
        ];
        for (rows, compiled) in published {
            let (made, compiled) = (rows.descriptor(), compiled.to_vec());
            let said = |bytes: &[u8]| FileDescriptorSet::decode(bytes).expect("a descriptor set");
            assert_eq!(said(&made), said(&compiled));
            assert_eq!(made, compiled);
        }
    }

    #[test]
    fn a_descriptor_names_the_columns_and_is_read_back() {
        let named = ResultColumns::named(&["momentum_n_s", "front_bead"]);
        let array = ResultColumns::array("energy_j", 3);
        for (topic, message, file) in [
            ("own/2d-map", "beadline.own._2d_map", "beadline/own/_2d_map.proto"),
            ("local-energy", "beadline.v1.LocalEnergy", "beadline/v1/local_energy.proto"),
        ] {
            for (columns, names) in [(&named, &["momentum_n_s", "front_bead"][..]), (&array, &["energy_j"])] {
                let rows = rows(topic, columns);
                assert_eq!((rows.topic(), rows.names()), (&*format!("/{topic}"), names.to_vec()));
                let set = FileDescriptorSet::decode(&*rows.descriptor()).expect("a descriptor");
                let found = &set.file[0].message_type[0];
                assert_eq!(format!("{}.{}", set.file[0].package(), found.name()), message);
                assert_eq!(set.file[0].name(), file);
                let fields: Vec<_> = found.field.iter().map(|field| (field.number(), field.name())).collect();
                let expected = ["frame", "step", "time_s"].iter().chain(names).copied();
                assert_eq!(fields, (1..).zip(expected).collect::<Vec<_>>());
                let read = columns_of(&rows.descriptor(), found.name()).expect("plain numbers");
                assert_eq!(read, (names.iter().map(|name| (*name).to_owned()).collect(), names.len() == 1));
            }
        }
        let motion = rows("impurity", &ResultColumns::motion(&[1])).descriptor();
        assert_eq!(columns_of(&motion, "ImpurityMotion"), None, "not plain");
        assert_eq!(columns_of(&motion[1..], "ImpurityMotion"), None, "not one");
    }

    #[test]
    fn the_bytes_of_ones_own_rows_are_what_they_were() {
        let values = [-0.0, f64::NAN];
        let columns = rows("own/x", &ResultColumns::named(&["a_m", "b_m"]));
        let array = rows("own/x", &ResultColumns::array("a_m", 2));
        let [zero, nan] = values.map(f64::to_le_bytes);
        let head = [&[8, 0, 16, 0xac, 2, 25][..], &0.5_f64.to_le_bytes()].concat();
        let values = RowValues::Numbers(&values);
        assert_eq!(encoded(&columns, values), Ok([&head[..], &[33], &zero, &[41], &nan].concat()));
        assert_eq!(encoded(&array, values), Ok([&head[..], &[34, 16], &zero, &nan].concat()));
    }

    #[test]
    fn rows_come_back_with_all_bits() {
        let pulse = [2.0, -0.0, 5e-324, -1.5, f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN];
        let classes: Vec<u8> = (0..3).cycle().take(manifest().contact_count()).collect();
        let numbers = RowValues::Numbers;
        for (rows, values, things) in [
            (rows("energies", &ResultColumns::named(&ENERGIES)), numbers(&DOUBLES), vec![]),
            (rows("own/a", &ResultColumns::array("a_m", 11)), numbers(&DOUBLES), vec![]),
            (rows("impurity", &ResultColumns::motion(&[3, 5])), numbers(&DOUBLES[..8]), vec![3, 5]),
            (rows("pulses", &ResultColumns::pulses(2, 1e-3)), numbers(&pulse), vec![2]),
            (
                rows("contacts", &ResultColumns::contacts(classes.len(), 1e-9)),
                RowValues::Classes(&classes),
                vec![],
            ),
        ] {
            let message = encoded(&rows, values).expect("a row of that kind");
            let row = rows.decode(&message, &(classes.len()..=classes.len())).expect("a row");
            assert_eq!((row.frame, row.step, row.time_s, row.things), (0, 300, 0.5, things));
            let (read, written) = (bits(row.values.lend()), bits(values));
            assert_eq!(read, written[..read.len()], "{}", rows.topic());
            assert!(read.len() == written.len() || rows.topic() == "/pulses");
        }
    }

    #[test]
    fn rows_of_another_shape_are_refused() {
        let refused =
            |topic, columns: &ResultColumns, values| encoded(&rows(topic, columns), values).is_err();
        let numbers = RowValues::Numbers;
        let energies = ResultColumns::named(&ENERGIES);
        assert!(refused("energies", &energies, numbers(&DOUBLES[..9])));
        assert!(refused("energies", &energies, RowValues::Classes(&[0; 11])));
        assert!(refused("impurity", &ResultColumns::motion(&[1]), numbers(&DOUBLES[..8])));
        let contacts = ResultColumns::contacts(manifest().contact_count(), 0.0);
        assert!(refused("contacts", &contacts, RowValues::Classes(&[3])));
        assert!(refused("contacts", &contacts, numbers(&DOUBLES)));
        assert!(refused("pulses", &ResultColumns::pulses(1, 1e-3), numbers(&[1.5, 0.0, 0.0, 0.0, 0.0])));
        assert!(refused("own/x", &ResultColumns::array("a", 2), numbers(&DOUBLES[..1])));
    }

    #[test]
    fn columns_that_are_no_fields_are_refused() {
        let refused = |columns: &ResultColumns| {
            let topic = Topic::own("x").expect("a name");
            RowMessages::new(topic, columns, &manifest()).expect_err("no fields")
        };
        for names in
            [&["a b"][..], &["step"], &["2x"], &["a", "a"], &["x_m", "xM"], &["TimeS"], &[""], &["é"]]
        {
            refused(&ResultColumns::named(names));
        }
        refused(&ResultColumns::array("a", 0));
        refused(&ResultColumns::contacts(3, 0.0));
        refused(&ResultColumns { width: 3, ..ResultColumns::named(&["a", "b"]) });
        let many: Vec<_> = (0..100).map(|at| format!("c{at}")).collect();
        refused(&ResultColumns::named(&many.iter().map(String::as_str).collect::<Vec<_>>()));
    }
}
