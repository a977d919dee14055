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
