//! PLY point clouds: binary, little-endian, each point with a colour and two numbers.

use std::path::Path;

use crate::{IoError, write};

/// A point of a cloud.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloudPoint {
    /// (X, Y, Z) of the left camera: right, down, ahead, in metres.
    pub position_m: [f32; 3],
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// The quantity that the colour shows.
    pub value: f32,
    /// Its standard deviation.
    pub sigma: f32,
}

/// Write a cloud; `quantity` names what [`CloudPoint::value`] is, as in `depth_velocity`.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, quantity: &str, points: &[CloudPoint]) -> Result<(), IoError> {
    let mut content = Vec::with_capacity(256 + 23 * points.len());
    let head = format!(
        "ply\nformat binary_little_endian 1.0\ncomment left camera: x right, y down, z ahead, in metres\n\
         element vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property float {quantity}\nproperty float {quantity}_sigma\nend_header\n",
        points.len()
    );
    content.extend(head.as_bytes());
    for point in points {
        point.position_m.iter().for_each(|v| content.extend(v.to_le_bytes()));
        content.extend(point.colour);
        content.extend(point.value.to_le_bytes());
        content.extend(point.sigma.to_le_bytes());
    }
    write::bytes(path, &content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_head_says_what_follows() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let point =
            |x: f32| CloudPoint { position_m: [x, -1.0, 4.5], colour: [1, 2, 3], value: -0.5, sigma: 0.25 };
        write(&path, "depth_velocity", &[point(0.0), point(7.0)]).unwrap();
        let content = std::fs::read(&path).unwrap();
        let end = content.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let head = std::str::from_utf8(&content[..end]).unwrap();
        assert!(
            head.starts_with("ply\nformat binary_little_endian 1.0\n") && head.contains("element vertex 2\n")
        );
        // 3 floats, 3 bytes, 2 floats.
        let rows = content[end..].chunks(23).collect::<Vec<_>>();
        assert_eq!((rows.len(), rows[1].len()), (2, 23));
        assert_eq!(rows[1][..4], 7.0_f32.to_le_bytes());
        assert_eq!(
            (rows[1][12..15].to_vec(), rows[1][15..19].to_vec()),
            (vec![1, 2, 3], (-0.5_f32).to_le_bytes().to_vec())
        );
    }
}
