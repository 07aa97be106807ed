//! `beadline top` in a build without live streams, and without the library that draws screens.

use crate::args::TopArgs;
use crate::failure::{Done, Failure};
use bus::RootError;

pub(crate) fn top(_: &TopArgs) -> Result<Done, Failure> {
    Err(RootError::Absent.into())
}
