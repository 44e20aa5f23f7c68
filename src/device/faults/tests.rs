use super::*;
use crate::port::Message;
use crate::{Exposure, PatternImage, Readout, Roi, Shot};
use phasmid_core::source::TomlSource;
use phasmid_protocol::PixelFormat;
use phasmid_protocol::faults::What;

fn faults(text: &str) -> Faults {
    let schedule = Schedule::from_source(&TomlSource::new(text, "test")).unwrap();
    Faults::new(&schedule, "left")
}

fn exposure(id: u64) -> Exposure {
    Exposure {
        shot: Shot {
            id,
            pattern_index: Some(id as u32 % 4),
            pattern_image: Some(Arc::new(PatternImage::Uniform(id as u16 % 4))),
            light: 1.0,
            start_ns: id * 100,
            exposure_ns: 50,
            ..Shot::default()
        },
        readout: Readout {
            roi: Roi {
                x: 0,
                y: 0,
                width: 4,
                height: 4,
            },
            format: PixelFormat::Grey,
            data_line: None,
        },
    }
}

fn frame(id: u64) -> Arc<Frame> {
    Arc::new(Frame {
        id,
        pattern_index: Some(id as u32 % 4),
        width: 4,
        height: 4,
        format: PixelFormat::Grey,
        exposure_start_ns: 0,
        exposure_end_ns: 0,
        data: vec![id as u8; 16],
    })
}

fn pattern_images() -> Vec<Option<Arc<PatternImage>>> {
    (0..4)
        .map(|i| Some(Arc::new(PatternImage::Uniform(i))))
        .collect()
}

/// Passes eight frames, 100 ns apart. Returns time, id and last byte of each frame when it leaves.
fn eight(faults: &mut Faults) -> Vec<(u64, u64, u8)> {
    let mut out = Vec::new();
    let mut take = |faults: &mut Faults, now: u64| {
        while let Some(frame) = faults.next_frame(now) {
            out.push((now, frame.id, *frame.data.last().unwrap()));
        }
    };
    for id in 0..8 {
        let now = id * 100;
        while let Some(next) = faults.next_event_ns().filter(|next| *next < now) {
            take(faults, next);
        }
        assert_eq!(
            faults
                .exposures(vec![exposure(id)], now, &pattern_images)
                .len(),
            1
        );
        faults.frame(frame(id), now);
        take(faults, now);
    }
    while let Some(next) = faults.next_event_ns() {
        take(faults, next);
    }
    out
}

/// Same as [`eight`], but returns only times, in hundreds of nanoseconds, and ids.
fn ids(text: &str) -> Vec<(u64, u64)> {
    let out = eight(&mut faults(text)).into_iter();
    out.map(|(now, id, _)| (now / 100, id)).collect()
}

fn well() -> Vec<(u64, u64)> {
    (0..8).map(|i| (i, i)).collect()
}

#[test]
fn frames_are_dropped_repeated_late_and_swapped() {
    assert_eq!(ids(""), well());
    let mut wanted = well();
    wanted.remove(2);
    assert_eq!(
        ids("[[fault]]\nwhat = \"dropped\"\nwhen = { nth = 3 }"),
        wanted
    );
    wanted = well();
    wanted.insert(2, (2, 2));
    assert_eq!(
        ids("[[fault]]\nwhat = \"repeated\"\nwhen = { nth = 3 }"),
        wanted
    );
    // The third frame is 250 ns late, and the frames behind it wait.
    let late = "[[fault]]\nwhat = \"late\"\nby_ms = 0.00025\nwhen = { nth = 3 }";
    let wanted = [
        (0, 0),
        (1, 1),
        (4, 2),
        (4, 3),
        (4, 4),
        (5, 5),
        (6, 6),
        (7, 7),
    ];
    assert_eq!(ids(late), wanted);
    let swapped = "[[fault]]\nwhat = \"swapped\"\nwhen = { nth = 3 }";
    let wanted = [
        (0, 0),
        (1, 1),
        (3, 3),
        (3, 2),
        (4, 4),
        (5, 5),
        (6, 6),
        (7, 7),
    ];
    assert_eq!(ids(swapped), wanted);
    // The last frame has no successor to swap places with.
    let last = "[[fault]]\nwhat = \"swapped\"\nby_ms = 0.0003\nwhen = { nth = 8 }";
    let mut wanted = well();
    wanted[7] = (10, 7);
    assert_eq!(ids(last), wanted);
}

