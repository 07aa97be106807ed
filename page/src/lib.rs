//! One page that shows any run: as a file that carries its recording, and from a server on this machine.
//!
//! The page is plain ES modules (`page/*.js`), put into one inline script by [`page`], so that it opens by a double click and
//! loads nothing from anywhere. [`Server`] hands it out together with recordings and live runs, to whoever knows the token
//! in the address.
//!
//! Architecture invariants: nothing here prints, opens a directory, or knows the bus: a [`Shelf`] says what there is.

mod bundle;
mod carried;
mod serve;

pub use carried::{Carried, Packed, page};
pub use serve::live::{LiveFeed, LiveWriter};
pub use serve::{Served, Server, Shelf};
