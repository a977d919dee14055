//! Every analytic Jacobian, and every covariance that rests on one, against central differences.

use crate::scattered::{self, correlated, normals, phi, places, random, rig, stereo_flow};
use egomotion::constrain::{LinearConstraint, binocular_flow, dcce, displacement, image_flow};
use egomotion::estimate::{
    LikelihoodTerm, Row, StudentT, Weighting, least_squares, m_estimate, maximum_likelihood,
};
use egomotion::geometry::{CayleyMotion, Gaussian, RigidMotion, Twist};
use egomotion::motion::{
    DepthVelocity, RigUncertainty, RigidPrediction, depth_velocity as vz, rotation_left_out, scaled_depth,
};
use egomotion::observe::{DepthChange, DepthFlow, DepthTrack, StereoFlow, StereoTrack};
use nalgebra::{Matrix2, Matrix3, Matrix6, SMatrix, SVector, Vector2, Vector3, Vector4, Vector6};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// Derivatives of `f` by central differences over two step sizes, exact to the fourth order.
fn numeric<const M: usize, const N: usize>(
    f: impl Fn(&SVector<f64, N>) -> SVector<f64, M>,
    at: &SVector<f64, N>,
    step: f64,
) -> SMatrix<f64, M, N> {
    let mut jacobian = SMatrix::<f64, M, N>::zeros();
    for k in 0..N {
        let value = |h: f64| {
            let mut moved = *at;
            moved[k] += h;
            f(&moved)
        };
        let near = value(step) - value(-step);
        let far = value(2.0 * step) - value(-2.0 * step);
        jacobian.set_column(k, &((8.0 * near - far) / (12.0 * step)));
    }
    jacobian
}

/// Row by row relative to the row's largest entry.
#[track_caller]
fn close<const M: usize, const N: usize>(
    got: &SMatrix<f64, M, N>,
    want: &SMatrix<f64, M, N>,
    tolerance: f64,
) {
    for i in 0..M {
        let error = (got.row(i) - want.row(i)).amax();
        assert!(error <= tolerance * want.row(i).amax(), "row {i}: got {got}want {want}");
    }
}

/// A covariance, entry by entry relative to the two variances.
#[track_caller]
fn close_cov<const N: usize>(got: &SMatrix<f64, N, N>, want: &SMatrix<f64, N, N>, tolerance: f64) {
    for i in 0..N {
        for j in 0..N {
            let scale = (want[(i, i)] * want[(j, j)]).sqrt();
            let error = (got[(i, j)] - want[(i, j)]).abs();
            assert!(error <= tolerance * scale, "({i}, {j}): got {got}want {want}");
        }
    }
}

/// The covariance of `f` by its numeric Jacobian.
fn propagated<const M: usize, const N: usize>(
    f: impl Fn(&SVector<f64, N>) -> SVector<f64, M>,
    of: &Gaussian<N>,
    step: f64,
) -> SMatrix<f64, M, M> {
    let j = numeric(f, &of.mean, step);
    j * of.cov * j.transpose()
}

const EXACT: f64 = 1e-8;

#[test]
fn rig_jacobians() {
    let rig = rig();
    for xyd in places(20, &mut random(1)) {
        let by_measured = numeric(|m| rig.point(m).unwrap(), &xyd, 1e-2);
        close(&rig.point_jacobian(&xyd), &by_measured, EXACT);
        let p = rig.point(&xyd).unwrap();
        let by_point = numeric(|p| rig.project(p).unwrap(), &p, 1e-4);
        close(&rig.project_jacobian(&p), &by_point, EXACT);
    }
}

#[test]
fn twist_jacobians() {
    let mut rng = random(2);
    for size in [0.0, 1e-6, 0.01, 0.3, 2.0] {
        let at = normals::<6>(&mut rng) * size;
        let back = Twist::from_vector(&at).exp().inverse();
        let away = |v: &Vector6<f64>| Twist::from_vector(v).exp().after(&back).log().vector();
        close(&Twist::from_vector(&at).left_jacobian(), &numeric(away, &at, 1e-3), EXACT);

        let p = normals::<3>(&mut rng) + Vector3::z() * 4.0;
        let turned = |v: &Vector6<f64>| Twist::from_vector(v).exp().apply(&p);
        close(&RigidMotion::point_jacobian(&p), &numeric(turned, &Vector6::zeros(), 1e-3), EXACT);
        let moved = Twist::from_vector(&at).exp().apply(&p);
        let chained = RigidMotion::point_jacobian(&moved) * Twist::from_vector(&at).left_jacobian();
        close(&chained, &numeric(turned, &at, 1e-3), EXACT);

        let centre = normals::<3>(&mut rng);
        let seen = |v: &Vector6<f64>| Twist::from_vector(v).seen_from(&centre).vector();
        close(&Twist::seen_from_matrix(&centre), &numeric(seen, &at, 1e-2), EXACT);
    }
}

