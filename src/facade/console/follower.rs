//! Finds the scans among the frames of a served device, and shows them.

use super::ScanViews;
use crate::facade::ask_service;
use phasmid_console::Source;
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Capture, FrameInfo};
use phasmid_pattern::Manifest;
use phasmid_protocol::Frame;
use phasmid_protocol::record::{Event, Observer};
use phasmid_protocol::service::{Item, Request};
use std::fmt;
use std::mem::take;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Shows the scans of a device that is being served, whichever program makes them.
///
/// It never uses the device's port: what it needs besides the frames it asks on the service channel. So a
/// scan appears only of a device that is emulated.
///
/// ```
/// # #[cfg(target_os = "linux")] {
/// use phasmid::{Console, ConsoleOptions, Device, Follower, ScanOptions, Scanner, ServeOptions};
///
/// let console = Console::start(&ConsoleOptions::default())?;
/// let follower = Follower::start(console.source("bench"))?;
/// let options = ServeOptions {
///     observer: Some(follower.observer()),
///     ..ServeOptions::default()
/// };
/// let device = Device::builder().profile("webcam-grey").scene("sphere").build()?;
/// let serving = device.serve(&options)?;
/// let at = serving.endpoints();
/// follower.ask_at(&at.service);
/// Scanner::connect(&at.camera, &at.control, ScanOptions::default())?.scan()?;
/// # }
/// # Ok::<(), phasmid::Error>(())
/// ```
pub struct Follower {
    source: Source,
    inbox: Arc<Inbox>,
    thread: Option<JoinHandle<()>>,
}

/// State of the device as seen so far.
#[derive(Default)]
struct Seen {
    /// Path of the device's service channel, once it is known.
    service: Option<PathBuf>,
    /// Frames of the present run of a sequence, from its first.
    run: Vec<Arc<Frame>>,
    /// Whether it has changed since it was last looked at.
    news: bool,
    /// Whether the follower is to end.
    ended: bool,
}

#[derive(Default)]
struct Inbox {
    seen: Mutex<Seen>,
    news: Condvar,
}

impl Inbox {
    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Seen)) {
        let mut seen = self.seen();
        change(&mut seen);
        seen.news = true;
        drop(seen);
        self.news.notify_all();
    }

    /// Adds a frame to the run that it continues, or begins another run.
    fn take(&self, frame: &Arc<Frame>) {
        self.change(|seen| {
            let run = &mut seen.run;
            let due = run.len() as u64;
            let continues = run.first().is_some_and(|first| {
                frame.pattern_index.map(u64::from) == Some(due)
                    && first.id.checked_add(due) == Some(frame.id)
                    && (first.width, first.height) == (frame.width, frame.height)
                    && first.format == frame.format
            });
            if !continues {
                run.clear();
            }
            if continues || frame.pattern_index == Some(0) {
                run.push(frame.clone());
            }
        });
    }
}

impl Follower {
    /// Shows a device's scans as this source of a console.
    ///
    /// # Errors
    /// Returns an error if the system refuses a thread.
    pub fn start(source: Source) -> Result<Self> {
        let inbox = Arc::new(Inbox::default());
        let (theirs, shown) = (inbox.clone(), source.clone());
        let thread = std::thread::Builder::new().name("follower".into());
        let thread = thread.spawn(move || follow(&theirs, &shown));
        Ok(Self {
            source,
            inbox,
            thread: Some(thread.map_err(|e| Error::io("follower", e))?),
        })
    }

    /// Returns the observer for the device's events.
    pub fn observer(&self) -> Observer {
        let (inbox, shown) = (self.inbox.clone(), self.source.observer());
        Observer::new(move |time_ns, channel, event| {
            if let Event::Frame(frame) = event {
                inbox.take(frame);
            }
            shown.see(time_ns, channel, event);
        })
    }

    /// Tells where the device's service channel is. Until then no scan is shown.
    pub fn ask_at(&self, service: impl Into<PathBuf>) {
        self.inbox
            .change(|seen| seen.service = Some(service.into()));
    }
}

impl fmt::Debug for Follower {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Follower")
    }
}

