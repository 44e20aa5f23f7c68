//! What is thrown at the wire of USB/IP in both directions.
//!
//! Every target is a function of bytes, a script: whatever its bytes are, they say what is sent and
//! what happens, so that most scripts get past the first check.

pub mod choices;
pub mod device;
pub mod host;
pub mod ledger;
pub mod sample;
pub mod wire;
