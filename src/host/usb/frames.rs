//! Assembles the payloads of a video stream into frames (UVC 1.1, 2.4.3).

use phasmid_protocol::usb::uvc::payload;
use std::io::{self, Read};

/// Output of a stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Event {
    /// A complete frame.
    Frame(Vec<u8>),
    /// A damaged frame, with a description of the damage.
    Damaged(String),
}

/// Assembles frames.
#[derive(Debug)]
pub(super) struct Assembler {
    frame_len: usize,
    /// Maximum payload length in bytes, header included.
    max_payload: usize,
    data: Vec<u8>,
    /// Identifier bit (FID) of the frame being assembled or last completed.
    fid: Option<bool>,
    /// The last payload completed its frame.
    ended: bool,
    damage: Option<String>,
    /// Description of damage to the next frame, which was detected before that frame began.
    next_damage: Option<String>,
    /// Number of bytes and header bits of a payload that continues in the next transfer.
    open: Option<(usize, u8)>,
}

impl Assembler {
    pub(super) fn new(frame_len: usize, max_payload: usize) -> Self {
        Self {
            frame_len,
            max_payload,
            data: Vec::new(),
            fid: None,
            ended: true,
            damage: None,
            next_damage: None,
            open: None,
        }
    }

    /// Returns whether the next frame needs a buffer.
    pub(super) fn wants_buffer(&self) -> bool {
        self.data.capacity() == 0
    }

    /// Supplies a buffer for the next frame.
    pub(super) fn supply(&mut self, mut buffer: Vec<u8>) {
        buffer.clear();
        self.data = buffer;
    }

    /// Records that part of the stream was lost.
    pub(super) fn lose(&mut self, why: String) {
        self.open = None;
        let damage = match self.ended {
            true => &mut self.next_damage,
            false => &mut self.damage,
        };
        damage.get_or_insert(why);
    }

    /// Takes `len` bytes of a transfer with a capacity of `room` bytes: a whole payload, or part of
    /// one if the transfer is full and below the maximum payload length.
    ///
    /// # Errors
    /// Returns the errors of reading `from`.
    pub(super) fn take(
        &mut self,
        len: usize,
        room: usize,
        from: &mut dyn Read,
        out: &mut dyn FnMut(Event),
    ) -> io::Result<()> {
        let (before, bits, pixels) = match self.open.take() {
            Some((before, bits)) => (before, bits, len),
            None if len == 0 => return Ok(()),
            None => match self.header(len, from, out)? {
                Some((bits, pixels)) => (0, bits, pixels),
                None => return Ok(()),
            },
        };
        self.pixels(pixels, from)?;
        if len == room && before + len < self.max_payload {
            self.open = Some((before + len, bits));
        } else if bits & payload::EOF != 0 && !self.ended {
            self.finish(out);
        }
        Ok(())
    }

    /// Reads a payload header; returns its bits and the length of the data that follows.
    fn header(
        &mut self,
        len: usize,
        from: &mut dyn Read,
        out: &mut dyn FnMut(Event),
    ) -> io::Result<Option<(u8, usize)>> {
        let mut header = [0; 2];
        if len >= 2 {
            from.read_exact(&mut header)?;
        }
        let header_len = usize::from(header[0]);
        if header_len < payload::HEADER_LEN || header_len > len {
            self.lose(format!(
                "a payload of {len} bytes with a header of {header_len}"
            ));
            return Ok(None);
        }
        // Timestamp and source clock are not used.
        let mut rest = [0; 255];
        from.read_exact(&mut rest[2..header_len])?;
        let bits = header[1];
        let fid = bits & payload::FID != 0;
        let pixels = len - header_len;
        if self.fid != Some(fid) {
            if !self.ended {
                self.finish(out);
            }
            self.begin(fid);
        } else if self.ended && pixels > 0 {
            self.begin(fid);
            self.damage = Some("its identifier equals that of the previous frame".to_owned());
        }
        if bits & payload::ERR != 0 {
            self.damage
                .get_or_insert("the device reports an error in it".to_owned());
        }
        Ok(Some((bits, pixels)))
    }

    fn begin(&mut self, fid: bool) {
        self.fid = Some(fid);
        self.ended = false;
        self.data.clear();
        self.damage = self.next_damage.take();
    }

    fn pixels(&mut self, len: usize, from: &mut dyn Read) -> io::Result<()> {
        let have = self.data.len();
        if len > self.frame_len - have {
            let want = self.frame_len;
            self.damage
                .get_or_insert_with(|| format!("it has more than {want} bytes"));
        }
        if self.damage.is_some() {
            // The caller discards the data that remains unread on this return.
            return Ok(());
        }
        self.data.reserve_exact(self.frame_len - have);
        self.data.resize(have + len, 0);
        from.read_exact(&mut self.data[have..])
    }

