//! Tabulated functions of one variable: strict CSV reading and interpolation.
mod table;

pub use table::{Table, TableError};
