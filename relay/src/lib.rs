//! A live run on another host.
