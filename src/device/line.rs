//! The serial line in device time. A byte takes its start bit, data, parity and stop bits at the
//! line's baud rate; bytes sent together follow each other without a gap, independently in each
//! direction. Times are exact: n bytes of a burst take ceil(n * bits * 1e9 / baud) nanoseconds.

use phasmid_profile::Control;
use std::collections::VecDeque;

/// Number of bytes in transit to the device at which senders must start to wait: the buffer size of
/// a UART driver.
const CROWDED_TO_DEVICE: usize = 1 << 10;
/// Number of bytes in transit to the client at which the device stops reading.
const CROWDED_TO_HOST: usize = 64 << 10;
/// Maximum number of bytes in transit to the client; a message beyond it is lost.
const MAX_TO_HOST: usize = 1 << 20;
/// Bytes to the client that arrive within this time are delivered together unless a message ends
/// earlier, because a host driver does not wake its program for every byte.
const TOGETHER_NS: u64 = 1_000_000;

/// Transmission time of one byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ByteTime {
    half_bits: u32,
    baud: u32,
}

impl ByteTime {
    /// Returns the number of nanoseconds that `bytes` bytes take.
    fn after(time: Option<Self>, bytes: u64) -> u64 {
        let Some(Self { half_bits, baud }) = time else {
            return 0;
        };
        let half_bits = u128::from(bytes) * u128::from(half_bits) * 1_000_000_000;
        let ns = half_bits.div_ceil(2 * u128::from(baud));
        u64::try_from(ns).unwrap_or(u64::MAX)
    }

    /// Returns the number of bytes transmitted within `ns` nanoseconds.
    fn within(time: Option<Self>, ns: u64) -> u64 {
        let Some(Self { half_bits, baud }) = time else {
            return u64::MAX;
        };
        let bytes = u128::from(ns) * 2 * u128::from(baud) / (u128::from(half_bits) * 1_000_000_000);
        u64::try_from(bytes).unwrap_or(u64::MAX)
    }
}

/// Bytes that follow each other without a gap.
#[derive(Debug, Default)]
struct Burst {
    start_ns: u64,
    bytes: VecDeque<u8>,
    /// Number of bytes of the burst that have been taken.
    taken: u64,
    /// Byte counts at which a message of the burst ends.
    ends: VecDeque<u64>,
}

impl Burst {
    fn total(&self) -> u64 {
        self.taken + self.bytes.len() as u64
    }
}

/// One direction of the line.
#[derive(Debug, Default)]
struct Way {
    bursts: VecDeque<Burst>,
    len: usize,
}

impl Way {
    fn put(&mut self, bytes: &[u8], now_ns: u64, time: Option<ByteTime>) {
        if bytes.is_empty() {
            return;
        }
        // If the wire is still busy, these bytes continue its last burst.
        let busy = self.bursts.back().is_some_and(|burst| {
            let lasts = ByteTime::after(time, burst.total());
            now_ns < burst.start_ns.saturating_add(lasts)
        });
        if !busy {
            self.bursts.push_back(Burst {
                start_ns: now_ns,
                ..Burst::default()
            });
        }
        if let Some(burst) = self.bursts.back_mut() {
            burst.bytes.extend(bytes);
            burst.ends.push_back(burst.total());
        }
        self.len += bytes.len();
    }

    /// Takes the bytes that have arrived. A burst whose last byte has not arrived stays queued, so
    /// that following bytes join it without a gap.
    fn take(&mut self, now_ns: u64, time: Option<ByteTime>) -> Vec<u8> {
        let mut out = Vec::new();
        while let Some(burst) = self.bursts.front_mut() {
            let Some(passed_ns) = now_ns.checked_sub(burst.start_ns) else {
                break;
            };
            let through = ByteTime::within(time, passed_ns).min(burst.total());
            let count = usize::try_from(through - burst.taken).unwrap_or(usize::MAX);
            out.extend(burst.bytes.drain(..count));
            burst.taken = through;
            while burst.ends.front().is_some_and(|&end| end <= through) {
                burst.ends.pop_front();
            }
            if !burst.bytes.is_empty() {
                break;
            }
            self.bursts.pop_front();
        }
        self.len -= out.len();
        out
    }

    /// Arrival time of the next byte.
    fn next_ns(&self, time: Option<ByteTime>) -> Option<u64> {
        let burst = self.bursts.front()?;
        let lasts = ByteTime::after(time, burst.taken + 1);
        Some(burst.start_ns.saturating_add(lasts))
    }

