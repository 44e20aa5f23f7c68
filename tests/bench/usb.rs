//! Measures the frame rate over USB/IP on loopback TCP, and compares it with a bare socket and a
//! memory copy of the same number of bytes in the same run.
//!
//! `cargo bench --bench usb`

use phasmid::host::Camera;
use phasmid::host::usb::{UsbAddress, UsbCamera, UsbDevice};
use phasmid::link::usb::{CameraState, UsbDevice as Emulated, UsbServer};
use phasmid::profile::{Profile, Speed};
use phasmid::protocol::{Frame, PixelFormat};
use std::hint::black_box;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

const WIDTH: u32 = 1138;
const HEIGHT: u32 = 489;
const FRAMES: u64 = 3000;
/// Time for which the firmware waits before it refills the server's queue.
const AHEAD: Duration = Duration::from_micros(200);
const TIMEOUT: Duration = Duration::from_secs(10);

fn main() {
    let bytes = vec![7u8; (WIDTH * HEIGHT) as usize];
    println!("{FRAMES} frames of {WIDTH} x {HEIGHT} GREY, best of 5, in MB/s");
    let copy = best(|| copy(&bytes));
    println!("{:<28}{copy:>10.0}", "memory copy");
    let socket = best(|| socket(&bytes));
    println!("{:<28}{socket:>10.0}", "bare loopback socket");
    for speed in [Speed::High, Speed::Super] {
        let rate = best(|| usb(&bytes, speed));
        let share = rate / socket;
        println!(
            "{:<28}{rate:>10.0}  {:.0} % of the socket",
            format!("USB, {speed:?}"),
            100.0 * share
        );
    }
}

/// Returns the best rate of a few runs, in bytes per microsecond.
fn best(run: impl Fn() -> Duration) -> f64 {
    let bytes = FRAMES as f64 * f64::from(WIDTH) * f64::from(HEIGHT);
    let times = (0..5).map(|_| run().as_secs_f64());
    bytes / times.fold(f64::INFINITY, f64::min) / 1e6
}

fn copy(bytes: &[u8]) -> Duration {
    let mut to = vec![0; bytes.len()];
    let start = Instant::now();
    for _ in 0..FRAMES {
        black_box(&mut to).copy_from_slice(black_box(bytes));
    }
    start.elapsed()
}

fn socket(bytes: &[u8]) -> Duration {
    let listener = TcpListener::bind("127.0.0.1:0").expect("loopback");
    let address = listener.local_addr().expect("an address");
    let sent = bytes.to_vec();
    let sender = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a client");
        for _ in 0..FRAMES {
            stream.write_all(&sent).expect("a reader");
        }
    });
    let mut stream = TcpStream::connect(address).expect("a server");
    let mut frame = vec![0; bytes.len()];
    let start = Instant::now();
    for _ in 0..FRAMES {
        stream.read_exact(&mut frame).expect("a frame");
        black_box(&frame);
    }
    let took = start.elapsed();
    sender.join().expect("sent");
    took
}

fn usb(bytes: &[u8], speed: Speed) -> Duration {
    let mut profile = Profile::load("webcam-grey").expect("built in");
    profile.usb.speed = speed;
    let camera = CameraState {
        exposure_ns: 1_000_000,
        gain_db: 0.0,
        settable_ns: Some(u64::MAX),
    };
    let device = Emulated::new(&profile, 1, (WIDTH, HEIGHT), &[PixelFormat::Grey], camera)
        .expect("descriptors");
    let frame = Arc::new(Frame {
        id: 0,
        // Use triggered frames: unlike free-running frames, they all wait for the host.
        pattern_index: Some(0),
        width: WIDTH,
        height: HEIGHT,
        format: PixelFormat::Grey,
        exposure_start_ns: 0,
        exposure_end_ns: 0,
        data: bytes.to_vec(),
    });
    let (address, bound) = channel();
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let server = std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build();
        runtime.expect("a runtime").block_on(async move {
            let start = Instant::now();
            let any = "127.0.0.1:0".parse().expect("an address");
            let server = UsbServer::bind(any, vec![device.clone()])
                .await
                .expect("loopback");
            address
                .send(server.address().expect("bound"))
                .expect("a bench");
            let firmware = async {
                loop {
                    while device.put(frame.clone(), start.elapsed()) {}
                    tokio::time::sleep(AHEAD).await;
                }
            };
            tokio::select! {
                () = server.run(move || start.elapsed()) => {}
                () = firmware => {}
                _ = stopped => {}
            }
        });
    });
    let address = format!("usb:{}", bound.recv().expect("an address"));
    let address = UsbAddress::parse(&address, "bench").expect("an address");
    let opened = Arc::new(UsbDevice::open(&address, TIMEOUT).expect("a device"));
    let mut camera = UsbCamera::open(&opened, None).expect("a camera");
    let next = |camera: &mut UsbCamera| {
        let frame = camera
            .next_frame(TIMEOUT)
            .expect("a camera")
            .expect("a frame");
        camera.give_back(black_box(frame).data);
    };
    next(&mut camera);
    let start = Instant::now();
    for _ in 0..FRAMES {
        next(&mut camera);
    }
    let took = start.elapsed();
    drop(camera);
    let _ = stop.send(());
    server.join().expect("served");
    took
}
