//! Error parameters that vary with the configuration: banks of fuzzy cells.
