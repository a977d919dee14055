//! Files, calibrations and recordings, seen from outside.
#![allow(missing_docs)]

mod calibration;
mod real;
mod rectification;
mod source;
mod split_halves;
