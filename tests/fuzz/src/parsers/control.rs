//! Data from the control port.

use phasmid::emulator::Firmware;
use phasmid::profile::Profile;
use phasmid::protocol::dialect::{Cut, Dialect, Direction};
use phasmid::protocol::scpi::{Framer, Framing, parse};
use std::cell::OnceCell;

/// Reads bytes as SCPI messages, whole and in pieces, and parses each message into program units.
pub fn scpi(bytes: &[u8]) -> bool {
    let framed = |pieces: &[&[u8]]| {
        let mut framer = Framer::default();
        let mut messages = Vec::new();
        for piece in pieces {
            framer.push(piece, &mut |framing| messages.push(framing));
        }
        messages
    };
    let whole = framed(&[bytes]);
    let (a, b) = bytes.split_at(bytes.len() / 3);
    assert_eq!(framed(&[a, b]), whole, "pieces make no difference");
    let mut understood = !whole.is_empty();
    for framing in whole {
        if let Framing::Message(message) = framing {
            let program = parse(&message);
            understood &= program.error.is_none();
            for unit in &program.units {
                assert!(!unit.header().is_empty());
            }
        }
    }
    understood
}

thread_local! {
    static PROFILE: OnceCell<Profile> = const { OnceCell::new() };
}

/// Sends arbitrary commands to a device for two minutes of device time. The device must count
/// frames without a gap, reply with complete lines, and still identify itself at the end.
pub fn firmware(bytes: &[u8]) -> bool {
    let profile = PROFILE.with(|cell| {
        let load = || Profile::load("webcam-grey").expect("is built in");
        cell.get_or_init(load).clone()
    });
    let mut device = Firmware::new(&profile, &[]).expect("is sound");
    let mut now_ns = 0;
    let mut next_id = 0;
    device.set_streaming(true, now_ns);
    for piece in bytes.chunks(97) {
        device.receive(piece, now_ns);
        for _ in 0..64 {
            let Some(event_ns) = device.next_event_ns() else {
                break;
            };
            assert!(event_ns >= now_ns);
            now_ns = event_ns;
            device.advance(now_ns);
            for exposure in device.take_exposures() {
                assert_eq!(exposure.shot.id, next_id);
                next_id += 1;
                device.delivered(1);
            }
        }
        now_ns += 1_000_000;
    }
    device.receive(b"\nSYST:ERR:COUN?\n", now_ns);
    let understood = device.take_output().ends_with(b"\n0\n");
    device.hang_up();
    device.receive(b"\nABOR;*CLS;*IDN?\n", now_ns);
    for _ in 0..2 * next_id {
        device.delivered(1);
    }
    let answer = device.take_output();
    let answer = String::from_utf8_lossy(&answer).into_owned();
    assert!(answer.ends_with("0.1.0\n"), "{answer:?}");
    understood
}

thread_local! {
    static DIALECTS: Vec<Dialect> = Dialect::names()
        .map(|name| Dialect::load(name).expect("is built in"))
        .collect();
}

/// Reads bytes on a port with one of the shipped dialects, in either direction. The messages must
/// not depend on how the bytes are split, and each must be understood or rejected.
pub fn dialect_wire(bytes: &[u8]) -> bool {
    DIALECTS.with(|dialects| {
        let mut understood = false;
        for dialect in dialects {
            for direction in [Direction::ToDevice, Direction::ToHost] {
                let cut = |pieces: &[&[u8]]| {
                    let mut cutter = dialect.cutter(direction);
                    let mut cuts = Vec::new();
                    for piece in pieces {
                        cutter.push(piece, &mut |cut| cuts.push(cut));
                    }
                    cuts
                };
                let cuts = cut(&[bytes]);
                let (a, b) = bytes.split_at(bytes.len() / 2);
                assert_eq!(cut(&[a, b]), cuts, "pieces make no difference");
                for cut in cuts {
                    let Cut::Message(message) = cut else { continue };
                    match dialect.asked(&message) {
                        Ok(asked) => {
                            understood = true;
                            dialect.runs(&asked);
                            dialect.busy(&asked);
                        }
                        Err(error) => drop(dialect.nack(&error)),
                    }
                    for command in ["identify", "version", "wait"] {
                        let _ = dialect.reply(command, &message, 0);
                    }
                }
            }
        }
        understood
    })
}
