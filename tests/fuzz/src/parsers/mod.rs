//! Every parser of the program, as a function of arbitrary bytes. A parser must return a value or an
//! error message for any input, and the value must satisfy the guarantees of its type.
//!
//! `seeds/NAME` holds inputs that a parser accepts, as a starting point.

mod control;
mod files;
mod patient;
mod text;
mod wire;

/// A parser under test.
pub struct Parser {
    /// Name of its fuzz target and of its seed folder.
    pub name: &'static str,
    /// Parses bytes; returns whether they were valid input for the parser.
    pub run: fn(&[u8]) -> bool,
    /// Files of the repository that also serve as seeds, given by a folder and an extension.
    pub shipped: Option<(&'static str, &'static str)>,
}

const fn parser(name: &'static str, run: fn(&[u8]) -> bool) -> Parser {
    Parser {
        name,
        run,
        shipped: None,
    }
}

const fn of_files(
    name: &'static str,
    run: fn(&[u8]) -> bool,
    folder: &'static str,
    extension: &'static str,
) -> Parser {
    Parser {
        name,
        run,
        shipped: Some((folder, extension)),
    }
}

/// All parsers.
pub const PARSERS: &[Parser] = &[
    parser("scpi", control::scpi),
    parser("firmware", control::firmware),
    parser("service", wire::service),
    parser("frames", wire::frames),
    parser("data_line", wire::data_line),
    parser("usb_records", wire::usb_records),
    parser("recording", wire::recording),
    parser("usb_address", text::usb_address),
    parser("manifest", text::manifest),
    parser("rig", text::rig),
    parser("endpoints", text::endpoints),
    of_files("profile", text::profile, "device-profiles", "toml"),
    of_files("station", text::station, "device-profiles/stations", "toml"),
    of_files("dialect", text::dialect, "device-profiles/dialects", "toml"),
    parser("dialect_wire", control::dialect_wire),
    of_files("faults", text::faults, "device-profiles/faults", "toml"),
    of_files("scene", text::scene, "device-profiles/scenes", "toml"),
    of_files("patient", text::patient, "device-profiles/patients", "toml"),
    parser("stl", files::stl),
    parser("obj", files::obj),
    parser("ply", files::ply),
    parser("image", files::image),
    parser("metaimage", patient::metaimage),
    parser("dicom", patient::dicom),
    parser("planning", patient::planning),
];

/// Runs the parser with this name.
///
/// # Panics
/// Panics if no parser has this name.
pub fn run(name: &str, bytes: &[u8]) {
    let parser = PARSERS.iter().find(|parser| parser.name == name);
    let run = parser.expect("a parser's name").run;
    run(bytes);
}
