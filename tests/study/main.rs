//! Studies from outside: killed and gone on with, failing, growing; and references.

// Helpers outside test functions; what fails there fails the test.
#![allow(clippy::unwrap_used, clippy::panic)]

mod bench;
mod failures;
#[cfg(unix)]
mod killed;
mod references;
