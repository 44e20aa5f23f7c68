//! Replaces the emulated device in builds without emulation, in which only captures can be
//! calibrated.

use super::args::Args;
use super::session::Gathered;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Board, Pose, Rig};
use std::path::Path;

/// An emulated device, which cannot exist in this build.
pub(super) enum Emulated {}

impl Emulated {
    pub(super) fn new(_: &Args, _: &str) -> Result<Self> {
        Err(Error::device(
            "--profile needs Linux; --captures works here",
        ))
    }

    pub(super) fn board(&self) -> &Board {
        match *self {}
    }

    pub(super) fn truth(&self) -> &Rig {
        match *self {}
    }

    pub(super) fn shown(&self) -> Vec<Pose> {
        match *self {}
    }

    pub(super) fn names(&self) -> Vec<String> {
        match *self {}
    }

    pub(super) fn scan(
        &self,
        _: &Args,
        _: &str,
        _: &Path,
        _: impl FnMut(usize, usize),
    ) -> Result<(Gathered, String)> {
        match *self {}
    }
}
