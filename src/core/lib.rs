//! Basics that every other crate uses: the error type, checks of configuration values, TOML with
//! line numbers, reading and writing of files, counter-based random numbers and SIMD dispatch.
//! Depends on no other crate of the workspace.
//!
//! | module | contents |
//! | --- | --- |
//! | [`check`] | checks of values read from TOML, reported with their line |
//! | `deserializer` | deserialisation of TOML values |
//! | [`error`] | the error type and its exit statuses |
//! | [`file`](mod@file) | bounded reading of user files |
//! | `layers` | documents that extend others, and settings on top |
//! | [`new_file`] | atomic writing of output files, scratch folders |
//! | [`npy`] | NumPy's array files |
//! | [`numbers`] | deserialisation of number lists of a fixed length |
//! | [`output_folder`] | output folders that receive all files of a result or none |
//! | [`philox`](mod@philox) | Philox4x32-10 random numbers |
//! | `positions` | positions of the values of a document |
//! | `repair` | all errors of a document in one message |
//! | `setting` | values for single fields of a document |
//! | [`simd`] | run-time dispatch to AVX2 |
//! | [`source`] | TOML documents with file and line in every error |
//! | [`statistics`] | medians, the biweight, nodes of quadrature |
//! | [`stop`] | ends long calls early, from another thread |
//! | [`wording`] | messages of serde in this workspace's form, suggestions for misspelt names |

pub mod check;
mod deserializer;
pub mod error;
pub mod file;
mod layers;
pub mod new_file;
pub mod npy;
pub mod numbers;
pub mod output_folder;
pub mod philox;
mod positions;
mod repair;
mod setting;
pub mod simd;
pub mod source;
pub mod statistics;
pub mod stop;
pub mod wording;

pub use error::{Error, Result};
pub use stop::Stop;
