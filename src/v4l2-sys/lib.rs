//! Bindings of `linux/videodev2.h`, generated beforehand by `regenerate.sh` so that no build needs
//! libclang.
//!
//! bindgen gives the same text for x86-64, AArch64 and i386: pointers, `long` and `timeval` are
//! named by their C types, so the layout follows the target. `tests/host/v4l2_layout.rs` compares
//! sizes, offsets and request codes with the kernel's.

#![allow(
    clippy::all,
    missing_docs,
    non_camel_case_types,
    non_snake_case,
    non_upper_case_globals
)]

include!("bindings.rs");
