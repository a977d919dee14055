//! One draw of a setting: its measurements, and how wrong every contender is on them.

use nalgebra::{Matrix6, RowVector6, Vector3};

use super::errors::QuantityErrors;
use super::tally::ErrorTally;
use crate::components::{NAMES, unit};
use crate::synthetic::{
    Contender, DifferentialDraw, DiscreteDraw, MeasurementModel, SyntheticWorld, UsablePixel, approach_name,
};
use egomotion::estimate::MotionEstimate;
use egomotion::estimate::cramer_rao_bound;
use egomotion::geometry::{Gaussian, RigidMotion, StereoRig, Twist};
use egomotion::motion::depth_velocity;
use egomotion::motion::{RigUncertainty, RigidPrediction};
use egomotion::pipeline::{Approach, EstimatorKind, Method};

/// φ by a contender whose rows are weighted at a motion.
type WeightedSolver<'a> = Box<dyn Fn(&Contender, &Twist) -> Option<MotionEstimate> + 'a>;
/// VZ of every measured point through φ, in metres.
type VzThroughMotion<'a> = Box<dyn Fn(&Twist) -> Vec<f64> + 'a>;

/// One draw and its truth, in the terms that both forms share.
pub(super) struct Trial<'a> {
    approach: Approach,
    /// VZ of every pixel alone, by DCCE and by DV, in metres.
    alone: [(Method, Vec<f64>); 2],
    solve: WeightedSolver<'a>,
    through: VzThroughMotion<'a>,
    /// True VZ of every pixel, in metres.
    truth: Vec<f64>,
    /// |VZ| from which on a relative error counts, in metres.
    floor_m: f64,
    /// The bound of φ's covariance, and the variance of each pixel's VZ through φ there.
    bound: Option<(Matrix6<f64>, Vec<f64>)>,
}

/// The measured points; NaN where the measured disparity is not positive.
fn points(rig: &StereoRig, xyd: impl Iterator<Item = Vector3<f64>>) -> Vec<Vector3<f64>> {
    xyd.map(|xyd| rig.point(&xyd).unwrap_or_else(|| Vector3::from_element(f64::NAN))).collect()
}

impl<'a> Trial<'a> {
    /// A draw of the differential form; relative errors count from `floor_m` of |VZ| on.
    pub(super) fn differential(
        world: &'a SyntheticWorld,
        floor_m: f64,
        model: &MeasurementModel,
        seed: u64,
    ) -> Self {
        let draw = DifferentialDraw::new(world, model, seed);
        let rig = &world.rig;
        let bf = rig.depth_disparity_product();
        let dcce = draw.changes.iter().map(|c| depth_velocity::dcce(&c.depth_change(bf)).vz().value());
        let dv = draw.motions.iter().map(|m| depth_velocity::dv(m, bf).vz().value());
        let alone = [(Method::Dcce, dcce.collect()), (Method::Dv, dv.collect())];
        let points =
            points(rig, draw.motions.iter().map(|m| Vector3::new(m.x_px, m.y_px, m.measured.mean[0])));
        let turn = Twist { t: Vector3::zeros(), ..world.phi };
        let by_d = |xyd: &Vector3<f64>| turn.velocity(&rig.point_jacobian(xyd).column(2).into_owned()).z;
        let noisy = model.disparity_variance() > 0.0 && model.std_vel_px > 0.0;
        let cov = noisy.then(|| cramer_rao_bound(&draw.exact(), rig, &world.phi)).flatten();
        let variance = |cov: &Matrix6<f64>, p: &UsablePixel| {
            let row = vz_by_phi(&p.point);
            (row * cov * row.transpose())[0] + by_d(&p.xyd).powi(2) * model.disparity_variance()
        };
        Self {
            approach: Approach::Differential,
            alone,
            truth: draw.pixels.iter().map(|p| p.depth_velocity_m(Approach::Differential)).collect(),
            floor_m,
            bound: cov.map(|cov| (cov, draw.pixels.iter().map(|p| variance(&cov, p)).collect())),
            through: Box::new(move |phi| points.iter().map(|p| phi.velocity(p).z).collect()),
            solve: Box::new(move |contender, at| {
                contender.differential(&draw, rig, at, &contender.config(seed)).ok()
            }),
        }
    }

