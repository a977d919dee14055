//! Which motion is the scene's where a large moving body holds as many tracks: the one that goes on.

use nalgebra::Vector3;

use crate::estimate::Unsolvable;
use crate::geometry::{RigidMotion, StereoRig, Twist, median};
use crate::observe::StereoTrack;

/// A track moves by a motion that leads within this many pixels of where it was found.
const FITTING_PX: f64 = 1.0;
/// A motion by which at least this share of the tracks moves is uncontested.
const UNCONTESTED_SHARE: f64 = 0.7;
/// The scene may show no more than this share of the tracks where a body fills most of the image.
const LEAST_SCENE_SHARE: f64 = 0.25;
/// Tracks that go on with the last motion lie within this many pixels of where it leads: what a change of speed leaves.
const GOING_ON_PX: f64 = 3.0;

/// The motion `found`, or that of the tracks which go on as `prior` says, if the former is contested and changes
/// more. `refine` finds the motion of most of some tracks.
pub(super) fn scene_motion(
    tracks: &[StereoTrack],
    rig: &StereoRig,
    found: Twist,
    prior: &Twist,
    refine: impl Fn(&[StereoTrack]) -> Result<Twist, Unsolvable>,
) -> Twist {
    let share = |count: usize| count as f64 / tracks.len().max(1) as f64;
    let fitting = |phi: &Twist| {
        let motion = phi.exp();
        tracks.iter().filter(|track| error_px(track, rig, &motion) < FITTING_PX).count()
    };
    if share(fitting(&found)) >= UNCONTESTED_SHARE {
        return found;
    }
    let (by_found, by_prior) = (found.exp(), prior.exp());
    let going_on: Vec<StereoTrack> = tracks
        .iter()
        .filter(|track| {
            error_px(track, rig, &by_found) >= FITTING_PX && error_px(track, rig, &by_prior) < GOING_ON_PX
        })
        .copied()
        .collect();
    if share(going_on.len()) < LEAST_SCENE_SHARE {
        return found;
    }
    let Ok(other) = refine(&going_on) else { return found };
    let goes_on = share(fitting(&other)) >= LEAST_SCENE_SHARE;
    if goes_on && change_px(tracks, rig, &other, prior) < change_px(tracks, rig, &found, prior) {
        other
    } else {
        found
    }
}

/// By how much the image of a track's point is off where the track was found.
fn error_px(track: &StereoTrack, rig: &StereoRig, motion: &RigidMotion) -> f64 {
    let led = moved(&track.before.mean, rig, motion);
    led.map_or(f64::INFINITY, |led| (led - track.after.mean).norm())
}

/// By how much two motions differ in the image, as the median over the tracks.
fn change_px(tracks: &[StereoTrack], rig: &StereoRig, a: &Twist, b: &Twist) -> f64 {
    let (a, b) = (a.exp(), b.exp());
    let apart = |track: &StereoTrack| {
        let at = &track.before.mean;
        Some((moved(at, rig, &a)? - moved(at, rig, &b)?).norm())
    };
    median(&mut tracks.iter().filter_map(apart).collect::<Vec<f64>>())
}

fn moved(xyd: &Vector3<f64>, rig: &StereoRig, motion: &RigidMotion) -> Option<Vector3<f64>> {
    rig.project(&motion.apply(&rig.point(xyd)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Gaussian;

    #[test]
    fn what_goes_on_is_preferred_where_a_motion_is_contested() {
        let rig = StereoRig::new(400.0, (159.5, 119.5), 0.2, (320, 240)).unwrap();
        let twist = |x: f64, z: f64| Twist { t: Vector3::new(x, 0.0, z), omega: Vector3::zeros() };
        let (scene, body) = (twist(0.0, -0.05), twist(0.2, 0.05));
        // The scene's share of a hundred tracks.
        let tracks = |of_scene: usize| -> Vec<StereoTrack> {
            let track = |i: usize| {
                let xyd = Vector3::new(
                    (i * 37 % 300) as f64 - 150.0,
                    (i * 53 % 220) as f64 - 110.0,
                    20.0 + (i % 7) as f64,
                );
                let motion = if i < of_scene { scene } else { body }.exp();
                let gaussian = |mean| Gaussian { mean, cov: nalgebra::Matrix3::identity() * 0.01 };
                StereoTrack { before: gaussian(xyd), after: gaussian(moved(&xyd, &rig, &motion).unwrap()) }
            };
            (0..100).map(track).collect()
        };
        // A refinement that returns what all its tracks do.
        let refine = |tracks: &[StereoTrack]| {
            let all = |phi: &Twist| tracks.iter().all(|track| error_px(track, &rig, &phi.exp()) < 1e-6);
            [scene, body].into_iter().find(all).ok_or(Unsolvable::Unobservable)
        };
        let of = |of_scene, prior| scene_motion(&tracks(of_scene), &rig, body, &prior, refine);
        let near = twist(0.01, -0.06);
        assert_eq!(of(40, near), scene);
        // Too few tracks go on; nothing goes on; the other motion is the one that goes on.
        assert_eq!(of(20, near), body);
        assert_eq!(of(40, twist(-0.5, 0.0)), body);
        assert_eq!(of(40, twist(0.19, 0.05)), body);
    }
}
