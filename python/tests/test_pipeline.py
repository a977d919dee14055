"""Images in, motion out: the package's own face on the pipeline, the front end, the studies."""

import json
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import egomotion as em

C = em.Sequence("C", frames=3)
FRAMES = [C.render(k, samples=2) for k in range(3)]


def pushed(motion: em.StereoMotion, kind: type = np.float32) -> list[em.FrameMotion]:
    # 16 bits are as white at 65535 as 8 bits at 255.
    unit = 257 if kind is np.uint16 else 1
    pairs = [[image.astype(kind) * kind(unit) for image in pair] for pair in FRAMES]
    return [motion.push(left, right, 0.1 * k) for k, (left, right) in enumerate(pairs)]


def inside(answer: em.FrameMotion, truth: Any, sigmas: float = 4.0) -> bool:
    sigma = np.sqrt(np.diag(answer.covariance))
    return bool(np.all(np.abs(answer.phi - truth) < sigmas * sigma))


def test_motion_and_maps_of_a_rendered_sequence() -> None:
    answers = pushed(em.StereoMotion(C.rig))
    assert [answer.status for answer in answers] == ["first", "ok", "ok"]
    assert answers[0].dt_s is None and answers[0].reason == "no earlier frame"
    for k, answer in enumerate(answers[1:]):
        assert inside(answer, C.phi(k))
        assert answer.frame == k + 1 and answer.dt_s == pytest.approx(0.1)
        np.testing.assert_allclose(answer.covariance, answer.covariance.T, rtol=1e-12)
        truth = C.truth(k)
        for found, sigma, true in [
            (answer.disparity, answer.disparity_sigma, truth["disparity"]),
            (answer.depth_velocity, answer.depth_velocity_sigma, truth["depth_velocity"]),
        ]:
            assert found is not None and sigma is not None and found.shape == (240, 320)
            z = (found - true) / sigma
            known = np.isfinite(z)
            assert known.mean() > 0.8
            assert (np.abs(z[known]) < 2).mean() > 0.85
        assert answer.flow is not None and answer.flow_cov is not None
        assert np.nanmedian(np.abs(answer.flow - truth["flow"])) < 0.1
        assert answer.looming is not None and answer.impact_map is not None
        near = answer.looming > 0
        np.testing.assert_allclose(answer.impact_map[near], 1 / answer.looming[near], rtol=1e-5)
        assert set(answer.stages_ms) == {"pyramids", "disparity", "tracks", "flow", "estimate", "maps"}


def test_types_threads_and_repetition_give_the_same_bits() -> None:
    first = pushed(em.StereoMotion(C.rig, observe="sparse"))[-1]
    for motion, kind in [
        (em.StereoMotion(C.rig, observe="sparse", threads=1), np.float32),
        (em.StereoMotion(C.rig, observe="sparse"), np.uint8),
        (em.StereoMotion(C.rig, observe="sparse"), np.uint16),
    ]:
        other = pushed(motion, kind)[-1]
        assert first.phi.tobytes() == other.phi.tobytes()
        assert first.covariance.tobytes() == other.covariance.tobytes()
    assert first.disparity is None


def test_settings_reach_the_pipeline() -> None:
    default = em.default_config()
    assert default["method"] == "ml" and default["tracks"]["corners"] > 0
    answers = {
        method: pushed(em.StereoMotion(C.rig, method=method, observe="sparse"))[-1].phi
        for method in ("ml", "dv", "joint", "rigid")
    }
    assert len({phi.tobytes() for phi in answers.values()}) == 4
    few = pushed(em.StereoMotion(C.rig, observe="sparse", tracks={"corners": 100}))[-1]
    assert few.motion is not None and few.motion.rows < 150


def test_a_renamed_setting_is_refused_with_its_new_name(tmp_path: Path) -> None:
    calls: list[Callable[..., object]] = [
        lambda **settings: em.StereoMotion(C.rig, **settings),
        lambda **settings: em.RgbdMotion(100.0, (15.5, 11.5), (32, 24), **settings),
        lambda **settings: em.run(tmp_path, **settings),
    ]
    for call in calls:
        with pytest.raises(ValueError, match="there is no setting `window` any more: write vehicle instead"):
            call(window={"width_m": 2.0})
    assert "vehicle" in em.default_config() and "window" not in em.default_config()
    # The same word elsewhere is no renamed setting.
    with pytest.raises(ValueError, match="unknown field `window`"):
        em.StereoMotion(C.rig, tracks={"window": 5})


