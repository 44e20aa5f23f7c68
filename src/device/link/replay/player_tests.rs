//! Clients that follow a recording, and clients that depart from it.

use super::super::ahead::MAX_AHEAD;
use super::*;
use phasmid_protocol::record::{Channel, Event, encode_head, encode_record};
use phasmid_protocol::{Frame, PixelFormat};
use std::sync::Arc;

const PORT: Channel = Channel::Control;

fn sent(text: &str) -> Event {
    Event::Sent(text.into())
}

fn received(text: &str) -> Event {
    Event::Received(text.into())
}

fn frame(id: u64) -> Arc<Frame> {
    Arc::new(Frame {
        id,
        pattern_index: None,
        width: 1,
        height: 1,
        format: PixelFormat::Grey,
        exposure_start_ns: 0,
        exposure_end_ns: 1,
        data: vec![7],
    })
}

fn file(events: &[(u64, Event)]) -> Vec<u8> {
    let mut bytes = encode_head().to_vec();
    for ((time_ns, event), number) in events.iter().zip(0..) {
        bytes.extend(encode_record(number, *time_ns, PORT, event));
    }
    bytes
}

fn player(events: &[(u64, Event)]) -> Player<std::io::Cursor<Vec<u8>>> {
    let bytes = std::io::Cursor::new(file(events));
    Player::new(Reader::new(bytes, "rec").unwrap(), false, None)
}

/// A recording of two clients, the first of which scans.
fn two_sessions() -> Vec<(u64, Event)> {
    vec![
        (100, Event::Opened),
        (100, sent("*IDN?\n")),
        (130, received("a,b\n")),
        (200, sent("INIT\n")),
        (205, sent("*TRG\n")),
        (300, Event::Frame(frame(1))),
        (400, Event::Frame(frame(2))),
        (500, Event::Left),
        (510, Event::Frame(frame(3))),
        (900, Event::Opened),
        (900, sent("*TST?\n")),
        (905, received("0\n")),
        (950, Event::Left),
        (960, Event::End),
    ]
}

fn outputs<R: Read>(player: &mut Player<R>, now_ns: u64) -> Vec<String> {
    std::iter::from_fn(|| player.next(now_ns))
        .map(|output| match output {
            Output::Bytes(bytes) => String::from_utf8(bytes).unwrap(),
            Output::Frame(frame) => format!("frame {}", frame.id),
            Output::Counted(frame, taken_ns) => format!("frame {} of {taken_ns}", frame.id),
            Output::Gone(End::Port) => "gone".to_owned(),
            Output::Back(End::Port) => "back".to_owned(),
            Output::Gone(End::Camera) => "camera gone".to_owned(),
            Output::Back(End::Camera) => "camera back".to_owned(),
        })
        .collect()
}

#[test]
fn matching_client_gets_replies_at_recorded_times() {
    let mut player = player(&two_sessions());
    assert_eq!(
        (player.next(u64::MAX), player.next_event_ns()),
        (None, None)
    );
    // The client sends the command in pieces, and much later than recorded.
    player.receive(b"*ID", 5000);
    assert_eq!(player.next_event_ns(), None);
    player.receive(b"N?\n", 5010);
    assert_eq!(player.next_event_ns(), Some(5040));
    assert_eq!(outputs(&mut player, 5039), [""; 0]);
    assert_eq!(outputs(&mut player, 5040), ["a,b\n"]);
    // The client sends at once what the recorded client sent with a pause.
    player.receive(b"INIT\n*TRG\n", 6000);
    assert_eq!(player.next_event_ns(), Some(6095));
    assert_eq!(outputs(&mut player, 6194), ["frame 1"]);
    assert_eq!(outputs(&mut player, 6195), ["frame 2"]);
    player.hang_up(7000);
    assert_eq!(outputs(&mut player, 7010), ["frame 3"]);
    // A client that only checks whether the port exists does not start a session.
    player.hang_up(7500);
    player.receive(b"*TST?\n", 8000);
    assert_eq!(outputs(&mut player, 8005), ["0\n"]);
    player.hang_up(8006);
    assert_eq!(player.news(), None);
    let want = Outcome {
        matched_bytes: 22,
        ..Outcome::default()
    };
    assert_eq!(player.finish(), want);
}

#[test]
fn a_client_that_sends_ahead_gets_all_in_order() {
    let mut player = player(&two_sessions());
    player.receive(b"*IDN?\nINIT\n*TRG\n", 1000);
    assert_eq!(outputs(&mut player, 1029), [""; 0]);
    assert_eq!(outputs(&mut player, 1200), ["a,b\n", "frame 1", "frame 2"]);
    // A client that disconnects early gets no more bytes, but other readers still get the frames.
    let mut player = self::player(&two_sessions());
    player.receive(b"*IDN?\nINIT\n*TRG\n", 1000);
    player.hang_up(1001);
    assert_eq!(
        outputs(&mut player, 2000),
        ["frame 1", "frame 2", "frame 3"]
    );
    let outcome = player.finish();
    assert_eq!((outcome.departures, outcome.missing_bytes), (0, 6));
}

