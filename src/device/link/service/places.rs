//! Who is on the service channel. Where all places are taken, who has asked nothing for the longest
//! makes room, so that forgotten connections lock nobody out.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::time::Instant;

/// Clients at a time.
pub(super) const MAX_CLIENTS: usize = 16;
/// Who has asked nothing for so long makes room for others.
pub(super) const IDLE: Duration = Duration::from_secs(10);

/// The places of all clients.
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
    /// When it was answered last, or came; `None` while it is.
    idle_since: Option<Instant>,
    leave: Arc<Notify>,
}

impl Places {
    /// Places of clients that have to make room when they have been idle for so long.
    pub(super) fn new(idle: Duration) -> Self {
        Self {
            idle,
            shared: Arc::default(),
        }
    }

    /// How many are taken.
    pub(super) fn taken(&self) -> usize {
        self.shared().clients.len()
    }

    /// A place for one more client.
    ///
    /// # Errors
    /// None left and nobody idle, worded for the reply.
    pub(super) fn enter(&self) -> Result<Place, String> {
        let mut shared = self.shared();
        if shared.clients.len() >= MAX_CLIENTS {
            let idle = shared.clients.iter().filter_map(|(number, client)| {
                let since = client.idle_since?;
                (since.elapsed() >= self.idle).then_some((since, *number))
            });
            let Some((_, longest)) = idle.min() else {
                return Err(format!(
                    "service channel: one more connection; allowed: {MAX_CLIENTS} at a time, of \
                     which one that has asked nothing for {} s makes room",
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
        // A client that has died leaves nothing half done here.
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A client's place; free again when this is dropped.
pub(super) struct Place {
    places: Places,
    number: u64,
    leave: Arc<Notify>,
}

impl Place {
    /// The client asks nothing, from now on, or is being answered.
    pub(super) fn set_idle(&self, idle: bool) {
        if let Some(client) = self.places.shared().clients.get_mut(&self.number) {
            client.idle_since = idle.then(Instant::now);
        }
    }

    /// Waits until the client has to make room.
    pub(super) async fn taken_back(&self) {
        self.leave.notified().await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.shared().clients.remove(&self.number);
    }
}