def test_own_disparity_takes_the_place_of_ours() -> None:
    maps = [em.disparity(*pair) for pair in FRAMES[:2]]
    own = em.StereoMotion(C.rig)
    for k, ((left, _), (shift, sigma)) in enumerate(zip(FRAMES, maps)):
        answer = own.push(left, None, 0.1 * k, disparity=shift, disparity_sigma=sigma)
    assert answer.status == "ok" and answer.disparity is not None
    assert np.nanmax(np.abs(answer.disparity - maps[0][0])) == 0
    assert np.abs(answer.phi - C.phi(0)).max() < 1e-3


def test_own_flow_takes_the_place_of_ours() -> None:
    flow, covariance = em.flow(FRAMES[0][0], FRAMES[1][0])
    own = em.StereoMotion(C.rig)
    own.push(*FRAMES[0], 0.0)
    answer = own.push(*FRAMES[1], 0.1, flow=flow, flow_cov=covariance)
    assert answer.status == "ok" and answer.flow is not None
    known = np.isfinite(flow[..., 0])
    assert np.array_equal(answer.flow[known], flow[known])
    assert inside(answer, C.phi(0))
    # Without a covariance each pixel has the same, and where one component is unknown both are.
    holes = flow.astype(np.float64)
    holes[:20, :, 1] = np.nan
    other = em.StereoMotion(C.rig)
    other.push(*FRAMES[0], 0.0)
    answer = other.push(*FRAMES[1], 0.1, flow=holes)
    assert np.abs(answer.phi - C.phi(0)).max() < 1e-3
    wrongs: list[tuple[dict[str, Any], str]] = [
        ({"flow": flow[..., 0]}, "give \\(height, width, 2\\)"),
        ({"flow": np.zeros(flow.shape, np.int32)}, "flow has dtype int32"),
        ({"flow_cov": covariance}, "flow_cov needs flow"),
        ({"flow": flow, "flow_cov": covariance[1:]}, "differ in size"),
        ({"flow": flow[1:]}, "the flow is 320x239, the rig 320x240"),
    ]
    for wrong, words in wrongs:
        with pytest.raises((TypeError, ValueError), match=words):
            own.push(*FRAMES[2], 0.2, **wrong)
    # Nothing of these calls has passed for a frame.
    assert own.push(*FRAMES[2], 0.2).frame == 2


def test_a_method_that_does_not_hold_is_warned_of_once() -> None:
    drive = em.Sequence("drive", frames=2, step=16.0)
    pair = [drive.render(k, samples=2) for k in range(2)]
    motion = em.StereoMotion(drive.rig, method="dv", approach="differential")
    motion.push(*pair[0], 0.0)
    with pytest.warns(UserWarning, match="frame 1: .* tracked corners .* too fast"):
        answer = motion.push(*pair[1], 1.0)
    assert answer.status == "ok" and answer.contradiction is not None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert motion.push(*pair[0], 2.0).contradiction is not None


def test_the_nearest_obstacle_has_a_time_and_a_place() -> None:
    drive = em.Sequence("drive", frames=2)
    motion = em.StereoMotion(drive.rig)
    for k in range(2):
        answer = motion.push(*drive.render(k, samples=2), k * drive.interval_s)
    assert answer.impact is not None and answer.no_obstacle_reason is None and answer.impact_map is not None
    assert answer.contradiction is None
    impact = answer.impact
    assert impact.seconds is not None and impact.interval95_s is not None and impact.bounds is not None
    low, high = impact.interval95_s
    assert 0 < low < impact.seconds < high
    assert impact.looming == pytest.approx(1 / impact.seconds) and impact.looming_sigma > 0
    u, v, width, height = impact.bounds
    region = answer.impact_map[v : v + height, u : u + width]
    assert np.nanmin(region) < high and impact.points is not None and impact.points <= width * height


