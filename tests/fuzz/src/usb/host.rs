//! A hostile server against the host: the answers of a correct device are damaged in transit. The
//! host must get the data that it requests, or one clear error, in time.

use super::choices::Choices;
use super::ledger::Ledger;
use super::sample;
use super::wire::Wire;
use phasmid::host::usb::{
    Client, UsbAddress, UsbCamera, UsbDevice, UsbPort, VideoControl, VideoFunction,
};
use phasmid::host::{Camera, CommandPort};
use phasmid::link::usb::{Event, UsbDevice as Emulated};
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::PixelFormat;
use phasmid::protocol::usb::usbip::{BUS_ID_LEN, OPERATION_LEN, Operation, Outcome};
use phasmid::{Error, Result};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time that the host waits for an answer.
const TIMEOUT: Duration = Duration::from_millis(20);
/// Maximum total time of all actions of the host: about thirty timeouts, on a loaded machine.
const LIMIT: Duration = Duration::from_secs(20);
/// Maximum number of replies per connection; after them the server disconnects.
const MAX_REPLIES: usize = 2000;

/// Stages of its work that a host has reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reached {
    pub opened: bool,
    pub frames: u32,
    pub echoed: bool,
}

/// Runs a script that decides how replies are damaged.
pub fn run(script: &[u8]) -> Reached {
    run_within(script, TIMEOUT)
}

/// Runs a script with another timeout for each answer.
pub fn run_within(script: &[u8], timeout: Duration) -> Reached {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let host = listener.local_addr().unwrap().to_string();
    let over = Arc::new(AtomicBool::new(false));
    let (ours, script) = (over.clone(), script.to_vec());
    let server = std::thread::spawn(move || {
        let mut choices = Choices::new(&script);
        let speed = choices.pick(&[Speed::High, Speed::Super]);
        let transfer = choices.pick(&[Transfer::Bulk, Transfer::Isochronous]);
        let device = sample::device(&sample::profile(speed, transfer), 1);
        for stream in listener.incoming() {
            if ours.load(Ordering::SeqCst) {
                break;
            }
            // A client may disconnect at any time.
            let _ = serve(&mut stream.unwrap(), &device, &mut choices);
        }
    });
    let start = Instant::now();
    let mut reached = Reached::default();
    if let Err(error) = use_device(&host, timeout, &mut reached) {
        sound(&error);
    }
    let took = start.elapsed();
    assert!(took < LIMIT, "the host was held up for {took:?}");
    over.store(true, Ordering::SeqCst);
    // Wakes the server so that it ends, whether or not it is still waiting.
    let _ = TcpStream::connect(&host);
    server.join().expect("a server without a panic");
    reached
}

/// Returns scripts with one kind of damage each.
pub fn seeds() -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    for kind in 0..DAMAGES {
        for at in [0, 1, 2, 4, 8, 14, 20, 30] {
            let mut script = vec![at & 1, u8::from(at == 14)];
            script.extend(vec![0; at.into()]);
            script.extend([HARM + kind, at.wrapping_mul(37), 3, at, 0x35, 9]);
            seeds.push(script);
        }
    }
    seeds
}

/// Checks that an error is readable for a user.
fn sound(error: &Error) {
    let message = error.to_string();
    assert!(
        !message.is_empty() && !message.contains(char::is_control),
        "{message:?}"
    );
    assert!(matches!(error.exit_code(), 1 | 2));
}

/// Performs all actions of a host with a device.
fn use_device(host: &str, timeout: Duration, reached: &mut Reached) -> Result<()> {
    if let Err(error) = Client::list(host, timeout) {
        sound(&error);
    }
    let address = UsbAddress::parse(&format!("usb:{host}"), "test")?;
    let device = Arc::new(UsbDevice::open(&address, timeout)?);
    reached.opened = true;
    if let Ok(function) = VideoFunction::find(device.configuration()) {
        for control in [VideoControl::Exposure, VideoControl::Gain] {
            if let Err(error) = control.read(&device, &function) {
                sound(&error);
            }
        }
    }
    let streamed = stream(&device, timeout, reached);
    let talked = talk(&device, timeout, reached);
    streamed.and(talked)
}

