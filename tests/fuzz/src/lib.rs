//! Fuzz targets for the USB/IP protocol and for every parser. libFuzzer runs the targets for an
//! unlimited time; the ordinary tests run them over the cases of [`cases`].

pub mod cases;
pub mod parsers;
pub mod usb;
