//! Images, datasets, calibration files, trajectories and maps for `egomotion`.
#![deny(missing_docs)]
