use super::{CommandPort, SerialPort};
use crate::Instrument;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::{read, write};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::os::fd::OwnedFd;
use std::os::unix::fs::symlink;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

/// Timeout for a device that does not read.
const SHORT: Duration = Duration::from_millis(50);
/// A timeout that is far longer than any operation in these tests takes.
const LONG: Duration = Duration::from_secs(60);

#[test]
fn path_that_is_no_serial_port_is_a_usage_error() {
    for (path, found) in [
        ("/dev/null", "no serial port"),
        ("/dev", "no serial port"),
        ("/dev/no-such-port", "no such file"),
        ("/dev/null/port", "no such file"),
    ] {
        let error = SerialPort::open(path).err().unwrap();
        assert_eq!(error.exit_code(), 2, "{error}");
        assert!(error.to_string().contains(found), "{error}");
    }
}

#[test]
fn another_refusal_keeps_the_system_s_words() {
    // Use a name that is too long as the invalid path: a folder without permission would not do,
    // because root can enter every folder.
    let error = SerialPort::open(&"x".repeat(5000)).err().unwrap();
    assert_eq!(error.exit_code(), 1, "{error}");
    assert!(error.to_string().contains("too long"), "{error}");
}

/// Opens a pty; returns the device's side and the path of the client's.
fn pty() -> (OwnedFd, String) {
    let device = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&device).unwrap();
    unlockpt(&device).unwrap();
    let path = ptsname(&device, Vec::new()).unwrap();
    (device, path.into_string().unwrap())
}

/// Returns all bytes that arrive on the device's side until no byte has come for [`SHORT`].
fn heard(device: &OwnedFd) -> Vec<u8> {
    let mut all = Vec::new();
    let mut buffer = [0; 4096];
    let short = Timespec::try_from(SHORT).unwrap();
    while poll(&mut [PollFd::new(device, PollFlags::IN)], Some(&short)).unwrap() > 0 {
        let len = read(device, &mut buffer).unwrap();
        all.extend_from_slice(&buffer[..len]);
    }
    all
}

/// Runs a test in a thread, and fails if it hangs. A blocked write cannot be ended from outside, so
/// the thread is left behind.
fn in_time(test: impl FnOnce() + Send + 'static) {
    let (done, ended) = channel();
    let test = thread::spawn(move || {
        test();
        let _ = done.send(());
    });
    match ended.recv_timeout(LONG) {
        Err(std::sync::mpsc::RecvTimeoutError::Timeout) => panic!("hangs"),
        // If the test has panicked, this panics with the same message.
        _ => test.join().unwrap(),
    }
}

/// Sends lines until the port accepts no more. Returns the error for the first line that was not
/// fully accepted, the number of bytes accepted before it, and the longest duration of a call.
fn fill(port: &mut SerialPort) -> (String, usize, Duration) {
    let line = [[b'x'; 1022].as_slice(), b"\r\n"].concat();
    let mut longest = Duration::ZERO;
    for sent in 0..100_000 {
        let begin = Instant::now();
        let done = port.send(&line, SHORT);
        longest = longest.max(begin.elapsed());
        if let Err(error) = done {
            return (error.to_string(), sent * line.len(), longest);
        }
    }
    panic!("the pty accepts data without limit");
}

#[test]
fn send_to_device_that_reads_nothing_times_out_and_recovers() {
    in_time(|| {
        let (device, path) = pty();
        let mut port = SerialPort::open(&path).unwrap();
        let (first, before, longest) = fill(&mut port);
        // The error of a partial write states how many bytes were accepted. After that error the
        // line is full.
        let part = first.split("has accepted ").nth(1).unwrap().to_owned();
        let part = part
            .trim_start_matches("only ")
            .split(' ')
            .next()
            .unwrap()
            .parse::<usize>()
            .unwrap_or(0);
        let nothing = format!("{path}: the device has accepted no data in 0.05 s");
        let some = format!("{path}: the device has accepted only {part} of 1024 bytes in 0.05 s");
        assert_eq!(first, if part == 0 { &nothing } else { &some }.as_str());
        let error = port.send(b"x", SHORT).unwrap_err();
        assert_eq!(error.to_string(), nothing);
        assert_eq!(error.exit_code(), 1);
        // The limit is the timeout with a large allowance for a busy machine.
        assert!(longest < 40 * SHORT, "{longest:?}");

        // Exactly the bytes that the port counted as accepted come out.
        assert_eq!(heard(&device).len(), before + part);
        port.send(b"hello\n", LONG).unwrap();
        assert_eq!(heard(&device), b"hello\n");
        write(&device, b"yes\n").unwrap();
        let mut buffer = [0; 16];
        assert_eq!(port.receive(&mut buffer, LONG).unwrap(), 4);
        assert_eq!(&buffer[..4], b"yes\n");
    });
}

