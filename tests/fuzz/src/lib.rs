//! What is thrown at the wire of USB/IP in both directions, and at every parser.
//!
//! Every target is a function of bytes, a script: whatever its bytes are, they say what is sent and
//! what happens, so that most scripts get past the first check. libFuzzer runs the targets for as
//! long as one likes; the ordinary tests run them over cases of [`cases`].

pub mod cases;
pub mod choices;
pub mod device;
pub mod host;
pub mod ledger;
pub mod parsers;
pub mod sample;
pub mod wire;