/// A depth flow with everything correlated that can be.
fn depth_flow(rng: &mut Pcg64Mcg) -> DepthFlow {
    let xyd = places(1, rng)[0];
    let slope = normals::<2>(rng) * 0.2;
    let rates = normals::<3>(rng);
    DepthFlow {
        x_px: xyd.x,
        y_px: xyd.y,
        disparity: Gaussian {
            mean: Vector4::new(xyd.z, slope.x, slope.y, rates.x),
            cov: correlated(0.1, rng),
        },
        flow: Gaussian { mean: Vector2::new(3.0 * rates.y, 3.0 * rates.z), cov: correlated(0.2, rng) },
    }
}

fn depth_track(rng: &mut Pcg64Mcg) -> DepthTrack {
    let flow = depth_flow(rng);
    let [d, dx, dy, dt] = flow.disparity.mean.into();
    DepthTrack {
        x_px: flow.x_px,
        y_px: flow.y_px,
        disparity: Gaussian { mean: Vector4::new(d, d + dt, dx, dy), cov: flow.disparity.cov },
        displacement: flow.flow,
    }
}

fn stereo_track(rng: &mut Pcg64Mcg) -> StereoTrack {
    let rig = rig();
    let xyd = places(1, rng)[0];
    let mean = scattered::moved(&xyd, &phi(), &rig) + normals::<3>(rng) * 0.3;
    StereoTrack {
        before: Gaussian { mean: xyd, cov: correlated(0.15, rng) },
        after: Gaussian { mean, cov: correlated(0.2, rng) },
    }
}

/// Two independent groups of quantities as one.
fn joined<const A: usize, const B: usize, const N: usize>(a: &Gaussian<A>, b: &Gaussian<B>) -> Gaussian<N> {
    let mut both = Gaussian { mean: SVector::<f64, N>::zeros(), cov: SMatrix::<f64, N, N>::zeros() };
    both.mean.rows_mut(0, A).copy_from(&a.mean);
    both.mean.rows_mut(A, B).copy_from(&b.mean);
    both.cov.view_mut((0, 0), (A, A)).copy_from(&a.cov);
    both.cov.view_mut((A, A), (B, B)).copy_from(&b.cov);
    both
}

fn with_disparity(flow: &DepthFlow, mean: &Vector4<f64>) -> DepthFlow {
    DepthFlow { disparity: Gaussian { mean: *mean, ..flow.disparity }, ..*flow }
}

fn with_track_disparity(track: &DepthTrack, mean: &Vector4<f64>) -> DepthTrack {
    DepthTrack { disparity: Gaussian { mean: *mean, ..track.disparity }, ..*track }
}

fn with_measured(flow: &StereoFlow, mean: &Vector4<f64>) -> StereoFlow {
    StereoFlow { measured: Gaussian { mean: *mean, ..flow.measured }, ..*flow }
}

fn with_ends(track: &StereoTrack, m: &Vector6<f64>) -> StereoTrack {
    let end = |g: &Gaussian<3>, i: usize| Gaussian { mean: m.fixed_rows::<3>(i).into(), ..*g };
    StereoTrack { before: end(&track.before, 0), after: end(&track.after, 3) }
}

#[test]
fn covariances_of_depth_changes() {
    let (bf, mut rng) = (rig().depth_disparity_product(), random(3));
    for _ in 0..20 {
        let flow = depth_flow(&mut rng);
        let depth = |m: &Vector4<f64>| with_disparity(&flow, m).depth_change(bf).depth.mean;
        close_cov(&flow.depth_change(bf).depth.cov, &propagated(depth, &flow.disparity, 1e-3), EXACT);
        let track = depth_track(&mut rng);
        let depth = |m: &Vector4<f64>| with_track_disparity(&track, m).depth_change(bf).depth.mean;
        close_cov(&track.depth_change(bf).depth.cov, &propagated(depth, &track.disparity, 1e-3), EXACT);
    }
}

