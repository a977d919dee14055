"""What the viewer Rerun is told, read back from its file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import egomotion as em

rr = pytest.importorskip("rerun")
chunk = pytest.importorskip("rerun.chunk")

SIZE = (160, 120)


def logged(path: Path) -> dict[str, dict[int, dict[str, Any]]]:
    """What each entity holds at each frame; what is static at frame −1."""
    found: dict[str, dict[int, dict[str, Any]]] = {}
    for part in chunk.RrdReader(path).stream():
        for row in part.to_record_batch().to_pylist():
            values = {name: value for name, value in row.items() if value is not None}
            found.setdefault(part.entity_path, {}).setdefault(row.get("frame", -1), {}).update(values)
    return found


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[em.Run, list[em.FrameMotion], dict[str, Any]]:
    import egomotion.rerun

    folder = tmp_path_factory.mktemp("rerun")
    em.simulate("demo", folder / "demo", frames=4, size_px=SIZE)
    run = em.run(folder / "demo")
    answers = list(run)
    world = em.Sequence("demo", frames=4, size_px=SIZE)
    recording = rr.RecordingStream("egomotion_test")
    recording.save(folder / "demo.rrd")
    for m in answers:
        left = world.render(m.frame - 1)[0].astype(np.uint8) if m.frame > 0 else None
        egomotion.rerun.log(m, rig=run.rig, left=left, entity="rig", recording=recording)
    recording.disconnect()
    return run, answers, logged(folder / "demo.rrd")


def test_time_pose_and_camera(run: tuple[em.Run, list[em.FrameMotion], dict[str, Any]]) -> None:
    recording, answers, found = run
    camera = found["/rig/camera"]
    assert sorted(camera) == [0, 1, 2, 3]
    for m, pose in zip(answers, recording.poses):
        row = camera[m.frame]
        assert row["time"].total_seconds() == pytest.approx(m.time_s)
        np.testing.assert_allclose(row["Transform3D:translation"][0], pose[:3, 3], atol=1e-6)
        # Column by column.
        np.testing.assert_allclose(np.reshape(row["Transform3D:mat3x3"][0], (3, 3)).T, pose[:3, :3], atol=1e-6)
        pinhole = found["/rig/camera/before/image"][m.frame]
        assert pinhole["Pinhole:resolution"] == [[160, 120]]
        assert pinhole["Pinhole:image_from_camera"][0][0] == pytest.approx(recording.rig.focal_px)
    # The camera of the maps is where the frame before was.
    now, then = camera[3], found["/rig/camera/before"][3]
    rotation = np.reshape(now["Transform3D:mat3x3"][0], (3, 3)).T
    place = rotation @ then["Transform3D:translation"][0] + now["Transform3D:translation"][0]
    np.testing.assert_allclose(place, recording.poses[2, :3, 3], atol=1e-6)


def test_maps(run: tuple[em.Run, list[em.FrameMotion], dict[str, Any]]) -> None:
    recording, answers, found = run
    for name in ("disparity", "depth_velocity", "depth_velocity_sigma", "looming"):
        assert "Clear:is_recursive" in found[f"/rig/{name}"][0]
        for m in answers[1:]:
            values = np.array(found[f"/rig/{name}"][m.frame]["Image:buffer"][0], np.uint8).view(np.float32)
            np.testing.assert_array_equal(values.reshape(120, 160), getattr(m, name))
    row = found["/rig/camera/before/image/depth"][2]
    depth = np.array(row["DepthImage:buffer"][0], np.uint8).view(np.float32)
    disparity = answers[2].disparity
    assert disparity is not None and row["DepthImage:meter"] == [1.0]
    seen = depth > 0
    assert seen.mean() > 0.9
    np.testing.assert_allclose(recording.rig.disparity(depth[seen]), disparity.ravel()[seen], rtol=1e-5)
    assert "Image:buffer" in found["/rig/camera/before/image/left"][2]


def test_series(run: tuple[em.Run, list[em.FrameMotion], dict[str, Any]]) -> None:
    _, answers, found = run
    assert found["/rig/impact"][-1]["SeriesLines:names"][0] == "time to impact, s"
    assert any("no earlier frame" in word for word in found["/rig/status"][0]["TextLog:text"])
    for m in answers[1:]:
        sigma = np.sqrt(np.diag(m.covariance))
        for name, values in (("motion", m.phi), ("sigma", sigma)):
            assert found[f"/rig/{name}/t"][m.frame]["Scalars:scalars"] == values[:3].tolist()
            assert found[f"/rig/{name}/omega"][m.frame]["Scalars:scalars"] == values[3:].tolist()
        row = found["/rig/impact"][m.frame]
        if m.impact is None or m.impact.seconds is None:
            assert "Clear:is_recursive" in row
        else:
            assert row["Scalars:scalars"] == [m.impact.seconds, *(m.impact.interval95_s or ())]
    assert any(m.impact is not None for m in answers)


def test_what_moves_and_frames_without_files(tmp_path: Path) -> None:
    """A textured square crosses the scene."""
    import egomotion.rerun

    world = em.Sequence("C", frames=3)
    texture = np.random.default_rng(3).uniform(0, 255, (80, 80)).astype(np.float32)
    motion = em.StereoMotion(world.rig)
    recording = rr.RecordingStream("egomotion_test")
    recording.save(tmp_path / "moves.rrd")
    for k in range(3):
        left, right = world.render(k)
        for image, u in ((left, 120 + 4 * k), (right, 90 + 4 * k)):
            image[60:140, u : u + 80] = texture
        m = motion.push(left, right, 0.1 * k)
        egomotion.rerun.log(m, rig=world.rig, pose=(np.eye(3), [0, 0, k]), recording=recording)
    recording.disconnect()
    found = logged(tmp_path / "moves.rrd")
    assert len(m.moving_groups) > 0
    boxes = found["/egomotion/camera/before/image/moving"][2]
    u, v, width, height = m.moving_groups[0].bounds
    assert boxes["Boxes2D:centers"][0] == [u + width / 2, v + height / 2]
    assert boxes["Boxes2D:half_sizes"][0] == [width / 2, height / 2]
    assert found["/egomotion/camera"][2]["Transform3D:translation"] == [[0, 0, 2]]
