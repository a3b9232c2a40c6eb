//! Identification of constant error parameters from measurements.
