//! The layout of the Karlsruhe sequences: KITTI's folders, and a GPS/INS as the truth.

use std::fs;

use egomotion_io::trajectory;
use nalgebra::{Rotation3, Vector3};

use crate::process::{assert_refused, egomotion, run, summary, try_run};
use crate::recording::{Copy, recording};

/// The recording with the rows that the car's GPS/INS would have written.
fn karlsruhe() -> Copy {
    let copy = Copy::new();
    let poses = trajectory::read(&copy.file("poses.txt"), None).unwrap();
    let mut rows = String::new();
    for (k, pose) in poses.iter().enumerate() {
        let pose = pose.world_from_camera;
        // East, north and up, for a camera that looked east at first.
        let east_north_up = |v: &Vector3<f64>| [v.z, -v.x, -v.y];
        let ([x, y, z], ahead) =
            (east_north_up(&pose.translation), east_north_up(&pose.rotation.column(2).into_owned()));
        let yaw = ahead[1].atan2(ahead[0]);
        let stamp = 1_268_139_655_398_043_392_u64 + 100_000_000 * k as u64;
        rows +=
            &format!("{stamp} 49.0 8.3 114.2 {:?} {:?} {z:?} 0.01 2.09 {yaw:?} \n", x - 5311.3, y - 1023.6);
    }
    fs::write(copy.file("insdata.txt"), rows).unwrap();
    fs::remove_file(copy.file("poses.txt")).unwrap();
    copy
}

/// Root mean square from frame to frame of the rotations that yaw does not tell, in degrees.
fn untold_tilt_deg() -> f64 {
    let poses = trajectory::read(&recording().join("poses.txt"), None).unwrap();
    let rotations: Vec<Rotation3<f64>> =
        poses.iter().map(|pose| Rotation3::from_matrix_unchecked(pose.world_from_camera.rotation)).collect();
    let level = |rotation: &Rotation3<f64>| {
        let ahead = rotation * Vector3::z();
        Rotation3::from_axis_angle(&Vector3::y_axis(), ahead.x.atan2(ahead.z))
    };
    let squares = rotations.windows(2).map(|pair| {
        let told = level(&pair[0]).inverse() * level(&pair[1]);
        (told.inverse() * (pair[0].inverse() * pair[1])).angle().to_degrees().powi(2)
    });
    (squares.sum::<f64>() / (rotations.len() - 1) as f64).sqrt()
}

#[test]
fn a_recording_in_karlsruhes_layout_with_its_truth() {
    let copy = karlsruhe();
    let told = egomotion(["info".as_ref(), copy.source().as_os_str()]).stdout;
    for part in ["layout      Karlsruhe", "and insdata.txt", "truth     poses of 5 frames"] {
        assert!(told.contains(part), "{part:?} is not in\n{told}");
    }
    run(&copy.source(), &copy.out(), "--observe sparse");
    let truth = &summary(&copy.out())["truth"];
    let error = |name: &str| truth[name].as_f64().unwrap();
    assert!(error("t_rmse_m") < 0.003, "{truth}");
    // Of the rotation only yaw is told: what the robot's camera nods counts as an error, and no more.
    let tilt = untold_tilt_deg();
    assert!(tilt > 0.05 && (error("r_rmse_deg") - tilt).abs() < 0.1 * tilt, "{tilt} {truth}");
}

#[test]
fn a_bad_row_is_named() {
    let copy = karlsruhe();
    let file = copy.file("insdata.txt");
    let good = fs::read_to_string(&file).unwrap();
    let refused = |content: String, parts: &[&str]| {
        fs::write(&file, content).unwrap();
        assert_refused(&try_run(&copy.source(), &copy.out(), ""), 1, parts);
    };
    refused(good.replacen("114.2", "nowhere", 1), &["insdata.txt:1", "\"nowhere\" is not a number"]);
    let cut: Vec<&str> =
        good.lines().enumerate().map(|(k, row)| if k == 2 { &row[..40] } else { row }).collect();
    refused(cut.join("\n"), &["insdata.txt:3", "numbers, not 10"]);
    // Fewer rows than images: these frames have no truth, and the run goes on.
    fs::write(&file, good.lines().take(2).collect::<Vec<_>>().join("\n")).unwrap();
    let told = egomotion(["info".as_ref(), copy.source().as_os_str()]).stdout;
    assert!(told.contains("truth     poses of 2 frames"), "{told}");
}
