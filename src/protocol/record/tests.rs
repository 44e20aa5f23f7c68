//! Recordings that are intact, truncated, damaged, or too large for the disk.

use super::*;
use crate::PixelFormat;
use proptest::prelude::*;
use std::io::{self, Write};
use std::sync::mpsc;
use std::sync::{Mutex, PoisonError};

fn about() -> About {
    About {
        side: Side::Device,
        program: "phasmid 0".into(),
        started_unix_s: 1_700_000_000,
        name: "a,b,c,d".into(),
        control: "control".into(),
        camera: "socket:camera.sock".into(),
        profile: Some("p".into()),
        scene: None,
        seed: Some(7),
        monotonic_ns: None,
    }
}

fn frame(id: u64) -> Event {
    Event::Frame(Arc::new(Frame {
        id,
        pattern_index: (id > 3).then_some(5),
        width: 4,
        height: 3,
        format: PixelFormat::Y16,
        exposure_start_ns: 10 * id,
        exposure_end_ns: 10 * id + 4,
        data: (0..24).map(|i| (i * 31 + id) as u8).collect(),
    }))
}

/// Returns one event of each kind.
fn events() -> Vec<(u64, Channel, Event)> {
    vec![
        (5, Channel::Recording, Event::About(about())),
        (6, Channel::Control, Event::Opened),
        (7, Channel::Control, Event::Sent(b"*IDN?\n".to_vec())),
        (9, Channel::Control, Event::Received(b"a,b,c,d\n".to_vec())),
        (9, Channel::Camera, Event::Opened),
        (11, Channel::Camera, frame(3)),
        (12, Channel::Counted, frame(9)),
        (13, Channel::Usb, Event::Sent(vec![0, 255])),
        (14, Channel::Camera, Event::Note("a fault: dropped".into())),
        (15, Channel::Control, Event::Left),
        (
            15,
            Channel::Recording,
            Event::Cut("the disk is full".into()),
        ),
        (16, Channel::Recording, Event::End),
        (17, Channel::Control, Event::Unplugged),
        (18, Channel::Control, Event::Plugged),
    ]
}

fn encode(events: &[(u64, Channel, Event)]) -> Vec<u8> {
    let mut bytes = encode_head().to_vec();
    for ((time_ns, channel, event), number) in events.iter().zip(0..) {
        bytes.extend(encode_record(number, *time_ns, *channel, event));
    }
    bytes
}

type Read = (Vec<(u64, Channel, Event)>, Option<Damage>);

fn read(bytes: &[u8]) -> Result<Read, phasmid_core::error::Error> {
    let mut reader = Reader::new(bytes, "a file")?;
    let mut found = Vec::new();
    loop {
        match reader.read() {
            Ok(Some(record)) => found.push((record.time_ns, record.channel, record.event)),
            Ok(None) => return Ok((found, None)),
            Err(damage) => {
                assert_eq!(reader.read(), Ok(None), "damage is reported once");
                return Ok((found, Some(damage)));
            }
        }
    }
}

/// Returns the start offset of each record, and the length of the file.
fn offsets(events: &[(u64, Channel, Event)]) -> Vec<usize> {
    let ends = (0..=events.len()).map(|count| encode(&events[..count]).len());
    ends.collect()
}

#[test]
fn written_events_read_back_equal() {
    let events = events();
    assert_eq!(read(&encode(&events)).unwrap(), (events, None));
}

#[test]
fn a_file_cut_anywhere_gives_its_whole_records() {
    let events = events();
    let (bytes, offsets) = (encode(&events), offsets(&events));
    for len in 0..=bytes.len() {
        if len < HEAD_LEN {
            let error = read(&bytes[..len]).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{error}");
            continue;
        }
        let (found, damage) = read(&bytes[..len]).unwrap();
        let whole = offsets.iter().filter(|&&at| at <= len).count() - 1;
        assert_eq!(found, events[..whole], "{len}");
        let at = (!offsets.contains(&len)).then_some(offsets[whole] as u64);
        assert_eq!(damage.as_ref().map(|d| d.offset), at, "{len}");
        assert!(damage.is_none_or(|d| d.number == whole as u64 && d.what.contains("cut off")));
    }
}

#[test]
fn every_flipped_bit_is_found_at_its_record() {
    let events = events();
    let (sound, offsets) = (encode(&events), offsets(&events));
    for at in 0..sound.len() {
        let mut bytes = sound.clone();
        bytes[at] ^= 1 << (at % 8);
        let Ok((found, damage)) = read(&bytes) else {
            assert!(at < HEAD_LEN);
            continue;
        };
        let damaged = offsets.iter().filter(|&&start| start <= at).count() - 1;
        assert_eq!(found, events[..damaged], "{at}");
        let damage = damage.expect("the damage is reported");
        let place = (damaged as u64, offsets[damaged] as u64);
        assert_eq!((damage.number, damage.offset), place, "{damage}");
    }
}

