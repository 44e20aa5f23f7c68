//! Messages that are printed when devices become reachable and when they end.

use phasmid_protocol::Endpoints;
use phasmid_protocol::service::Clock;
use std::io::Write;

/// Prints how to reach a device. `about` describes the camera, or says why it is not a V4L2 node.
pub(super) fn announce(endpoints: &Endpoints, about: &str) {
    let mut text = format!(
        "{} looking at {}\n  control  {}\n",
        endpoints.profile.as_deref().unwrap_or_default(),
        endpoints.scene.as_deref().unwrap_or_default(),
        endpoints.control.display(),
    );
    if let Some(tty) = &endpoints.control_usb {
        text += &format!("           {}\n", tty.display());
    }
    if let Some(dialect) = &endpoints.dialect {
        text += &match endpoints.baud {
            Some(baud) => format!("           {dialect} at {baud} baud\n"),
            None => format!("           {dialect}\n"),
        };
    }
    text += &format!("  camera   {}", endpoints.camera);
    if !about.is_empty() {
        text += &format!(" ({about})");
    }
    text.push('\n');
    if endpoints.camera_socket != endpoints.camera {
        text += &format!("           {}\n", endpoints.camera_socket);
    }
    if let Some(tcp) = &endpoints.camera_tcp {
        text += &format!("           {tcp}\n");
    }
    if let Some(usb) = endpoints
        .usb
        .as_ref()
        .filter(|usb| **usb != endpoints.camera)
    {
        text += &format!("  usb      {usb}\n");
    }
    text += &format!("  service  {}\n", endpoints.service.display());
    if let Some(clock) = endpoints.clock {
        text += &format!("  clock    {}\n", format!("{clock:?}").to_lowercase());
    }
    say(&text);
}

/// Prints the addresses of the console, if there is one, and how to stop, after the last device has
/// been announced.
pub(super) fn announce_end(console: &str) {
    say(&format!("{console}Ctrl-C ends it.\n"));
}

/// Prints at the end of a run how fast frames were rendered and, with the real clock, how late events
/// were handled.
pub(super) fn announce_clock(clock: &Clock) {
    let mut text = String::new();
    if let Some(rendering) = clock.rendering {
        text += &format!(
            "rendering: {} frames at {} times real time\n",
            rendering.frames, rendering.real_time_factor
        );
    }
    if let Some(late) = clock.late.filter(|late| late.events > 0) {
        let ms = |ns: u64| ns as f64 * 1e-6;
        text += &format!(
            "device time: {} events handled {:.3} ms late on average, 99 % of them up to {:.3} ms, all \
             up to {:.3} ms\n",
            late.events,
            ms(late.mean_ns),
            ms(late.percentile_99_ns),
            ms(late.max_ns),
        );
    }
    say(&text);
}

fn say(text: &str) {
    // Keep serving even if standard output is closed.
    let mut out = std::io::stdout();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}