#[test]
fn covariances_of_flows_from_tracks() {
    let mut rng = random(4);
    for _ in 0..20 {
        let track = stereo_track(&mut rng);
        let ends: Gaussian<6> = joined(&track.before, &track.after);
        let discrete = |m: &Vector6<f64>| with_ends(&track, m).discrete_flow().measured.mean;
        close_cov(&track.discrete_flow().measured.cov, &propagated(discrete, &ends, 1e-2), EXACT);
        let midpoint = |m: &Vector6<f64>| with_ends(&track, m).midpoint_flow().measured.mean;
        close_cov(&track.midpoint_flow().measured.cov, &propagated(midpoint, &ends, 1e-2), EXACT);
    }
}

/// σ of a constraint against that of its residual as a function of what was measured.
#[track_caller]
fn check_sigma(
    constraint: impl Fn(&Vector4<f64>) -> LinearConstraint,
    measured: &Gaussian<4>,
    at: &Twist,
    step: f64,
) {
    let residual = |m: &Vector4<f64>| SVector::<f64, 1>::new(constraint(m).residual(at));
    let want = propagated(residual, measured, step)[0].sqrt();
    let got = constraint(&measured.mean).sigma;
    assert!((got - want).abs() <= EXACT * want, "{got} {want}");
}

#[test]
fn sigma_of_every_constraint() {
    let (rig, mut rng) = (rig(), random(5));
    let (f, bf) = (rig.focal_px, rig.depth_disparity_product());
    for scale in [0.0, 1.0, -3.0] {
        let at = phi().scaled(scale);
        for _ in 0..10 {
            let flow = depth_flow(&mut rng);
            let change = |c: DepthChange| dcce::constraint(&c, f, &at);
            check_sigma(|m| change(with_disparity(&flow, m).depth_change(bf)), &flow.disparity, &at, 1e-3);
            let track = depth_track(&mut rng);
            let of = |m: &Vector4<f64>| change(with_track_disparity(&track, m).depth_change(bf));
            check_sigma(of, &track.disparity, &at, 1e-3);

            let mut flow = stereo_flow(&places(1, &mut rng)[0], &phi(), &rig, [1.0; 4]);
            flow.measured.cov = correlated(0.2, &mut rng);
            let metres = |m: &Vector4<f64>| binocular_flow::constraint(&with_measured(&flow, m), &rig, &at);
            check_sigma(metres, &flow.measured, &at, 1e-2);
            for i in 0..2 {
                let pixels =
                    |m: &Vector4<f64>| image_flow::constraints(&with_measured(&flow, m), &rig, &at)[i];
                check_sigma(pixels, &flow.measured, &at, 1e-2);
            }
        }
    }
}

/// Rows of finite displacements: their unknowns are (τ, w), in the places of (t, Ω).
#[test]
fn sigma_of_displacements() {
    let (rig, mut rng) = (rig(), random(26));
    for scale in [0.0, 1.0, -3.0] {
        let at = CayleyMotion::from_twist(&phi().scaled(scale));
        let unknowns = Twist { t: at.tau, omega: at.w };
        for _ in 0..10 {
            let track = stereo_track(&mut rng);
            let ends: Gaussian<6> = joined(&track.before, &track.after);
            let rows = |track: &StereoTrack| {
                let found = displacement::constraints(track, &rig, &at).unwrap();
                [found.image[0], found.image[1], found.depth]
            };
            for (i, got) in rows(&track).into_iter().enumerate() {
                let residual = |m: &Vector6<f64>| {
                    SVector::<f64, 1>::new(rows(&with_ends(&track, m))[i].residual(&unknowns))
                };
                let want = propagated(residual, &ends, 1e-2)[0].sqrt();
                assert!((got.sigma - want).abs() <= EXACT * want, "{i}: {} {want}", got.sigma);
            }
        }
    }
}

