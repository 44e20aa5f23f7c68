//! `--console` in a build without the feature `console`.

use super::args::Args;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Endpoints;
use phasmid_protocol::record::Observer;

/// No page.
pub(super) struct Page;

impl Page {
    /// # Errors
    /// Returns an error if a page was requested.
    pub(super) fn start<'a>(args: &Args, _: impl Iterator<Item = &'a str>) -> Result<Self> {
        if args.console.is_none() && args.recordings.is_none() {
            return Ok(Self);
        }
        Err(Error::input(
            "--console",
            "a build without the feature `console`",
            "a build with it",
        ))
    }

    pub(super) fn observer(&self, _device: usize) -> Option<Observer> {
        None
    }

    pub(super) fn served(&self, _device: usize, _endpoints: &Endpoints) {}

    pub(super) fn about(&self) -> String {
        String::new()
    }
}