#[test]
fn a_record_that_is_missing_is_noticed_and_unknown_kinds_are_skipped() {
    let events = events();
    let (bytes, offsets) = (encode(&events), offsets(&events));
    let without = [&bytes[..offsets[3]], &bytes[offsets[4]..]].concat();
    let (found, damage) = read(&without).unwrap();
    assert_eq!(found, events[..3]);
    let said = damage.unwrap().to_string();
    let want = format!("record 3 at byte {}: has number 4", offsets[3]);
    assert!(said.starts_with(&want), "{said}");
    // Give the first record the kind of a later version.
    let mut later = bytes;
    later[HEAD_LEN + 4] = 200;
    let crc = crc32fast::hash(&later[HEAD_LEN..HEAD_LEN + 32]);
    later[HEAD_LEN + 32..HEAD_LEN + 36].copy_from_slice(&crc.to_le_bytes());
    assert_eq!(read(&later).unwrap(), (events[1..].to_vec(), None));
    // Give the file an unsupported version.
    let mut head = encode_head();
    head[8] = 2;
    let crc = crc32fast::hash(&head[..12]);
    head[12..].copy_from_slice(&crc.to_le_bytes());
    let said = read(&head).unwrap_err().to_string();
    assert!(said.contains("version 2") && said.contains("expected version 1"));
}

proptest! {
    #[test]
    fn any_bytes_do_not_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..200),
        kind in 0..14_u16,
        at in 0..400_usize,
    ) {
        let _ = read(&bytes);
        let _ = read(&[&encode_head()[..], &bytes].concat());
        // A record with a correct checksum and arbitrary payload.
        let mut file = encode(&[(0, Channel::Control, Event::Sent(bytes.clone()))]);
        file[HEAD_LEN + 4..HEAD_LEN + 6].copy_from_slice(&kind.to_le_bytes());
        let crc = crc32fast::hash(&file[HEAD_LEN..HEAD_LEN + 32]);
        file[HEAD_LEN + 32..HEAD_LEN + 36].copy_from_slice(&crc.to_le_bytes());
        let _ = read(&file);
        let mut file = encode(&events());
        let at = at % file.len();
        file.splice(at..at, bytes);
        let _ = Reader::new(&file[..], "f").map(|mut reader| Summary::of(&mut reader));
    }
}

#[test]
fn texts_are_cut_to_the_readers_limit() {
    let long = "\u{e9}".repeat(MAX_TEXT);
    let wide = About {
        name: "\u{1}".repeat(MAX_TEXT),
        ..about()
    };
    let events = [
        (0, Channel::Recording, Event::About(wide)),
        (0, Channel::Recording, Event::Note(format!("x{long}"))),
    ];
    let (found, damage) = read(&encode(&events)).unwrap();
    assert_eq!(damage, None);
    assert!(matches!(&found[0].2, Event::About(about) if about.name.len() == 1000));
    assert!(matches!(&found[1].2, Event::Note(text) if text.len() == MAX_TEXT - 1));
}

/// An in-memory file that the test can read. It holds at most `room` bytes, and waits for a signal
/// before each write except the first.
struct Disk {
    bytes: Arc<Mutex<Vec<u8>>>,
    room: usize,
    go: Option<mpsc::Receiver<()>>,
    begun: bool,
}