/// σ of (14) is that of (13)'s residual in its unit, so the residual must vanish: then scaling commutes.
#[test]
fn sigma_of_binocular_flow_as_printed() {
    let (rig, mut rng) = (rig(), random(6));
    for xyd in places(10, &mut rng) {
        let mut flow = stereo_flow(&xyd, &phi(), &rig, [1.0; 4]);
        flow.measured.cov = correlated(0.2, &mut rng);
        let printed =
            |m: &Vector4<f64>| binocular_flow::constraint_as_printed(&with_measured(&flow, m), &rig, &phi());
        check_sigma(printed, &flow.measured, &phi(), 1e-2);
    }
}

#[test]
fn rows_are_derivatives_of_residuals() {
    let (rig, mut rng) = (rig(), random(7));
    for _ in 0..10 {
        let change = depth_flow(&mut rng).depth_change(rig.depth_disparity_product());
        let flow = stereo_flow(&places(1, &mut rng)[0], &phi(), &rig, [1.0; 4]);
        let [x, y] = image_flow::constraints(&flow, &rig, &phi());
        let depth = dcce::constraint(&change, rig.focal_px, &phi());
        for constraint in [depth, binocular_flow::constraint(&flow, &rig, &phi()), x, y] {
            let residual =
                |v: &Vector6<f64>| SVector::<f64, 1>::new(constraint.residual(&Twist::from_vector(v)));
            close(&-constraint.row().transpose(), &numeric(residual, &phi().vector(), 1e-2), EXACT);
        }
    }
}

#[test]
fn covariances_of_depth_velocity() {
    let (bf, mut rng) = (rig().depth_disparity_product(), random(8));
    let z_vz = |v: DepthVelocity| v.z_vz.mean;
    for _ in 0..20 {
        let flow = depth_flow(&mut rng);
        let raw: Gaussian<6> = joined(&flow.disparity, &flow.flow);
        let of = |m: &Vector6<f64>| {
            let moved = with_disparity(&flow, &m.fixed_rows::<4>(0).into());
            let flow = Gaussian { mean: m.fixed_rows::<2>(4).into(), ..flow.flow };
            z_vz(vz::dcce(&DepthFlow { flow, ..moved }.depth_change(bf)))
        };
        close_cov(&vz::dcce(&flow.depth_change(bf)).z_vz.cov, &propagated(of, &raw, 1e-3), EXACT);

        let track = depth_track(&mut rng);
        let raw: Gaussian<6> = joined(&track.disparity, &track.displacement);
        let of = |m: &Vector6<f64>| {
            let moved = with_track_disparity(&track, &m.fixed_rows::<4>(0).into());
            let displacement = Gaussian { mean: m.fixed_rows::<2>(4).into(), ..track.displacement };
            z_vz(vz::dcce(&DepthTrack { displacement, ..moved }.depth_change(bf)))
        };
        close_cov(&vz::dcce(&track.depth_change(bf)).z_vz.cov, &propagated(of, &raw, 1e-3), EXACT);

        let mut flow = stereo_flow(&places(1, &mut rng)[0], &phi(), &rig(), [1.0; 4]);
        flow.measured.cov = correlated(0.2, &mut rng);
        let of = |m: &Vector4<f64>| z_vz(vz::dv(&with_measured(&flow, m), bf));
        close_cov(&vz::dv(&flow, bf).z_vz.cov, &propagated(of, &flow.measured, 1e-3), EXACT);

        let track = stereo_track(&mut rng);
        let ends: Gaussian<6> = joined(&track.before, &track.after);
        let of = |m: &Vector6<f64>| z_vz(vz::dv_discrete(&with_ends(&track, m), bf));
        close_cov(&vz::dv_discrete(&track, bf).z_vz.cov, &propagated(of, &ends, 1e-3), EXACT);
    }
}

#[test]
fn variance_of_looming() {
    let (bf, dt, mut rng) = (rig().depth_disparity_product(), 0.1, random(9));
    for _ in 0..20 {
        let d = rng.random_range(5.0..50.0);
        let after = d * rng.random_range(0.9..1.1);
        let disparities = Gaussian { mean: Vector2::new(d, after), cov: correlated::<2>(0.1, &mut rng) };
        // (d′ − d)/(d Δt) needs neither b nor f.
        let of = |m: &Vector2<f64>| SVector::<f64, 1>::new((m.y - m.x) / (m.x * dt));
        let got = DepthVelocity::from_disparities(&disparities, bf).looming(dt).unwrap();
        assert!((got.value() - of(&disparities.mean)[0]).abs() < 1e-12 / dt);
        close_cov(&got.cov, &propagated(of, &disparities, 1e-3), EXACT);
    }
}

