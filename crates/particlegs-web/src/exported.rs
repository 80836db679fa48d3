//! The exported functions of the WebAssembly module. They pass memory by address and length; an instance has one
//! [`Engine`].

use crate::{Engine, EngineResponse};
use std::cell::UnsafeCell;

thread_local! {
    static ENGINE: UnsafeCell<Engine> = UnsafeCell::default();
}

/// Calls the engine. No `RefCell`: a trap does not unwind, so its borrow would stay and every later call would trap.
fn answered(by: impl FnOnce(&mut Engine) -> EngineResponse) -> u64 {
    // SAFETY: there is one thread, and the engine does not call this function.
    ENGINE.with(|engine| packed(by(unsafe { &mut *engine.get() }).into_bytes()))
}

/// Allocates `length` bytes for the input of [`open`] or [`ask`].
#[unsafe(no_mangle)]
pub extern "C" fn room(length: usize) -> *mut u8 {
    Vec::leak(vec![0; length]).as_mut_ptr()
}

/// Frees the answer of [`open`] or [`ask`].
///
/// # Safety
/// Address and length are those packed into the answer, and this is called once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn release(at: *mut u8, length: usize) {
    // SAFETY: the caller's promise; answers are boxed slices.
    drop(unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(at, length)) });
}

/// Opens the model file at `at`.
///
/// # Safety
/// `at` and `length` come from [`room`]; the memory is taken over.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn open(at: *mut u8, length: usize) -> u64 {
    // SAFETY: the caller's promise.
    let bytes = unsafe { Vec::from_raw_parts(at, length, length) };
    answered(|engine| engine.open(bytes))
}

/// Answers a query.
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
