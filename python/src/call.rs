//! Runs long calls on a thread pool of this module and without the interpreter's lock, until they
//! have finished or Python raises an exception (for example after Ctrl-C).

use crate::errors::raised;
use phasmid::host::Progress;
use phasmid::{Error, Result, Stop};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::mem;
use std::ops::{ControlFlow, Deref, DerefMut};
use std::process;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, SendError, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two checks for Python signals.
const POLL: Duration = Duration::from_millis(20);
/// Time between two attempts to lock a value that another thread is using.
const RETRY: Duration = Duration::from_millis(1);

/// The pool, and the id of the process that owns its threads. A forked child does not inherit these
/// threads.
///
/// Only a thread that holds the interpreter's lock locks this mutex. A thread that forks also holds
/// the interpreter's lock, so a child never finds the mutex locked.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Returns this process's pool.
pub fn pool(_: Python<'_>) -> PyResult<Arc<ThreadPool>> {
    let mut held = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = process::id();
    if let Some((owner, pool)) = &*held
        && *owner == process
    {
        return Ok(Arc::clone(pool));
    }
    let pool = Arc::new(new_pool()?);
    // Forget the parent's pool instead of dropping it: dropping signals its threads, which do not
    // exist in this process.
    mem::forget(held.replace((process, Arc::clone(&pool))));
    Ok(pool)
}

/// Returns a separate pool for work that waits for a device, because this work would block the
/// threads of [`pool`].
pub fn new_pool() -> PyResult<ThreadPool> {
    let named = ThreadPoolBuilder::new().thread_name(|i| format!("phasmid {i}"));
    named.build().map_err(|why| {
        raised(Error::device(format!(
            "threads of parallel work: {why}; expected more memory, a higher limit, or fewer threads \
             (RAYON_NUM_THREADS)"
        )))
    })
}

/// Checks for Python signals, which only the main thread handles. Other threads do not attach to
/// the interpreter while they wait, because it may end before they do.
#[derive(Default)]
struct Signals {
    is_main: Option<bool>,
}

impl Signals {
    /// # Errors
    /// Returns the exception of a signal.
    fn check(&mut self) -> PyResult<()> {
        if self.is_main == Some(false) {
            return Ok(());
        }
        Python::attach(|py| {
            if self.is_main.is_none() {
                let threading = py.import("threading")?;
                let this = threading.call_method0("current_thread")?;
                self.is_main = Some(this.is(&threading.call_method0("main_thread")?));
            }
            py.check_signals()
        })
    }
}

/// Messages from a long call to the thread that waits for it.
enum News<T, P> {
    Progress(P),
    Done(Result<T>),
}

/// Runs `work` on the pool and waits for it. The calling thread passes the progress that `work`
/// reports to `tell`. If `tell` or a signal raises an exception, `stop` is requested, and the
/// exception is raised when the work has ended.
///
/// # Errors
/// Returns the exception of `tell` or of a signal, or the error of the work.
pub fn long<T: Send, P: Send>(
    py: Python<'_>,
    stop: &Stop,
    tell: impl FnMut(Python<'_>, P) -> PyResult<()> + Send,
    work: impl FnOnce(&dyn Fn(P)) -> Result<T> + Send,
) -> PyResult<T> {
    long_on(&*pool(py)?, py, stop, tell, work)
}

/// Runs [`long`] on the threads of another pool.
///
/// # Errors
/// Returns the errors of [`long`].
pub fn long_on<T: Send, P: Send>(
    pool: &ThreadPool,
    py: Python<'_>,
    stop: &Stop,
    mut tell: impl FnMut(Python<'_>, P) -> PyResult<()> + Send,
    work: impl FnOnce(&dyn Fn(P)) -> Result<T> + Send,
) -> PyResult<T> {
    let (send, news) = mpsc::channel();
    let outcome = py.detach(move || {
        pool.in_place_scope(|scope| {
            scope.spawn(move |_| do_work(work, &send));
            let mut exception = None;
            let mut signals = Signals::default();
            let mut checked = Instant::now();
            loop {
                let seen = match news.recv_timeout(POLL) {
                    Ok(News::Done(result)) => return Some((result, exception)),
                    // The work has panicked; the scope passes the panic on.
                    Err(RecvTimeoutError::Disconnected) => return None,
                    // An exception has ended the call: drop further progress.
                    Ok(News::Progress(_)) if exception.is_some() => Ok(()),
                    Ok(News::Progress(progress)) => Python::attach(|py| tell(py, progress)),
                    Err(RecvTimeoutError::Timeout) => Ok(()),
                };
                let seen = match checked.elapsed() < POLL {
                    true => seen,
                    false => {
                        checked = Instant::now();
                        seen.and_then(|()| signals.check())
                    }
                };
                if let Err(raised) = seen
                    && exception.is_none()
                {
                    exception = Some(raised);
                    stop.ask();
                }
            }
        })
    });
    let (result, exception) = outcome.expect("the scope passes panics on");
    if let Some(exception) = exception {
        stop.reset();
        return Err(exception);
    }
    result.map_err(raised)
}

fn do_work<T, P>(work: impl FnOnce(&dyn Fn(P)) -> Result<T>, news: &Sender<News<T, P>>) {
    let result = work(&|progress| {
        let _ = news.send(News::Progress(progress));
    });
    let _ = news.send(News::Done(result));
}

/// Runs [`long`] for work that reports no progress.
pub fn quiet<T: Send>(
    py: Python<'_>,
    stop: &Stop,
    work: impl FnOnce() -> Result<T> + Send,
) -> PyResult<T> {
    long(py, stop, |_, ()| Ok(()), |_| work())
}

/// Runs work that cannot be stopped on a new thread. If a signal raises an exception, the work runs
/// on in the background, and its result is passed to `unwanted`.
///
/// # Errors
/// Returns the exception of a signal, or the error of the work.
pub fn left<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T> + Send + 'static,
    unwanted: impl FnOnce(T) + Send + 'static,
) -> PyResult<T> {
    // The channel has no buffer, so sending fails if nobody receives the result.
    let (send, result) = mpsc::sync_channel(0);
    let thread = thread::Builder::new().name("phasmid".to_owned());
    let begun = thread.spawn(move || {
        if let Err(SendError(Ok(result))) = send.send(work()) {
            unwanted(result);
        }
    });
    begun.map_err(|e| raised(Error::io("a thread", e)))?;
    py.detach(move || {
        let mut signals = Signals::default();
        loop {
            match result.recv_timeout(POLL) {
                Ok(result) => return result.map_err(raised),
                Err(RecvTimeoutError::Timeout) => signals.check()?,
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(raised(Error::device("the thread of a call panicked")));
                }
            }
        }
    })
}

