//! The command's contract, seen from outside: a process, its options, streams, files and exit codes.
#![allow(missing_docs)]

#[cfg(unix)]
mod background;
mod bad_config;
mod bad_input;
mod bad_output;
mod browser;
mod combinations;
mod demo;
mod documents;
mod evaluate;
mod gaps;
mod given;
mod impact;
mod info;
mod interrupt;
mod karlsruhe;
mod maps;
mod outputs;
mod parquet;
mod process;
mod raw;
mod readme;
mod real;
mod recording;
mod resume;
mod selection;
mod settings;
mod simulate;
mod sources;
mod study;
mod table;
mod viewpoint;