impl Disk {
    fn new(room: usize, go: Option<mpsc::Receiver<()>>) -> (Self, Arc<Mutex<Vec<u8>>>) {
        let bytes = Arc::new(Mutex::new(Vec::new()));
        let disk = Self {
            bytes: bytes.clone(),
            room,
            go,
            begun: false,
        };
        (disk, bytes)
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if std::mem::replace(&mut self.begun, true)
            && let Some(go) = &self.go
        {
            // Returns immediately if the test has dropped the sender.
            let _ = go.recv();
        }
        let mut file = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        let len = bytes.len().min(self.room - file.len());
        if len == 0 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        file.extend_from_slice(&bytes[..len]);
        Ok(len)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Store for Disk {
    fn cut_back(&mut self, len: u64) -> io::Result<()> {
        let mut file = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        file.cut_back(len)
    }
}

fn start(disk: Disk, limits: Limits) -> (Recorder, mpsc::Receiver<String>) {
    let (tell, told) = mpsc::channel();
    let notice = move |text: &str| tell.send(text.to_owned()).unwrap();
    let recorder = Recorder::start(disk, "rec", about(), 5, limits, notice).unwrap();
    (recorder, told)
}

fn taken(bytes: &Mutex<Vec<u8>>) -> Vec<u8> {
    bytes.lock().unwrap().clone()
}

#[test]
fn recorder_writes_all_events_and_an_end_record() {
    let (disk, bytes) = Disk::new(usize::MAX, None);
    let (recorder, told) = start(disk, Limits::default());
    let events = &events()[..10];
    for (time_ns, channel, event) in &events[1..] {
        recorder.put(*time_ns, *channel, event.clone());
    }
    recorder.put(17, Channel::Control, Event::Sent(vec![1; MAX_BYTES + 1]));
    drop(recorder);
    let (found, damage) = read(&taken(&bytes)).unwrap();
    assert_eq!(damage, None);
    assert_eq!(found[..10], *events);
    let lens: Vec<_> = found[10..]
        .iter()
        .map(|f| f.2.bytes() - RECORD_LEN)
        .collect();
    assert_eq!(lens, [MAX_BYTES, 1, 0]);
    assert_eq!(found[12], (17, Channel::Recording, Event::End));
    assert!(told.try_recv().is_err(), "nothing to say");
}

#[test]
fn slow_disk_ends_the_recording_without_blocking() {
    let (go, wait) = mpsc::channel();
    let (disk, bytes) = Disk::new(usize::MAX, Some(wait));
    let limits = Limits {
        records: 10,
        bytes: 1 << 20,
    };
    let (recorder, told) = start(disk, limits);
    for time_ns in 0..1000 {
        recorder.put(time_ns, Channel::Control, Event::Sent(vec![7]));
    }
    drop(go);
    drop(recorder);
    let mut reader_bytes = &taken(&bytes)[..];
    let summary = Summary::of(&mut Reader::new(&mut reader_bytes, "f").unwrap());
    assert!((10..=11).contains(&summary.sent.count), "{summary:?}");
    assert!(matches!(&summary.ending, Ending::Cut(why) if why.contains("10 records")));
    let said: Vec<_> = told.try_iter().collect();
    assert!(said.len() == 1 && said[0].contains("rec: the recording ends"));
}

#[test]
fn full_disk_leaves_whole_records_and_is_reported_once() {
    let whole = encode(&events()[..1]).len();
    let (disk, bytes) = Disk::new(whole + 150, None);
    let (recorder, told) = start(disk, Limits::default());
    recorder.put(6, Channel::Control, Event::Sent(vec![7; 4]));
    recorder.put(7, Channel::Control, Event::Sent(vec![7; 200]));
    while told.try_recv().is_err() {
        std::thread::yield_now();
    }
    recorder.put(8, Channel::Control, Event::Sent(vec![7; 4]));
    drop(recorder);
    let file = taken(&bytes);
    let summary = Summary::of(&mut Reader::new(&file[..], "f").unwrap());
    assert_eq!(summary.sent, Kind { count: 1, bytes: 4 });
    assert!(matches!(&summary.ending, Ending::Cut(why) if why.contains("cannot be written")));
    assert!(told.try_recv().is_err(), "once");
}

#[test]
fn summary_counts_the_records() {
    let mut events = events();
    let file = encode(&events[..10]);
    let summary = Summary::of(&mut Reader::new(&file[..], "f").unwrap());
    assert_eq!(summary.about, Some(about()));
    assert_eq!((summary.records, summary.duration_ns), (10, 10));
    assert_eq!(summary.sent, Kind { count: 2, bytes: 8 });
    assert_eq!((summary.lines_sent, summary.received.bytes), (1, 8));
    assert_eq!(
        summary.frame,
        Kind {
            count: 2,
            bytes: 48
        }
    );
    let frames = &summary.frames;
    assert_eq!((frames.first_id, frames.last_id), (Some(3), Some(9)));
    assert_eq!((frames.out_of_order, frames.formats.len()), (1, 1));
    assert_eq!((summary.clients.control, summary.clients.camera), (1, 1));
    assert_eq!(summary.ending, Ending::Open);
    events.truncate(11);
    let mut file = encode(&events);
    file.extend(b"PHRR and so on");
    let cut = Summary::of(&mut Reader::new(&file[..], "f").unwrap());
    assert_eq!(cut.ending, Ending::Cut("the disk is full".into()));
    assert_eq!(cut.damaged_at, Some(file.len() as u64 - 14));
}

/// Returns the size in bytes of a Python `struct` format.
fn struct_len(format: &str) -> usize {
    let mut count = String::new();
    let mut len = 0;
    for c in format.trim_start_matches('<').chars() {
        let size = match c {
            '0'..='9' => {
                count.push(c);
                continue;
            }
            's' => 1,
            'H' => 2,
            'I' => 4,
            'Q' => 8,
            other => panic!("{other}"),
        };
        len += count.parse().unwrap_or(1) * size;
        count.clear();
    }
    len
}

#[test]
fn the_sizes_in_the_python_of_the_docs_are_right() {
    let script = include_str!("read.py");
    let formats: Vec<_> = script.split("unpack").skip(1).collect();
    let formats = formats.iter().map(|text| text.split('"').nth(1).unwrap());
    let formats: Vec<_> = formats.collect();
    assert_eq!(formats, ["<8sHHI", "<4sHHQQIII", "<QIII4s"]);
    assert_eq!(struct_len(formats[0]), HEAD_LEN);
    assert_eq!(struct_len(formats[1]), RECORD_LEN);
    for piece in [
        format!("file.read({HEAD_LEN})"),
        format!("file.read({RECORD_LEN})) == {RECORD_LEN}"),
        format!("zlib.crc32(head[:{}])", RECORD_LEN - 4),
        format!("length - {}", wire::HEADER_LEN),
    ] {
        assert!(script.contains(&piece), "{piece}");
    }
    for (_, _, event) in events() {
        let kind = format!("{event:?}").to_lowercase();
        let kind: String = kind.chars().take_while(char::is_ascii_alphabetic).collect();
        assert!(script.contains(&format!("{}: \"{kind}\"", event.code())));
    }
}
