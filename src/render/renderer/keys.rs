//! Cache of the geometry at key instants of a moving scene.

use crate::exposure::GeometryBuffer;
use crate::scene::Span;
use crate::transport::Between;
use std::collections::VecDeque;
use std::sync::Arc;

/// Maximum number of key instants kept; each takes some 100 to 250 bytes per pixel. If a span is rejected, the
/// shorter spans within it use its key instants again.
const MOST_KEYS: usize = 4;
/// Maximum number of spans kept that are interpolated; each holds its key instants.
const MOST_SPANS: usize = 2;
/// Maximum number of spans kept that are known not to be interpolated.
const MOST_REJECTED: usize = 16;

/// Geometry at key instants, and the spans that are interpolated. Both depend only on the scene, the
/// plan and device time, so no frame depends on what the cache holds.
#[derive(Default)]
pub(super) struct Keys {
    traced: VecDeque<(u64, Arc<GeometryBuffer>)>,
    spans: VecDeque<(Span, Arc<Between>)>,
    rejected: VecDeque<Span>,
    /// Times of key instants whose memory use is known; `true` if a key instant takes too much
    /// memory.
    oversized: VecDeque<(u64, bool)>,
}

impl Keys {
    /// Returns the geometry at a key instant in nanoseconds of device time, if it is kept.
    pub(super) fn traced(&mut self, time_ns: u64) -> Option<Arc<GeometryBuffer>> {
        let index = self.traced.iter().position(|(at, _)| *at == time_ns)?;
        // The key instants used last are kept longest.
        let key = self.traced.remove(index)?;
        let buffer = key.1.clone();
        self.traced.push_front(key);
        Some(buffer)
    }

    pub(super) fn keep(&mut self, time_ns: u64, buffer: Arc<GeometryBuffer>) {
        self.traced.truncate(MOST_KEYS - 1);
        self.traced.push_front((time_ns, buffer));
    }

    /// Returns whether the key instant at a time takes too much memory, if this is known.
    pub(super) fn oversized(&self, time_ns: u64) -> Option<bool> {
        let known = self.oversized.iter().find(|(at, _)| *at == time_ns)?;
        Some(known.1)
    }

    /// Notes whether the key instant at a time takes too much memory; if so, it is not kept.
    pub(super) fn weigh(&mut self, time_ns: u64, oversized: bool) {
        if oversized {
            self.traced.clear();
        }
        self.oversized.truncate(MOST_REJECTED - 1);
        self.oversized.push_front((time_ns, oversized));
    }

    /// Returns the cached decision on a span, if there is one. The decision is the span's
    /// interpolation, or `None` if the span is not interpolated.
    pub(super) fn decided(&self, span: Span) -> Option<Option<Arc<Between>>> {
        if self.rejected.contains(&span) {
            return Some(None);
        }
        let (_, found) = self.spans.iter().find(|(of, _)| *of == span)?;
        Some(Some(found.clone()))
    }

    pub(super) fn decide(&mut self, span: Span, found: Option<Arc<Between>>) {
        match found {
            Some(found) => {
                self.spans.truncate(MOST_SPANS - 1);
                self.spans.push_front((span, found));
            }
            None => {
                self.rejected.truncate(MOST_REJECTED - 1);
                self.rejected.push_front(span);
            }
        }
    }
}