#[test]
fn fast_replay_sends_replies_at_once() {
    let bytes = std::io::Cursor::new(file(&two_sessions()));
    let mut player = Player::new(Reader::new(bytes, "rec").unwrap(), true, None);
    player.receive(b"*IDN?\n", 7);
    assert_eq!(outputs(&mut player, 7), ["a,b\n"]);
}

#[test]
fn departure_is_reported_once_and_ends_with_the_client() {
    let mut player = player(&two_sessions());
    player.receive(b"*IDN?\nINIT:", 1000);
    player.receive(b"CONT ON\n", 1001);
    let said = player.news().unwrap();
    let want =
        "record 3 at 0.000000 s: expected \"INIT\\n\", but \"INIT:\", different from byte 4 on";
    assert!(said.ends_with(want), "{said}");
    player.receive(b"*IDN?\n", 1002);
    assert_eq!((outputs(&mut player, 9000), player.news()), (vec![], None));
    player.hang_up(9000);
    assert_eq!(outputs(&mut player, 9010), ["frame 3"]);
    player.receive(b"*TST?\n", 9100);
    assert_eq!(outputs(&mut player, 9105), ["0\n"]);
    player.receive(b"\x00\xff", 9106);
    let said = player.news().unwrap();
    let want = "record 12 at 0.000001 s: expected the client to leave, but 00 ff";
    assert!(said.ends_with(want), "{said}");
    player.hang_up(9200);
    player.receive(b"x", 9300);
    let said = player.news().unwrap();
    assert!(
        said.contains("the recording ends here, but \"x\""),
        "{said}"
    );
    let want = Outcome {
        departures: 3,
        // The matched bytes include "INIT" of "INIT\n".
        matched_bytes: 16,
        missing_bytes: 6,
    };
    assert_eq!(player.finish(), want);
}

#[test]
fn client_that_leaves_early_counts_as_departure() {
    let mut player = player(&two_sessions());
    player.receive(b"*IDN?\nIN", 1000);
    player.hang_up(1001);
    let said = player.news().unwrap();
    let want = "expected \"IT\\n\", but the client has left";
    assert!(said.ends_with(want), "{said}");
    player.receive(b"*TST?\n", 1002);
    assert_eq!(outputs(&mut player, 9105), ["frame 3", "0\n"]);
    assert_eq!(player.finish().departures, 1);
}

#[test]
fn frames_of_a_camera_recording_start_with_the_first_reader() {
    let mut player = player(&[
        (40, Event::Opened),
        (50, Event::Frame(frame(1))),
        (80, Event::Frame(frame(2))),
    ]);
    player.begin(1000);
    assert_eq!(player.next_event_ns(), Some(1010));
    assert_eq!(outputs(&mut player, 1039), ["frame 1"]);
    assert_eq!(outputs(&mut player, 1040), ["frame 2"]);
    player.begin(1050);
    assert_eq!(player.finish(), Outcome::default());
}

#[test]
fn plays_records_before_damage_and_reports_it() {
    let mut bytes = file(&two_sessions()[..3]);
    bytes.truncate(bytes.len() - 1);
    let cursor = std::io::Cursor::new(bytes);
    let mut player = Player::new(Reader::new(cursor, "rec").unwrap(), false, None);
    player.receive(b"*IDN?\n", 0);
    let said = player.news().unwrap();
    assert!(
        said.contains("damaged and ends here: record 2 at byte"),
        "{said}"
    );
    let mut player = self::player(&[(1, sent("x")), (2, Event::Cut("disk full".into()))]);
    player.receive(b"x", 0);
    assert!(player.news().unwrap().contains("disk full"));
}

#[test]
fn read_ahead_is_bounded() {
    let frames = (0..2000).map(|id| (id, Event::Frame(frame(id))));
    let events: Vec<_> = frames
        .chain([(2000, sent("x")), (2001, received("y"))])
        .collect();
    let mut player = player(&events);
    player.receive(b"x", 0);
    assert_eq!(player.ahead.len(), MAX_AHEAD.0);
    assert!(player.listens());
    player.receive(&[b'x'; MAX_INPUT], 0);
    assert!(!player.listens(), "bytes wait to be compared");
    let mut count = 0;
    while player.next(5000).is_some() {
        count += 1;
        assert!(player.ahead.len() <= MAX_AHEAD.0);
    }
    // The client's bytes after the reply exceed the limit before the last frames are due.
    assert!(count >= 2000 - MAX_AHEAD.0, "{count}");
    assert!(
        player
            .news()
            .unwrap()
            .contains("the recording ends here, but \"xxx")
    );
}

