//! Clients that idle, flood, disconnect, or are too many.

use super::places::MAX_CLIENTS;
use super::*;
use phasmid_protocol::service::MAX_LINE;
use std::io::{BufRead, BufReader, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream as Client;
use std::sync::Mutex;
use std::thread::{JoinHandle, sleep};
use std::time::Instant;

const SOON: Duration = Duration::from_secs(10);
const NEVER: Duration = Duration::from_secs(3600);
/// A request that the channel answers at once with an empty reply.
const QUICK: &[u8] = b"{\"get\":\"device\"}\n";
/// A request that remains unanswered until the test answers it.
const SLOW: &[u8] = b"{\"get\":\"clock\"}\n";

/// A service channel served on its own thread.
struct Channel {
    dir: tempfile::TempDir,
    /// Requests that wait for the test to answer them.
    waiting: Arc<Mutex<Vec<oneshot::Sender<Answer>>>>,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Channel {
    /// Opens a channel in which a client idle for `idle` can be disconnected in favour of a new one.
    fn open(idle: Duration) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("service.sock");
        let waiting = Arc::new(Mutex::new(Vec::new()));
        let kept = waiting.clone();
        let (end, mut ended) = oneshot::channel();
        let (ready, is_ready) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build();
            runtime.unwrap().block_on(async move {
                let mut socket = ServiceSocket::open(&path).unwrap();
                socket.places = Places::new(idle);
                ready.send(()).unwrap();
                loop {
                    tokio::select! {
                        (request, reply) = socket.next() => match request {
                            Request::Get(phasmid_protocol::service::Item::Clock) => {
                                kept.lock().unwrap().push(reply);
                            }
                            _ => drop(reply.send((Reply::default(), Vec::new()))),
                        },
                        _ = &mut ended => return,
                    }
                }
            });
        });
        is_ready.recv().unwrap();
        Self {
            dir,
            waiting,
            end: Some(end),
            thread: Some(thread),
        }
    }

    fn client(&self) -> BufReader<Client> {
        let stream = Client::connect(self.dir.path().join("service.sock")).unwrap();
        stream.set_read_timeout(Some(SOON)).unwrap();
        stream.set_write_timeout(Some(SOON)).unwrap();
        BufReader::new(stream)
    }

    /// Waits until `holds` returns true for the waiting requests.
    fn until(&self, holds: impl Fn(&[oneshot::Sender<Answer>]) -> bool) {
        let end = Instant::now() + SOON;
        while !holds(&self.waiting.lock().unwrap()) {
            assert!(Instant::now() < end);
            sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Channel {
    fn drop(&mut self) {
        drop(self.end.take());
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn send(client: &mut BufReader<Client>, bytes: &[u8]) {
    client.get_mut().write_all(bytes).unwrap();
}

/// Returns the error in the next line that the client reads, if any.
fn error(client: &mut BufReader<Client>) -> Option<String> {
    let mut line = Vec::new();
    client.read_until(b'\n', &mut line).unwrap();
    Reply::parse(&line).unwrap().error
}

fn is_over(client: &mut BufReader<Client>) -> bool {
    client.fill_buf().unwrap().is_empty()
}

#[test]
fn a_line_that_is_too_long_is_refused_and_the_connection_goes_on() {
    let channel = Channel::open(NEVER);
    for length in [MAX_LINE, MAX_LINE + 1, 3 << 20] {
        let mut client = channel.client();
        // The client continues to write before it reads.
        send(&mut client, &vec![b'x'; length]);
        send(&mut client, b"\n");
        send(&mut client, QUICK);
        let words = error(&mut client).unwrap();
        assert!(words.contains("up to 4096 bytes"), "{words}");
        assert_eq!(error(&mut client), None, "{length}");
    }
    // A line that is too long is refused before it ends; a line without a newline at the end of the
    // input is refused too.
    let mut client = channel.client();
    send(&mut client, &vec![b'x'; MAX_LINE]);
    assert!(error(&mut client).unwrap().contains("up to 4096 bytes"));
    send(&mut client, b"\n{");
    client.get_ref().shutdown(Shutdown::Write).unwrap();
    assert!(error(&mut client).unwrap().contains("a line of JSON"));
    assert!(is_over(&mut client));
}

#[test]
fn client_beyond_the_limit_is_refused() {
    let channel = Channel::open(NEVER);
    let mut clients: Vec<_> = (0..MAX_CLIENTS).map(|_| channel.client()).collect();
    for client in &mut clients {
        send(client, QUICK);
        assert_eq!(error(client), None);
    }
    let mut more = channel.client();
    send(&mut more, QUICK);
    let words = error(&mut more).unwrap();
    assert!(words.contains("expected at most 16 at a time"), "{words}");
    assert!(is_over(&mut more));
    // The other clients are still connected, and a freed slot can be taken.
    send(&mut clients[0], QUICK);
    assert_eq!(error(&mut clients[0]), None);
    drop(clients.pop());
    let end = Instant::now() + SOON;
    loop {
        let mut next = channel.client();
        send(&mut next, QUICK);
        match error(&mut next) {
            None => break,
            Some(words) => assert!(Instant::now() < end, "{words}"),
        }
    }
}

#[test]
fn longest_idle_client_makes_room() {
    let channel = Channel::open(Duration::ZERO);
    let mut clients: Vec<_> = (0..MAX_CLIENTS).map(|_| channel.client()).collect();
    // The first client waits for its answer; the others are idle, and the second has been idle the
    // longest.
    send(&mut clients[0], SLOW);
    channel.until(|waiting| waiting.len() == 1);
    for client in &mut clients[1..] {
        send(client, QUICK);
        assert_eq!(error(client), None);
    }
    let mut more = channel.client();
    send(&mut more, QUICK);
    assert_eq!(error(&mut more), None);
    let words = error(&mut clients[1]).unwrap();
    assert!(words.contains("to make room for another client"), "{words}");
    assert!(is_over(&mut clients[1]));
    let answer = channel.waiting.lock().unwrap().remove(0);
    answer.send((Reply::default(), Vec::new())).unwrap();
    assert_eq!(error(&mut clients[0]), None);
}

#[test]
fn device_learns_when_a_waiting_client_has_left() {
    let channel = Channel::open(NEVER);
    let mut listens = channel.client();
    send(&mut listens, SLOW);
    channel.until(|waiting| waiting.len() == 1);
    // The client shuts down its sending side only.
    listens.get_ref().shutdown(Shutdown::Write).unwrap();
    let mut leaves = channel.client();
    send(&mut leaves, SLOW);
    send(&mut leaves, SLOW);
    channel.until(|waiting| waiting.len() == 2);
    drop(leaves);
    channel.until(|waiting| waiting[1].is_closed());
    let answer = channel.waiting.lock().unwrap().remove(0);
    assert!(!answer.is_closed());
    answer.send((Reply::default(), Vec::new())).unwrap();
    assert_eq!(error(&mut listens), None);
}
