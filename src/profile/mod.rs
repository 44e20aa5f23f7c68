//! `device-profiles/*.toml` and scene files as typed, validated structs.

mod source;

pub use source::TomlSource;
