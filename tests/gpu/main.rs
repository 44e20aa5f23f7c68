//! The passes on a GPU against those on the processor, over every term of image formation. They need
//! a Vulkan adapter, and a software one will do:
//!
//! ```text
//! cargo test --release --test gpu -- --include-ignored
//! ```
//!
//! On a failure the pictures and their difference are left in `target/gpu-parity`.

mod case;
mod compare;
mod frames;
mod terms;
mod variations;
