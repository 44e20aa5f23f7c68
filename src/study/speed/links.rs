//! The links that carry commands to a device and its frames to the host, and what the tables have of
//! each.
//!
//! The device's clock is the fast one: what would be exposure on a real device takes no time, and
//! what is left is what a link and a rendering take. Exposures are short all the same, for a V4L2
//! node is given frames no closer to each other than they were exposed.

use super::passes::bench;
use phasmid_core::error::{Error, Result};
use phasmid_profile::Profile;
use phasmid_report::lab::{Context, Row, Settings, Trial};

/// Exposure of a frame in microseconds, and the period of a pattern.
const SHORT_US: [f64; 2] = [100.0, 200.0];

/// How commands and frames travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Link {
    /// Not at all: the device is called.
    Memory,
    /// A pty and the frame socket.
    Socket,
    /// A pty and TCP on the loopback interface.
    Tcp,
    /// USB/IP on the loopback interface, with the host's own drivers.
    UsbIp,
    /// A pty and a node of v4l2loopback.
    Video,
    /// USB/IP to this machine's kernel, whose `uvcvideo` and `cdc_acm` make nodes of it.
    Kernel,
}

/// In the order of the tables.
pub(super) const LINKS: [Link; 6] = [
    Link::Memory,
    Link::Socket,
    Link::Tcp,
    Link::UsbIp,
    Link::Video,
    Link::Kernel,
];

impl Link {
    /// What the tables call it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Memory => "in memory",
            Self::Socket => "pty and frame socket",
            Self::Tcp => "pty and TCP",
            Self::UsbIp => "USB/IP",
            Self::Video => "pty and V4L2",
            Self::Kernel => "USB of the kernel",
        }
    }

    /// The one that is called so.
    pub(super) fn named(name: &str) -> Option<Self> {
        LINKS.into_iter().find(|link| link.name() == name)
    }

    /// Whether some machines lack it: it needs a module of the kernel, or another system.
    pub(super) fn by_chance(self) -> bool {
        match self {
            Self::Memory => false,
            Self::Video | Self::Kernel => true,
            _ => cfg!(not(target_os = "linux")),
        }
    }

    /// Whether frames that the host does not take in time are overwritten.
    pub(super) fn overwrites(self) -> bool {
        self == Self::Video
    }
}

/// Why a link has no figures.
pub(super) enum Missing {
    /// This machine lacks what it needs.
    Lack(String),
    /// It is there and does not work.
    Broken(String),
}

impl From<Error> for Missing {
    fn from(e: Error) -> Self {
        Self::Broken(e.to_string())
    }
}

/// A trial of all links.
pub(super) fn trial(
    settings: &Settings,
    group: &'static str,
    work: fn(&Context<'_>, &'static str) -> Result<Vec<Row>>,
) -> Trial {
    let work = move |ctx: &Context<'_>| work(ctx, group);
    Trial::new(format!("link/{group}"), settings.seed, work).alone()
}

/// What each link has given in some rounds, or why it has nothing. A machine's speed wanders, so the
/// links take turns: what one round is slow for, all of them have.
pub(super) fn in_turns<T>(
    rounds: usize,
    mut once: impl FnMut(Link) -> Result<Vec<T>, Missing>,
) -> Vec<(Link, Result<Vec<T>, Missing>)> {
    let mut found: Vec<_> = LINKS
        .into_iter()
        .map(|link| (link, Ok(Vec::new())))
        .collect();
    for _ in 0..rounds {
        for (link, all) in &mut found {
            if let Ok(so_far) = all {
                match once(*link) {
                    Ok(more) => so_far.extend(more),
                    Err(missing) => *all = Err(missing),
                }
            }
        }
    }
    found
}

/// The bench with the data line, by which frames are told on links that say nothing else of them.
pub(super) fn profile(settings: &Settings) -> Result<Profile> {
    let mut profile = bench(settings)?;
    profile.camera.data_line = true;
    let [exposure_us, period_us] = SHORT_US;
    // As much light as before.
    profile.projector.radiant_intensity_w_sr *= profile.camera.exposure_us / exposure_us;
    profile.camera.exposure_us = exposure_us;
    for sequence in &mut profile.sequence {
        sequence.period_us = period_us;
    }
    Ok(profile)
}

/// Bytes of a frame on a link.
pub(super) fn bytes(profile: &Profile) -> usize {
    let camera = &profile.camera;
    camera.width_px as usize * (camera.height_px as usize + 1)
}

/// Frames of the sequence.
pub(super) fn patterns(profile: &Profile) -> usize {
    profile.sequence[0].frame.len()
}

/// A row of a link, with what was found or why there is nothing.
pub(super) fn row<T>(
    group: &str,
    link: Link,
    found: Result<T, Missing>,
    complete: impl FnOnce(Row, T) -> Row,
) -> Row {
    let row = Row::new().text("group", group).text("name", link.name());
    match found {
        Ok(found) => complete(row, found),
        // Machines differ in what they have, so this is no failure of the study.
        Err(Missing::Lack(why)) => row.text("state", "lacking").text("note", &why),
        Err(Missing::Broken(why)) => row.text("state", "broken").text("note", &why),
    }
}
