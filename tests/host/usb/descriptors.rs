//! Checks every descriptor against the specifications: lengths, totals and cross-references. An
//! independent parser reads them according to USB 2.0 (chapter 9), USB 3.2 (9.6), UVC 1.1 (chapter
//! 3), CDC 1.2 (5.2) and PSTN 1.2 (5.3).

use crate::usb::served::{HEIGHT, Served, WIDTH};
use phasmid::host::usb::UsbDevice;
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::usb::{Setup, request};
use std::collections::BTreeSet;

fn get(device: &UsbDevice, kind: u16, number: u16, length: u16) -> Vec<u8> {
    let get = request::GET_DESCRIPTOR;
    device
        .get(Setup::STANDARD_IN, get, kind << 8 | number, 0, length)
        .unwrap()
}

fn u16_at(bytes: &[u8], at: usize) -> usize {
    usize::from(bytes[at]) | usize::from(bytes[at + 1]) << 8
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u16_at(bytes, at) | u16_at(bytes, at + 2) << 16
}

/// Splits a sequence into descriptors; each length must lead to the next one.
fn cut(mut bytes: &[u8]) -> Vec<&[u8]> {
    let mut pieces = Vec::new();
    while !bytes.is_empty() {
        let len = usize::from(bytes[0]);
        assert!(
            (2..=bytes.len()).contains(&len),
            "length {len} of {}",
            bytes.len()
        );
        let (piece, rest) = bytes.split_at(len);
        pieces.push(piece);
        bytes = rest;
    }
    pieces
}

/// State collected while walking over a configuration.
struct Checker {
    superspeed: bool,
    strings: BTreeSet<u8>,
    /// For each interface: number, setting, class triple, number of endpoints declared, and number
    /// of endpoints found.
    interfaces: Vec<(u8, u8, [u8; 3], u8, u8)>,
    endpoints: BTreeSet<(u8, u8)>,
    companion_due: bool,
    /// First interface and number of interfaces of each association.
    functions: Vec<(u8, u8)>,
}

impl Checker {
    fn standard(&mut self, d: &[u8]) {
        match d[1] {
            4 => {
                assert_eq!(d.len(), 9);
                self.strings.insert(d[8]);
                self.interfaces
                    .push((d[2], d[3], [d[5], d[6], d[7]], d[4], 0));
            }
            5 => self.endpoint(d),
            0x30 => {
                assert_eq!(d.len(), 6);
                assert!(self.companion_due, "a companion without an endpoint");
                self.companion_due = false;
                assert!(d[2] <= 15, "burst");
            }
            11 => {
                assert_eq!(d.len(), 8);
                self.strings.insert(d[7]);
                self.functions.push((d[2], d[3]));
            }
            0x24 => {}
            other => panic!("descriptor type {other:#x}"),
        }
        assert!(
            d[1] == 5 || !self.companion_due,
            "an endpoint without its companion"
        );
    }

    fn endpoint(&mut self, d: &[u8]) {
        assert_eq!(d.len(), 7);
        let interface = self.interfaces.last_mut().unwrap();
        interface.4 += 1;
        assert!(
            self.endpoints.insert((d[2], interface.1)),
            "endpoint {:#x} twice",
            d[2]
        );
        assert!(d[2] & 0x70 == 0 && d[2] & 0x0F != 0);
        let packet = u16_at(d, 4);
        match (d[3] & 3, self.superspeed) {
            (2, false) => assert_eq!(packet, 512),
            (2, true) => assert_eq!(packet, 1024),
            (1, _) => {
                assert!(packet & 0x7FF <= 1024 && packet >> 11 <= 2 && d[6] == 1);
                assert_eq!(d[3] >> 2 & 3, 1, "video is asynchronous");
                assert_eq!(
                    interface.1, 1,
                    "only settings other than 0 reserve bandwidth"
                );
            }
            (3, _) => assert!(packet <= 1024 && (1..=16).contains(&d[6])),
            _ => panic!("a control endpoint"),
        }
        self.companion_due = self.superspeed;
    }

