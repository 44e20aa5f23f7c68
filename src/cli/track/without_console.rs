//! `--console` in a build without the feature `console`.

use crate::cli::pods::Address;
use crate::{TrackOptions, TrackProgress};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::record::Observer;
use phasmid_sgrt::Planned;
use std::marker::PhantomData;

/// No page.
pub(super) struct Page<'a>(PhantomData<&'a ()>);

impl<'a> Page<'a> {
    /// # Errors
    /// Returns an error if a page was requested.
    pub(super) fn start(
        port: Option<u16>,
        _: &'a Planned,
        _: &[Address],
        _: &TrackOptions,
    ) -> Result<Self> {
        match port {
            None => Ok(Self(PhantomData)),
            Some(_) => Err(Error::input(
                "--console",
                "a build without the feature `console`",
                "a build with it",
            )),
        }
    }

    pub(super) fn observer(&self, _pod: usize) -> Option<Observer> {
        None
    }

    pub(super) fn show(&mut self, _progress: &TrackProgress<'_>) {}
}
