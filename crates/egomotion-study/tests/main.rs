//! The laboratory, seen from outside.
#![allow(missing_docs)]

mod consistency;
mod efficiency;
mod errors_in_variables;
mod reliability;
mod rounded_disparity;
mod study;
mod study_real;
mod study_recording;
mod uncertainty;