    fn finish(&self, count: u8) {
        assert!(!self.companion_due);
        let numbers: BTreeSet<u8> = self.interfaces.iter().map(|i| i.0).collect();
        assert_eq!(numbers, (0..count).collect(), "numbered from 0");
        for (number, setting, _, told, has) in &self.interfaces {
            assert_eq!(
                told, has,
                "endpoints of interface {number}, setting {setting}"
            );
        }
        let mut covered = BTreeSet::new();
        for &(first, count) in &self.functions {
            for number in first..first + count {
                assert!(
                    covered.insert(number),
                    "interface {number} in two functions"
                );
            }
        }
        assert_eq!(covered, numbers);
    }
}

/// Returns the class-specific descriptors of one interface after its header, and the total length
/// that the header declares.
fn class_total(pieces: &[&[u8]], number: u8) -> (Vec<Vec<u8>>, usize) {
    let begin = pieces
        .iter()
        .position(|d| d[1] == 4 && d[2] == number && d[3] == 0)
        .unwrap();
    let own: Vec<Vec<u8>> = pieces[begin + 1..]
        .iter()
        .take_while(|d| d[1] == 0x24)
        .map(|d| d.to_vec())
        .collect();
    let total = own.iter().map(Vec::len).sum();
    (own, total)
}

fn check_video(pieces: &[&[u8]], transfer: Transfer) {
    let (control, total) = class_total(pieces, 0);
    let header = &control[0];
    assert_eq!(
        (header.len(), header[2]),
        (13, 1),
        "one streaming interface"
    );
    assert_eq!(u16_at(header, 3), 0x0110);
    assert_eq!(u16_at(header, 5), total);
    assert_eq!(header[11..], [1, 1]);
    let mut entities = BTreeSet::new();
    for entity in &control[1..] {
        assert!(
            entity[3] != 0 && entities.insert(entity[3]),
            "entity {}",
            entity[3]
        );
    }
    for entity in &control[1..] {
        let sources: &[u8] = match entity[2] {
            2 => {
                assert_eq!(u16_at(entity, 4), 0x0201, "a camera");
                assert_eq!(entity.len(), 15 + usize::from(entity[14]));
                &[]
            }
            3 => {
                assert_eq!(
                    (entity.len(), u16_at(entity, 4)),
                    (9, 0x0101),
                    "streams over USB"
                );
                &entity[7..8]
            }
            5 => {
                // UVC 1.1 has the field bmVideoStandards after iProcessing.
                assert_eq!(entity.len(), 10 + usize::from(entity[7]));
                &entity[4..5]
            }
            other => panic!("entity of subtype {other}"),
        };
        assert!(sources.iter().all(|source| entities.contains(source)));
    }
    check_streaming(pieces, transfer, &control);
}

