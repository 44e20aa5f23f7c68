//! Slots for connections to the service channel. When all slots are taken, the client that has been
//! idle the longest is disconnected, so that forgotten connections block nobody.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::time::Instant;

/// Maximum number of clients.
pub(super) const MAX_CLIENTS: usize = 16;
/// A client that has been idle for this long can be disconnected to make room for a new one.
pub(super) const IDLE: Duration = Duration::from_secs(10);

/// The slots of all clients; clones share them.
#[derive(Clone)]
pub(super) struct Places {
    idle: Duration,
    shared: Arc<Mutex<Shared>>,
}

#[derive(Default)]
struct Shared {
    clients: BTreeMap<u64, Client>,
    next: u64,
}

struct Client {
    /// Time at which the client connected or was last answered; `None` while its request is in
    /// progress.
    idle_since: Option<Instant>,
    leave: Arc<Notify>,
}

impl Places {
    /// Returns a set of free slots. A client that has been idle for `idle` can be disconnected to
    /// make room for a new one.
    pub(super) fn new(idle: Duration) -> Self {
        Self {
            idle,
            shared: Arc::default(),
        }
    }

    /// Returns the number of slots taken.
    pub(super) fn taken(&self) -> usize {
        self.shared().clients.len()
    }

    /// Returns a slot for a new client.
    ///
    /// # Errors
    /// Returns an error, worded for the reply, if all slots are taken and no client is idle long
    /// enough.
    pub(super) fn enter(&self) -> Result<Place, String> {
        let mut shared = self.shared();
        if shared.clients.len() >= MAX_CLIENTS {
            let idle = shared.clients.iter().filter_map(|(number, client)| {
                let since = client.idle_since?;
                (since.elapsed() >= self.idle).then_some((since, *number))
            });
            let Some((_, longest)) = idle.min() else {
                return Err(format!(
                    "service channel: one connection too many; expected at most {MAX_CLIENTS} at a \
                     time, or one that has been idle for {} s, which is then closed",
                    self.idle.as_secs_f64()
                ));
            };
            if let Some(client) = shared.clients.remove(&longest) {
                client.leave.notify_one();
            }
        }
        let number = shared.next;
        shared.next += 1;
        let leave = Arc::new(Notify::new());
        let client = Client {
            idle_since: Some(Instant::now()),
            leave: leave.clone(),
        };
        shared.clients.insert(number, client);
        Ok(Place {
            places: self.clone(),
            number,
            leave,
        })
    }

    fn shared(&self) -> MutexGuard<'_, Shared> {
        // A client task that panicked leaves no partial change here.
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A client's slot; dropping it frees the slot.
pub(super) struct Place {
    places: Places,
    number: u64,
    leave: Arc<Notify>,
}

impl Place {
    /// Marks the client as idle, or as waiting for an answer.
    pub(super) fn set_idle(&self, idle: bool) {
        if let Some(client) = self.places.shared().clients.get_mut(&self.number) {
            client.idle_since = idle.then(Instant::now);
        }
    }

    /// Waits until the client has to disconnect to make room for another.
    pub(super) async fn taken_back(&self) {
        self.leave.notified().await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.shared().clients.remove(&self.number);
    }
}