/// Reads a time in seconds.
pub fn seconds(field: &str, seconds: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(seconds)
        .map_err(|_| raised(Error::input(field, seconds, "seconds, 0 or more")))
}

/// Returns the progress function of a scan, which reports frames and ends the scan when `stop` is
/// requested.
pub fn watch<'a>(
    stop: &'a Stop,
    report: &'a dyn Fn((usize, usize)),
) -> impl FnMut(Progress) -> ControlFlow<()> + 'a {
    move |progress| {
        if let Progress::Frame { done, of } = progress {
            report((done, of));
        }
        flow(stop)
    }
}

/// Returns whether to go on.
pub fn flow(stop: &Stop) -> ControlFlow<()> {
    match stop.is_asked() {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    }
}

/// Calls a Python function with the progress of a call: parts done, all parts.
pub fn tell(
    progress: Option<Py<PyAny>>,
) -> impl FnMut(Python<'_>, (usize, usize)) -> PyResult<()> + Send {
    move |py, parts| match &progress {
        Some(progress) => progress.call1(py, parts).map(drop),
        None => Ok(()),
    }
}

/// Number that was assigned last to a thread.
static THREADS: AtomicU64 = AtomicU64::new(0);

thread_local! {
    /// Number of this thread.
    static THREAD: u64 = THREADS.fetch_add(1, Ordering::Relaxed) + 1;
}

/// A locked value.
pub struct Locked<'a, T> {
    value: MutexGuard<'a, Option<T>>,
    owner: &'a AtomicU64,
}

impl<T> Deref for Locked<'_, T> {
    type Target = Option<T>;

    fn deref(&self) -> &Option<T> {
        &self.value
    }
}

impl<T> DerefMut for Locked<'_, T> {
    fn deref_mut(&mut self) -> &mut Option<T> {
        &mut self.value
    }
}

impl<T> Drop for Locked<'_, T> {
    // Clear the owner before the value is unlocked.
    fn drop(&mut self) {
        self.owner.store(0, Ordering::Relaxed);
    }
}

/// A value that one thread at a time may use, until it is closed. The wait of another thread can be
/// interrupted.
pub struct Shared<T> {
    value: Mutex<Option<T>>,
    /// Id of the process that last locked the value.
    process: AtomicU32,
    /// Number of the thread that has locked the value; 0 if the value is not locked.
    owner: AtomicU64,
    /// For messages.
    name: &'static str,
    /// Id of the only process that may use the value, if it is restricted to one.
    home: Option<u32>,
}

impl<T> Shared<T> {
    /// Creates a value of which a forked child gets a copy.
    pub fn new(name: &'static str, value: T) -> Self {
        Self {
            value: Mutex::new(Some(value)),
            process: AtomicU32::new(process::id()),
            owner: AtomicU64::new(0),
            name,
            home: None,
        }
    }

