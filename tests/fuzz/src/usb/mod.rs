//! Fuzz targets for the USB/IP protocol in both directions.
//!
//! Every target is a function of bytes that it interprets as a script. Any bytes describe valid
//! actions and data, so most scripts get past the first check.

pub mod choices;
pub mod device;
pub mod host;
pub mod ledger;
pub mod sample;
pub mod wire;