#[test]
fn recorded_unplugging_of_the_port_is_replayed() {
    let events = [
        (10, sent("x")),
        (12, Event::Unplugged),
        (22, Event::Plugged),
        (40, sent("y")),
        (41, received("z")),
    ];
    let mut player = player(&events);
    player.receive(b"x", 100);
    assert_eq!(outputs(&mut player, 102), ["gone"]);
    assert!(player.listens(), "a new client may connect");
    assert_eq!(outputs(&mut player, 112), ["back"]);
    player.receive(b"y", 200);
    assert_eq!(outputs(&mut player, 201), ["z"]);
    assert_eq!(player.finish().missing_bytes, 0);
    // The port also reconnects for a client that departed from the recording.
    let mut player = self::player(&events);
    player.receive(b"x", 100);
    assert_eq!(outputs(&mut player, 102), ["gone"]);
    player.receive(b"q", 103);
    assert_eq!(player.news().map(|_| ()), Some(()));
    assert_eq!(outputs(&mut player, 112), ["back"]);
}

#[test]
fn recorded_unplugging_of_the_camera_is_replayed() {
    let camera = Channel::Camera;
    let events = [
        (10, PORT, sent("x")),
        (11, camera, Event::Frame(frame(1))),
        (12, camera, Event::Unplugged),
        (15, PORT, sent("y")),
        (16, PORT, received("z")),
        (22, camera, Event::Plugged),
        (40, PORT, Event::Left),
    ];
    let mut bytes = encode_head().to_vec();
    for ((time_ns, channel, event), number) in events.iter().zip(0..) {
        bytes.extend(encode_record(number, *time_ns, *channel, event));
    }
    let reader = Reader::new(std::io::Cursor::new(bytes), "rec").unwrap();
    let mut player = Player::new(reader, false, None);
    player.receive(b"x", 100);
    assert_eq!(outputs(&mut player, 104), ["frame 1", "camera gone"]);
    // The port and its client remain connected.
    player.receive(b"y", 105);
    assert_eq!(outputs(&mut player, 110), ["z"]);
    assert_eq!(outputs(&mut player, 112), ["camera back"]);
    player.hang_up(130);
    assert_eq!(player.news(), None);
    assert_eq!(
        player.finish(),
        Outcome {
            matched_bytes: 2,
            ..Outcome::default()
        }
    );
}

#[test]
fn input_while_the_port_is_unplugged_is_lost() {
    let events = [
        (10, sent("x")),
        (11, received("a")),
        (12, sent("y")),
        (14, Event::Unplugged),
        (22, Event::Plugged),
        (40, sent("z")),
        (41, received("b")),
    ];
    // The recorded client was interrupted after y; the client of the replay has not noticed that
    // yet.
    let mut player = player(&events);
    player.receive(b"xyq", 100);
    assert_eq!(outputs(&mut player, 102), ["a", "gone"]);
    assert_eq!(outputs(&mut player, 110), ["back"]);
    player.receive(b"z", 200);
    assert_eq!(outputs(&mut player, 201), ["b"]);
    assert_eq!(player.news(), None);
    assert_eq!(player.finish().departures, 0);
    // In this recording the client sends nothing after an answer.
    let mut player = self::player(&[&events[..2], &events[3..]].concat());
    player.receive(b"xq", 100);
    assert!(player.news().unwrap().contains("the client to leave"));
}

#[test]
fn counted_frames_keep_their_delay_after_the_command() {
    let counted = |id: u64, taken_ns: u64| {
        let frame = Frame {
            exposure_end_ns: taken_ns,
            ..Frame::clone(&frame(id))
        };
        Event::Frame(Arc::new(frame))
    };
    let events = [
        (100, PORT, sent("x")),
        (130, Channel::Counted, counted(1, 5090)),
        (140, Channel::Counted, counted(2, 5125)),
        (150, Channel::Counted, counted(3, 7)),
    ];
    let mut bytes = encode_head().to_vec();
    for ((time_ns, channel, event), number) in events.iter().zip(0..) {
        bytes.extend(encode_record(number, *time_ns, *channel, event));
    }
    let reader = Reader::new(std::io::Cursor::new(bytes), "rec").unwrap();
    let mut player = Player::new(reader, false, Some(5000));
    player.receive(b"x", 1000);
    // The frames were taken before the client's bytes, after them, and at an implausible time.
    let want = ["frame 1 of 990", "frame 2 of 1025", "frame 3 of 1050"];
    assert_eq!(outputs(&mut player, 1050), want);
}
