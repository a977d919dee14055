//! The command `egomotion`.

#[allow(dead_code)]
mod report;

fn main() {}