    /// Creates a value with ports, threads or a driver, which belong to this process. In a forked
    /// child the value is closed, and dropping the child's copy does not affect them.
    pub fn at_home(name: &'static str, value: T) -> Self {
        let mut shared = Self::new(name, value);
        shared.home = Some(process::id());
        shared
    }

    fn is_abroad(&self) -> bool {
        self.home.is_some_and(|home| home != process::id())
    }

    /// Returns the error for a closed value.
    pub fn closed(&self) -> PyErr {
        raised(Error::device(match self.is_abroad() {
            true => format!(
                "{}: it belongs to the process that this one was forked from; expected one that was made \
                 in this process",
                self.name
            ),
            false => format!("{}: it is closed", self.name),
        }))
    }
}

impl<T: Send> Shared<T> {
    /// Locks the value, which is `None` when it is closed.
    ///
    /// # Errors
    /// Returns an error if a signal raised an exception, if this thread is already using the value
    /// (for example in a progress function), if the value belongs to another process, or if another
    /// thread was using the value when this process was forked; in this case it stays locked.
    pub fn lock(&self, py: Python<'_>) -> PyResult<Locked<'_, T>> {
        if self.is_abroad() {
            return Err(self.closed());
        }
        let thread = THREAD.with(|thread| *thread);
        loop {
            let locked = match self.value.try_lock() {
                Ok(value) => Some(value),
                // A call that panicked has not left the value partly modified.
                Err(TryLockError::Poisoned(value)) => Some(value.into_inner()),
                Err(TryLockError::WouldBlock) => None,
            };
            match locked {
                Some(value) => {
                    self.process.store(process::id(), Ordering::Relaxed);
                    self.owner.store(thread, Ordering::Relaxed);
                    let owner = &self.owner;
                    return Ok(Locked { value, owner });
                }
                None if self.owner.load(Ordering::Relaxed) == thread => {
                    return Err(raised(Error::device(format!(
                        "{}: a call of this thread is using it; expected another one, or an end of that call",
                        self.name
                    ))));
                }
                None => {
                    if self.process.load(Ordering::Relaxed) != process::id() {
                        return Err(raised(Error::device(format!(
                            "{}: another thread was using it when this process was forked; expected one \
                             that was made in this process",
                            self.name
                        ))));
                    }
                    py.check_signals()?;
                    py.detach(|| thread::sleep(RETRY));
                }
            }
        }
    }

    /// Runs a short operation on the value.
    ///
    /// # Errors
    /// Returns the errors of [`Self::lock`] and of `then`, and an error if the value is closed.
    pub fn with<R>(&self, py: Python<'_>, then: impl FnOnce(&mut T) -> Result<R>) -> PyResult<R> {
        let mut value = self.lock(py)?;
        then(value.as_mut().ok_or_else(|| self.closed())?).map_err(raised)
    }

    /// Runs a long operation on the value, as [`long`] does.
    ///
    /// # Errors
    /// Returns the errors of [`Self::lock`] and of [`long`], and an error if the value is closed.
    pub fn long<R: Send, P: Send>(
        &self,
        py: Python<'_>,
        stop: &Stop,
        tell: impl FnMut(Python<'_>, P) -> PyResult<()> + Send,
        work: impl FnOnce(&mut T, &dyn Fn(P)) -> Result<R> + Send,
    ) -> PyResult<R> {
        let mut value = self.lock(py)?;
        let value = value.as_mut().ok_or_else(|| self.closed())?;
        long(py, stop, tell, |report| work(value, report))
    }

    /// Runs [`Self::long`] for work that reports no progress.
    ///
    /// # Errors
    /// Returns the errors of [`Self::long`].
    pub fn quiet<R: Send>(
        &self,
        py: Python<'_>,
        stop: &Stop,
        work: impl FnOnce(&mut T) -> Result<R> + Send,
    ) -> PyResult<R> {
        self.long(py, stop, |_, ()| Ok(()), |value, _| work(value))
    }

    /// Takes the value and closes it; `None` if it was closed or belongs to another process.
    ///
    /// # Errors
    /// Returns the errors of [`Self::lock`].
    pub fn take(&self, py: Python<'_>) -> PyResult<Option<T>> {
        match self.is_abroad() {
            true => Ok(None),
            false => Ok(self.lock(py)?.take()),
        }
    }

    /// Puts a value back that was taken.
    ///
    /// # Errors
    /// Returns the errors of [`Self::lock`].
    pub fn put(&self, py: Python<'_>, value: T) -> PyResult<()> {
        *self.lock(py)? = Some(value);
        Ok(())
    }
}

impl<T> Drop for Shared<T> {
    fn drop(&mut self) {
        if self.is_abroad() {
            let value = self.value.get_mut().unwrap_or_else(PoisonError::into_inner);
            mem::forget(value.take());
        }
    }
}