#[test]
fn variances_of_scaled_depth_and_of_its_error() {
    let (rig, dt, mut rng) = (rig(), 0.1, random(12));
    // Everything in the image approaches, at 0.2 to 0.4 m an interval.
    let mean = Vector6::new(0.06, -0.045, -0.3, 0.01, -0.015, 0.005);
    for xyd in places(20, &mut rng) {
        let (point, z_variance) = (rig.point(&xyd).unwrap(), 0.04);
        let motion = Gaussian { mean, cov: correlated::<6>(0.003, &mut rng) };
        let raw: Gaussian<7> = joined(&Gaussian::scalar(point.z, z_variance), &motion);
        let scaled = |m: &SVector<f64, 7>| SVector::<f64, 1>::new(-m[3] / (m[0] * dt));
        // The depth's rate under the exact motion, by differences, of a point that noise moves along its ray.
        let error = |m: &SVector<f64, 7>| {
            let (p, phi) = (point * (m[0] / point.z), Twist::from_vector(&m.fixed_rows::<6>(1).into()));
            let z_after =
                |time: &SVector<f64, 1>| SVector::<f64, 1>::new(phi.scaled(time[0]).exp().apply(&p).z);
            let vz = numeric(z_after, &SVector::<f64, 1>::zeros(), 1e-3)[0];
            SVector::<f64, 1>::new(scaled(m)[0].recip() + dt * p.z / vz)
        };
        let found = scaled_depth(&point, z_variance, &motion, dt).unwrap().looming;
        assert!((found.value() - scaled(&raw.mean)[0]).abs() < 1e-12);
        close_cov(&found.cov, &propagated(scaled, &raw, 1e-3), EXACT);
        let found = rotation_left_out(&point, z_variance, &motion, dt).unwrap();
        assert!((found.value() - error(&raw.mean)[0]).abs() < 1e-8);
        close_cov(&found.cov, &propagated(error, &raw, 1e-4), 1e-6);
    }
}

#[test]
fn covariance_of_the_rigid_prediction() {
    let (rig, mut rng) = (rig(), random(10));
    for xyd in places(20, &mut rng) {
        let motion = Gaussian { mean: phi().scaled(5.0).vector(), cov: correlated::<6>(0.003, &mut rng) };
        let sigma = 0.2;
        let raw: Gaussian<7> = joined(&Gaussian::scalar(xyd.z, sigma * sigma), &motion);
        let of = |m: &SVector<f64, 7>| {
            let p = rig.point(&Vector3::new(xyd.x, xyd.y, m[0])).unwrap();
            let motion = Twist::from_vector(&m.fixed_rows::<6>(1).into()).exp();
            Vector2::new(p.z, motion.apply(&p).z - p.z)
        };
        let prediction = RigidPrediction::new(&motion, &RigUncertainty::none(), &rig).unwrap();
        let got = prediction.depth_velocity(&xyd, sigma).unwrap().z_vz;
        assert!((got.mean - of(&raw.mean)).norm() < 1e-12);
        let want: Matrix2<f64> = propagated(of, &raw, 1e-3);
        close_cov(&got.cov, &want, EXACT);
        assert!(
            (prediction.moved(&xyd).unwrap() - scattered::moved(&xyd, &phi().scaled(5.0), &rig)).norm()
                < 1e-9
        );
    }
}

#[test]
fn point_pairs_carry_the_mean_variance_of_a_component() {
    let (rig, mut rng) = (rig(), random(11));
    for _ in 0..10 {
        let track = stereo_track(&mut rng);
        let pair = egomotion::estimate::alignment::PointPair::from_track(&track, &rig, 0).unwrap();
        let point = |m: &Vector3<f64>| rig.point(m).unwrap();
        let sum: Matrix3<f64> =
            propagated(point, &track.before, 1e-2) + propagated(point, &track.after, 1e-2);
        assert!((pair.variance - sum.trace() / 3.0).abs() < EXACT * pair.variance);
    }
}

