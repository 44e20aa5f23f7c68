//! The page of `--console`.

use crate::cli::pods::Address;
use crate::facade::{RoomViews, service_of};
use crate::{TrackOptions, TrackProgress};
use phasmid_console::{Console, ConsoleOptions};
use phasmid_core::error::Result;
use phasmid_protocol::record::Observer;
use phasmid_sgrt::Planned;

/// The page and its views, if `--console` is given.
pub(super) struct Page<'a>(Option<(Console, RoomViews<'a>)>);

impl<'a> Page<'a> {
    /// Starts to serve the page at a port.
    ///
    /// # Errors
    /// Returns an error if the port is taken.
    pub(super) fn start(
        port: Option<u16>,
        planned: &'a Planned,
        pods: &[Address],
        options: &TrackOptions,
    ) -> Result<Self> {
        let Some(port) = port else {
            return Ok(Self(None));
        };
        let recordings = None;
        let console = Console::start(&ConsoleOptions { port, recordings });
        let console = console.map_err(|e| e.at("--console"))?;
        let places = pods.iter().map(|pod| (pod.name.as_str(), pod.place));
        let mut views = RoomViews::new(&console, planned, places, options);
        for (i, pod) in pods.iter().enumerate() {
            if let Ok(service) = service_of(pod.control.as_ref()) {
                views = views.with_service(i, service);
            }
        }
        // Print to standard error, because the CSV lines may go to standard output.
        eprintln!(
            "Console\n  control  {}\n  view     {}\nCtrl-C ends it.",
            console.url(),
            console.view_url()
        );
        Ok(Self(Some((console, views))))
    }

    /// Returns the observer of a pod.
    pub(super) fn observer(&self, pod: usize) -> Option<Observer> {
        self.0.as_ref().map(|(_, views)| views.observer(pod))
    }

    /// Shows a progress report of tracking.
    pub(super) fn show(&mut self, progress: &TrackProgress<'_>) {
        if let Some((_, views)) = &mut self.0 {
            views.show(progress);
        }
    }
}
