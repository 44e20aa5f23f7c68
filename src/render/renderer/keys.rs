//! Cache of the geometry at key instants of a moving scene.

use crate::exposure::GeometryBuffer;
use crate::scene::Span;
use crate::transport::Between;
use std::collections::VecDeque;
use std::sync::Arc;

/// Maximum number of key instants kept. If a span is rejected, the shorter spans within it use its
/// key instants again.
const MOST_KEYS: usize = 8;
/// Maximum number of spans for which the decision to interpolate is kept.
const MOST_SPANS: usize = 16;

/// Geometry at key instants, and the spans that are interpolated. Both depend only on the scene, the
/// plan and device time, so no frame depends on what the cache holds.
#[derive(Default)]
pub(super) struct Keys {
    traced: VecDeque<(u64, Arc<GeometryBuffer>)>,
    spans: VecDeque<(Span, Option<Arc<Between>>)>,
}

impl Keys {
    /// Returns the geometry at a key instant in nanoseconds of device time, if it is kept.
    pub(super) fn traced(&self, time_ns: u64) -> Option<Arc<GeometryBuffer>> {
        let mut all = self.traced.iter();
        let (_, buffer) = all.find(|(at, _)| *at == time_ns)?;
        Some(buffer.clone())
    }

    pub(super) fn keep(&mut self, time_ns: u64, buffer: Arc<GeometryBuffer>) {
        self.traced.truncate(MOST_KEYS - 1);
        self.traced.push_front((time_ns, buffer));
    }

    /// Returns the cached decision on a span, if there is one. The decision is the span's
    /// interpolation, or `None` if the span is not interpolated.
    pub(super) fn decided(&self, span: Span) -> Option<Option<Arc<Between>>> {
        let mut all = self.spans.iter();
        let (_, found) = all.find(|(of, _)| *of == span)?;
        Some(found.clone())
    }

    pub(super) fn decide(&mut self, span: Span, found: Option<Arc<Between>>) {
        self.spans.truncate(MOST_SPANS - 1);
        self.spans.push_front((span, found));
    }
}
