//! Choices of the libraries and of the results, as words of the command line.

use clap::ValueEnum;
use egomotion::geometry::RigCamera;
use egomotion::pipeline::{Approach, EstimatorKind, Method, Observe};
use egomotion_io::recording::Sensor;
use serde::Serialize;

use crate::results::maps::{CloudQuantity, MapFormat};

/// An enumeration whose words can be typed, and what each of them becomes.
macro_rules! choice {
    ($name:ident for $target:ident { $($variant:ident: $help:literal),+ $(,)? }) => {
        #[doc = concat!("[`", stringify!($target), "`] as it is typed.")]
        #[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
        pub enum $name { $(#[doc = $help] $variant),+ }
        impl From<$name> for $target {
            fn from(value: $name) -> Self {
                match value { $($name::$variant => Self::$variant),+ }
            }
        }
    };
}

choice!(MethodArg for Method {
    Ml: "Maximum likelihood in the measured (x, y, disparity) at both times.",
    Dcce: "The paper's depth change constraint.",
    Dv: "The paper's binocular flow, in two steps.",
    Joint: "Binocular flow and image flow solved together.",
    Rigid: "Point pairs with a rotation.",
    Linear22: "Point pairs with any matrix.",
});
choice!(ApproachArg for Approach {
    Discrete: "Finite displacements between two frames.",
    Differential: "Velocities and derivatives.",
});
choice!(EstimatorArg for EstimatorKind {
    Ls: "Least squares, all rows alike.",
    Lmeds: "Least median of squares.",
    Irls: "Reweighted least squares, rows weighted by their variance.",
    Eiv: "Least squares corrected for the bias of noisy gradients (method dcce alone).",
});
choice!(ObserveArg for Observe {
    Dense: "Disparity and flow of every pixel, with all maps.",
    Sparse: "Tracked corners alone.",
});
choice!(FrameArg for RigCamera {
    Left: "The left camera.",
    Right: "The right camera.",
    Cyclopean: "The camera in the middle between the two.",
});
choice!(SensorArg for Sensor {
    Stereo: "Left and right images.",
    Depth: "Left images and depth images.",
});
choice!(MapFormatArg for MapFormat {
    Pfm: "PFM, flow as .flo.",
    Npy: "NumPy arrays of single precision.",
    Kitti: "KITTI's 16-bit PNG, of disparity and flow alone.",
    Colour: "PNG in colours, to look at.",
});
choice!(CloudArg for CloudQuantity {
    Vz: "Depth velocity.",
    Impact: "Time to impact.",
});
