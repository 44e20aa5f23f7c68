//! The page of `--console`.

use super::Args;
use phasmid_console::{Console, ConsoleOptions};
use phasmid_core::error::Result;
use phasmid_protocol::record::Observer;

/// The page, if it was asked for.
pub(super) struct Page(Option<Console>);

impl Page {
    /// Starts to serve it.
    ///
    /// # Errors
    /// Returns an error if the port is taken.
    pub(super) fn start(args: &Args) -> Result<Self> {
        let console = args.console.map(|port| {
            let console = Console::start(&ConsoleOptions { port });
            console.map_err(|e| e.at("--console"))
        });
        console.transpose().map(Self)
    }

    /// Adds a device and returns its observer.
    pub(super) fn observer(&self, device: &str) -> Option<Observer> {
        self.0.as_ref().map(|console| console.observer(device))
    }

    /// Returns the addresses, for the operator.
    pub(super) fn about(&self) -> String {
        self.0.as_ref().map_or_else(String::new, |console| {
            let (control, view) = (console.url(), console.view_url());
            format!("Console\n  control  {control}\n  view     {view}\n")
        })
    }
}
