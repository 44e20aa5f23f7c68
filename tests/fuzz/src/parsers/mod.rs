//! Every parser of the program, each a function of bytes that anybody may have written. It ends
//! with a value or with words, whatever the bytes are; what is read has to hold what its type
//! promises.
//!
//! `seeds/NAME` has bytes that a parser reads, to begin with.

mod control;
mod files;
mod patient;
mod text;
mod wire;

/// Something that reads bytes.
pub struct Parser {
    /// Name of its target and of the folder of its seeds.
    pub name: &'static str,
    /// Reads; tells whether the bytes were what the parser is for.
    pub run: fn(&[u8]) -> bool,
    /// Files of the repository that are seeds too: a folder and an extension.
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

/// All of them.
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
    parser("picture", files::picture),
    parser("metaimage", patient::metaimage),
    parser("dicom", patient::dicom),
    parser("planning", patient::planning),
];

/// Runs the parser of a name.
///
/// # Panics
/// Where there is none of that name.
pub fn run(name: &str, bytes: &[u8]) {
    let parser = PARSERS.iter().find(|parser| parser.name == name);
    let run = parser.expect("a parser's name").run;
    run(bytes);
}