    /// Arrival time of the last byte of the next group that is delivered together.
    fn next_together_ns(&self, time: Option<ByteTime>) -> Option<u64> {
        let burst = self.bursts.front()?;
        let end = *burst.ends.front()?;
        let lasts = ByteTime::after(time, burst.taken + 1).saturating_add(TOGETHER_NS);
        let count = ByteTime::within(time, lasts).min(end);
        let lasts = ByteTime::after(time, count);
        Some(burst.start_ns.saturating_add(lasts))
    }
}

/// Bytes in transit in both directions. The default line has no delay.
#[derive(Debug, Default)]
pub struct SerialLine {
    time: Option<ByteTime>,
    /// Mask of the bits of each byte that the line does not carry.
    lost: u8,
    to_device: Way,
    to_host: Way,
}

impl SerialLine {
    /// Returns the line of a profile. Without a baud rate it has no delay and carries 8-bit bytes.
    pub fn new(control: &Control) -> Self {
        Self {
            time: control.baud.map(|baud| ByteTime {
                half_bits: control.half_bits(),
                baud,
            }),
            lost: match control.data_bits {
                7 => 0x80,
                _ => 0,
            },
            ..Self::default()
        }
    }

    /// Puts a client's bytes on the line.
    pub fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.to_device.put(bytes, now_ns, self.time);
    }

    /// Takes the bytes that have reached the device.
    pub fn received(&mut self, now_ns: u64) -> Vec<u8> {
        let bytes = self.to_device.take(now_ns, self.time);
        self.carried(bytes)
    }

    /// Returns when the next byte reaches the device.
    pub fn next_received_ns(&self) -> Option<u64> {
        self.to_device.next_ns(self.time)
    }

    /// Puts a message of the device on the line. Returns `false` if the message is lost because too
    /// many bytes are in transit.
    pub fn send(&mut self, bytes: &[u8], now_ns: u64) -> bool {
        if self.to_host.len > 0 && self.to_host.len + bytes.len() > MAX_TO_HOST {
            return false;
        }
        self.to_host.put(bytes, now_ns, self.time);
        true
    }

    /// Takes the bytes that have reached the client.
    pub fn sent(&mut self, now_ns: u64) -> Vec<u8> {
        let bytes = self.to_host.take(now_ns, self.time);
        self.carried(bytes)
    }

    fn carried(&self, mut bytes: Vec<u8>) -> Vec<u8> {
        if self.lost != 0 {
            bytes.iter_mut().for_each(|byte| *byte &= !self.lost);
        }
        bytes
    }

    /// Discards all bytes in transit.
    pub fn clear(&mut self) {
        self.to_device = Way::default();
        self.to_host = Way::default();
    }

    /// Returns whether enough bytes are in transit that senders should wait.
    pub fn crowded(&self) -> bool {
        self.to_device.len >= CROWDED_TO_DEVICE || self.to_host.len >= CROWDED_TO_HOST
    }

    /// Returns the time of the next arrival at either end. Bytes to the client that arrive within a
    /// millisecond count as one arrival, at the time of the last byte; the end of a message always
    /// counts as an arrival.
    pub fn next_event_ns(&self) -> Option<u64> {
        let to_host = self.to_host.next_together_ns(self.time);
        self.next_received_ns().into_iter().chain(to_host).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn line(baud: u32) -> SerialLine {
        SerialLine::new(&Control {
            baud: Some(baud),
            ..Control::default()
        })
    }

    /// Closed form of the transmission time with 8 data bits, no parity and 1 stop bit.
    fn ns(bytes: u64, baud: u32) -> u64 {
        (u128::from(bytes) * 10 * 1_000_000_000).div_ceil(u128::from(baud)) as u64
    }

    #[test]
    fn without_a_rate_bytes_are_there_at_once() {
        let mut line = SerialLine::default();
        line.receive(b"abc", 5);
        assert_eq!(line.next_received_ns(), Some(5));
        assert_eq!(line.received(5), b"abc");
        assert!(line.send(b"xyz", 7));
        assert_eq!(line.sent(7), b"xyz");
        assert_eq!(line.next_event_ns(), None);
    }

    #[test]
    fn a_byte_takes_ten_bits_and_both_ways_go_at_once() {
        for (baud, one, twelve) in [
            (9600, 1_041_667, 12_500_000),
            (115_200, 86_806, 1_041_667),
            (300, 33_333_334, 400_000_000),
        ] {
            let mut line = line(baud);
            line.receive(&[b'a'; 12], 100);
            assert!(line.send(&[b'b'; 12], 100));
            assert_eq!(line.next_received_ns(), Some(100 + one));
            assert_eq!(line.received(100 + one - 1), b"");
            assert_eq!(line.received(100 + one), b"a");
            assert_eq!(line.received(100 + twelve - 1).len(), 10);
            assert_eq!(line.sent(100 + twelve - 1).len(), 11);
            assert_eq!(line.received(100 + twelve), b"a");
            assert_eq!(line.sent(100 + twelve), b"b");
            assert_eq!(line.next_event_ns(), None);
        }
    }

    #[test]
    fn bytes_queued_on_a_busy_wire_follow_without_a_gap() {
        let mut line = line(115_200);
        line.receive(b"ab", 0);
        line.receive(b"cd", ns(1, 115_200));
        assert_eq!(line.received(ns(4, 115_200) - 1), b"abc");
        assert_eq!(line.received(ns(4, 115_200)), b"d");
        // The wire is idle again, so the transmission of the next byte starts when the byte is sent.
        line.receive(b"e", 1_000_000);
        assert_eq!(line.next_received_ns(), Some(1_000_000 + ns(1, 115_200)));
    }

    #[test]
    fn seven_bits_carry_no_eighth() {
        let mut line = SerialLine::new(&Control {
            data_bits: 7,
            ..Control::default()
        });
        line.receive(&[0x80 | b'a'], 0);
        assert_eq!(line.received(0), b"a");
    }

    #[test]
    fn a_message_s_end_is_an_event_of_its_own() {
        let mut line = line(1_000_000);
        assert!(line.send(b"ok\n", 0));
        assert!(line.send(&[0; 300], 0));
        assert_eq!(line.next_event_ns(), Some(ns(3, 1_000_000)));
        assert_eq!(line.sent(ns(3, 1_000_000)), b"ok\n");
        // The next byte arrives after 10 us, and a hundred more within the millisecond after it.
        assert_eq!(line.next_event_ns(), Some(ns(104, 1_000_000)));
    }

    #[test]
    fn flood_is_detected_and_replies_are_bounded() {
        let mut line = line(9600);
        assert!(!line.crowded());
        line.receive(&[0; CROWDED_TO_DEVICE], 0);
        assert!(line.crowded());
        assert_eq!(line.received(ns(1, 9600)).len(), 1);
        assert!(!line.crowded());
        let mut sent = 0;
        while line.send(&[0; 1000], 0) {
            sent += 1000;
        }
        assert!(line.crowded() && sent <= MAX_TO_HOST);
        line.clear();
        assert!(!line.crowded() && line.next_event_ns().is_none());
    }

    proptest! {
        /// For bursts sent and taken at arbitrary times, each byte arrives as on a wire that
        /// transmits a byte as soon as wire and byte are available, without drift inside a burst.
        #[test]
        fn bytes_arrive_as_on_a_real_wire(
            baud in prop_oneof![Just(9600u32), Just(115_200), 50u32..12_000_000],
            puts in proptest::collection::vec((0u64..5_000_000, 1usize..40), 1..20),
            look_ns in 1u64..3_000_000,
        ) {
            let mut line = line(baud);
            let (mut now, mut expected) = (0, Vec::new());
            // Start of the burst, and number of bytes in it.
            let mut burst = (0u64, 0u64);
            let mut looked = 0;
            let mut seen = Vec::new();
            for (pause_ns, bytes) in puts {
                now += pause_ns;
                while looked + look_ns <= now {
                    looked += look_ns;
                    let came = line.sent(looked);
                    seen.extend(came.into_iter().map(|_| looked));
                }
                prop_assert!(line.send(&vec![1; bytes], now));
                if now >= burst.0 + ns(burst.1, baud) {
                    burst = (now, 0);
                }
                for _ in 0..bytes {
                    burst.1 += 1;
                    expected.push(burst.0 + ns(burst.1, baud));
                }
            }
            // Each call returns exactly the bytes that have arrived by `looked`.
            while seen.len() < expected.len() {
                looked += look_ns;
                let came = line.sent(looked);
                seen.extend(came.into_iter().map(|_| looked));
            }
            for (at, arrival) in seen.iter().zip(&expected) {
                prop_assert!(at >= arrival && at - arrival < look_ns, "{at} {arrival}");
            }
            prop_assert!(line.next_event_ns().is_none());
        }
    }
}