#[test]
fn robust_weights_and_their_derivative() {
    for nu in [2.0, 4.0, 30.0] {
        let kernel = StudentT { nu, ..StudentT::default() };
        for q in [0.1, 1.0, 7.0, 40.0] {
            for dimension in [1.0, 3.0] {
                let weight = |q: &SVector<f64, 1>| SVector::<f64, 1>::new(kernel.weight(q[0], dimension));
                let slope = numeric(weight, &SVector::<f64, 1>::new(q), 1e-3 * q)[0];
                let curvature = kernel.curvature(q, dimension);
                assert!((curvature + 2.0 * slope).abs() < EXACT * curvature, "{nu} {q}");
                // The weight is that of the density (1 + q/ν)^{−(ν + p)/2}: −2 ∂ log density/∂q.
                let log_density = |q: &SVector<f64, 1>| {
                    SVector::<f64, 1>::new(-0.5 * (nu + dimension) * (q[0] / nu).ln_1p())
                };
                let slope = numeric(log_density, &SVector::<f64, 1>::new(q), 1e-3 * q)[0];
                assert!((kernel.weight(q, dimension) + 2.0 * slope).abs() < EXACT);
            }
        }
    }
}

#[test]
fn bread_of_the_m_estimator_is_the_derivative_of_its_score() {
    let mut rng = random(12);
    let truth = Vector3::new(1.0, -2.0, 0.5);
    let rows: Vec<Row<3>> = (0..60)
        .map(|block| {
            let (a, noise, sigma) =
                (normals::<3>(&mut rng), normals::<2>(&mut rng), rng.random_range(0.1..0.4));
            // A t-like tail, so that the weights differ.
            Row { a, b: a.dot(&truth) + sigma * noise.x / noise.y.abs().max(0.1), sigma, block }
        })
        .collect();
    let kernel = StudentT { tolerance: 1e-10, iterations: 500, ..StudentT::default() };
    let start = least_squares(&rows, Weighting::InverseVariance).unwrap().theta;
    let fit = m_estimate(&rows, &start, &kernel).unwrap();
    let score = |theta: &Vector3<f64>| -> Vector3<f64> {
        let pull = |row: &Row<3>| {
            let q = (row.residual(theta) / (row.sigma * fit.residual_scale)).powi(2);
            row.a * (kernel.weight(q, 1.0) * row.residual(theta) / row.sigma.powi(2))
        };
        rows.iter().map(pull).sum()
    };
    let information: Matrix3<f64> = rows.iter().map(|r| r.a * r.a.transpose() / r.sigma.powi(2)).sum();
    let left: Vector3<f64> = score(&fit.theta).component_div(&information.diagonal().map(f64::sqrt));
    assert!(left.amax() < 1e-6, "the score at the estimate is {left}");
    close(&-fit.bread.unwrap(), &numeric(score, &fit.theta, 1e-4), 1e-7);
}

/// The six derivatives and the Hessian of `cost` over coordinates in which `cov` is the identity.
fn whitened_derivatives(
    cost: impl Fn(&Twist) -> f64,
    at: &Vector6<f64>,
    cov: &Matrix6<f64>,
) -> (Vector6<f64>, Matrix6<f64>) {
    let (root, h) = (cov.cholesky().unwrap().l(), 0.1);
    let value = |k: &Vector6<f64>| cost(&Twist::from_vector(&(at + root * k * h)));
    let unit = |i: usize| Vector6::from_fn(|k, _| f64::from(u8::from(k == i)));
    let gradient = Vector6::from_fn(|i, _| (value(&unit(i)) - value(&-unit(i))) / (2.0 * h));
    let hessian = Matrix6::from_fn(|i, j| {
        let (a, b) = (unit(i), unit(j));
        (value(&(a + b)) - value(&(a - b)) - value(&(b - a)) + value(&(-a - b))) / (4.0 * h * h)
    });
    (gradient, hessian)
}

