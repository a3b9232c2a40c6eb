//! Python bindings: convert, release the lock, call, translate errors.
