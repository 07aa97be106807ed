//! consumers
pub mod figure;
