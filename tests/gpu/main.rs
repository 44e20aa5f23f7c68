//! Compares the passes on a GPU with the passes on the CPU, over every term of image formation.
//! Needs a Vulkan adapter; a software adapter is enough:
//!
//! ```text
//! cargo test --release --test gpu -- --include-ignored
//! ```
//!
//! On a failure the images and their difference are written to `target/gpu-parity`.

mod case;
mod compare;
mod frames;
mod terms;
mod variations;
