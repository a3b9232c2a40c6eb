//! Serial chains with Denavit-Hartenberg links: poses and Jacobians over lanes of eight.
