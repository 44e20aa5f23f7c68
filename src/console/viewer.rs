//! Serves one viewer over one WebSocket. A frame is sent only after the page has drawn an earlier
//! frame. A slow or paused page therefore receives fewer frames, each the latest at that time, and
//! frames do not queue.

use crate::hub::{Seat, View};
use crate::operator::Request;
use crate::views::{Wanted, failed, messages};
use crate::wire::{
    Asked, Told, frame_message, message, room_message, sequence_message, tracked_message,
};
use axum::extract::ws::{Message, WebSocket};
use serde_json::Value;
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use tokio::task::{JoinHandle, JoinSet};

/// Maximum number of frames that have been sent but not drawn yet.
const MAX_AHEAD: usize = 2;
/// Number of recent frames over which the reported median delay is computed.
const DELAYS: usize = 60;
/// Maximum time for the browser to accept a message.
const STALL: Duration = Duration::from_secs(30);
/// Time between two pings, which browsers answer by themselves.
const PING: Duration = Duration::from_secs(20);
/// Time without an answer after which a viewer is gone.
const SILENCE: Duration = Duration::from_secs(70);

/// Maximum number of requests of a viewer that are being answered.
const MAX_ASKED: usize = 8;
/// Time between two messages of traffic.
const TRAFFIC: Duration = Duration::from_millis(100);

/// The number of a request, and the answer or the reason why it was refused.
type Answer = (u64, Result<Value, String>);

/// The state of a viewer.
struct Viewer {
    socket: WebSocket,
    seat: Seat,
    /// The source whose frames are shown.
    source: usize,
    /// Number of the last frame that was sent.
    sent: u64,
    /// Numbers and arrival times of the frames that have been sent but not drawn yet.
    ahead: VecDeque<(u64, Instant)>,
    /// Number of the last sequence that was sent.
    sequence: u64,
    /// Number of the last room that was sent.
    room: u64,
    /// Number of the last result of the room that was sent.
    row: u64,
    /// Wanted views of measurements.
    wanted: Wanted,
    /// Number of the last measurement whose views were sent or are being computed.
    measured: u64,
    /// Messages of a measurement that are being computed.
    work: Option<Work>,
    /// Number of the measurement or results that have been sent but that the page has not drawn
    /// yet.
    unseen: Option<u64>,
    /// Number of the last event that was sent; `None` if the page does not show events.
    traffic: Option<u64>,
    /// Requests that are being answered.
    asked: JoinSet<Answer>,
    /// Times from the arrival of recent frames to when they were drawn, in milliseconds.
    delays: VecDeque<f64>,
}

/// Messages of a measurement that are being computed.
struct Work {
    number: u64,
    /// Whether the viewer still wants these messages.
    wanted: bool,
    messages: JoinHandle<Vec<Vec<u8>>>,
}

/// Waits for the messages that are being computed; never returns if `work` is `None`.
async fn done(work: &mut Option<Work>, source: usize) -> Vec<Vec<u8>> {
    let Some(work) = work else {
        return std::future::pending().await;
    };
    let messages = (&mut work.messages).await;
    messages.unwrap_or_else(|_| failed(source, work.number, "the scan could not be shown".into()))
}

/// Serves a viewer until it leaves.
pub(crate) async fn serve(socket: WebSocket, seat: Seat) {
    let viewer = Viewer {
        socket,
        seat,
        source: 0,
        sent: 0,
        ahead: VecDeque::new(),
        sequence: 0,
        room: 0,
        row: 0,
        wanted: Wanted::default(),
        measured: 0,
        work: None,
        unseen: None,
        traffic: None,
        asked: JoinSet::new(),
        delays: VecDeque::new(),
    };
    viewer.run().await;
}

impl Viewer {
    /// Serves the viewer; returns when the viewer has left or does not accept a message.
    async fn run(mut self) -> Option<()> {
        let mut view = None;
        let mut heard = Instant::now();
        let mut ping = tokio::time::interval(PING);
        let mut traffic = tokio::time::interval(TRAFFIC);
        traffic.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        loop {
            let now = self.seat.view();
            if view.as_ref() != Some(&now) {
                let era = |view: &View| view.sources.get(self.source).map(|source| source.era);
                if view.as_ref().is_some_and(|view| era(view) != era(&now)) {
                    self.measure_again();
                    // On a restart, the page forgets the frames that it has not drawn.
                    self.ahead.clear();
                }
                self.send(Message::Binary(message(&Told::State(&now), &[]).into()))
                    .await?;
                view = Some(now);
            }
            if self.ahead.len() < MAX_AHEAD
                && let Some(shown) = self.seat.newer(self.source, self.sent)
            {
                self.sent = shown.number;
                self.ahead.push_back((shown.number, shown.arrived));
                let bytes = frame_message(self.source, &shown, self.delay_ms());
                self.send(Message::Binary(bytes.into())).await?;
            }
            if let Some(sequence) = self.seat.newer_sequence(self.source, self.sequence) {
                self.sequence = sequence.number;
                let bytes = sequence_message(self.source, &sequence.value.manifest);
                self.send(Message::Binary(bytes.into())).await?;
            }
            self.send_room().await?;
            self.measure();
            tokio::select! {
                messages = done(&mut self.work, self.source) => self.show(messages).await?,
                asked = self.socket.recv() => {
                    heard = Instant::now();
                    match asked?.ok()? {
                        // An invalid message ends the connection.
                        Message::Text(text) => self.answer(serde_json::from_str(&text).ok()?).await?,
                        Message::Close(_) => return None,
                        _ => {}
                    }
                }
                _ = ping.tick() => {
                    if heard.elapsed() > SILENCE {
                        return None;
                    }
                    self.send(Message::Ping(Vec::new().into())).await?;
                }
                _ = traffic.tick(), if self.traffic.is_some() => self.send_traffic().await?,
                Some(answered) = self.asked.join_next() => {
                    // If the task failed, the operator panicked; the panic has been reported.
                    if let Ok((number, answer)) = answered {
                        self.send_answer(number, answer).await?;
                    }
                }
                () = self.seat.changed() => {}
            }
        }
    }

