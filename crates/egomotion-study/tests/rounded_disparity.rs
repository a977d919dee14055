//! Least median of squares on disparity rounded to few levels: most rates are exactly zero, and no motion fits them best.

use egomotion::geometry::Twist;
use egomotion::pipeline::{Approach, EstimatorKind, Method};
use egomotion::sim::Sequence;
use egomotion_study::synthetic::{Contender, DifferentialDraw, MeasurementModel, SyntheticWorld};

#[test]
fn rounding_does_not_bring_the_scene_to_rest() {
    let sequence = Sequence::named("C", None, None, 1.0).unwrap();
    let phi = sequence.phi_cyclopean(0).unwrap();
    let world = SyntheticWorld::new(&sequence.scene, &sequence.rig, &phi, 0, 1.0);
    for round in [4, 8, 16] {
        let model = MeasurementModel { round: Some(round), ..MeasurementModel::clean() };
        let draw = DifferentialDraw::new(&world, &model, 1);
        let zeros = draw.changes.iter().filter(|c| c.disparity.mean[3] == 0.0).count();
        let solve = |method, estimator, start: &Twist| {
            let contender = Contender { approach: Approach::Differential, method, estimator };
            contender.differential(&draw, &world.rig, start, &contender.config(1)).unwrap()
        };
        // σ of a row is that of its gradients too, which takes a motion: that of binocular flow, as in the study.
        let start = solve(Method::Dv, EstimatorKind::Ls, &Twist::zero()).phi();
        let dcce = |estimator| solve(Method::Dcce, estimator, &start).theta.mean;
        let (ls, lmeds) = (dcce(EstimatorKind::Ls), dcce(EstimatorKind::Lmeds));
        let share = zeros as f64 / draw.changes.len() as f64;
        println!("1/{round} px, {share:.2} zeros: tZ {:.4} by LS, {:.4} by LMedS", ls[2], lmeds[2]);
        assert!(round > 4 || share > 0.5, "{share}");
        // Where zeros abound it is found as well as by least squares, which has no outliers to fear here.
        let ratio = lmeds[2] / ls[2];
        assert!(share < 0.05 || (ratio > 0.8 && ratio < 1.25), "{lmeds} {ls}");
        assert!(lmeds[2] < -0.005, "{lmeds}");
    }
}
