//! Devices that speak SCPI with other headers than the emulated device, and dialect files that
//! describe them.

use super::Sink;
use phasmid::decode::Capture;
use phasmid::emulator::Device;
use phasmid::host::{MemoryCamera, MemoryPort, ScanOptions, Scanner};
use phasmid::profile::{Profile, Scene};
use phasmid::protocol::dialect::Dialect;
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

/// Pairs of a header of the emulated device and its equivalent in a device with other headers.
const OTHERS: [(&str, &str); 8] = [
    ("SEQ:SEL", "PATT:NAME"),
    ("SEQ:LIST", "PATT:ALL"),
    ("SEQ:DATA", "PATT:DESC"),
    ("CAL:DATA", "RIG:DESC"),
    ("TRIG:SOUR", "SHOT:FROM"),
    ("PROJ:POW", "LASER"),
    ("*TRG", "SHOT:NOW"),
    ("*IDN?", "WHO?"),
];

/// Returns the dialect file of a device with other headers.
fn other() -> String {
    let own = Dialect::text("scpi").unwrap().to_owned();
    let text = OTHERS
        .iter()
        .fold(own, |text, (own, other)| text.replace(own, other));
    text.replace("name = \"scpi\"", "name = \"other\"")
}

fn parse(text: &str) -> Dialect {
    Dialect::parse(text, "other.toml").unwrap()
}

/// Scans a device that has the emulated device's headers or the other headers. Also returns the
/// commands that the host has sent.
fn scan(
    dialect: Option<Dialect>,
    others: bool,
    sequence: Option<&str>,
) -> (phasmid::Result<Capture>, Vec<u8>) {
    let mut profile = Profile::load("webcam-grey").unwrap();
    (profile.camera.width_px, profile.camera.height_px) = (64, 48);
    let camera = MemoryCamera::default();
    let mut bench = Device::builder(&profile, &Scene::load("plane").unwrap())
        .seed(1)
        .build()
        .unwrap()
        .bench(Sink(camera.clone()));
    let sent = Rc::new(RefCell::new(Vec::new()));
    let tape = sent.clone();
    let port = MemoryPort::new(move |bytes: &[u8]| {
        tape.borrow_mut().extend_from_slice(bytes);
        if !others {
            return bench.control(bytes);
        }
        let mut text = String::from_utf8(bytes.to_vec()).unwrap();
        for (own, other) in OTHERS {
            // The device knows only its own headers.
            text = text.replace(own, "NONE").replace(other, own);
        }
        bench.control(text.as_bytes())
    });
    let timeout = Duration::from_millis(20);
    let options = ScanOptions {
        sequence: sequence.map(str::to_owned),
        manifest: None,
        frame_timeout: timeout,
    };
    let scanner = Scanner::with_dialect(port, dialect, timeout, || Ok(camera));
    let captured = scanner.and_then(|mut scanner| {
        let mut retries = 0;
        let captured = scanner.scan(&options, &mut |progress| {
            retries += usize::from(matches!(progress, phasmid::host::Progress::Retry(_)));
        });
        // The host retries a rejected scan, but not a successful one.
        assert!(captured.is_err() || retries == 0, "{retries} retries");
        scanner.finish().and(captured)
    });
    let sent = sent.borrow().clone();
    (captured, sent)
}

fn same(one: &Capture, other: &Capture) {
    assert_eq!(one.idn, other.idn);
    assert_eq!(one.manifest, other.manifest);
    assert_eq!(one.calibration, other.calibration);
    same_frames(one, other);
}

fn same_frames(one: &Capture, other: &Capture) {
    assert_eq!(one.frames.len(), other.frames.len());
    for (one, other) in one.frames.iter().zip(&other.frames) {
        assert_eq!(one.pattern_index, other.pattern_index);
    }
    assert!(one.images == other.images, "other pixels");
}

#[test]
fn the_device_s_own_file_changes_no_byte() {
    let (none, said) = scan(None, false, None);
    let (own, with_file) = scan(Some(Dialect::load("scpi").unwrap()), false, None);
    same(&own.unwrap(), &none.unwrap());
    assert_eq!(
        said.escape_ascii().to_string(),
        with_file.escape_ascii().to_string()
    );
}