#[test]
fn long_message_is_sent_while_the_device_reads() {
    in_time(|| {
        let (device, path) = pty();
        let mut port = SerialPort::open(&path).unwrap();
        let sent: Vec<u8> = (0..1 << 20).map(|i: u32| ((i * 7) >> 3) as u8).collect();
        let want = sent.clone();
        let writer = thread::spawn(move || {
            port.send(&sent, LONG).unwrap();
            // Keep the port open, because closing it would discard unread data.
            port
        });
        let mut got = Vec::new();
        while got.len() < want.len() {
            got.extend(heard(&device));
        }
        assert!(got == want);
        drop(writer.join().unwrap());
    });
}

#[test]
fn reopening_discards_unread_output() {
    in_time(|| {
        let (device, path) = pty();
        let mut port = SerialPort::open(&path).unwrap();
        let (_, before, _) = fill(&mut port);
        let begin = Instant::now();
        port.reopen(LONG).unwrap();
        assert!(begin.elapsed() < LONG / 2);
        port.send(b"hello\n", LONG).unwrap();
        let heard = heard(&device);
        assert!(heard.ends_with(b"hello\n"));
        // Linux keeps one page of the arrived data on the device's side.
        assert!(before > 2 * 4096, "{before}");
        assert!(heard.len() <= 4096 + 6, "{} of {before}", heard.len());
    });
}

#[test]
fn port_is_exclusive_until_closed() {
    let (_device, path) = pty();
    let port = SerialPort::open(&path).unwrap();
    let error = SerialPort::open(&path).err().unwrap();
    let want = format!("--control {path}: another program has the port open");
    assert_eq!(error.to_string(), want);
    drop(port);
    SerialPort::open(&path).unwrap();
}

#[test]
fn closed_device_is_reported() {
    in_time(|| {
        let (device, path) = pty();
        // Open the port through a link: the number of a closed pty may be given to another test's pty.
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("control");
        symlink(path, &link).unwrap();
        let mut port = SerialPort::open(link.to_str().unwrap()).unwrap();
        // Data that the device sent before it was closed is not lost.
        write(&device, b"bye\n").unwrap();
        drop(device);
        std::fs::remove_file(&link).unwrap();
        let mut buffer = [0; 16];
        let len = port.receive(&mut buffer, LONG).unwrap_or(0);
        assert!(len == 0 || buffer[..len] == *b"bye\n");
        assert!(port.receive(&mut buffer, LONG).is_err());
        assert!(port.send(b"x", LONG).is_err());
        let error = port.reopen(SHORT).unwrap_err().to_string();
        let want = "the device disconnected and did not come back within 0.05 s";
        assert!(error.starts_with(want), "{error}");
        assert!(port.send(b"x", LONG).is_err());
    });
}

/// Answers a line like a SCPI instrument: with the number that was set, and `1` for any other
/// query.
fn answer(line: &str, number: &mut String) -> String {
    let mut answers = Vec::new();
    for unit in line.split(';') {
        match unit {
            "*ESE?" => answers.push(number.clone()),
            question if question.ends_with('?') => answers.push("1".to_owned()),
            order => {
                if let Some(told) = order.strip_prefix("*ESE ") {
                    told.clone_into(number);
                }
            }
        }
    }
    match answers.is_empty() {
        true => String::new(),
        false => answers.join(";") + "\n",
    }
}

#[test]
fn a_device_that_stood_still_is_found_again() {
    in_time(|| {
        static STANDS: AtomicBool = AtomicBool::new(false);
        let (device, path) = pty();
        let port = SerialPort::open(&path).unwrap();
        thread::spawn(move || {
            let (mut number, mut rest) = (String::new(), Vec::new());
            let mut buffer = [0; 4096];
            // Ends when the port is closed.
            while let Ok(len @ 1..) = read(&device, &mut buffer) {
                while STANDS.load(Ordering::Relaxed) {
                    thread::sleep(SHORT);
                }
                rest.extend_from_slice(&buffer[..len]);
                while let Some(end) = rest.iter().position(|byte| *byte == b'\n') {
                    let line: Vec<u8> = rest.drain(..=end).collect();
                    let line = String::from_utf8_lossy(&line);
                    let said = answer(line.trim(), &mut number);
                    write(&device, said.as_bytes()).unwrap();
                }
            }
        });
        let mut instrument = Instrument::open(port, 20 * SHORT).unwrap();
        assert_eq!(instrument.query("A?").unwrap(), "1");
        STANDS.store(true, Ordering::Relaxed);
        let order = "x".repeat(1 << 12);
        let error = (0..100_000).find_map(|_| instrument.tell(&order).err());
        let error = error.unwrap().to_string();
        assert!(error.contains("the device has accepted "), "{error}");
        assert!(error.contains(&path), "{error}");
        STANDS.store(false, Ordering::Relaxed);
        instrument.recover().unwrap();
        assert_eq!(instrument.query("B?").unwrap(), "1");
    });
}