#[test]
fn frames_are_torn_cut_and_flipped_with_their_identity() {
    let mut torn = faults("[[fault]]\nwhat = \"torn\"\nwhen = { nth = 3 }");
    assert_eq!(eight(&mut torn)[2], (200, 2, 1));
    let mut cut = faults("[[fault]]\nwhat = \"rows-missing\"\nrows = 1\nwhen = { nth = 3 }");
    assert_eq!(eight(&mut cut)[2], (200, 2, 0));
    let flip = "seed = 3\n[[fault]]\nwhat = \"bits-flipped\"\ncount = 9\nwhen = { nth = 3 }";
    let bytes = |text: &str| {
        let mut faults = faults(text);
        faults.exposures((0..3).map(exposure).collect(), 0, &pattern_images);
        for id in 0..3 {
            faults.frame(frame(id), 0);
        }
        let frames = std::iter::from_fn(|| faults.next_frame(0));
        frames.last().unwrap().data.clone()
    };
    let flipped = bytes(flip);
    let bits: u32 = flipped.iter().map(|b| (b ^ 2).count_ones()).sum();
    // Nine of 128 bits are drawn and inverted; two equal draws cancel.
    assert!(bits % 2 == 1 && bits <= 9, "{bits}");
    assert_eq!(flipped, bytes(flip));
    assert_ne!(flipped, bytes(&flip.replace("seed = 3", "seed = 4")));
}

#[test]
fn exposures_are_dark_partial_and_of_another_pattern() {
    let struck = |text: &str| {
        let mut faults = faults(text);
        let out = faults.exposures((0..8).map(exposure).collect(), 800, &pattern_images);
        assert_eq!(out[2], exposure(2), "{text}");
        let told: Vec<_> = faults.struck().map(|s| (s.frame, s.time_ns)).collect();
        assert_eq!(told, [(Some(3), 300)]);
        out[3].shot.clone()
    };
    let when = "when = { nth = 4 }";
    let dark = struck(&format!("[[fault]]\nwhat = \"dark\"\n{when}"));
    assert_eq!((dark.pattern_image, dark.light), (None, 0.0));
    for (offset, level) in [(1, 0), (-1, 2), (-4096, 3), (6, 1)] {
        let text = format!("[[fault]]\nwhat = \"wrong-pattern\"\noffset = {offset}\n{when}");
        let shot = struck(&text);
        assert_eq!(
            *shot.pattern_image.unwrap(),
            PatternImage::Uniform(level),
            "{offset}"
        );
        assert_eq!((shot.id, shot.pattern_index), (3, Some(3)));
    }
    let partial = format!("[[fault]]\nwhat = \"partial-exposure\"\nfraction = 0.25\n{when}");
    let shot = struck(&partial);
    assert_eq!((shot.light, shot.exposure_ns), (0.25, 50));
}

/// Asks the questions 100 ns apart. Returns the time and bytes of each reply.
fn ask(faults: &mut Faults, questions: &[&str]) -> Vec<(u64, Vec<u8>)> {
    let mut out = Vec::new();
    let mut now = 0;
    for question in questions {
        let line = format!("{question}\n");
        for incoming in faults.incoming(line.as_bytes(), now) {
            let (bytes, to) = match incoming {
                Incoming::Bytes(bytes) => (bytes, Some((*question).to_owned())),
                Incoming::Refused(_) => (b"refused\n".to_vec(), None),
            };
            let message = Message { bytes, to };
            faults.reply(message, now);
        }
        out.extend(faults.replies(now).into_iter().map(|bytes| (now, bytes)));
        now += 100;
    }
    while let Some(next) = faults.next_event_ns() {
        out.extend(faults.replies(next).into_iter().map(|bytes| (next, bytes)));
    }
    out
}

#[test]
fn replies_are_lost_late_doubled_and_refused() {
    let said = |text: &str| {
        let text = format!("[[fault]]\n{text}\nwhen = {{ command = \"b?\" }}");
        let out = ask(&mut faults(&text), &["A?", "B?", "C?"]).into_iter();
        out.map(|(now, bytes)| (now, String::from_utf8(bytes).unwrap()))
            .collect::<Vec<_>>()
    };
    let reply = |now: u64, text: &str| (now, format!("{text}\n"));
    let [a, b, c] = [reply(0, "A?"), reply(100, "B?"), reply(200, "C?")];
    assert_eq!(said("what = \"no-reply\""), [a.clone(), c.clone()]);
    assert_eq!(
        said("what = \"late-reply\"\nby_ms = 0.00025"),
        [a.clone(), reply(350, "B?"), reply(350, "C?")]
    );
    assert_eq!(
        said("what = \"reply-twice\""),
        [a.clone(), b.clone(), b, c.clone()]
    );
    assert_eq!(said("what = \"nak\""), [a, reply(100, "refused"), c]);
}

#[test]
fn adds_garbage_and_flips_bits_at_the_stated_place() {
    for (text, len) in [
        ("what = \"garbage-before\"\ncount = 5", 8),
        ("what = \"garbage-inside\"\ncount = 5", 8),
        ("what = \"bit-errors\"\ncount = 1", 3),
        ("what = \"bit-errors\"\nrate = 1.0", 3),
        ("what = \"bit-errors\"\ndirection = \"to-device\"", 3),
    ] {
        let text = format!("[[fault]]\n{text}\ntimes = 1");
        let out = ask(&mut faults(&text), &["A?", "B?"]);
        let [(_, first), (_, second)] = &out[..] else {
            panic!("{text}: {out:?}");
        };
        assert_eq!((first.len(), &second[..]), (len, &b"B?\n"[..]), "{text}");
        assert_ne!(first, b"A?\n", "{text}");
        if text.contains("before") {
            assert!(first.ends_with(b"A?\n"));
        } else if text.contains("inside") {
            assert!(first.starts_with(b"A") && first.ends_with(b"\n"));
        } else if text.contains("rate") {
            assert_eq!(first[..], b"A?\n".map(|byte| !byte));
        }
        assert_eq!(out, ask(&mut faults(&text), &["A?", "B?"]));
    }
}

