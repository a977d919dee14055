//! Every reader on a file of its kind, from memory: `cargo bench -p egomotion-io`. Throughput is that of the file's bytes.
#![allow(missing_docs)]

use std::fs;
use std::io::{Cursor, Write as _};
use std::path::Path;

use ::image::{DynamicImage, GrayImage, ImageBuffer, ImageFormat, Luma};
use criterion::{Criterion, Throughput};
use egomotion::geometry::{Field, Gaussian, Grid, RigidMotion, Twist};
use egomotion_io::motion_table::{self, EstimatedMotion, MotionRow};
use egomotion_io::trajectory::{self, Pose};
use egomotion_io::{depth, disparity_png, flo, flow_png, image, npy, pfm, tracks};
use nalgebra::{Matrix6, Vector6};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Size of the images and maps: KITTI's.
const SIZE: (usize, usize) = (1242, 375);
/// Rows of the tables.
const ROWS: usize = 10_000;

type Reader = fn(&[u8]);

/// Grey levels of something like a street: shades, some texture, and the noise of a sensor.
fn street() -> Grid<f64> {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    Grid::from_fn(SIZE.0, SIZE.1, |u, v| {
        let (x, y) = (u as f64, v as f64);
        let shade = 110.0 + 60.0 * (0.006 * x).sin() * (0.011 * y).cos();
        let texture = 15.0 * (0.21 * x + 0.3 * (0.05 * y).sin()).sin() * (0.17 * y).sin();
        shade + texture + 3.0 * (rng.random::<f64>() + rng.random::<f64>() - 1.0)
    })
}

fn eight_bit() -> GrayImage {
    let street = street();
    GrayImage::from_fn(SIZE.0 as u32, SIZE.1 as u32, |u, v| {
        Luma([street.at(u as usize, v as usize).round() as u8])
    })
}

fn sixteen_bit() -> ImageBuffer<Luma<u16>, Vec<u16>> {
    let street = street();
    ImageBuffer::from_fn(SIZE.0 as u32, SIZE.1 as u32, |u, v| {
        Luma([(257.0 * street.at(u as usize, v as usize)) as u16])
    })
}

fn encoded(picture: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut content = Cursor::new(Vec::new());
    picture.into().write_to(&mut content, format).unwrap();
    content.into_inner()
}

/// As libpng compresses unless it is told otherwise.
fn png(samples: &[u8], depth: png::BitDepth) -> Vec<u8> {
    let mut content = Vec::new();
    let mut encoder = png::Encoder::new(&mut content, SIZE.0 as u32, SIZE.1 as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    encoder.set_deflate_compression(png::DeflateCompression::Level(6));
    encoder.set_filter(png::Filter::Adaptive);
    encoder.write_header().unwrap().write_image_data(samples).unwrap();
    content
}

/// Content that a writer of ours puts into a file.
fn written(write: impl FnOnce(&Path)) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    write(&path);
    fs::read(path).unwrap()
}

/// A map that is smooth, with holes.
fn field() -> Field {
    let street = street();
    Field::from_grid(Grid::from_fn(SIZE.0, SIZE.1, |u, v| {
        if (u * v) % 11 == 0 { f32::NAN } else { (0.3 * street.at(u, v)) as f32 }
    }))
}

fn images() -> Vec<(&'static str, Vec<u8>, Reader)> {
    let read: Reader = |c| drop(image::decode(c, Path::new("a")).unwrap());
    let wide: Vec<u8> = sixteen_bit().iter().flat_map(|level| level.to_be_bytes()).collect();
    let colour = DynamicImage::from(eight_bit()).to_rgb8();
    vec![
        ("PNG, 8 bit", png(eight_bit().as_raw(), png::BitDepth::Eight), read),
        ("PNG, 16 bit", png(&wide, png::BitDepth::Sixteen), read),
        ("JPEG, grey", encoded(eight_bit(), ImageFormat::Jpeg), read),
        ("JPEG, colour", encoded(colour, ImageFormat::Jpeg), read),
        ("TIFF, 8 bit", encoded(eight_bit(), ImageFormat::Tiff), read),
        ("PGM, 8 bit", encoded(eight_bit(), ImageFormat::Pnm), read),
        ("PGM, 16 bit", encoded(sixteen_bit(), ImageFormat::Pnm), read),
    ]
}

