//! The WebAssembly module's functions. Memory is handed over by address and length; one instance has one [`Engine`].

use crate::{Engine, EngineResponse};
use std::cell::UnsafeCell;

thread_local! {
    static ENGINE: UnsafeCell<Engine> = UnsafeCell::default();
}

/// What the engine answers. No borrow is kept over the call: a trap, which unwinds nothing, would leave it behind, and
/// every later question would trap as well.
fn answered(by: impl FnOnce(&mut Engine) -> EngineResponse) -> u64 {
    // SAFETY: one thread, and no answer asks the engine again.
    ENGINE.with(|engine| packed(by(unsafe { &mut *engine.get() }).into_bytes()))
}

/// Room for `length` bytes, which [`open`] or [`ask`] takes back.
#[unsafe(no_mangle)]
pub extern "C" fn room(length: usize) -> *mut u8 {
    Vec::leak(vec![0; length]).as_mut_ptr()
}

/// Gives back what [`open`] or [`ask`] answered.
///
/// # Safety
/// Address and length are those that were packed into the answer, and given back once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn release(at: *mut u8, length: usize) {
    // SAFETY: the caller's promise; answers are boxed slices.
    drop(unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(at, length)) });
}

/// Begins to decode the model file at `at`, and keeps the model.
///
/// # Safety
/// `at` comes from [`room`], with its length, and is handed over.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn open(at: *mut u8, length: usize) -> u64 {
    // SAFETY: the caller's promise.
    let bytes = unsafe { Vec::from_raw_parts(at, length, length) };
    answered(|engine| engine.open(bytes))
}

/// Answers a question.
///
/// # Safety
/// As [`open`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ask(at: *mut u8, length: usize) -> u64 {
    // SAFETY: the caller's promise.
    let bytes = unsafe { Vec::from_raw_parts(at, length, length) };
    answered(|engine| engine.ask(&bytes))
}

/// Address in the low 32 bits, length in the others.
fn packed(bytes: Vec<u8>) -> u64 {
    let bytes = Box::leak(bytes.into_boxed_slice());
    (bytes.len() as u64) << 32 | bytes.as_ptr() as u64
}