def test_depth_camera() -> None:
    rig = C.rig
    motion = em.RgbdMotion(rig.focal_px, rig.centre_px, rig.size_px, noise="exact", observe="sparse")
    for k in range(2):
        answer = motion.push(FRAMES[k][0], C.truth(k)["depth"], 0.1 * k)
    assert answer.status == "ok"
    assert np.abs(answer.phi - C.phi(0)).max() < 5e-4


def test_parts_of_the_front_end_lead_to_phi() -> None:
    tracks = em.track(FRAMES[0], FRAMES[1], C.rig)
    assert len(tracks) > 300 and tracks.before_cov.shape == (len(tracks), 3, 3)
    found, cost = em.maximum_likelihood(tracks, C.rig, block_px=48)
    assert cost > 0 and found.observed.all() and len(found.undetermined_words) == 0
    assert np.all(np.abs(found.theta - C.phi(0)) < 4 * found.sigma)
    flow, cov = em.flow(FRAMES[0][0], FRAMES[1][0])
    error = np.abs(flow - C.truth(0)["flow"])
    assert flow.shape == (240, 320, 2) and cov.shape == (240, 320, 3) and np.nanmedian(error) < 0.1


def test_what_is_not_determined_is_said() -> None:
    # Points on a line through the camera's axis do not show a turn about it.
    p = np.stack([np.zeros(40), np.zeros(40), np.linspace(2, 9, 40)], axis=1)
    xyd = C.rig.project(p)
    tracks = em.StereoTracks(xyd, xyd, np.full(3, 0.01), np.full(3, 0.01))
    found, _ = em.maximum_likelihood(tracks, C.rig)
    assert not found.observed[5] and np.isnan(found.theta[5]) and np.isinf(found.covariance[5, 5])
    assert found.undetermined_words == ["turn about z"]


def test_two_threads_of_python_work_at_a_time() -> None:
    """The interpreter is free while frames are worked on."""
    ticks = 0
    done = threading.Event()

    def work() -> None:
        pushed(em.StereoMotion(C.rig, threads=1))
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.wait(0.001):
        ticks += 1
    thread.join()
    assert ticks > 10


def test_a_study_is_the_sum_of_its_parts() -> None:
    study = em.Study("sensitivity", sequences=["C"], draws=1)
    assert study.settings == {"sequences": ["C"], "draws": 1, "seed": 1}
    table = em.Study("table", draws=4, measuring={"features": 128})
    backwards = [table.run(part) for part in reversed(range(len(table.parts)))]
    records = [record for part in reversed(backwards) for record in part]
    assert json.loads(records[0])["sequence"] == "C"
    assert table.publish(records) == table.tables()
    rows = table.tables()["table"]
    assert len({len(column) for column in rows.values()}) == 1 and "sequence" in rows
    with pytest.raises(ValueError):
        table.publish(["{}"])


def test_evaluate(tmp_path: Path) -> None:
    truth, estimate = tmp_path / "truth.txt", tmp_path / "estimate.txt"
    truth.write_text("".join(f"{0.1 * k} {k} 0 0 0 0 0 1\n" for k in range(12)))
    estimate.write_text("".join(f"{0.1 * k} {1.01 * k} 0 0 0 0 0 1\n" for k in range(12)))
    found = em.evaluate(estimate, truth, align="none", lengths_m=[5.0], deltas=["2f"])
    assert found["frames"] == 12 and found["t_rmse_m"] == pytest.approx(0.01)
    # KITTI's segments end at the first pose beyond the length: here six steps of 1 cm each for 5 m.
    assert found["drift_percent"] == pytest.approx(6 / 5)
    assert found["relative"][0]["translation_m"]["mean"] == pytest.approx(0.02)
    with pytest.raises(em.FileError, match="nowhere.txt"):
        em.evaluate(tmp_path / "nowhere.txt", truth)
    with pytest.raises(ValueError, match='delta "2x"'):
        em.evaluate(estimate, truth, deltas=["2x"])
