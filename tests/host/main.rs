//! The host: cameras, ports, frame checks, decoding, calibration, comparison with the truth.

#[path = "../fuzz/src/cases.rs"]
mod cases;
#[path = "../support/photometry.rs"]
mod photometry;

mod accuracy;
mod boards;
mod calibration;
mod calibration_files;
mod compare;
mod consistency;
mod decode;
mod decode_surfaces;
mod parsers;
mod real_capture;
mod scanner;
mod usb;
mod v4l2_layout;