fn check_streaming(pieces: &[&[u8]], transfer: Transfer, control: &[Vec<u8>]) {
    let (streaming, total) = class_total(pieces, 1);
    let header = &streaming[0];
    let formats = usize::from(header[3]);
    assert_eq!((header[2], header[12]), (1, 1));
    assert_eq!(header.len(), 13 + formats);
    assert_eq!(u16_at(header, 4), total);
    let output = control.iter().find(|d| d[2] == 3).unwrap();
    assert_eq!(
        header[8], output[3],
        "the stream comes from the output terminal"
    );
    let own = |kind| {
        pieces
            .iter()
            .any(|d| d[1] == 5 && d[2] == header[6] && d[3] & 3 == kind)
    };
    assert!(own(if transfer == Transfer::Bulk { 2 } else { 1 }));
    let mut rest = &streaming[1..];
    for number in 1..=formats as u8 {
        let [format, frame, color, behind @ ..] = rest else {
            panic!("{} descriptors for format {number}", rest.len());
        };
        rest = behind;
        assert_eq!(
            (format.len(), format[2], format[3], format[4]),
            (27, 4, number, 1)
        );
        assert_eq!(
            &format[9..21],
            b"\x00\x00\x10\x00\x80\x00\x00\xAA\x00\x38\x9B\x71"
        );
        let bits = match &format[5..9] {
            b"Y800" => 8,
            b"Y16 " | b"YUY2" => 16,
            other => panic!("{other:?}"),
        };
        assert_eq!((usize::from(format[21]), format[22]), (bits, 1));
        assert_eq!((frame[2], frame[3]), (5, 1));
        assert_eq!(
            (u16_at(frame, 5), u16_at(frame, 7)),
            (WIDTH as usize, HEIGHT as usize)
        );
        let bytes = WIDTH as usize * HEIGHT as usize * bits / 8;
        assert_eq!(u32_at(frame, 17), bytes);
        let count = usize::from(frame[25]);
        assert_eq!(frame.len(), 26 + 4 * count);
        let intervals: Vec<usize> = (0..count).map(|i| u32_at(frame, 26 + 4 * i)).collect();
        assert!(intervals.is_sorted() && intervals[0] > 0);
        assert!(intervals.contains(&u32_at(frame, 21)));
        let rate = |interval: usize| bytes as f64 * 8e7 / interval as f64;
        for (at, interval) in [(9, intervals[count - 1]), (13, intervals[0])] {
            let told = u32_at(frame, at) as f64;
            assert!((told - rate(interval)).abs() <= 1.0, "bit rate {told}");
        }
        assert_eq!((color.len(), color[2]), (6, 13));
    }
    assert!(rest.is_empty());
}

fn check_serial(pieces: &[&[u8]]) {
    let (control, _) = class_total(pieces, 2);
    let lengths: Vec<(u8, usize)> = control.iter().map(|d| (d[2], d.len())).collect();
    assert_eq!(lengths[0], (0, 5), "the header comes first");
    assert_eq!(lengths.len(), 4);
    for wanted in [(1, 5), (2, 4), (6, 5)] {
        assert!(lengths.contains(&wanted), "{wanted:?}");
    }
    let find = |subtype| control.iter().find(|d| d[2] == subtype).unwrap();
    assert_eq!(find(6)[3..], [2, 3], "the union: control, data");
    assert_eq!(find(1)[4], 3);
    assert_eq!(find(2)[3] & 0x06, 0x06, "line coding and break");
}

