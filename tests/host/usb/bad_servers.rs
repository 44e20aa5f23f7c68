//! Servers that do not speak the protocol, send false data, disconnect or stay silent: each gives
//! one clear error without waiting.

use phasmid::host::usb::{Client, UsbAddress, UsbDevice};
use phasmid::protocol::usb::usbip::{
    BUS_ID_LEN, DeviceInfo, HEADER_LEN, OPERATION_LEN, Operation, Outcome, Reply, status,
};
use phasmid::protocol::usb::{Setup, request};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

const TIMEOUT: Duration = Duration::from_millis(400);

fn info(bus_id: &str) -> DeviceInfo {
    DeviceInfo {
        bus_id: bus_id.to_owned(),
        bus: 1,
        device: 2,
        speed: 3,
        vendor: 0x1209,
        product: 1,
        release: 0x100,
        class: [0xEF, 2, 1],
        interfaces: 0,
    }
}

/// Starts a server that handles each connection with a function; returns the server's address.
fn server(serve: impl Fn(TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let host = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            serve(stream.unwrap());
        }
    });
    host
}

fn take<const N: usize>(stream: &mut TcpStream) -> Option<[u8; N]> {
    let mut bytes = [0; N];
    stream.read_exact(&mut bytes).ok().map(|()| bytes)
}

/// Answers an import request positively.
fn grant(stream: &mut TcpStream) -> Option<()> {
    take::<OPERATION_LEN>(stream)?;
    take::<BUS_ID_LEN>(stream)?;
    let granted = [
        &Operation::Import.reply(Outcome::Done)[..],
        &info("1-1").encode(),
    ]
    .concat();
    stream.write_all(&granted).ok()
}

/// Returns a client of an imported device whose server answers the first command with these bytes
/// and then stays silent.
fn answers(reply: impl Fn(u32) -> Vec<u8> + Send + 'static) -> Client {
    let host = server(move |mut stream| {
        let _ = grant(&mut stream).and_then(|()| {
            let command = take::<HEADER_LEN>(&mut stream)?;
            let seqnum = u32::from_be_bytes(command[4..8].try_into().unwrap());
            let _ = stream.write_all(&reply(seqnum));
            // Wait until the client disconnects.
            take::<1>(&mut stream)
        });
    });
    Client::import(&host, Some("1-1"), TIMEOUT).unwrap()
}

fn submitted(seqnum: u32, status: i32, actual: u32) -> Reply {
    Reply::Submit {
        seqnum,
        status,
        actual,
        packets: None,
        errors: 0,
    }
}

const GET: Setup = Setup {
    kind: Setup::STANDARD_IN,
    request: request::GET_DESCRIPTOR,
    value: 0x100,
    index: 0,
    length: 18,
};

#[test]
fn refuses_invalid_device_lists() {
    let reply = |bytes: Vec<u8>| {
        let host = server(move |mut stream| {
            let _ = take::<OPERATION_LEN>(&mut stream);
            let _ = stream.write_all(&bytes);
        });
        let start = Instant::now();
        let error = Client::list(&host, TIMEOUT).unwrap_err();
        assert!(start.elapsed() < 10 * TIMEOUT);
        assert_eq!(error.exit_code(), 1);
        let error = error.to_string();
        assert!(error.contains(&host), "{error}");
        error
    };
    let granted = Operation::List.reply(Outcome::Done);
    assert!(reply(b"HTTP/1.1 400".to_vec()).contains("not a USB/IP server"));
    assert!(reply(Operation::List.reply(Outcome::Refused(1)).to_vec()).contains("refuses"));
    assert!(reply(vec![]).contains("closed"));
    assert!(reply(granted.to_vec()).contains("closed"));
    let huge = [&granted[..], &u32::MAX.to_be_bytes()].concat();
    assert!(reply(huge).contains("4294967295 devices"));
    let cut = [&granted[..], &[0, 0, 0, 1, 1, 2, 3]].concat();
    assert!(reply(cut).contains("closed"));
}

#[test]
fn silent_or_slow_server_times_out() {
    let silent = server(|stream| {
        std::thread::sleep(5 * TIMEOUT);
        drop(stream);
    });
    let dripping = server(|mut stream| {
        for byte in Operation::List.reply(Outcome::Done) {
            let _ = stream.write_all(&[byte]);
            std::thread::sleep(TIMEOUT / 3);
        }
    });
    for host in [silent, dripping] {
        let start = Instant::now();
        let error = Client::list(&host, TIMEOUT).unwrap_err().to_string();
        assert!(error.contains("does not answer"), "{error}");
        assert!(start.elapsed() < 4 * TIMEOUT);
    }
}

