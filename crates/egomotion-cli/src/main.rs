//! The command `egomotion`.
fn main() {}
