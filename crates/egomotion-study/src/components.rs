//! The six components of φ: their names, symbols, and the units that the paper prints them in.

use egomotion::geometry::Twist;

/// Names of φ's components in files, in the order of φ.
pub(crate) const NAMES: [&str; 6] = ["tx", "ty", "tz", "wx", "wy", "wz"];
/// Symbols of φ's components on pages, in the order of φ.
pub(crate) const SYMBOLS: [&str; 6] = ["tX", "tY", "tZ", "ΩX", "ΩY", "ΩZ"];

/// The paper's units in one metre or one radian of φ's component `i`: 1000 mm, or 180/π degrees.
pub(crate) fn unit(i: usize) -> f64 {
    if i < 3 { 1e3 } else { 1f64.to_degrees() }
}

/// φ as (tX, tY, tZ) in mm and (ΩX, ΩY, ΩZ) in degrees.
pub(crate) fn in_mm_deg(phi: &Twist) -> [f64; 6] {
    let v = phi.vector();
    std::array::from_fn(|i| v[i] * unit(i))
}
