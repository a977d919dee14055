"""What the paper says beside its numbered vectors, through the package: each against its definition in NumPy."""

import numpy as np
import pytest

import egomotion as em

PHI = np.array([0.06, -0.045, -0.3, 0.01, -0.015, 0.005])
POINTS = np.array([[0.5, -0.2, 4.0], [-1.0, 0.6, 6.0], [2.0, 1.0, 5.0]])


def test_scaled_depth_and_what_leaving_rotation_out_makes_of_it() -> None:
    seconds, interval = em.scaled_depth(POINTS, PHI, dt_s=0.1)
    np.testing.assert_allclose(seconds, -0.1 * POINTS[:, 2] / PHI[2], rtol=1e-14)
    np.testing.assert_allclose(interval, np.stack([seconds, seconds], axis=1), rtol=1e-14)

    error, sigma = em.rotation_left_out(POINTS, PHI, dt_s=0.1)
    impact = -0.1 * POINTS[:, 2] / em.velocity(PHI, POINTS)[:, 2]
    np.testing.assert_allclose(error, seconds - impact, rtol=1e-12)
    assert np.all(sigma == 0)

    # σ against draws: 3 % is four standard errors of 10,000.
    rng = np.random.default_rng(1)
    depth_sigma, cov = np.full(3, 0.02), np.diag(np.square([0.001] * 3 + [0.0002] * 3))
    _, sigma = em.rotation_left_out(POINTS, PHI, depth_sigma=depth_sigma, phi_cov=cov, dt_s=0.1)
    draws = rng.multivariate_normal(PHI, cov, 10_000)
    depths = POINTS[:, 2] + 0.02 * rng.standard_normal((10_000, 3))
    rays = POINTS / POINTS[:, 2:]
    vz = draws[:, 2:3] + depths * (draws[:, 3:4] * rays[:, 1] - draws[:, 4:5] * rays[:, 0])
    np.testing.assert_allclose(sigma, (0.1 * (depths / vz - depths / draws[:, 2:3])).std(axis=0), rtol=0.03)
    _, interval = em.scaled_depth(POINTS, PHI, depth_sigma=depth_sigma, phi_cov=cov, dt_s=0.1)
    assert np.all((interval[:, 0] < seconds) & (seconds < interval[:, 1]))

    seconds, interval = em.scaled_depth(POINTS, -PHI)
    assert np.isnan(seconds).all() and np.isnan(interval).all()
    with pytest.raises(ValueError, match="depth_sigma has 2 rows; give 3"):
        em.scaled_depth(POINTS, PHI, depth_sigma=[0.1, 0.1])


def test_image_velocity() -> None:
    velocities = em.velocity(PHI, POINTS)
    found = em.image_velocity(POINTS, velocities, 400.0)
    # (2) with (1) in it is (3).
    xy = 400.0 * POINTS[:, :2] / POINTS[:, 2:]
    flow = em.image_flow(PHI, np.column_stack([xy, POINTS[:, 2]]), 400.0)
    np.testing.assert_allclose(found, flow, rtol=1e-12)
    with pytest.raises(ValueError, match="velocities has 2 rows; give 3"):
        em.image_velocity(POINTS, velocities[:2], 400.0)


def test_propagated_and_rounded_variances() -> None:
    rng = np.random.default_rng(2)
    for m, n in [(1, 1), (2, 6), (6, 2), (3, 4)]:
        jacobian, root = rng.normal(size=(m, n)), rng.normal(size=(n, n))
        found = em.propagate_covariance(jacobian, root @ root.T)
        np.testing.assert_allclose(found, jacobian @ root @ root.T @ jacobian.T, rtol=1e-12)
    with pytest.raises(ValueError, match=r"covariance has shape \(3, 3\); give \(4, 4\)"):
        em.propagate_covariance(jacobian, np.eye(3))
    with pytest.raises(ValueError, match="at most 6 rows and columns"):
        em.propagate_covariance(np.ones((2, 7)), np.eye(7))
    assert abs(em.rounding_variance(0.25) - 0.25**2 / 12) < 1e-18


RIG = em.StereoRig(400.0, (159.5, 119.5), 0.13, (320, 240))


def test_coefficients_of_the_discrete_forms() -> None:
    bf = 400.0 * 0.13
    d, after, dx, dy = disparity = np.array([20.0, 21.0, 0.1, -0.2])
    shift = np.array([1.5, -0.5])
    unit = em.DepthTracks([[0, 0]], [disparity], [shift], [1.0, 1.0, 0.5, 0.5], [1.0, 1.0])
    # (47) with d_t = d′ − d and its 2 σ²_d.
    slope = (bf / d**2) ** 2
    of_disparity = (2 * bf / d**3) ** 2 * (dx**2 * shift[0] ** 2 + dy**2 * shift[1] ** 2 + (after - d) ** 2)
    of_disparity += slope * (0.5 * shift @ shift + 2)
    np.testing.assert_allclose(
        unit.coefficients(RIG), [[of_disparity, slope * (dx**2 + dy**2)]], rtol=1e-12
    )
    tracks = em.StereoTracks([[3, 4, d]], [[4, 4, after]], np.ones(3), np.ones(3))
    np.testing.assert_allclose(tracks.coefficients(RIG), [[slope + (bf / after**2) ** 2, 0]], rtol=1e-12)


