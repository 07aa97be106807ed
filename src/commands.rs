//! One module for each mode; each reads from top to bottom.

pub(crate) mod bench;
pub(crate) mod check;
pub(crate) mod contacts;
pub(crate) mod deformation;
pub(crate) mod demo;
pub(crate) mod energies;
pub(crate) mod export;
pub(crate) mod impurity;
pub(crate) mod info;
pub(crate) mod ls;
pub(crate) mod manual;
pub(crate) mod plot;
pub(crate) mod presets;
pub(crate) mod pulses;
pub(crate) mod record;
pub(crate) mod recover;
pub(crate) mod replay;
pub(crate) mod reproduce;
pub(crate) mod run;
pub(crate) mod share;
pub(crate) mod spreading;
pub(crate) mod sweep;
pub(crate) mod thin;
pub(crate) mod top;
pub(crate) mod verify;
pub(crate) mod view;
