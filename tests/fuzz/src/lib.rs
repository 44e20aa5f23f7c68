//! What is thrown at the wire of USB/IP, and at every parser. libFuzzer runs the targets for as
//! long as one likes; the ordinary tests run them over cases of [`cases`].

pub mod cases;
pub mod parsers;
pub mod usb;
