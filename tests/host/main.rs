//! The host, tested as a library.
//!
//! - Devices and cameras: `scanner`, `usb`, `v4l2_layout`, `pixel_formats`
//! - Frame checks: `consistency`
//! - Decoding: `decode`, `decode_surfaces`, `accuracy`, `real_capture`
//! - Calibration: `boards`, `calibration`, `calibration_files`
//! - Comparison with the truth: `compare`
//! - Parsers of all files: `parsers`

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
mod pixel_formats;
mod real_capture;
mod scanner;
mod usb;
mod v4l2_layout;
