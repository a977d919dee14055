"""Recordings from their files: the same numbers as the command's, and as those of the images themselves."""

import csv
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import egomotion as em

DATA = Path(os.environ.get("EGOMOTION_DATA", Path(__file__).resolve().parents[3] / "shared/data"))


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recordings") / "drive"
    assert em.simulate("drive", folder, frames=6, size_px=(160, 120)) == 6
    return folder


def test_a_recording_frame_by_frame(rendered: Path) -> None:
    run = em.run(rendered, threads=1)
    assert em.sequences(rendered) == [run.name] == ["drive"]
    assert len(run) == 6 and run.rig.size_px == (160, 120)
    answers = list(run)
    assert [m.frame for m in answers] == list(range(6)) and [m.status for m in answers[1:]] == ["ok"] * 5
    assert list(run) == []
    assert run.poses.shape == (6, 4, 4) and run.times_s.shape == (6,)
    world = em.Sequence("drive", frames=6, size_px=(160, 120))
    for k, m in enumerate(answers[1:]):
        assert np.abs(m.phi - world.phi(k)).max() < 2e-3
        pose, truth = m.pose, m.true_pose
        assert pose is not None and truth is not None
        assert np.abs(pose[1] - truth[1]).max() < 0.01
        np.testing.assert_array_equal(pose[1], run.poses[k + 1, :3, 3])


def test_choices(rendered: Path) -> None:
    sparse = list(em.run(rendered, observe="sparse", start=1, stride=2, frames=3))
    assert [m.frame for m in sparse] == [1, 3, 5] and sparse[1].depth_velocity is None
    back = list(em.run(rendered, observe="sparse", reverse=True, frames=2))
    assert [m.frame for m in back] == [1, 0]
    # A file of tracks or their settings: what is given says which.
    few, many = (list(em.run(rendered, observe="sparse", frames=2, tracks={"corners": n}))[1] for n in (60, 600))
    assert few.motion is not None and many.motion is not None and few.motion.rows < many.motion.rows
    refusals: list[tuple[type[Exception], str, Callable[[], object]]] = [
        (em.FileError, "nowhere", lambda: em.run(rendered / "nowhere")),
        (ValueError, "start 9 is past", lambda: em.run(rendered, start=9)),
        (ValueError, "stride is 0", lambda: em.run(rendered, stride=0)),
        (ValueError, "has no depth images", lambda: em.run(rendered, sensor="depth")),
        (ValueError, "no sequence 'other'|no sequence \"other\"", lambda: em.run(rendered, sequence="other")),
        (ValueError, "unknown field", lambda: em.run(rendered, metod="ml")),
        (ValueError, "unknown field `cornets`", lambda: em.run(rendered, tracks={"cornets": 5})),
        (em.FileError, "nowhere.npz", lambda: em.run(rendered, tracks=rendered / "nowhere.npz")),
    ]
    for error, words, call in refusals:
        with pytest.raises(error, match=words):
            call()


def test_a_run_that_is_left_ends(rendered: Path) -> None:
    """The thread that reads ahead does not keep the interpreter."""
    code = f"import egomotion; print(next(egomotion.run({str(rendered)!r})).status)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and done.stdout == "first\n", done.stderr


def same_as_the_command(command: str, path: Path, out: Path, frames: int) -> None:
    words = [command, "run", str(path), "--out", str(out), "--frames", str(frames), "--quiet"]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with (out / "motion.csv").open() as file:
        rows = list(csv.DictReader(file))
    answers = list(em.run(path, frames=frames))[1:]
    assert len(rows) == len(answers) > 1
    for row, m in zip(rows, answers):
        assert int(row["frame"]) == m.frame and row["status"] == m.status
        assert [float(row[name]) for name in ("tx", "ty", "tz", "wx", "wy", "wz")] == m.phi.tolist()
        upper = [float(row[f"cov_{i}{j}"]) for i in range(6) for j in range(i, 6)]
        assert upper == [m.covariance[i, j] for i in range(6) for j in range(i, 6)]
        seconds = m.impact.seconds if m.impact else None
        assert (float(row["impact_s"]) if row["impact_s"] else None) == seconds


@pytest.mark.parametrize("name", ["rendered", "kitti_odometry/sequences/06"])
def test_the_bits_are_those_of_the_command(name: str, rendered: Path, tmp_path: Path) -> None:
    command = os.environ.get("EGOMOTION_COMMAND")
    if command is None:
        pytest.skip("EGOMOTION_COMMAND does not name the command")
    path = rendered if name == "rendered" else DATA / name
    if not path.is_dir():
        pytest.skip(f"{path} is not there")
    same_as_the_command(command, path, tmp_path / "out", 4)
