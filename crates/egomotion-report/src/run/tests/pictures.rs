//! Pictures: small, thinned, and in the colours of their bars.

use egomotion::geometry::{Field, Grid, Image};
use egomotion::observe::{DisparityMap, FlowField};
use egomotion::pipeline::DenseResults;
use egomotion::pipeline::MotionMaps;

use super::super::{Album, FramePictures, render};
use super::steady;

/// Maps of any values, some missing.
pub fn dense(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> DenseResults {
    let plane = Grid::from_fn(width, height, &value);
    let field = || Field::from_grid(plane.clone());
    let (u, v) = (field(), field());
    let flow = FlowField { u, v, cov_uu: plane.clone(), cov_uv: plane.clone(), cov_vv: plane.clone() };
    DenseResults {
        disparity: DisparityMap { shift: field(), sigma: field() },
        flow,
        motion: MotionMaps {
            depth_velocity: field(),
            depth_velocity_sigma: field(),
            looming: field(),
            looming_sigma: field(),
        },
    }
}

/// A value for every pixel that looks like noise.
fn noise(u: usize, v: usize) -> f32 {
    ((u * 7919 + v * 104_729 + u * v * 31) % 251) as f32
}

fn noisy_pictures(row: usize, width: usize, height: usize, width_px: usize) -> FramePictures {
    let image = Image::from_fn(width, height, noise);
    FramePictures::new(row - 1, row, &image, &dense(width, height, noise), 0.1, width_px)
}

/// Pictures of the pairs that end at rows 1 … `rows`.
pub fn album(rows: usize, (width, height): (usize, usize)) -> Album {
    let mut album = Album::of(rows + 1);
    for row in 1..=rows {
        let width_px = album.width_px((width, height));
        album.offer(|| noisy_pictures(row, width, height, width_px));
    }
    album
}

#[test]
fn the_page_stays_small() {
    let long = render(&steady(5000).report(&Album::of(5001)));
    assert!(long.len() < 3_000_000, "{}", long.len());
    // Pure noise cannot be compressed, and still the pictures fit.
    let (run, album) = (steady(8), album(8, (900, 700)));
    let page = render(&run.report(&album));
    assert!(page.len() < 8_000_000, "{}", page.len());
    assert!(album.stride() > 1 && page.contains("Pictures are kept of"), "{}", album.stride());
}

#[test]
fn an_album_thins_itself() {
    let mut album = Album::of(1000);
    let mut made = 0;
    for row in 1..=1000 {
        album.offer(|| {
            made += 1;
            noisy_pictures(row, 8, 4, 8)
        });
    }
    let rows: Vec<usize> = album.pictures().iter().map(|p| p.row).collect();
    assert_eq!(rows, (1..=1000).step_by(32).collect::<Vec<_>>());
    assert!(made < 120, "{made}");
    assert_eq!([Album::of(2).width_px((1242, 375)), Album::of(2).width_px((64, 48))], [960, 64]);
    // Forty-eight pictures in 5.6 MB, at 1.5 bytes a pixel.
    assert!((480..520).contains(&Album::of(5000).width_px((1242, 375))));
}

#[test]
fn a_map_comes_out_in_the_colours_of_its_bar() {
    let disparity = |u: usize, _| if u == 3 { f32::NAN } else { 10.0 * u as f32 };
    let pictures = FramePictures::new(0, 1, &Image::filled(5, 1, 128.0), &dense(5, 1, disparity), 0.1, 960);
    let (low, high) = pictures.range(0).unwrap();
    // The 2nd and 98th percentile of 0, 10, 20, 40, interpolated.
    assert!((low - 0.6).abs() < 1e-9 && (high - 38.8).abs() < 1e-9, "{low} {high}");
    // Twice the range: the picture uses the lower half of the colours.
    let content = pictures.map_png(0, (0.0, 80.0)).unwrap();
    let mut decoder = png::Decoder::new(std::io::Cursor::new(content));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    let pixel = |u: usize| &pixels[4 * u..4 * u + 4];
    let near = |u: usize, share: f64| {
        let expected = crate::chart::colour::VIRIDIS.at(share);
        pixel(u).iter().zip(expected).all(|(a, b)| a.abs_diff(b) < 8) && pixel(u)[3] == 255
    };
    assert!(near(0, 0.0) && near(2, 0.25) && near(4, 0.5), "{pixels:?}");
    assert_eq!(pixel(3)[3], 0);
}