    fn finish(&mut self, out: &mut dyn FnMut(Event)) {
        self.ended = true;
        let (have, want) = (self.data.len(), self.frame_len);
        let short = (have != want).then(|| format!("it has {have} of {want} bytes"));
        match self.damage.take().or(short) {
            Some(why) => {
                self.data.clear();
                out(Event::Damaged(why));
            }
            None => out(Event::Frame(std::mem::take(&mut self.data))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ROOM: usize = 8;

    /// Feeds transfers to an assembler of 10-byte frames.
    fn events(max_payload: usize, transfers: &[&[u8]]) -> Vec<Event> {
        let mut assembler = Assembler::new(10, max_payload);
        let mut events = Vec::new();
        for &(mut transfer) in transfers {
            let len = transfer.len();
            let mut out = |event| events.push(event);
            assembler.take(len, ROOM, &mut transfer, &mut out).unwrap();
        }
        events
    }

    fn damage(events: &[Event], at: usize) -> &str {
        match &events[at] {
            Event::Damaged(why) => why,
            Event::Frame(_) => panic!("{events:?}"),
        }
    }

    #[test]
    fn frames_end_by_mark_or_by_the_next_one() {
        let got = events(
            8,
            &[
                &[2, 0x80, 0, 1, 2, 3, 4, 5],
                &[],
                &[2, 0x82, 6, 7, 8, 9],
                // A header with a timestamp, and without the end-of-frame bit.
                &[6, 0x85, 1, 1, 1, 1, 9, 9],
                &[2, 0x81, 9, 9, 9, 9, 9, 9],
                &[2, 0x81, 9, 9],
                &[2, 0x80, 1],
                &[2, 0x82],
            ],
        );
        assert_eq!(got[0], Event::Frame((0..10).collect()));
        assert_eq!(got[1], Event::Frame(vec![9; 10]));
        assert!(damage(&got, 2).contains("1 of 10"));
        assert_eq!(got.len(), 3);
    }

    #[test]
    fn a_payload_may_take_several_transfers() {
        let got = events(
            12,
            &[
                &[2, 0x82, 0, 1, 2, 3, 4, 5],
                &[6, 7, 8, 9],
                &[2, 0x83, 0, 1, 2, 3, 4, 5],
                &[6, 7, 8, 9],
            ],
        );
        assert_eq!(got, vec![Event::Frame((0..10).collect()); 2]);
    }

    #[test]
    fn damage_is_reported_and_the_next_frame_is_whole() {
        let whole: [&[u8]; 2] = [&[2, 0x80, 0, 1, 2, 3, 4, 5], &[2, 0x82, 6, 7, 8, 9]];
        let bad: [(&[&[u8]], &str); 5] = [
            (&[&[2, 0xC1, 1], &[2, 0x83]], "reports an error"),
            (
                &[
                    &[2, 0x81, 1, 1, 1, 1, 1, 1],
                    &[2, 0x81, 1, 1, 1, 1, 1],
                    &[2, 0x83],
                ],
                "more than",
            ),
            (
                &[&[2, 0x81, 1], &[9, 0x81, 1], &[2, 0x83, 1]],
                "header of 9",
            ),
            (&[&[1], &[2, 0x83, 1]], "header of 0"),
            (&[&[2, 0x83]], "0 of 10"),
        ];
        for (transfers, why) in bad {
            let got = events(8, &[transfers, &whole[..]].concat());
            assert!(damage(&got, 0).contains(why), "{got:?}");
            assert_eq!(got[1..], [Event::Frame((0..10).collect())], "{why}");
        }
        // If the identifier never toggles, every frame except the first is damaged.
        let got = events(8, &[whole, whole, whole].concat());
        assert_eq!(got[0], Event::Frame((0..10).collect()));
        assert!(damage(&got, 1).contains("identifier") && damage(&got, 2).contains("identifier"));
    }

    #[test]
    fn loss_between_frames_marks_the_next_frame_damaged() {
        let mut assembler = Assembler::new(1, 8);
        let mut got = Vec::new();
        let mut out = |event| got.push(event);
        for (lost, bits) in [(false, 0x82), (true, 0x83), (false, 0x82)] {
            if lost {
                assembler.lose("gone".to_owned());
            }
            assembler
                .take(3, ROOM, &mut &[2, bits, 7][..], &mut out)
                .unwrap();
        }
        let frame = Event::Frame(vec![7]);
        assert_eq!(
            got,
            [frame.clone(), Event::Damaged("gone".to_owned()), frame]
        );
    }

    proptest! {
        #[test]
        fn any_payload_gives_only_whole_frames(transfers: Vec<Vec<u8>>, max_payload in 0usize..40) {
            let pieces: Vec<&[u8]> = transfers.iter().map(|t| &t[..t.len().min(ROOM)]).collect();
            for event in events(max_payload, &pieces) {
                if let Event::Frame(data) = event {
                    prop_assert_eq!(data.len(), 10);
                }
            }
        }
    }
}