fn maps() -> Vec<(&'static str, Vec<u8>, Reader)> {
    let flow = || [field(), field()];
    let disparity = written(|p| disparity_png::write(p, &field()).unwrap());
    vec![
        ("disparity, KITTI PNG", disparity.clone(), |c| {
            drop(disparity_png::decode(c, Path::new("a")).unwrap());
        }),
        ("depth, 16-bit PNG", disparity, |c| drop(depth::decode_png(c, 5000.0, Path::new("a")).unwrap())),
        ("flow, KITTI PNG", written(|p| flow_png::write(p, &flow()).unwrap()), |c| {
            drop(flow_png::decode(c, Path::new("a")).unwrap());
        }),
        ("flow, .flo", written(|p| flo::write(p, &flow()).unwrap()), |c| {
            drop(flo::decode(c, Path::new("a")).unwrap());
        }),
        ("PFM", written(|p| pfm::write(p, field().grid()).unwrap()), |c| {
            drop(pfm::decode(c, Path::new("a")).unwrap());
        }),
        (".npy", written(|p| npy::write(p, field().grid()).unwrap()), |c| {
            drop(npy::decode(c, Path::new("a")).unwrap());
        }),
    ]
}

/// A table's reader, given as text.
fn text(content: &[u8]) -> &str {
    std::str::from_utf8(content).unwrap()
}

fn tables() -> Vec<(&'static str, Vec<u8>, Reader)> {
    let poses: Vec<Pose> = (0..ROWS)
        .map(|k| {
            let phi = Twist::from_vector(&(1e-3 * k as f64 * Vector6::new(1.0, 0.1, 3.0, 0.01, 0.3, 0.02)));
            Pose { time_s: Some(0.1 * k as f64), world_from_camera: phi.exp() }
        })
        .collect();
    let trajectory: Reader = |c| drop(trajectory::parse(text(c), None, Path::new("a")).unwrap());
    let rows: Vec<MotionRow> =
        poses.iter().enumerate().map(|(k, pose)| row(k, &pose.world_from_camera)).collect();
    let mut csv = "frame,track,u_left,v_left,u_right,v_right\n".to_owned();
    for k in 0..ROWS {
        let x = k as f64;
        csv += &format!(
            "{},{},{:.3},{:.3},{:.3},{:.3}\n",
            k / 500,
            k % 500,
            0.1 * x,
            0.03 * x,
            0.09 * x,
            0.03 * x
        );
    }
    vec![
        ("motion.csv", motion_table::text(&rows).into_bytes(), |c| {
            drop(motion_table::parse(text(c), Path::new("a")).unwrap());
        }),
        ("trajectory, TUM", written(|p| trajectory::write_tum(p, &poses).unwrap()), trajectory),
        ("trajectory, KITTI", written(|p| trajectory::write_kitti(p, &poses).unwrap()), trajectory),
        ("trajectory, EuRoC", written(|p| trajectory::write_euroc(p, &poses).unwrap()), trajectory),
        ("tracks, CSV", csv.into_bytes(), |c| drop(tracks::parse_csv(text(c), Path::new("a")).unwrap())),
        ("tracks, .npz", npz(), |c| drop(tracks::decode_npz(c, Path::new("a")).unwrap())),
    ]
}

fn row(frame: usize, pose: &RigidMotion) -> MotionRow {
    let cov = Matrix6::from_fn(|i, j| if i == j { 1.234_567e-6 } else { 3.456_789e-9 });
    let phi = Gaussian { mean: pose.log().vector(), cov };
    MotionRow {
        frame,
        time_s: 0.1 * frame as f64,
        dt_s: Some(0.1),
        motion: Some(EstimatedMotion {
            phi,
            own: Some(cov),
            observed: [true; 6],
            rows: 16_000,
            inliers: 14_000,
        }),
        impact_s: Some([2.0, 1.8, 2.3]),
        status: "ok".into(),
    }
}

/// As many tracks as in the CSV, twenty frames of five hundred, deflated.
fn npz() -> Vec<u8> {
    let head = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': (4, 500, {}), }}\n", ROWS / 500);
    let values: Vec<u8> = (0..4 * ROWS).flat_map(|k| (0.37 * k as f64).to_le_bytes()).collect();
    let length = (head.len() as u16).to_le_bytes();
    let array = [b"\x93NUMPY\x01\x00".as_slice(), &length, head.as_bytes(), &values].concat();
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    archive.start_file("features.npy", options).unwrap();
    archive.write_all(&array).unwrap();
    archive.finish().unwrap().into_inner()
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    for (name, kinds) in [("images", images()), ("maps", maps()), ("tables", tables())] {
        let mut group = criterion.benchmark_group(name);
        for (kind, content, read) in kinds {
            group.throughput(Throughput::Bytes(content.len() as u64));
            group.bench_function(kind, |b| b.iter(|| read(&content)));
        }
        group.finish();
    }
    criterion.final_summary();
}
