//! Zenoh with nothing around it, to measure a relay against: messages of a given size through one publisher.
//!
//!     cargo run --release -p beadline-relay --features zenoh --example bare_zenoh -- send tcp/10.0.0.1:7448 1048576 2000
//!     cargo run --release -p beadline-relay --features zenoh --example bare_zenoh -- take tcp/10.0.0.1:7448 1048576 2000
#![allow(clippy::print_stdout, reason = "an example says what it found")]

use relay::wire::zenoh::{self, Wait as _, qos::CongestionControl};
use std::error::Error;
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [side, endpoint, bytes, count] = arguments.as_slice() else {
        return Err("usage: bare_zenoh send|take ENDPOINT BYTES COUNT".into());
    };
    let (bytes, count): (usize, usize) = (bytes.parse()?, count.parse()?);
    let mut config = zenoh::Config::default();
    config.insert_json5("scouting/multicast/enabled", "false")?;
    config.insert_json5("listen/endpoints", "[]")?;
    let key = if side == "send" { "listen/endpoints" } else { "connect/endpoints" };
    config.insert_json5(key, &format!("[\"{endpoint}\"]"))?;
    let session = zenoh::open(config).wait()?;
    if side == "send" {
        let publisher =
            session.declare_publisher("bare").congestion_control(CongestionControl::Block).wait()?;
        while !publisher.matching_status().wait()?.matching() {
            std::thread::sleep(Duration::from_millis(10));
        }
        for _ in 0..count {
            // made anew each time, as frames are
            publisher.put(vec![1u8; bytes]).wait()?;
        }
        // until the other side has left
        while publisher.matching_status().wait()?.matching() {
            std::thread::sleep(Duration::from_millis(10));
        }
    } else {
        let subscriber = session.declare_subscriber("bare").wait()?;
        let mut start = None;
        for _ in 0..count {
            let sample = subscriber.recv()?;
            start.get_or_insert_with(Instant::now);
            assert_eq!(sample.payload().to_bytes().len(), bytes, "whole");
        }
        let seconds = start.map_or(0.0, |start| start.elapsed().as_secs_f64());
        println!("{:.3} s, {:.0} MB/s", seconds, ((count - 1) * bytes) as f64 / seconds / 1e6);
    }
    session.close().wait()
}
