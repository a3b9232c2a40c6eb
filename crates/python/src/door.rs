//! The one door into the core: it lets other Python threads run, honours Ctrl-C and translates errors.

use std::fmt::Display;
use std::num::NonZeroUsize;
use std::ops::Range;
use std::process;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use truearm_bank::BankError;
use truearm_clearance::ClearanceError;
use truearm_compensate::CompensateError;
use truearm_estimate::EstimateError;
use truearm_field::FieldError;
use truearm_inverse::InverseError;
use truearm_kinematics::{Cancel, InstructionSet, KinematicsError};
use truearm_text::TextError;

create_exception!(
    truearm._core,
    CoreError,
    PyValueError,
    "The core refused its input; the message says the value, the rule and the way out."
);

/// Time between two looks at the signals: a person does not notice it, and it costs nothing measurable.
const PATIENCE: Duration = Duration::from_millis(50);

/// The process that loaded this module: rayon's common pool has its threads there.
static LOADED_BY: OnceLock<u32> = OnceLock::new();

/// A process that was forked from it, and the pool that took the place of the common one there.
static FORKED: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// An error of the core that becomes a Python exception.
pub trait Failure {
    /// The exception to raise.
    fn into_exception(self) -> PyErr;
}

/// An error whose words are the message.
trait Worded: Display {}

impl Worded for KinematicsError {}
impl Worded for EstimateError {}
impl Worded for BankError {}
impl Worded for FieldError {}
impl Worded for CompensateError {}
impl Worded for InverseError {}
impl Worded for ClearanceError {}
impl Worded for TextError {}

impl<E: Worded> Failure for E {
    fn into_exception(self) -> PyErr {
        CoreError::new_err(self.to_string())
    }
}

/// Work that is not interrupted, most of it of some tens of milliseconds: without the lock, and on this thread but for
/// processes that were forked. Ctrl-C waits for its end, for seconds where rows are many.
pub fn quick<T, E, F>(py: Python<'_>, work: F) -> PyResult<T>
where
    T: Send,
    E: Failure + Send,
    F: FnOnce() -> Result<T, E> + Send,
{
    py.detach(|| on_living_threads(work))?.map_err(Failure::into_exception)
}

/// Quick work on `count` poses, so many at once: in between signals are looked at, and what their handlers raise is raised.
pub fn in_parts<T, E, F>(py: Python<'_>, count: usize, at_once: usize, work: F) -> PyResult<Vec<T>>
where
    T: Send,
    E: Failure + Send,
    F: Fn(Range<usize>) -> Result<Vec<T>, E> + Send + Sync,
{
    let mut all = quick(py, || work(0..count.min(at_once)))?;
    for first in (at_once..count).step_by(at_once) {
        py.check_signals()?;
        all.extend(quick(py, || work(first..(first + at_once).min(count)))?);
    }
    Ok(all)
}

/// Long work on a thread of its own, while this one looks for signals.
///
/// When Python's handler of a signal raises (Ctrl-C), the token is set, the work is waited for, and what the
/// handler raised is raised here whatever the work returned. The work must look at the token often.
pub fn long<T, E, F>(py: Python<'_>, work: F) -> PyResult<T>
where
    T: Send,
    E: Failure + Send,
    F: FnOnce(&Cancel) -> Result<T, E> + Send,
{
    let cancel = Cancel::default();
    let (finished, interrupt) = py.detach(|| {
        thread::scope(|scope| {
            let (running, ended) = channel::<()>();
            let token = cancel.clone();
            let worker = scope.spawn(move || {
                let _running = running;
                on_living_threads(|| work(&token))
            });
            let mut interrupt = None;
            while ended.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                if let Err(raised) = Python::attach(|py| py.check_signals()) {
                    cancel.request();
                    interrupt.get_or_insert(raised);
                }
            }
            (worker.join(), interrupt)
        })
    });
    if let Some(raised) = interrupt {
        return Err(raised);
    }
    match finished {
        Ok(result) => result?.map_err(Failure::into_exception),
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

/// Note which process has the threads, and refuse to start with a setting of the environment that nobody knows.
pub fn open() -> PyResult<()> {
    LOADED_BY.get_or_init(process::id);
    InstructionSet::from_environment().map(|_| ()).map_err(Failure::into_exception)
}

/// Work on a pool of its own with so many threads, or on the common one; results do not depend on it.
pub fn with_threads<T: Send>(threads: Option<usize>, work: impl FnOnce() -> T + Send) -> T {
    let useful = thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let pool = threads.map(|count| ThreadPoolBuilder::new().num_threads(count.min(useful)).build());
    match pool {
        Some(Ok(pool)) => pool.install(work),
        // A pool that cannot be made costs time, not the result.
        Some(Err(_)) | None => work(),
    }
}

/// Work where rayon has threads. A forked process has none of its parent's: work for the common pool waits there
/// for ever, so it goes to a pool of the process.
fn on_living_threads<T: Send>(work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let process = process::id();
    if LOADED_BY.get() == Some(&process) {
        return Ok(work());
    }
    Ok(pool_of(process)?.install(work))
}

/// The pool of a forked process; that of its own parent is left alone, for it has no threads to end.
///
/// It is made without the lock, which a process that is forked meanwhile would find locked for ever.
fn pool_of(process: u32) -> PyResult<Arc<ThreadPool>> {
    if let Some(pool) = known_pool(process, &FORKED.lock().unwrap_or_else(PoisonError::into_inner)) {
        return Ok(pool);
    }
    let made = ThreadPoolBuilder::new().build().map_err(|error| {
        CoreError::new_err(format!(
            "a process that was forked cannot start threads: {error}. Start processes with \"spawn\": \
             multiprocessing.get_context(\"spawn\")"
        ))
    })?;
    let mut forked = FORKED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(pool) = known_pool(process, &forked) {
        return Ok(pool);
    }
    let pool = Arc::new(made);
    std::mem::forget(forked.replace((process, Arc::clone(&pool))));
    Ok(pool)
}

/// The pool that is kept, if it is of this process.
fn known_pool(process: u32, kept: &Option<(u32, Arc<ThreadPool>)>) -> Option<Arc<ThreadPool>> {
    kept.as_ref().filter(|(owner, _)| *owner == process).map(|(_, pool)| Arc::clone(pool))
}
