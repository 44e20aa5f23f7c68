//! The page of `--console`.

use super::args::Args;
use crate::facade::{Follower, Playback};
use phasmid_console::{Console, ConsoleOptions};
use phasmid_core::error::Result;
use phasmid_protocol::Endpoints;
use phasmid_protocol::record::Observer;

/// The page, if `--console` is given.
pub(super) struct Page {
    console: Option<Console>,
    /// One follower for each device, in the order of the devices.
    followers: Vec<Follower>,
    /// Plays recordings, if `--recordings` names a folder.
    _playback: Option<Playback>,
}

impl Page {
    /// Starts to serve the page, with a source for each device.
    ///
    /// # Errors
    /// Returns an error if the port is taken, or if the system refuses a thread.
    pub(super) fn start<'a>(args: &Args, devices: impl Iterator<Item = &'a str>) -> Result<Self> {
        let console = args.console.map(|port| {
            let recordings = args.recordings.clone();
            let console = Console::start(&ConsoleOptions { port, recordings });
            console.map_err(|e| e.at("--console"))
        });
        let console = console.transpose()?;
        let followers = match &console {
            Some(console) => devices
                .map(|name| Follower::start(console.source(name)))
                .collect::<Result<_>>()?,
            None => Vec::new(),
        };
        let playback = match (&console, &args.recordings) {
            (Some(console), Some(folder)) => {
                let source = console.playback("recordings");
                let playback = Playback::start(source, folder, None);
                Some(playback.map_err(|e| e.at("--recordings"))?)
            }
            _ => None,
        };
        Ok(Self {
            console,
            followers,
            _playback: playback,
        })
    }

    /// Returns the observer of a device.
    pub(super) fn observer(&self, device: usize) -> Option<Observer> {
        self.followers.get(device).map(Follower::observer)
    }

    /// Passes a device's follower the path of the service channel, from which the follower reads
    /// the device's sequence and calibration.
    pub(super) fn served(&self, device: usize, endpoints: &Endpoints) {
        if let Some(follower) = self.followers.get(device) {
            follower.ask_at(&endpoints.service);
        }
    }

    /// Returns a text with the page's addresses, for the operator.
    pub(super) fn about(&self) -> String {
        self.console.as_ref().map_or_else(String::new, |console| {
            let (control, view) = (console.url(), console.view_url());
            format!("Console\n  control  {control}\n  view     {view}\n")
        })
    }
}
