//! The messages of `proto/beadline/v1`, as prost generates them, and their descriptors: files in `proto/made`, which a test compiles.

#![allow(missing_docs, unreachable_pub, clippy::pedantic, reason = "generated code")]

include!("../proto/made/beadline.v1.rs");

/// A channel as its readers expect it.
#[derive(Debug, Clone, Copy)]
pub struct DescribedTopic<'a> {
    /// Its name.
    pub topic: &'a str,
    /// Full name of its messages' type.
    pub message: &'a str,
    /// The set of descriptors of that type and of the types that it needs.
    pub descriptor: &'a [u8],
}

pub(super) const STATE: DescribedTopic<'static> = DescribedTopic {
    topic: "/state",
    message: "beadline.v1.ChainState",
    descriptor: include_bytes!("../proto/made/chain_state.binpb"),
};

pub(super) const CHAIN: DescribedTopic<'static> = DescribedTopic {
    topic: "/chain",
    message: "beadline.v1.Chain",
    descriptor: include_bytes!("../proto/made/chain.binpb"),
};

pub(super) const SUMMARY: DescribedTopic<'static> = DescribedTopic {
    topic: "/summary",
    message: "beadline.v1.Summary",
    descriptor: include_bytes!("../proto/made/summary.binpb"),
};

/// The topics of frames. Every writer of frames writes these topics itself.
pub(super) const OF_FRAMES: [&str; 3] = [CHAIN.topic, STATE.topic, SUMMARY.topic];

pub(super) const CONTACTS: DescribedTopic<'static> = DescribedTopic {
    topic: "/contacts",
    message: "beadline.v1.ContactClasses",
    descriptor: include_bytes!("../proto/made/contact_classes.binpb"),
};

/// All our topics whose messages are not made from columns, those of frames first.
pub(super) const ALL: [DescribedTopic<'static>; 4] = [CHAIN, STATE, SUMMARY, CONTACTS];

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message;

    #[test]
    fn each_descriptor_set_holds_its_message_and_needs_no_other_file() {
        for topic in ALL {
            let set = prost_types::FileDescriptorSet::decode(topic.descriptor).expect("descriptor set");
            assert_eq!(set.file.len(), 1, "{}", topic.message);
            let file = &set.file[0];
            assert!(file.dependency.is_empty());
            let names: Vec<_> =
                file.message_type.iter().map(|m| format!("{}.{}", file.package(), m.name())).collect();
            assert_eq!(names, [topic.message]);
        }
    }

    #[test]
    fn the_state_keeps_its_numbers_and_reserves_the_rest_of_one_byte_tags() {
        let set = prost_types::FileDescriptorSet::decode(STATE.descriptor).expect("descriptor set");
        let message = &set.file[0].message_type[0];
        let fields: Vec<_> = message.field.iter().map(|f| (f.number(), f.name())).collect();
        let expected = ["frame", "step", "time_s", "displacement_m", "velocity_m_s", "extra"];
        assert_eq!(fields, (1..=6).zip(expected).collect::<Vec<_>>());
        assert!(message.field[0].proto3_optional());
        assert_eq!((message.reserved_range[0].start(), message.reserved_range[0].end()), (7, 16));
    }
}
