//! The ground of all crates: errors, checked numbers, files, TOML with line numbers, random numbers, SIMD.

pub mod check;
pub mod error;
pub mod file;
pub mod new_file;
pub mod numbers;
pub mod philox;
pub mod simd;
pub mod source;

pub use error::{Error, Result};
