//! One thread at a time in an object: the others wait for their turn.

use std::ops::{Deref, DerefMut};
use std::process;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
use std::time::Duration;

use pyo3::PyClass;
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::False;

use crate::error::{Failure, Outcome};
use crate::fork;

/// Time between two looks whether an object is free; signals are handled at each.
const LOOK: Duration = Duration::from_micros(200);

/// Objects that a thread is in: the object's address, the thread and its process. Taken and given back with the interpreter held, so that
/// no fork happens meanwhile.
static TAKEN: Mutex<Vec<(usize, ThreadId, u32)>> = Mutex::new(Vec::new());

/// An object of Python, for this thread alone.
pub(crate) struct Turn<'py, T: PyClass<Frozen = False>> {
    value: PyRefMut<'py, T>,
    address: usize,
}

fn taken() -> MutexGuard<'static, Vec<(usize, ThreadId, u32)>> {
    TAKEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The object, as soon as no other thread is in it. Other threads run meanwhile, and signals are handled.
pub(crate) fn turn<'py, T: PyClass<Frozen = False>>(object: &Bound<'py, T>) -> Outcome<Turn<'py, T>> {
    let address = object.as_ptr().addr();
    loop {
        if let Ok(value) = object.try_borrow_mut() {
            taken().push((address, thread::current().id(), process::id()));
            return Ok(Turn { value, address });
        }
        let holder = taken().iter().find(|(of, ..)| *of == address).copied();
        match holder {
            Some((.., process)) if process != process::id() => return Err(fork::refused(&name(object))),
            Some((_, thread, _)) if thread == thread::current().id() => {
                let found = "one from within another (of a signal's handler, say)";
                let message = format!("{}: expected a call after the other, found {found}", name(object));
                return Err(Failure::Refused("Error", message));
            }
            _ => {}
        }
        object.py().detach(|| thread::sleep(LOOK));
        object.py().check_signals()?;
    }
}

fn name<T>(object: &Bound<'_, T>) -> String {
    object.as_any().get_type().name().map_or_else(|_| "object".to_owned(), |name| name.to_string())
}

impl<T: PyClass<Frozen = False>> Deref for Turn<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T: PyClass<Frozen = False>> DerefMut for Turn<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}

impl<T: PyClass<Frozen = False>> Drop for Turn<'_, T> {
    fn drop(&mut self) {
        let mut taken = taken();
        if let Some(place) = taken.iter().rposition(|(of, ..)| *of == self.address) {
            taken.swap_remove(place);
        }
    }
}