#[test]
fn fault_strikes_a_message_that_arrives_in_pieces() {
    let mut faults = faults("[[fault]]\nwhat = \"nak\"\nwhen = { command = \"two\" }");
    let mut out = Vec::new();
    for piece in ["on", "e\ntw", "o", "\nthr"] {
        out.extend(faults.incoming(piece.as_bytes(), 1));
    }
    let first = Incoming::Bytes(b"one\n".to_vec());
    assert_eq!(out, [first, Incoming::Refused(Vec::new())]);
    assert!(faults.holds_back());
    assert_eq!(faults.input_stalled(), b"thr");
    assert!(!faults.holds_back());
}

#[test]
fn disconnected_port_returns_and_reset_device_reboots() {
    let gone = "[[fault]]\nwhat = \"disconnect\"\nfor_ms = 0.00015\nwhen = { command = \"B\" }";
    let mut faults = faults(gone);
    let out = ask(&mut faults, &["A?", "B?", "C?", "D?"]);
    let said: Vec<_> = out.iter().map(|(_, bytes)| &bytes[..]).collect();
    assert_eq!(said, [b"A?\n", b"D?\n"]);
    assert!(faults.take_broken() && !faults.take_broken());
    assert!(!faults.connected(249) && faults.connected(250));
    let log: Vec<_> = faults.struck().collect();
    assert_eq!((log.len(), log[0].what.as_str()), (1, "disconnect"));
    assert_eq!(log[0].command.as_deref(), Some("B?"));

    let mut faults = self::faults("[[fault]]\nwhat = \"reset\"\nwhen = { nth = 3 }");
    faults.exposures((0..5).map(exposure).collect(), 500, &pattern_images);
    assert!(faults.take_reset() && !faults.take_reset());
    for id in 0..7 {
        faults.frame(frame(id), 600);
    }
    // Frames exposed before the restart are lost; later frames are not.
    let left: Vec<_> = std::iter::from_fn(|| faults.next_frame(600)).collect();
    assert_eq!(left.iter().map(|f| f.id).collect::<Vec<_>>(), [5, 6]);
}

#[test]
fn faults_are_added_and_cleared_for_their_device_only() {
    let mut faults = faults(
        "[[fault]]\nwhat = \"dark\"\ndevice = \"right\"\n[[fault]]\nwhat = \"torn\"\ntimes = 1",
    );
    let ids = |faults: &Faults| faults.standing().map(|s| s.id).collect::<Vec<_>>();
    assert_eq!(ids(&faults), [2]);
    assert_eq!(faults.add(Fault::new(What::Nak)), Ok(3));
    let bad = Fault::new(What::Late { by_ms: -1.0 });
    assert_eq!(faults.add(bad).unwrap_err().field, "by_ms");
    let right = Fault {
        device: Some("right".into()),
        ..Fault::new(What::Nak)
    };
    let words = faults.add(right.clone()).unwrap_err().to_string();
    assert_eq!(words, "device: \"right\"; expected left");
    let left = Fault {
        device: Some("left".into()),
        ..right
    };
    assert_eq!(faults.add(left), Ok(4));
    assert!(faults.remove(4));
    eight(&mut faults);
    let standing: Vec<_> = faults.standing().map(|s| (s.id, s.struck)).collect();
    assert_eq!(standing, [(2, 1), (3, 0)]);
    assert!(faults.remove(3) && !faults.remove(3));
    for _ in 0..MAX_FAULTS - 1 {
        faults.add(Fault::new(What::Nak)).unwrap();
    }
    // Removing a fault makes room for another.
    faults.add(Fault::new(What::Nak)).unwrap();
    let full = faults.add(Fault::new(What::Nak)).unwrap_err();
    assert_eq!(full.allowed, "at most 1024 at a time");
    faults.clear();
    assert!(ids(&faults).is_empty());
    assert_eq!(faults.struck_in_all(), 1);
}

#[test]
fn a_row_that_the_camera_has_not_is_refused() {
    let torn = |row| Fault::new(What::Torn { row: Some(row) });
    let beyond = torn(480);
    let schedule = Schedule {
        seed: 1,
        fault: vec![Fault::new(What::Dark), beyond.clone()],
    };
    let flaw = Faults::new(&schedule, "left").of_rows(480).unwrap_err();
    assert_eq!(
        (flaw.field.as_str(), flaw.found.as_str()),
        ("fault[1].row", "480")
    );
    let mut faults = Faults::new(&Schedule::default(), "left")
        .of_rows(480)
        .unwrap();
    assert_eq!(faults.add(beyond).unwrap_err().field, "row");
    assert!(faults.add(torn(479)).is_ok());
}