    /// A draw of the discrete form; relative errors count from `floor_m` of |Z′ − Z| on.
    pub(super) fn discrete(
        world: &'a SyntheticWorld,
        floor_m: f64,
        model: &MeasurementModel,
        seed: u64,
    ) -> Self {
        let draw = DiscreteDraw::new(world, model, seed);
        let rig = &world.rig;
        let bf = rig.depth_disparity_product();
        let dcce = draw.changes.iter().map(|c| depth_velocity::dcce(&c.depth_change(bf)).vz().value());
        let dv = draw.motions.iter().map(|m| depth_velocity::dv_discrete(m, bf).vz().value());
        let alone = [(Method::Dcce, dcce.collect()), (Method::Dv, dv.collect())];
        let points = points(rig, draw.motions.iter().map(|m| m.before.mean));
        let noisy = model.disparity_variance() > 0.0 && model.std_track_px > 0.0;
        let cov = noisy.then(|| cramer_rao_bound(&draw.exact(model), rig, &world.phi)).flatten();
        let sigma_d = model.disparity_variance().sqrt();
        let variances = |cov: &Matrix6<f64>| {
            let phi = Gaussian { mean: world.phi.vector(), cov: *cov };
            let rigid = RigidPrediction::new(&phi, &RigUncertainty::none(), rig);
            let of = |p: &&UsablePixel| rigid?.depth_velocity(&p.xyd, sigma_d);
            draw.pixels.iter().map(|p| of(p).map_or(f64::NAN, |vz| vz.vz().variance())).collect()
        };
        Self {
            approach: Approach::Discrete,
            alone,
            truth: draw.pixels.iter().map(|p| p.depth_velocity_m(Approach::Discrete)).collect(),
            floor_m,
            bound: cov.map(|cov| (cov, variances(&cov))),
            through: Box::new(move |phi| {
                let motion = phi.exp();
                points.iter().map(|p| motion.apply(p).z - p.z).collect()
            }),
            solve: Box::new(move |contender, at| {
                contender.discrete(&draw, rig, at, &contender.config(seed)).ok()
            }),
        }
    }

    /// Errors of all contenders against the true φ of the cyclopean camera, whose `centre` the left one sees.
    pub(super) fn errors(&self, phi: &Twist, centre: &Vector3<f64>) -> Vec<QuantityErrors> {
        let contenders = Contender::all(self.approach);
        let start = start(&contenders, |c| (self.solve)(c, &Twist::zero()));
        let errors = |contender: &Contender| {
            let of = |quantity: &str, tally| QuantityErrors::new(contender.names(), quantity, tally);
            // The paper's VZ of a pixel needs no estimator: it stands with least squares.
            let alone = self.alone.iter().filter(|(method, _)| *method == contender.method);
            let alone = alone.filter(|_| contender.estimator == EstimatorKind::Ls);
            let mut errors: Vec<QuantityErrors> =
                alone.filter_map(|(_, vz)| Some(of("vz", self.vz_tally(vz)?))).collect();
            let estimate = (self.solve)(contender, &start).filter(MotionEstimate::is_complete);
            if let Some(estimate) = estimate {
                let estimate = estimate.phi();
                errors.extend(self.vz_tally(&(self.through)(&estimate)).map(|tally| of("vz_phi", tally)));
                let (estimate, truth) = (estimate.seen_from(centre).vector(), phi.vector());
                errors.extend(NAMES.iter().enumerate().map(|(i, quantity)| {
                    of(quantity, ErrorTally::component(estimate[i], truth[i], unit(i)))
                }));
            }
            errors
        };
        let of_contenders = contenders.iter().flat_map(errors).collect::<Vec<_>>();
        of_contenders.into_iter().chain(self.bound_errors(phi, centre)).collect()
    }

    fn vz_tally(&self, vz: &[f64]) -> Option<ErrorTally> {
        let pairs: Vec<_> = vz.iter().copied().zip(self.truth.iter().copied()).collect();
        ErrorTally::depth_velocity(&pairs, self.floor_m)
    }

    /// Errors of an unbiased Gaussian estimator at the bound: the mean of |error| is √(2/π) σ.
    fn bound_errors(&self, phi: &Twist, centre: &Vector3<f64>) -> Vec<QuantityErrors> {
        let Some((cov, variances)) = &self.bound else { return Vec::new() };
        let expected = |variance: f64| (2.0 / std::f64::consts::PI * variance).sqrt();
        let of = |quantity: &str, tally: ErrorTally| {
            QuantityErrors::new([approach_name(self.approach), "bound", "bound"], quantity, tally)
        };
        let vz: Vec<f64> = self.truth.iter().zip(variances).map(|(vz, var)| vz + expected(*var)).collect();
        let through = self.vz_tally(&vz).map(|tally| of("vz_phi", tally));
        let to_centre = Twist::seen_from_matrix(centre);
        let cov = to_centre * cov * to_centre.transpose();
        let truth = phi.vector();
        let components = NAMES.iter().enumerate().map(|(i, name)| {
            of(name, ErrorTally::component(truth[i] + expected(cov[(i, i)]), truth[i], unit(i)))
        });
        through.into_iter().chain(components).collect()
    }
}

/// Derivative of VZ = tZ + ΩX Y − ΩY X by φ.
fn vz_by_phi(p: &Vector3<f64>) -> RowVector6<f64> {
    RigidMotion::point_jacobian(p).row(2).into_owned()
}

/// The motion at which rows are weighted and iterations start: binocular flow by least squares, or none.
fn start(contenders: &[Contender], solve: impl Fn(&Contender) -> Option<MotionEstimate>) -> Twist {
    let plain = |c: &&Contender| c.method == Method::Dv && c.estimator == EstimatorKind::Ls;
    let found = contenders.iter().find(plain).and_then(solve).filter(MotionEstimate::is_complete);
    found.map_or(Twist::zero(), |found| found.phi_or_zero())
}