fn stream(device: &Arc<UsbDevice>, timeout: Duration, reached: &mut Reached) -> Result<()> {
    let mut camera = UsbCamera::open(device, None)?;
    for _ in 0..6 {
        match camera.next_frame(timeout) {
            Ok(Some(frame)) => {
                assert_eq!(frame.data.len() as u64, camera.mode().frame_len());
                reached.frames += 1;
                camera.give_back(frame.data);
            }
            Ok(None) => return Ok(()),
            Err(error) if camera.has_skipped() => sound(&error),
            Err(error) => return Err(error),
        }
    }
    camera.set_control(VideoControl::Exposure, 70)
}

fn talk(device: &Arc<UsbDevice>, timeout: Duration, reached: &mut Reached) -> Result<()> {
    let mut port = UsbPort::open(device)?;
    port.send(b"*IDN?\n", timeout)?;
    let mut buffer = [0; 64];
    let len = port.receive(&mut buffer, timeout)?;
    reached.echoed = &buffer[..len] == b"*IDN?\n";
    Ok(())
}

/// Answers a connection as the device would, except for the damage.
fn serve(stream: &mut TcpStream, device: &Emulated, choices: &mut Choices<'_>) -> Option<()> {
    stream.set_nodelay(true).ok()?;
    stream.set_read_timeout(Some(LIMIT)).ok()?;
    let mut operation = [0; OPERATION_LEN];
    stream.read_exact(&mut operation).ok()?;
    let operation = Operation::decode(operation).ok()?;
    let mut reply = operation.reply(Outcome::Done).to_vec();
    if operation == Operation::List {
        reply.extend(1u32.to_be_bytes());
        reply.extend(device.info().encode());
        reply.extend([0; 4].repeat(device.info().interfaces.into()));
        return send(stream, vec![reply], choices);
    }
    let mut bus_id = [0; BUS_ID_LEN];
    stream.read_exact(&mut bus_id).ok()?;
    reply.extend(device.info().encode());
    send(stream, vec![reply], choices)?;
    let mut wire = Wire::new(device);
    let mut ledger = Ledger::default();
    let mut replies = 0;
    let mut frames = 0;
    let mut buffer = vec![0; 64 << 10];
    while replies < MAX_REPLIES && !ledger.is_lost() {
        let len = stream.read(&mut buffer).ok().filter(|len| *len > 0)?;
        ledger.sent(&buffer[..len]);
        wire.send(&buffer[..len]);
        for event in device.take_events() {
            if let Event::Received(bytes) = event {
                device.send(&bytes, wire.now());
            }
        }
        let frame = |id| Arc::new(sample::frame(id, PixelFormat::Grey));
        for _ in 0..8 {
            frames += u64::from(device.put(frame(frames), wire.now()));
        }
        // Let time pass, so that isochronous transfers end.
        wire.advance(Duration::from_millis(50));
        let whole = ledger.received(&wire.take());
        replies += whole.len();
        send(stream, whole, choices)?;
    }
    Some(())
}

/// Script bytes from this value on cause damage.
const HARM: u8 = 200;
const DAMAGES: u8 = 8;

/// Sends replies, some of them damaged; returns `None` when the connection is over.
fn send(stream: &mut TcpStream, replies: Vec<Vec<u8>>, choices: &mut Choices<'_>) -> Option<()> {
    let mut held: Option<Vec<u8>> = None;
    for mut reply in replies {
        let choice = choices.byte();
        let kind = choice.checked_sub(HARM).map(|harm| harm % DAMAGES);
        match kind {
            Some(0) => {
                let at = 4 * choices.below(reply.len().min(64) / 4);
                reply[at..at + 4].copy_from_slice(&choices.word().to_be_bytes());
            }
            Some(1) => {
                for _ in 0..=choices.below(4) {
                    let at = choices.below(reply.len());
                    reply[at] = choices.byte();
                }
            }
            // Damages bytes of pixels or descriptors, preferably near their beginning.
            Some(2) => {
                let at = 48 + choices.below(16);
                if let Some(byte) = reply.get_mut(at) {
                    *byte = choices.byte();
                }
            }
            Some(3) => {
                reply.truncate(choices.below(reply.len()));
                let _ = stream.write_all(&reply);
                return None;
            }
            Some(4) => reply.extend(reply.clone()),
            Some(5) => {
                let noise = choices.bytes(60);
                reply.splice(0..0, noise);
            }
            // The reply is delayed until after the next reply, or is never sent.
            Some(6) => {
                held = Some(reply);
                continue;
            }
            Some(_) => continue,
            None => {}
        }
        stream.write_all(&reply).ok()?;
        if let Some(late) = held.take() {
            stream.write_all(&late).ok()?;
        }
    }
    Some(())
}