    /// Sends a new treatment room at once, and new results as soon as the page has drawn the
    /// earlier results.
    async fn send_room(&mut self) -> Option<()> {
        if let Some(room) = self.seat.newer_room(self.source, self.room) {
            self.room = room.number;
            let bytes = room_message(self.source, &room.value);
            self.send(Message::Binary(bytes.into())).await?;
        }
        if self.unseen.is_none()
            && let Some(new) = self.seat.newer_rows(self.source, self.row)
        {
            (self.row, self.unseen) = (new.last, Some(new.last));
            let bytes = tracked_message(self.source, new.last, &new.rows, &new.scan);
            self.send(Message::Binary(bytes.into())).await?;
        }
        Some(())
    }

    /// Starts to compute the wanted views of the latest measurement, once the page has drawn the
    /// previous measurement.
    fn measure(&mut self) {
        if self.work.is_some() || self.unseen.is_some() || self.wanted.is_nothing() {
            return;
        }
        if let Some(latest) = self.seat.newer_measurement(self.source, self.measured) {
            let (source, wanted) = (self.source, self.wanted.clone());
            let number = latest.number;
            self.measured = number;
            self.work = Some(Work {
                number,
                wanted: true,
                messages: tokio::task::spawn_blocking(move || messages(source, &latest, &wanted)),
            });
        }
    }

    /// Sends the messages of a measurement, unless the viewer wants other views by now.
    async fn show(&mut self, messages: Vec<Vec<u8>>) -> Option<()> {
        let work = self.work.take()?;
        if work.wanted {
            self.unseen = Some(work.number);
            for message in messages {
                self.send(Message::Binary(message.into())).await?;
            }
        }
        Some(())
    }

    /// Sends the views of the latest measurement again.
    fn measure_again(&mut self) {
        self.measured = 0;
        if let Some(work) = &mut self.work {
            work.wanted = false;
        }
    }

    async fn send_traffic(&mut self) -> Option<()> {
        let sent = self.traffic?;
        let events = self.seat.traffic(self.source, sent);
        let Some(last) = events.last() else {
            return Some(());
        };
        self.traffic = Some(last.number);
        let source = self.source;
        let told = message(&Told::Traffic { source, events }, &[]);
        self.send(Message::Binary(told.into())).await
    }

    /// Passes a request to the source's operator, or refuses it.
    async fn ask(&mut self, number: u64, request: Request) -> Option<()> {
        let operator = match self.seat.operator(self.source, &request) {
            Ok(_) if self.asked.len() == MAX_ASKED => Err("too many requests at a time"),
            operator => operator,
        };
        match operator {
            Ok(operator) => {
                self.asked.spawn_blocking(move || {
                    let answer = operator.answer(&request);
                    (number, answer.map_err(|e| e.to_string()))
                });
                Some(())
            }
            Err(why) => self.send_answer(number, Err(why.into())).await,
        }
    }

    async fn send_answer(&mut self, number: u64, answer: Result<Value, String>) -> Option<()> {
        let (answer, error) = match answer {
            Ok(answer) => (Some(answer), None),
            Err(why) => (None, Some(why)),
        };
        let told = Told::Answer {
            number,
            answer,
            error,
        };
        self.send(Message::Binary(message(&told, &[]).into())).await
    }

    async fn answer(&mut self, asked: Asked) -> Option<()> {
        match asked {
            Asked::Drawn { source, number } if source == self.source => {
                // If the page has drawn a later frame, it has skipped the earlier frames.
                while let Some((sent, arrived)) = self.ahead.front().copied()
                    && sent <= number
                {
                    self.ahead.pop_front();
                    if sent == number {
                        self.delays.push_back(arrived.elapsed().as_secs_f64() * 1e3);
                    }
                }
                while self.delays.len() > DELAYS {
                    self.delays.pop_front();
                }
            }
            Asked::Watch { source } if source != self.source => {
                self.source = source;
                self.sent = 0;
                self.ahead.clear();
                (self.sequence, self.room, self.row) = (0, 0, 0);
                self.unseen = None;
                self.traffic = self.traffic.map(|_| 0);
                self.measure_again();
            }
            Asked::Traffic { show } => self.traffic = show.then_some(0),
            Asked::Ask { number, request } => self.ask(number, request).await?,
            Asked::Show { layers, cloud } => {
                let wanted = Wanted { layers, cloud };
                if wanted != self.wanted {
                    self.wanted = wanted;
                    self.measure_again();
                }
            }
            Asked::Seen { source, number } if source == self.source => {
                self.unseen = self.unseen.filter(|unseen| *unseen != number);
            }
            Asked::Drawn { .. } | Asked::Watch { .. } | Asked::Seen { .. } => {}
            Asked::Control { take, if_free } => self.seat.control(take, if_free),
        }
        Some(())
    }

    fn delay_ms(&self) -> Option<f64> {
        let mut sorted: Vec<_> = self.delays.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied()
    }

    async fn send(&mut self, message: Message) -> Option<()> {
        let sent = self.socket.send(message);
        tokio::time::timeout(STALL, sent).await.ok()?.ok()
    }
}