impl Drop for Follower {
    fn drop(&mut self) {
        self.inbox.change(|seen| seen.ended = true);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The sequence of a run.
struct Sequence {
    /// Id of the first frame of the run.
    run: u64,
    name: String,
    /// The manifest as the device has written it, to recognise it again.
    text: String,
    manifest: Arc<Manifest>,
    shown: bool,
}

/// Shows each complete run, until the follower ends.
fn follow(inbox: &Inbox, source: &Source) {
    let mut sequence: Option<Sequence> = None;
    loop {
        let mut seen = inbox.seen();
        while !take(&mut seen.news) && !seen.ended {
            seen = inbox
                .news
                .wait(seen)
                .unwrap_or_else(PoisonError::into_inner);
        }
        if seen.ended {
            return;
        }
        let (Some(service), run) = (seen.service.clone(), seen.run.clone()) else {
            continue;
        };
        drop(seen);
        let Some(first) = run.first() else { continue };
        if sequence.as_ref().is_none_or(|known| known.run != first.id) {
            // A device that does not answer has ended.
            let Ok((reply, _)) = ask_service(&service, &Request::Get(Item::Sequence)) else {
                continue;
            };
            let Some(about) = reply.sequence else {
                continue;
            };
            let known = sequence.take().filter(|known| known.text == about.manifest);
            let manifest = match known {
                Some(known) => known.manifest,
                None => match Manifest::parse(&about.manifest, &about.name) {
                    Ok(manifest) => {
                        let manifest = Arc::new(manifest);
                        source.show_sequence(manifest.clone());
                        manifest
                    }
                    Err(_) => continue,
                },
            };
            sequence = Some(Sequence {
                run: first.id,
                name: about.name,
                text: about.manifest,
                manifest,
                shown: false,
            });
        }
        if let Some(known) = &mut sequence
            && !known.shown
            && run.len() == known.manifest.frame.len()
        {
            known.shown = true;
            // A frame that cannot be unpacked is reported where frames are shown.
            if let Ok(capture) = capture(&run, &known.manifest) {
                let views = ScanViews::new(capture).named(&known.name);
                source.show(Arc::new(views.with_service(service)));
            }
        }
    }
}

fn capture(run: &[Arc<Frame>], manifest: &Manifest) -> Result<Capture> {
    let images = run.iter().map(|frame| Frame::clone(frame).into_image());
    let frames = run.iter().map(|frame| FrameInfo {
        id: frame.id,
        pattern_index: frame.pattern_index,
        exposure_start_ns: frame.exposure_start_ns,
        exposure_end_ns: frame.exposure_end_ns,
    });
    Ok(Capture {
        idn: String::new(),
        manifest: manifest.clone(),
        calibration: None,
        images: images.collect::<Result<_>>()?,
        frames: frames.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::PixelFormat;

    #[test]
    fn run_is_made_of_frames_that_follow_each_other() {
        let inbox = Inbox::default();
        let ids = |frames: &[(u64, Option<u32>)]| {
            for &(id, pattern_index) in frames {
                inbox.take(&Arc::new(Frame {
                    id,
                    pattern_index,
                    width: 1,
                    height: 1,
                    format: PixelFormat::Grey,
                    exposure_start_ns: 0,
                    exposure_end_ns: 1,
                    data: vec![0],
                }));
            }
            inbox
                .seen()
                .run
                .iter()
                .map(|frame| frame.id)
                .collect::<Vec<_>>()
        };
        assert_eq!(ids(&[(3, None), (4, Some(1))]), [0u64; 0]);
        assert_eq!(ids(&[(5, Some(0)), (6, Some(1)), (7, Some(2))]), [5, 6, 7]);
        // One is missing, one is repeated, one belongs to no run.
        assert_eq!(ids(&[(8, Some(4))]), [0u64; 0]);
        assert_eq!(ids(&[(9, Some(0)), (9, Some(1))]), [0u64; 0]);
        assert_eq!(
            ids(&[(10, Some(0)), (11, Some(0)), (12, Some(1))]),
            [11, 12]
        );
        assert_eq!(ids(&[(13, None)]), [0u64; 0]);
    }
}
