"""Answers as tables and trajectories of other packages."""

from pathlib import Path

import numpy as np
import pytest

import egomotion as em
from egomotion import tables


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[em.Run, list[em.FrameMotion]]:
    folder: Path = tmp_path_factory.mktemp("tables") / "drive"
    em.simulate("drive", folder, frames=4, size_px=(160, 120))
    run = em.run(folder, observe="sparse")
    return run, list(run)


def test_columns_are_those_of_motion_csv(run: tuple[em.Run, list[em.FrameMotion]]) -> None:
    found = tables.columns(run[1])
    assert list(found) == list(tables.COLUMNS) and len(found["frame"]) == 3
    last = run[1][-1]
    assert [found[name][-1] for name in ("tx", "ty", "tz", "wx", "wy", "wz")] == last.phi.tolist()
    assert found["cov_35"][-1] == last.covariance[3, 5] and found["observed"][-1] == "111111"


def test_arrow_and_pandas(run: tuple[em.Run, list[em.FrameMotion]]) -> None:
    pa = pytest.importorskip("pyarrow")
    pytest.importorskip("pandas")
    arrow, frame = tables.to_arrow(run[1]), tables.to_pandas(run[1])
    assert arrow.column_names == list(frame.columns) == list(tables.COLUMNS)
    assert arrow.schema.field("frame").type == pa.int64() and arrow.num_rows == 3
    assert arrow.column("tz").to_pylist() == frame["tz"].tolist() == [m.phi[2] for m in run[1][1:]]


def test_evo(run: tuple[em.Run, list[em.FrameMotion]]) -> None:
    pytest.importorskip("evo")
    trajectory = tables.to_evo(run[0])
    assert trajectory.num_poses == 4 and trajectory.check()[0]
    np.testing.assert_allclose(trajectory.positions_xyz, run[0].poses[:, :3, 3])
