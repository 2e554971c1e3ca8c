//! The `splitsnow` command.
fn main() {}