#[test]
fn device_with_other_headers_is_scanned_with_its_file() {
    for sequence in [None, Some("quick-4-xy")] {
        let (plain, _) = scan(None, false, sequence);
        let (captured, said) = scan(Some(parse(&other())), true, sequence);
        same(&captured.unwrap(), &plain.unwrap());
        let said = String::from_utf8(said).unwrap();
        for (own, other) in OTHERS {
            assert!(!said.contains(own), "{own}: {said}");
            let asked = said.contains(other);
            // The list of sequences is not needed if the requested sequence exists.
            assert!(
                asked || own == "SEQ:LIST" || sequence.is_none() && own == "SEQ:SEL",
                "{other}"
            );
        }
        // The host always sends commands that every instrument has.
        assert!(
            said.contains("*ESR?") && said.contains("SYST:ERR?"),
            "{said}"
        );
    }
    // Without the dialect file, the host fails at the start.
    let (captured, _) = scan(None, true, None);
    let error = captured.err().unwrap().to_string();
    assert!(error.contains("the device refuses"), "{error}");
}

#[test]
fn refusals_and_unknown_sequences_are_reported() {
    let (captured, _) = scan(Some(parse(&other())), true, Some("moon"));
    let error = captured.unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    let words = error.to_string();
    assert!(words.starts_with("--sequence moon: "), "{words}");
    assert!(words.ends_with("expected quick-4, quick-4-xy"), "{words}");
    let lamp = other().replace("LASER {state}", "LASER:NO {state}");
    let (captured, _) = scan(Some(parse(&lamp)), true, None);
    let words = captured.unwrap_err().to_string();
    assert!(
        words.contains("the device refuses LASER:NO ON: -"),
        "{words}"
    );
}

#[test]
fn scan_omits_optional_operations_that_a_file_lacks() {
    let without = |operation: &str| {
        let text = other();
        let line = |line: &&str| !line.starts_with(&format!("{operation} = "));
        let kept: Vec<&str> = text.lines().filter(line).collect();
        assert_eq!(kept.len() + 1, text.lines().count(), "{operation}");
        parse(&kept.join("\n"))
    };
    for (operation, status, words) in [
        ("trigger", 2, "dialect other: [host]: no trigger"),
        ("manifest", 2, "--manifest: no manifest"),
    ] {
        let (captured, said) = scan(Some(without(operation)), true, None);
        let error = captured.err().unwrap();
        assert_eq!(error.exit_code(), status, "{operation}");
        assert!(error.to_string().starts_with(words), "{error}");
        assert_eq!(said.is_empty(), operation == "trigger");
    }
    let (captured, _) = scan(Some(without("select")), true, Some("quick-4-xy"));
    let words = captured.err().unwrap().to_string();
    assert!(
        words.contains("dialect other cannot select a sequence"),
        "{words}"
    );
    let (plain, _) = scan(None, false, None);
    let plain = plain.unwrap();
    for operation in [
        "identify",
        "calibration",
        "list",
        "selected",
        "source",
        "restore",
        "light_on",
        "complete",
        "errors",
        "mark",
        "marked",
        "exposure",
        "last_id",
    ] {
        let (captured, said) = scan(Some(without(operation)), true, None);
        let captured = captured.unwrap();
        same_frames(&captured, &plain);
        match operation {
            "identify" => assert_eq!(captured.idn, "a device that speaks other"),
            "calibration" => assert_eq!(captured.calibration, None),
            "light_on" => assert!(!said.windows(6).any(|word| word == b"LASER ")),
            _ => same(&captured, &plain),
        }
    }
}

#[test]
fn scpi_file_may_only_set_commands_and_boot_messages() {
    let with = |more: &str| format!("{}\n{more}\n", other());
    for more in [
        "[line]\necho = true",
        "[line]\nto_host = \"\\r\"",
        "[events]\ndone = \"ready\"",
        "[errors]\nline = \"no {number}\"\ndefault = { number = 1, text = \"\" }\n\
         busy = { number = 2, text = \"\" }",
        "[[command]]\nname = \"x\"\nline = \"X?\"\nreply = [\"a\", \"b\"]",
        "[[command]]\nname = \"x\"\nline = \"X\"\nruns = [\"*RST\"]",
    ] {
        let error = Dialect::parse(&with(more), "other.toml").unwrap_err();
        assert_eq!(error.exit_code(), 2, "{more}: {error}");
    }
    let chatty = parse(&with("[[boot]]\nline = \"Ready.\"\n[[boot]]\nbytes = [62]"));
    let (captured, _) = scan(Some(chatty), true, None);
    same(&captured.unwrap(), &scan(None, false, None).0.unwrap());
}
