//! A host's connection after the host has imported a device: reads commands, lets the session
//! execute them, and writes many replies at a time.

use super::device::{Attached, UsbDevice};
use super::outgoing::Outgoing;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::usbip::{Command, HEADER_LEN, PACKET_LEN, Packet};
use std::future::pending;
use std::io::IoSlice;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

/// Maximum number of chunks passed to one write.
const SLICES: usize = 64;
/// Number of queued chunks at which reading of commands stops.
const MAX_OUTGOING: usize = 4096;
const READ_LEN: usize = 64 << 10;

impl UsbDevice {
    /// Serves a host over any two byte streams, from the end of the import until the host leaves.
    /// `clock` returns the time since an arbitrary fixed point in time.
    ///
    /// # Errors
    /// Returns an error if another host has attached the device, if the host violates the protocol,
    /// or if reading or writing fails.
    pub async fn serve(
        &self,
        reader: impl AsyncRead + Unpin,
        writer: impl AsyncWrite + Unpin,
        clock: impl Fn() -> Duration,
    ) -> Result<()> {
        let attached = Attached::take(self)?;
        run(reader, writer, attached.device(), clock).await
    }
}

/// Serves a host until the host leaves or violates the protocol, or the device is unplugged. `clock`
/// returns the time since an arbitrary fixed point in time.
///
/// # Errors
/// Returns an error if the host violates the protocol or the socket fails.
pub(super) async fn run(
    mut reader: impl AsyncRead + Unpin,
    mut writer: impl AsyncWrite + Unpin,
    device: &UsbDevice,
    clock: impl Fn() -> Duration,
) -> Result<()> {
    let mut input = Input::default();
    let mut outgoing = Outgoing::default();
    let io = |e| Error::io("USB/IP", e);
    loop {
        // Stop reading commands while the host does not read its replies, or while it causes events
        // faster than the firmware processes them.
        while outgoing.len() < MAX_OUTGOING
            && !device.is_behind()
            && let Some((command, data, packets)) = input.next()?
        {
            device.with(|session| {
                let done = session.command(command, data, &packets, clock());
                outgoing.append(&mut session.outgoing);
                done
            })?;
        }
        let (due, unplugged) = device.with(|session| {
            session.pump(clock());
            outgoing.append(&mut session.outgoing);
            (session.video.next_due(), session.is_unplugged())
        });
        if unplugged {
            return Ok(());
        }
        let listening = outgoing.len() < MAX_OUTGOING && !device.is_behind();
        let mut slices = [IoSlice::new(&[]); SLICES];
        let count = outgoing.slices(&mut slices);
        let delay = due.map(|due| due.saturating_sub(clock()));
        tokio::select! {
            biased;
            written = writer.write_vectored(&slices[..count]), if count > 0 => {
                let written = written.map_err(io)?;
                if written == 0 {
                    return Ok(());
                }
                outgoing.advance(written);
            }
            read = reader.read(input.space()), if listening => {
                let read = read.map_err(io)?;
                if read == 0 {
                    return Ok(());
                }
                input.filled += read;
            }
            () = device.outward() => {}
            () = sleep(delay) => {}
        }
    }
}

async fn sleep(delay: Option<Duration>) {
    match delay {
        Some(delay) => tokio::time::sleep(delay).await,
        None => pending().await,
    }
}

/// Bytes from the host that do not form a complete command yet.
#[derive(Default)]
struct Input {
    bytes: Vec<u8>,
    filled: usize,
    /// Number of bytes at the start of the buffer that have been processed.
    done: usize,
}

type Whole = (Command, Vec<u8>, Vec<Packet>);

impl Input {
    /// Returns buffer space for more bytes.
    fn space(&mut self) -> &mut [u8] {
        if self.done > 0 {
            self.bytes.copy_within(self.done..self.filled, 0);
            self.filled -= self.done;
            self.done = 0;
        }
        let want = (self.filled + READ_LEN).next_multiple_of(READ_LEN);
        if self.bytes.len() < want {
            self.bytes.resize(want, 0);
        }
        &mut self.bytes[self.filled..]
    }

    /// Returns the next complete command.
    fn next(&mut self) -> Result<Option<Whole>> {
        let bytes = &self.bytes[self.done..self.filled];
        let Some((header, rest)) = bytes.split_first_chunk::<HEADER_LEN>() else {
            return Ok(None);
        };
        // Decoding checks the sizes in the header before any data is awaited.
        let command = Command::decode(header)?;
        let Command::Submit(submit) = command else {
            self.done += HEADER_LEN;
            return Ok(Some((command, Vec::new(), Vec::new())));
        };
        let data_len = if submit.input {
            0
        } else {
            submit.length as usize
        };
        let packets_len = submit.packets.unwrap_or(0) as usize * PACKET_LEN;
        if rest.len() < data_len + packets_len {
            return Ok(None);
        }
        let data = rest[..data_len].to_vec();
        let packets: Vec<Packet> = rest[data_len..data_len + packets_len]
            .as_chunks::<PACKET_LEN>()
            .0
            .iter()
            .map(Packet::decode)
            .collect();
        let room: u64 = packets.iter().map(|packet| u64::from(packet.length)).sum();
        if submit.packets.is_some() && room > u64::from(submit.length) {
            return Err(Error::device(format!(
                "USB/IP command: packets of {room} bytes in a transfer of {}",
                submit.length
            )));
        }
        self.done += HEADER_LEN + data_len + packets_len;
        Ok(Some((command, data, packets)))
    }
}