#[test]
fn refuses_no_device_several_devices_and_another_device() {
    let exports = |names: &'static [&str]| {
        server(move |mut stream| {
            let _ = take::<OPERATION_LEN>(&mut stream);
            let mut bytes = Operation::List.reply(Outcome::Done).to_vec();
            bytes.extend((names.len() as u32).to_be_bytes());
            bytes.extend(names.iter().flat_map(|name| info(name).encode()));
            let _ = stream.write_all(&bytes);
        })
    };
    let refusal = |host: &str| Client::import(host, None, TIMEOUT).err().unwrap();
    assert!(
        refusal(&exports(&[]))
            .to_string()
            .contains("exports no device")
    );
    let host = exports(&["1-1", "1-2"]);
    let several = refusal(&host);
    assert_eq!(several.exit_code(), 2);
    assert!(
        several.to_string().contains(&format!("usb:{host}/1-2")),
        "{several}"
    );
    let host = server(|mut stream| {
        let _ = grant(&mut stream);
    });
    let other = Client::import(&host, Some("7-7"), TIMEOUT).err().unwrap();
    assert!(
        other.to_string().contains("returned device \"1-1\""),
        "{other}"
    );
}

#[test]
fn refuses_impossible_replies() {
    type Bytes = fn(u32) -> Vec<u8>;
    let cases: [(Bytes, &str); 8] = [
        (
            |n| submitted(n + 7, 0, 0).encode().to_vec(),
            "which was not submitted",
        ),
        (|n| submitted(n, 0, 19).encode().to_vec(), "19 bytes"),
        (
            |n| submitted(n, 0, u32::MAX).encode().to_vec(),
            "4294967295 bytes",
        ),
        (
            |_| vec![9; HEADER_LEN],
            "expected 3 (submitted) or 4 (unlinked)",
        ),
        (
            |n| {
                let packets = Some(3);
                let Reply::Submit { seqnum, status, .. } = submitted(n, 0, 0) else {
                    unreachable!()
                };
                let reply = Reply::Submit {
                    seqnum,
                    status,
                    actual: 0,
                    packets,
                    errors: 0,
                };
                reply.encode().to_vec()
            },
            "Some(3)",
        ),
        (
            |n| {
                Reply::Unlink {
                    seqnum: n,
                    status: 0,
                }
                .encode()
                .to_vec()
            },
            "unlink 1, which was not submitted",
        ),
        (
            |n| submitted(n, status::STALL, 0).encode().to_vec(),
            "stall",
        ),
        (|n| submitted(n, -71, 0).encode().to_vec(), "status -71"),
    ];
    for (reply, says) in cases {
        let client = answers(reply);
        let error = client.control(GET, &[], TIMEOUT).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().contains(says), "{error}, expected {says}");
    }
}

#[test]
fn reports_silence_and_a_broken_connection() {
    let silent = answers(|_| Vec::new());
    let start = Instant::now();
    let error = silent.control(GET, &[], TIMEOUT).unwrap_err().to_string();
    assert!(error.contains("no answer for 0.4 s"), "{error}");
    // The connection ends in the middle of the data.
    let cut = answers(|n| [&submitted(n, 0, 18).encode()[..], &[18, 1, 0]].concat());
    let error = cut.control(GET, &[], TIMEOUT).unwrap_err().to_string();
    assert!(error.contains("no answer"), "{error}");
    drop(cut);
    drop(silent);
    assert!(start.elapsed() < 8 * TIMEOUT, "detaching does not wait");
    let host = server(|mut stream| {
        let _ = grant(&mut stream).and_then(|()| take::<HEADER_LEN>(&mut stream));
    });
    let client = Client::import(&host, Some("1-1"), TIMEOUT).unwrap();
    let error = client
        .control(GET, &[], 100 * TIMEOUT)
        .unwrap_err()
        .to_string();
    assert!(error.contains("disconnected"), "{error}");
    let again = client.control(GET, &[], TIMEOUT).unwrap_err().to_string();
    assert_eq!(again, error, "later requests report the same reason");
}

#[test]
fn a_device_that_answers_every_request_with_noise_is_refused() {
    let host = server(|mut stream| {
        let mut noise = 1u32;
        let mut next = move || {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (noise >> 24) as u8
        };
        let _ = grant(&mut stream);
        while let Some(command) = take::<HEADER_LEN>(&mut stream) {
            let word = |at: usize| u32::from_be_bytes(command[at..at + 4].try_into().unwrap());
            let input = word(12) == 1;
            let len = if input { word(24) } else { 0 };
            let data: Vec<u8> = (0..len).map(|_| next()).collect();
            let reply = submitted(word(4), 0, len).encode();
            if stream.write_all(&[&reply[..], &data].concat()).is_err() {
                break;
            }
        }
    });
    let address = UsbAddress::parse(&format!("usb:{host}/1-1"), "test").unwrap();
    let error = UsbDevice::open(&address, TIMEOUT).err().unwrap();
    assert_eq!(error.exit_code(), 1);
    assert!(error.to_string().contains("descriptor"), "{error}");
}
