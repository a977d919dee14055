"""Answers as tables and trajectories of other packages: pandas, Arrow, evo. Each is imported when it is asked for."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from ._native import FrameMotion, Run

if TYPE_CHECKING:
    import pandas
    import pyarrow
    from evo.core.trajectory import PoseTrajectory3D

_PHI = ("tx", "ty", "tz", "wx", "wy", "wz")
_UPPER = [(i, j) for i in range(6) for j in range(i, 6)]

#: The columns of `motion.csv`, in their order.
COLUMNS: tuple[str, ...] = (
    "frame",
    "time_s",
    "dt_s",
    *_PHI,
    *(f"cov_{i}{j}" for i, j in _UPPER),
    "rows",
    "inliers",
    "observed",
    "impact_s",
    "impact_lo_s",
    "impact_hi_s",
    "status",
)


def row(answer: FrameMotion) -> dict[str, float | int | str | None]:
    """The row of `motion.csv` of one frame: None where a value is not known."""
    motion, impact = answer.motion, answer.impact
    interval = impact.interval95_s if impact else None
    values: dict[str, float | int | str | None] = dict.fromkeys(COLUMNS)
    values.update(frame=answer.frame, time_s=answer.time_s, dt_s=answer.dt_s, status=answer.status)
    if motion is not None:
        theta, covariance, observed = motion.theta, motion.covariance, motion.observed
        values.update({name: float(theta[i]) if observed[i] else None for i, name in enumerate(_PHI)})
        values.update({f"cov_{i}{j}": float(covariance[i, j]) for i, j in _UPPER})
        values.update(rows=motion.rows, inliers=motion.inliers)
        values["observed"] = "".join("1" if seen else "0" for seen in observed)
    if impact is not None:
        values["impact_s"] = impact.seconds
    if interval is not None:
        values["impact_lo_s"], values["impact_hi_s"] = interval
    return values


def columns(answers: Iterable[FrameMotion]) -> dict[str, list[float | int | str | None]]:
    """All rows, column by column; as in `motion.csv` a first answer that has nothing before it has no row."""
    rows = [row(answer) for k, answer in enumerate(answers) if k > 0 or answer.dt_s is not None]
    return {name: [values[name] for values in rows] for name in COLUMNS}


def arrow_schema() -> pyarrow.Schema:
    """Names and types of the columns of `motion.csv`."""
    import pyarrow as pa

    kinds = dict.fromkeys(COLUMNS, pa.float64())
    kinds.update(frame=pa.int64(), rows=pa.int64(), inliers=pa.int64(), observed=pa.string(), status=pa.string())
    return pa.schema(list(kinds.items()))


def to_arrow(answers: Iterable[FrameMotion]) -> pyarrow.Table:
    """An Arrow table with the columns of `motion.csv`, typed, null where a value is not known."""
    import pyarrow as pa

    return pa.table(columns(answers), schema=arrow_schema())


def to_pandas(answers: Iterable[FrameMotion]) -> pandas.DataFrame:
    """A data frame with the columns of `motion.csv`; NaN, or NA in whole numbers, where a value is not known."""
    import pandas as pd

    kinds: dict[str, Any] = dict.fromkeys(COLUMNS, "float64")
    kinds.update(frame="int64", rows="Int64", inliers="Int64", observed="object", status="object")
    return pd.DataFrame(columns(answers)).astype(kinds)


def to_evo(run: Run) -> PoseTrajectory3D:
    """The trajectory of the frames so far for evo: world_from_camera, the first pose the identity."""
    from evo.core.trajectory import PoseTrajectory3D

    return PoseTrajectory3D(poses_se3=list(run.poses), timestamps=np.asarray(run.times_s))
