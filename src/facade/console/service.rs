//! Passes viewers' requests to the service channel of an emulated device.

use crate::facade::ask_service;
use phasmid_console::{Operator, Request};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::service;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Answers requests of the kind `service`.
pub(super) struct ServiceOperator {
    /// Path of the service channel.
    pub(super) service: PathBuf,
}

impl Operator for ServiceOperator {
    fn answers(&self) -> &'static [&'static str] {
        &["service"]
    }

    fn answer(&self, request: &Request) -> Result<Value> {
        match request {
            Request::Service(request) => answer(&self.service, request),
            _ => Err(Error::device(
                "this device takes requests for its service channel only",
            )),
        }
    }
}

/// Asks a device, and returns its answer without the maps.
pub(super) fn answer(service: &Path, request: &Value) -> Result<Value> {
    let line = format!("{request}\n");
    let request = service::Request::parse(line.as_bytes());
    let request = request.map_err(|e| Error::device(e.to_string()))?;
    if let service::Request::Get(service::Item::Truth)
    | service::Request::TruthAt(_)
    | service::Request::TruthOfFrame(_) = request
    {
        return Err(Error::device(
            "a console does not pass maps on; ask the service channel itself",
        ));
    }
    let (reply, _) = ask_service(service, &request)?;
    serde_json::to_value(reply).map_err(Error::device)
}
