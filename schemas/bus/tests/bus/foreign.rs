//! What a program in another language sees: only iceoryx2 and the rules of `docs/FORMAT.md`.

use crate::support::{TestBus, publish, publisher};
use bus::{Bus, ManifestText, PublishOptions, RunStatus, STATE_DONE, StateHeader};
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    Config, FileName, Path, PortFactory as _, PortName, SemanticString as _, ServiceName, SignalHandlingMode,
    ipc_threadsafe::Service as Ipc,
};
use schemas::frame::EndReason;

/// The configuration by the documented rule: the root, and the prefix that belongs to it.
pub(crate) fn node(bus: &Bus) -> Node<Ipc> {
    let mut config = Config::default();
    config.global.set_root_path(&Path::new(bus.root().as_os_str().as_encoded_bytes()).unwrap());
    config.global.prefix = FileName::new(bus.prefix().as_bytes()).unwrap();
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Ipc>()
        .unwrap()
}

pub(crate) fn service(name: &str) -> ServiceName {
    ServiceName::new(name).unwrap()
}

pub(crate) fn subscriber(
    node: &Node<Ipc>,
    run: &str,
    name: &str,
    buffer: Option<usize>,
) -> Subscriber<Ipc, [f64], StateHeader> {
    let name = PortName::new(name).unwrap();
    let state = node
        .service_builder(&service(&format!("beadline/{run}/state")))
        .publish_subscribe::<[f64]>()
        .user_header::<StateHeader>()
        .enable_safe_overflow(false)
        .open()
        .unwrap();
    let builder = state.subscriber_builder().name(&name);
    match buffer {
        Some(buffer) => builder.buffer_size(buffer).create().unwrap(),
        None => builder.create().unwrap(),
    }
}

#[test]
fn a_foreign_program_reads_frames_manifest_and_status() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "open", 10, &PublishOptions::default());
    let stream = run.stream();
    let node = node(&test.bus);
    let subscriber = subscriber(&node, "open", "latest.foreign", None);
    publish(&mut run, 10, 0..3);
    let sample = subscriber.receive().unwrap().unwrap();
    assert_eq!((sample.user_header().stream_id, sample.user_header().frame), (stream.stream_id, 0));
    assert_eq!((sample.payload().len(), sample.payload()[1]), (20, 1e-3));

    let board =
        node.service_builder(&service("beadline/open/manifest")).blackboard_opener::<u64>().open().unwrap();
    let reader = board.reader_builder().create().unwrap();
    let text = reader.entry::<ManifestText>(&0).unwrap().get();
    let length = usize::try_from(text.length_bytes).unwrap();
    assert!(std::str::from_utf8(&text.json[..length]).unwrap().contains("\"name\":\"open\""));
    run.finish(EndReason::Complete).unwrap();
    let status = *reader.entry::<RunStatus>(&1).unwrap().get();
    assert_eq!((status.state, status.frames, status.stream_id), (STATE_DONE, 3, stream.stream_id));
    assert!(board.attributes().iter().any(|attribute| attribute.value().as_bytes() == b"1.1"));
}
