//! Observer of link events.

use super::{Channel, Event};
use std::fmt;
use std::sync::Arc;

type Seen = dyn Fn(u64, Channel, &Event) + Send + Sync;

/// Receives the events of links as they happen: the same events as in a recording, at the same times
/// in nanoseconds.
///
/// It is called on the thread that serves the links, and must not block.
#[derive(Clone)]
pub struct Observer(Arc<Seen>);

impl Observer {
    /// Passes events to a function.
    pub fn new(seen: impl Fn(u64, Channel, &Event) + Send + Sync + 'static) -> Self {
        Self(Arc::new(seen))
    }

    /// Passes an event on.
    pub fn see(&self, time_ns: u64, channel: Channel, event: &Event) {
        (self.0)(time_ns, channel, event);
    }
}

impl fmt::Debug for Observer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Observer")
    }
}
