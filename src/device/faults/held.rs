//! A bounded queue of items that must not leave before their due times; items leave in order.

use std::collections::VecDeque;

/// Items in transit: each leaves no earlier than its due time and no earlier than the item ahead of
/// it.
#[derive(Debug)]
pub(super) struct Held<T> {
    queue: VecDeque<(u64, usize, T)>,
    bytes: usize,
    most_bytes: usize,
}

impl<T> Held<T> {
    /// Returns a queue with room for `most_bytes` bytes.
    pub(super) fn new(most_bytes: usize) -> Self {
        Self {
            queue: VecDeque::new(),
            bytes: 0,
            most_bytes,
        }
    }

    /// Appends an item of `bytes` bytes that is due at `from_ns`. Returns `false` and drops the item
    /// if it does not fit behind items that are not due yet.
    pub(super) fn push(&mut self, now_ns: u64, from_ns: u64, bytes: usize, thing: T) -> bool {
        let waits = self.next_ns().is_some_and(|next_ns| next_ns > now_ns);
        if waits && self.bytes.saturating_add(bytes) > self.most_bytes {
            return false;
        }
        self.bytes += bytes;
        self.queue.push_back((from_ns, bytes, thing));
        true
    }

    /// Takes the first item if it is due.
    pub(super) fn pop(&mut self, now_ns: u64) -> Option<T> {
        if self.queue.front()?.0 > now_ns {
            return None;
        }
        let (_, bytes, thing) = self.queue.pop_front()?;
        self.bytes -= bytes;
        Some(thing)
    }

    /// Returns when the first item may leave.
    pub(super) fn next_ns(&self) -> Option<u64> {
        self.queue.front().map(|(from_ns, ..)| *from_ns)
    }

    pub(super) fn clear(&mut self) {
        self.queue.clear();
        self.bytes = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holds_items_in_order_until_due_within_its_capacity() {
        let mut held = Held::new(10);
        assert!(held.push(0, 5, 100, 'a') && !held.push(4, 0, 1, 'b'));
        assert_eq!((held.pop(4), held.next_ns()), (None, Some(5)));
        assert_eq!((held.pop(5), held.next_ns()), (Some('a'), None));
        assert!(held.push(5, 7, 4, 'c') && held.push(5, 3, 6, 'd') && !held.push(6, 0, 1, 'e'));
        assert_eq!(
            (held.pop(6), held.pop(7), held.pop(7)),
            (None, Some('c'), Some('d'))
        );
        // Items that are due do not count towards the limit.
        assert!(held.push(9, 0, 10, 'f') && held.push(9, 0, 10, 'g'));
        held.clear();
        assert_eq!((held.pop(9), held.next_ns()), (None, None));
    }
}