def test_errors_of_section_seven() -> None:
    # Relative errors +10 %, −20 %, +40 %; the last two points are too small or unknown.
    estimate, truth = [-1.1, 1.6, 1.4, 0.5, np.nan], [-1.0, 2.0, 1.0, 0.1, 1.0]
    found = em.section_seven(estimate, truth)
    expected = {"erm_signed": 10, "erm_abs": 70 / 3, "erm_median": 20, "std_percent": 30, "eam": 1.3 / 4}
    for name, value in expected.items():
        assert abs(found[name] - value) < 1e-9, (name, found)
    assert (found["count"], found["relative_count"]) == (4, 3)
    assert em.section_seven([0.3, -0.1], [0, 0])["erm_abs"] is None
    with pytest.raises(ValueError, match="no point has both"):
        em.section_seven([np.nan], [1.0])
    with pytest.raises(ValueError, match="truth has 1 rows; give 2"):
        em.section_seven([1.0, 2.0], [1.0])


def flows(noise_px: float) -> em.StereoFlows:
    """Velocities under a tenth of PHI at 200 points, by (3) in both cameras."""
    rng, phi = np.random.default_rng(3), 0.1 * PHI
    xyd = rng.uniform([-150, -110, 8], [150, 110, 50], (200, 3))
    depth = RIG.depth(xyd[:, 2])
    left = em.image_flow(phi, np.column_stack([xyd[:, :2], depth]), 400.0)
    x_right = xyd[:, 0] - xyd[:, 2]
    right = em.image_flow(
        em.seen_from(phi, [0.13, 0, 0]), np.column_stack([x_right, xyd[:, 1], depth]), 400.0
    )
    measured = np.column_stack([xyd[:, 2], left, right[:, 0]])
    measured += noise_px * rng.standard_normal(measured.shape)
    return em.StereoFlows(xyd[:, :2], measured, np.full(4, max(noise_px, 0.1) ** 2))


def test_joint_is_its_rows_at_once() -> None:
    exact = flows(0.0)
    for estimator in ("irls", "ls", "lmeds"):
        found = em.joint(exact, RIG, estimator=estimator)
        np.testing.assert_allclose(found.theta, 0.1 * PHI, atol=1e-9)
    noisy = flows(0.1)
    rows = [noisy.equations(RIG, block_px=48.0), noisy.flow_equations(RIG, block_px=48.0)]
    a, b, sigma = (np.concatenate([getattr(r, name) for r in rows]) for name in ("a", "b", "sigma"))
    stacked = em.Rows(a, b, sigma)
    expected = em.least_squares(stacked, weighted=True)
    found = em.joint(noisy, RIG, estimator="ls")
    np.testing.assert_allclose(found.theta, expected.theta, rtol=1e-9)
    with pytest.raises(ValueError, match="is not known; give 'irls', 'ls' or 'lmeds'"):
        em.joint(noisy, RIG, estimator="eiv")  # type: ignore[arg-type]


def test_differential_likelihood_is_within_its_own_uncertainty_and_as_good_as_its_bound() -> None:
    observations = flows(0.1)
    found, cost = em.maximum_likelihood(observations, RIG, nu=np.inf)
    assert np.all(np.abs(found.theta - 0.1 * PHI) < 4 * found.sigma)
    # Three equations for each point, less the six of φ.
    assert abs(cost / (3 * 200 - 6) - 1) < 0.25, cost
    bound = em.cramer_rao_bound(observations, RIG, 0.1 * PHI)
    np.testing.assert_allclose(found.covariance.diagonal(), bound.diagonal(), rtol=0.1)
    exact, cost = em.maximum_likelihood(flows(0.0), RIG, nu=np.inf, iterations=50, tolerance=1e-12)
    np.testing.assert_allclose(exact.theta, 0.1 * PHI, atol=1e-9)
    assert cost < 1e-12


def test_an_estimate_seen_from_another_camera() -> None:
    left = em.joint(flows(0.1), RIG)
    centre = np.array([0.13, 0.0, 0.0])
    right = left.seen_from(centre)
    np.testing.assert_allclose(right.theta, em.seen_from(left.theta, centre), rtol=1e-12)
    # (4) is linear: its columns are what it makes of unit motions.
    matrix = np.stack([em.seen_from(unit, centre) for unit in np.eye(6)], axis=1)
    np.testing.assert_allclose(right.covariance, matrix @ left.covariance @ matrix.T, rtol=1e-9, atol=1e-18)
    back = right.seen_from(-centre)
    np.testing.assert_allclose(back.covariance, left.covariance, rtol=1e-9, atol=1e-18)
    assert (right.rows, right.inliers) == (left.rows, left.inliers)
    with pytest.raises(ValueError, match="an estimate of 3 unknowns is no motion"):
        em.least_squares(em.Rows(np.eye(3), np.ones(3))).seen_from(centre)
