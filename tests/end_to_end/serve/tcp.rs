//! Frames over TCP: a limit on clients that is separate from the Unix socket's, refusals with a
//! reason, and the token.

use crate::served::{LONG, Served, phasmid, text};
use rustix::process::Signal;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;

/// Maximum number of clients of each link (Unix socket, TCP).
const PLACES: usize = 32;
const TOKEN: &str = "correct horse battery";
const TOKEN_FILE: &str = "PHASMID_TCP_TOKEN_FILE";

fn connect(served: &Served) -> TcpStream {
    let address = served.at.camera_tcp.as_deref().unwrap();
    let stream = TcpStream::connect(address.strip_prefix("tcp:").unwrap()).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    stream
}

/// Returns everything that arrives before the connection ends.
fn rest(mut stream: impl Read) -> String {
    let mut all = Vec::new();
    stream.read_to_end(&mut all).unwrap();
    String::from_utf8_lossy(&all).into_owned()
}

fn with_token() -> (tempfile::TempDir, Served) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("token");
    std::fs::write(&file, format!("{TOKEN}\n")).unwrap();
    let served = Served::start(&["--tcp", "0", "--tcp-token", file.to_str().unwrap()]);
    (folder, served)
}

/// Scans over TCP with the token in a file.
fn scan(served: &Served, token: Option<&Path>, out: &Path) -> Output {
    let mut command = phasmid();
    command
        .args(["scan", "--camera", served.at.camera_tcp.as_ref().unwrap()])
        .arg("--control")
        .arg(&served.at.control)
        .arg("--out")
        .arg(out);
    set_token(&mut command, token);
    command.output().unwrap()
}

fn set_token(command: &mut Command, token: Option<&Path>) {
    match token {
        Some(token) => command.env(TOKEN_FILE, token),
        None => command.env_remove(TOKEN_FILE),
    };
}

#[test]
fn silent_tcp_clients_leave_the_unix_socket_to_its_owner() {
    let served = Served::start(&["--tcp", "0"]);
    let mut silent: Vec<_> = (0..PLACES).map(|_| connect(&served)).collect();
    let refused = rest(connect(&served));
    assert!(
        refused.starts_with("PHNO ") && refused.contains("at most 32 over TCP"),
        "{refused}"
    );
    let info = phasmid()
        .args(["camera", "info", served.at.camera_tcp.as_ref().unwrap()])
        .output()
        .unwrap();
    assert_eq!(info.status.code(), Some(1));
    assert!(
        text(&info).contains("at most 32 over TCP"),
        "{}",
        text(&info)
    );
    silent.extend((0..PLACES).map(|_| connect(&served)));
    let out = served.dir.parent().unwrap().join("out");
    let scan = served.scan(&out, &[]);
    assert_eq!(scan.status.code(), Some(0), "{}", text(&scan));
    drop(silent);
    served.stop(Signal::TERM);
}

#[test]
fn tcp_client_needs_the_token() {
    let (folder, served) = with_token();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("wrong"), "incorrect horse battery").unwrap();

    let none = scan(&served, None, &path("none"));
    assert_eq!(none.status.code(), Some(1));
    assert!(text(&none).contains("requires a token"), "{}", text(&none));
    let wrong = scan(&served, Some(&path("wrong")), &path("wrong-out"));
    assert_eq!(wrong.status.code(), Some(1));
    assert!(text(&wrong).contains("wrong token"), "{}", text(&wrong));
    for output in [&none, &wrong] {
        assert!(!text(output).contains(TOKEN), "{}", text(output));
    }
    let right = scan(&served, Some(&path("token")), &path("right"));
    assert_eq!(right.status.code(), Some(0), "{}", text(&right));

    // The Unix socket needs no token.
    let unix = served.scan(&path("unix"), &[]);
    assert_eq!(unix.status.code(), Some(0), "{}", text(&unix));
    served.stop(Signal::TERM);
}

#[test]
fn clients_without_the_token_hold_no_places() {
    let (folder, served) = with_token();
    // Far more silent clients than allowed. The oldest are evicted in favour of others; the
    // remaining ones are refused after 5 s.
    let silent: Vec<_> = (0..3 * PLACES).map(|_| connect(&served)).collect();
    let right = scan(
        &served,
        Some(&folder.path().join("token")),
        &folder.path().join("out"),
    );
    assert_eq!(right.status.code(), Some(0), "{}", text(&right));
    let last = rest(silent.last().unwrap());
    assert!(
        last.starts_with("PHTK\nPHNO ") && last.contains("no token within 5 s"),
        "{last}"
    );
    // A client that sends garbage is refused too.
    let mut garbage = connect(&served);
    garbage.write_all(&[b'x'; 1000]).unwrap();
    let reason = rest(garbage);
    assert!(reason.contains("wrong token"), "{reason}");
    served.stop(Signal::TERM);
}

#[test]
fn client_with_a_token_explains_a_device_without_one() {
    // This device waits for a trigger, so it sends nothing.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("token");
    std::fs::write(&file, TOKEN).unwrap();
    let mut command = phasmid();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    command.args(["camera", "info", &address, "--timeout", "0.3"]);
    set_token(&mut command, Some(&file));
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output).contains("no answer to the token"),
        "{}",
        text(&output)
    );
}

#[test]
fn full_unix_socket_names_its_limit() {
    let served = Served::start(&[]);
    let camera = served.at.camera_socket.strip_prefix("socket:").unwrap();
    let readers: Vec<_> = (0..PLACES)
        .map(|_| UnixStream::connect(camera).unwrap())
        .collect();
    let refused = UnixStream::connect(camera).unwrap();
    refused
        .set_read_timeout(Some(Duration::from_secs(10)))
        .unwrap();
    let reason = rest(refused);
    assert!(reason.contains("at most 32 on the Unix socket"), "{reason}");
    drop(readers);
    served.stop(Signal::TERM);
}

#[test]
fn unusable_token_files_are_refused_with_their_option() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("token");
    for (content, found) in [
        ("short", "a token of 5 characters"),
        ("0123456789abcdef\nmore\n", "several lines"),
    ] {
        std::fs::write(&file, content).unwrap();
        let output = phasmid()
            .args(["serve", "--scene", "plane", "--tcp", "0", "--tcp-token"])
            .arg(&file)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2));
        let message = text(&output);
        assert!(
            message.contains("--tcp-token: ") && message.contains(found),
            "{message}"
        );
        assert!(!message.contains("0123456789"), "{message}");
        let mut command = phasmid();
        command.args(["camera", "info", "tcp:127.0.0.1:1"]);
        set_token(&mut command, Some(&file));
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output).contains(TOKEN_FILE), "{}", text(&output));
    }
}
