//! The WebAssembly module of the page: [`splitsnow::page`] as functions that a worker calls.
//!
//! The worker calls `start` once. It writes a request to memory that `allocate` gives it and
//! calls `answer`, which returns the address of four numbers: address and length of the JSON,
//! address and length of the bytes beside it (each little-endian, in four bytes). It then gives
//! all memory back to `release`: its own, the JSON, the bytes and the four numbers.
#![allow(unreachable_pub, reason = "JavaScript calls these functions")]
#![allow(
    unsafe_code,
    reason = "JavaScript passes addresses; nothing here uses one that it did not give out"
)]
use std::cell::RefCell;

use splitsnow::page::PageEngine;

thread_local! {
    static ENGINE: RefCell<PageEngine> = RefCell::default();
}

/// Starts the engine anew with `tables` bytes of memory for tables of grain events.
#[unsafe(no_mangle)]
pub extern "C" fn start(tables: usize) {
    ENGINE.set(PageEngine::default().with_tables(tables));
}

/// Gives out `bytes` bytes of memory.
#[unsafe(no_mangle)]
pub extern "C" fn allocate(bytes: usize) -> *mut u8 {
    give_out(vec![0; bytes])
}

/// Takes back memory that was given out.
///
/// # Safety
/// `start` and `bytes` are those of one allocation.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn release(start: *mut u8, bytes: usize) {
    // SAFETY: `give_out` made the slice, and the caller gives it back once.
    drop(unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(start, bytes)) });
}

/// Answers the request at `request` with the bytes at `data`. The caller keeps both.
///
/// # Safety
/// Both ranges were given out by [`allocate`] and not released.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn answer(
    request: *const u8,
    request_bytes: usize,
    data: *const u8,
    data_bytes: usize,
) -> *mut u8 {
    // SAFETY: the caller wrote these bytes to memory that `allocate` gave out.
    let (request, data) = unsafe {
        (
            std::slice::from_raw_parts(request, request_bytes),
            std::slice::from_raw_parts(data, data_bytes),
        )
    };
    let answer = ENGINE.with_borrow_mut(|engine| engine.answer(request, data));
    let (json_bytes, data_bytes) = (answer.json.len(), answer.data.len());
    let starts = [give_out(answer.json.into_bytes()), give_out(answer.data)];
    let record = [
        starts[0] as usize,
        json_bytes,
        starts[1] as usize,
        data_bytes,
    ];
    give_out(record.map(usize::to_le_bytes).concat())
}

fn give_out(bytes: Vec<u8>) -> *mut u8 {
    Box::into_raw(bytes.into_boxed_slice()).cast()
}