/// Least cost over the structure, by its own Gauss–Newton with numeric derivatives.
fn profiled<const M: usize, const S: usize>(
    measured: &Gaussian<M>,
    first: SVector<f64, S>,
    predict: impl Fn(&SVector<f64, S>) -> SVector<f64, M>,
) -> f64 {
    let inverse = measured.cov.try_inverse().unwrap();
    let cost = |s: &SVector<f64, S>| {
        let e = measured.mean - predict(s);
        e.dot(&(inverse * e))
    };
    let mut s = first;
    for _ in 0..30 {
        let j = numeric(&predict, &s, 1e-3);
        let step = (j.transpose() * inverse * j).try_inverse().unwrap()
            * (j.transpose() * inverse * (measured.mean - predict(&s)));
        s += step;
        if step.norm() < 1e-11 {
            break;
        }
    }
    cost(&s)
}

const GAUSSIAN: StudentT = StudentT { nu: f64::INFINITY, fitted: false, iterations: 200, tolerance: 1e-10 };

/// The estimate is a stationary point of the profiled cost, and its covariance the inverse of half the Hessian.
///
/// The covariance is that of Gauss–Newton: it differs from the full Hessian by terms of the residuals' order,
/// which vanish without noise and set the `tolerance` with it.
fn check_likelihood<M: LikelihoodTerm>(observations: &[M], cost: impl Fn(&Twist) -> f64, tolerance: f64) {
    let found = maximum_likelihood(observations, &rig(), &Twist::zero(), None, &GAUSSIAN).unwrap();
    let theta = &found.motion.theta;
    let at = cost(&found.motion.phi());
    assert!((found.cost - at).abs() < 1e-7 * at.max(1.0), "{} {at}", found.cost);
    let (gradient, hessian) = whitened_derivatives(cost, &theta.mean, &theta.cov);
    assert!(gradient.amax() < 1e-4, "not stationary: {gradient}");
    let difference = (0.5 * hessian - Matrix6::identity()).amax();
    assert!(difference < tolerance, "{difference} {hessian}");
}

#[test]
fn maximum_likelihood_of_tracks() {
    let (rig, mut rng) = (rig(), random(13));
    for noise in [0.0, 1.0] {
        let tracks: Vec<StereoTrack> = places(15, &mut rng)
            .iter()
            .map(|xyd| {
                let (before, after) = (correlated::<3>(0.05, &mut rng), correlated::<3>(0.08, &mut rng));
                let mut disturb = |mean: Vector3<f64>, cov: Matrix3<f64>| {
                    let root = cov.cholesky().unwrap().l();
                    Gaussian { mean: mean + root * normals::<3>(&mut rng) * noise, cov }
                };
                StereoTrack {
                    before: disturb(*xyd, before),
                    after: disturb(scattered::moved(xyd, &phi(), &rig), after),
                }
            })
            .collect();
        let cost = |phi: &Twist| -> f64 {
            let one = |track: &StereoTrack| {
                let ends: Gaussian<6> = joined(&track.before, &track.after);
                profiled(&ends, track.before.mean, |s: &Vector3<f64>| {
                    let after = scattered::moved(s, phi, &rig);
                    Vector6::new(s.x, s.y, s.z, after.x, after.y, after.z)
                })
            };
            tracks.iter().map(one).sum()
        };
        check_likelihood(&tracks, cost, if noise == 0.0 { 1e-4 } else { 0.02 });
    }
}

#[test]
fn maximum_likelihood_of_flows() {
    let (rig, mut rng) = (rig(), random(14));
    for noise in [0.0, 1.0] {
        let flows: Vec<StereoFlow> = places(20, &mut rng)
            .iter()
            .map(|xyd| {
                let mut flow = stereo_flow(xyd, &phi(), &rig, [1.0; 4]);
                flow.measured.cov = correlated(0.05, &mut rng);
                let root = flow.measured.cov.cholesky().unwrap().l();
                flow.measured.mean += root * normals::<4>(&mut rng) * noise;
                flow
            })
            .collect();
        let cost = |phi: &Twist| -> f64 {
            let one = |flow: &StereoFlow| {
                profiled(&flow.measured, SVector::<f64, 1>::new(flow.measured.mean[0]), |d| {
                    let xyd = Vector3::new(flow.x_px, flow.y_px, d[0]);
                    stereo_flow(&xyd, phi, &rig, [1.0; 4]).measured.mean
                })
            };
            flows.iter().map(one).sum()
        };
        check_likelihood(&flows, cost, if noise == 0.0 { 1e-4 } else { 0.02 });
    }
}
