//! Results of calls: a status, and a text that says what was expected and what was found.

use std::any::Any;
use std::cell::RefCell;
use std::error::Error;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use meissner::live::LiveError;
use meissner::models::in_part;
use meissner::{EngineError, ModelError};

/// Result of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum meissner_status {
    /// It succeeded.
    MEISSNER_OK = 0,
    /// An argument is out of range, or a pointer is NULL or misaligned.
    MEISSNER_INVALID_ARGUMENT = 1,
    /// There is no network of this name, or a file cannot be read.
    MEISSNER_NOT_FOUND = 2,
    /// A description is inconsistent, or weights do not fit it.
    MEISSNER_INVALID_NETWORK = 3,
    /// The network is of another kind than the function takes, or has no incremental form.
    MEISSNER_WRONG_NETWORK = 4,
    /// The memory of the caller is too small for the result.
    MEISSNER_BUFFER_TOO_SMALL = 5,
    /// The engine would need more memory than its limit.
    MEISSNER_MEMORY_LIMIT = 6,
    /// A layer computed NaN: there is no prediction. The engine predicts again once the cause has
    /// left the window.
    MEISSNER_NOT_A_NUMBER = 7,
    /// Bytes are not a snapshot of such an engine.
    MEISSNER_INVALID_SNAPSHOT = 8,
    /// Another thread is using the handle.
    MEISSNER_BUSY = 9,
    /// The live engine has ended, or the handle was closed or released.
    MEISSNER_CLOSED = 10,
    /// A fault in the library. The handle can only be released.
    MEISSNER_PANICKED = 11,
    /// The call needs threads of the process that forked this one: make the handle in the child,
    /// after the fork.
    MEISSNER_FORKED = 12,
}

pub(crate) use meissner_status as Status;

/// Why a call failed.
#[derive(Debug)]
pub(crate) struct Failure {
    status: Status,
    text: String,
}

impl Failure {
    pub(crate) fn new(status: Status, text: impl Into<String>) -> Self {
        let text = text.into();
        Self { status, text: in_part(&text).into_owned() }
    }

    #[cfg(test)]
    pub(crate) fn status(&self) -> Status {
        self.status
    }

    /// An argument with an unexpected value.
    pub(crate) fn argument(what: &str, expected: impl ToString, found: impl ToString) -> Self {
        let text = format!("{what}: expected {}, found {}", expected.to_string(), found.to_string());
        Self::new(Status::MEISSNER_INVALID_ARGUMENT, text)
    }

    /// `error` with its causes.
    pub(crate) fn of(status: Status, error: &dyn Error) -> Self {
        let mut text = error.to_string();
        let mut cause = error.source();
        while let Some(error) = cause {
            text = format!("{text}: {error}");
            cause = error.source();
        }
        Self::new(status, text)
    }
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        let status = match &error {
            EngineError::Network { .. } | EngineError::Layer { .. } => Status::MEISSNER_INVALID_NETWORK,
            EngineError::NotIncremental(_) => Status::MEISSNER_WRONG_NETWORK,
            EngineError::Memory { .. } | EngineError::FrameMemory { .. } => Status::MEISSNER_MEMORY_LIMIT,
            EngineError::NotANumber { .. } => Status::MEISSNER_NOT_A_NUMBER,
            EngineError::SnapshotBytes { .. } | EngineError::Snapshot { .. } => {
                Status::MEISSNER_INVALID_SNAPSHOT
            }
            _ => Status::MEISSNER_INVALID_ARGUMENT,
        };
        Self::of(status, &error)
    }
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        let status = match &error {
            ModelError::Read { .. } => Status::MEISSNER_NOT_FOUND,
            ModelError::Engine(error) => return error.clone().into(),
            _ => Status::MEISSNER_INVALID_NETWORK,
        };
        Self::of(status, &error)
    }
}

impl From<LiveError> for Failure {
    fn from(error: LiveError) -> Self {
        let status = match error {
            LiveError::Engine(error) => return error.into(),
            LiveError::Panicked { .. } => Status::MEISSNER_PANICKED,
            LiveError::Closed { .. } => Status::MEISSNER_CLOSED,
            _ => Status::MEISSNER_INVALID_ARGUMENT,
        };
        Self::of(status, &error)
    }
}

thread_local! {
    /// Text of the last failure of this thread.
    static TEXT: RefCell<CString> = RefCell::default();
}

/// Runs the body of a function of the interface: keeps the text of a failure, and catches every
/// panic.
pub(crate) fn call(body: impl FnOnce() -> Result<(), Failure>) -> Status {
    let failure = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => return Status::MEISSNER_OK,
        Ok(Err(failure)) => failure,
        Err(cause) => Failure::new(Status::MEISSNER_PANICKED, panic_text(&*cause)),
    };
    // A text contains NUL only where it quotes a string of the caller.
    let text = CString::new(failure.text.replace('\0', " ")).unwrap_or_default();
    // While a thread ends, the text cannot be stored any more.
    let _ = TEXT.try_with(|last| last.replace(text));
    failure.status
}

fn panic_text(cause: &(dyn Any + Send)) -> String {
    let text = cause.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| cause.downcast_ref::<String>().cloned());
    format!("a fault in the library: {}", text.unwrap_or_else(|| "without a message".to_owned()))
}

/// What the last failed call of this thread expected and found, in UTF-8. The text is valid until
/// another call of this thread fails, and empty before the first failure.
#[unsafe(no_mangle)]
pub extern "C" fn meissner_error_text() -> *const c_char {
    TEXT.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}