fn check(speed: Speed, transfer: Transfer) {
    let served = Served::new(speed, transfer);
    let device = served.open();
    let superspeed = speed == Speed::Super;
    let own = get(&device, 1, 0, 255);
    assert_eq!((own.len(), own[0], own[1]), (18, 18, 1));
    assert_eq!(
        own[4..7],
        [0xEF, 2, 1],
        "a device with interface associations"
    );
    assert_eq!(u16_at(&own, 2), if superspeed { 0x0300 } else { 0x0200 });
    assert_eq!(own[7], if superspeed { 9 } else { 64 });
    assert_eq!(own[17], 1, "one configuration");
    let whole = get(&device, 2, 0, u16::MAX);
    assert_eq!(u16_at(&whole, 2), whole.len());
    assert_eq!(
        get(&device, 2, 0, 9),
        whole[..9],
        "no more bytes than requested"
    );
    let pieces = cut(&whole);
    let head = pieces[0];
    assert_eq!((head.len(), head[1], head[4]), (9, 2, 4));
    assert!(head[5] != 0 && head[7] & 0x80 != 0);
    let mut checker = Checker {
        superspeed,
        strings: [own[14], own[15], own[16], head[6]].into(),
        interfaces: Vec::new(),
        endpoints: BTreeSet::new(),
        companion_due: false,
        functions: Vec::new(),
    };
    for piece in &pieces[1..] {
        checker.standard(piece);
    }
    checker.finish(head[4]);
    let classes: Vec<[u8; 2]> = checker
        .interfaces
        .iter()
        .map(|i| [i.2[0], i.2[1]])
        .collect();
    for wanted in [[14, 1], [14, 2], [2, 2], [10, 0]] {
        assert!(classes.contains(&wanted), "{wanted:?}");
    }
    check_video(&pieces, transfer);
    check_serial(&pieces);
    assert_eq!(get(&device, 3, 0, 255), [4, 3, 9, 4], "English");
    for number in checker.strings.into_iter().filter(|number| *number != 0) {
        let string = get(&device, 3, number.into(), 255);
        assert!(
            string.len() > 2 && string.len().is_multiple_of(2),
            "string {number}"
        );
        assert_eq!((usize::from(string[0]), string[1]), (string.len(), 3));
    }
    if superspeed {
        let bos = get(&device, 15, 0, 255);
        assert_eq!((bos[0], u16_at(&bos, 2)), (5, bos.len()));
        let capabilities = cut(&bos[5..]);
        assert_eq!(capabilities.len(), usize::from(bos[4]));
        let kinds: Vec<(usize, u8, u8)> =
            capabilities.iter().map(|c| (c.len(), c[1], c[2])).collect();
        assert!(
            kinds.contains(&(7, 16, 2)) && kinds.contains(&(10, 16, 3)),
            "{kinds:?}"
        );
        assert_eq!(device.capabilities(), bos);
    } else {
        let qualifier = get(&device, 6, 0, 255);
        assert_eq!((qualifier.len(), qualifier[1]), (10, 6));
        assert_eq!(qualifier[4..7], own[4..7]);
        assert_eq!(qualifier[8], 1, "a configuration at full speed");
        check_other_speed(&get(&device, 7, 0, u16::MAX), &pieces);
    }
    let said = device.identity();
    assert_eq!((said.vendor_id, said.product_id), (0x1209, 1));
    assert!(
        said.serial
            .as_ref()
            .is_some_and(|serial| !serial.is_empty())
    );
}

/// Checks that the full-speed configuration equals the high-speed one except for its type, total
/// length and endpoints.
fn check_other_speed(whole: &[u8], high: &[&[u8]]) {
    assert_eq!(u16_at(whole, 2), whole.len());
    let full = cut(whole);
    assert_eq!(full.len(), high.len());
    assert_eq!(full[0][1], 7);
    assert_eq!(full[0][4..], high[0][4..]);
    for (full, high) in full[1..].iter().zip(&high[1..]) {
        if full[1] != 5 {
            assert_eq!(full, high);
            continue;
        }
        assert_eq!(full[..4], high[..4]);
        // Limits of USB 2.0, 5.6.3, 5.7.3 and 5.8.3.
        match full[3] & 3 {
            1 => assert!(u16_at(full, 4) <= 1023 && full[6] == 1),
            2 => assert_eq!(u16_at(full, 4), 64),
            // The interval is in milliseconds at full speed, and an exponent (a power of two of 125
            // us) at high speed.
            3 => {
                assert!(u16_at(full, 4) <= 64);
                assert_eq!(u32::from(full[6]) * 8, 1 << (high[6] - 1));
            }
            _ => panic!("a control endpoint"),
        }
    }
}

#[test]
fn descriptors_are_valid_for_high_speed_bulk() {
    check(Speed::High, Transfer::Bulk);
}

#[test]
fn descriptors_are_valid_for_high_speed_isochronous() {
    check(Speed::High, Transfer::Isochronous);
}

#[test]
fn descriptors_are_valid_for_superspeed_bulk() {
    check(Speed::Super, Transfer::Bulk);
}

#[test]
fn descriptors_are_valid_for_superspeed_isochronous() {
    check(Speed::Super, Transfer::Isochronous);
}
