"""Answers in the viewer Rerun (`pip install "egomotion[rerun]"`): the camera on its way, maps, time series.

```python
import rerun, egomotion, egomotion.rerun

rerun.init("egomotion", spawn=True)
run = egomotion.run("recordings/06")
for m in run:
    egomotion.rerun.log(m, rig=run.rig)
```
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import rerun as rr

from ._native import FrameMotion, StereoRig, exp

_SERIES = {
    "motion/t": ["tX, m", "tY, m", "tZ, m"],
    "motion/omega": ["ΩX, rad", "ΩY, rad", "ΩZ, rad"],
    "sigma/t": ["σ of tX, m", "σ of tY, m", "σ of tZ, m"],
    "sigma/omega": ["σ of ΩX, rad", "σ of ΩY, rad", "σ of ΩZ, rad"],
    "impact": ["time to impact, s", "from, s", "to, s"],
}


def log(
    answer: FrameMotion,
    *,
    rig: StereoRig,
    left: npt.ArrayLike | None = None,
    pose: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    entity: str = "egomotion",
    recording: rr.RecordingStream | None = None,
) -> None:
    """Log one frame at its time, on the timelines `time` (seconds) and `frame`.

    `left` is the image on whose pixels the maps lie, that of the frame before; they hang where the camera was then. `pose` is
    world_from_camera, rotation (3, 3) and translation (3,); by default the answer's own, which that of a recording has. What is
    not known is cleared, lest the viewer go on to show an earlier frame's.
    """
    rr.set_time("time", duration=answer.time_s, recording=recording)
    rr.set_time("frame", sequence=answer.frame, recording=recording)
    if answer.dt_s is None:
        for path, names in _SERIES.items():
            rr.log(f"{entity}/{path}", rr.SeriesLines(names=names), static=True, recording=recording)
    if answer.reason is not None:
        rr.log(f"{entity}/status", rr.TextLog(f"{answer.status}: {answer.reason}"), recording=recording)
    for path, what in (*_camera(answer, rig, pose or answer.pose), *_maps(answer, rig, left), *_series(answer)):
        rr.log(f"{entity}/{path}", rr.Clear(recursive=False) if what is None else what, recording=recording)


_Shown = Iterator[tuple[str, "rr.AsComponents | None"]]


def _transform(pose: tuple[npt.ArrayLike, npt.ArrayLike]) -> rr.Transform3D:
    return rr.Transform3D(mat3x3=np.asarray(pose[0]), translation=np.asarray(pose[1]))


def _camera(answer: FrameMotion, rig: StereoRig, pose: tuple[npt.ArrayLike, npt.ArrayLike] | None) -> _Shown:
    yield "camera", None if pose is None else _transform(pose)
    yield "camera/before", _transform(exp(answer.phi)) if np.isfinite(answer.phi).all() else None
    pinhole = rr.Pinhole(
        focal_length=[rig.focal_px, rig.focal_y_px],
        principal_point=rig.centre_px,
        resolution=rig.size_px,
        camera_xyz=rr.ViewCoordinates.RDF,
    )
    yield "camera/before/image", pinhole


def _maps(answer: FrameMotion, rig: StereoRig, left: npt.ArrayLike | None) -> _Shown:
    image = "camera/before/image"
    yield f"{image}/left", None if left is None else rr.Image(np.asarray(left))
    disparity = answer.disparity
    if disparity is None:
        yield f"{image}/depth", None
    else:
        depth = rig.depth(disparity.ravel()).reshape(disparity.shape)
        # Rerun takes 0 for what has no depth.
        depth[~np.isfinite(depth) | (depth < 0)] = 0
        yield f"{image}/depth", rr.DepthImage(depth.astype(np.float32), meter=1.0)
    for name in ("disparity", "depth_velocity", "depth_velocity_sigma", "looming"):
        values = getattr(answer, name)
        yield name, None if values is None else rr.Image(values, color_model="L")
    groups = answer.moving_groups
    boxes = rr.Boxes2D(
        array=[group.bounds for group in groups],
        array_format=rr.Box2DFormat.XYWH,
        labels=[f"VZ {group.depth_velocity[0]:.2g} m" for group in groups],
    )
    yield f"{image}/moving", boxes if groups else None


def _series(answer: FrameMotion) -> _Shown:
    sigma = np.sqrt(np.diag(answer.covariance))
    for name, values in (("motion", answer.phi), ("sigma", sigma)):
        yield f"{name}/t", None if answer.motion is None else rr.Scalars(values[:3])
        yield f"{name}/omega", None if answer.motion is None else rr.Scalars(values[3:])
    impact = answer.impact
    seconds = None if impact is None else impact.seconds
    if impact is None or seconds is None:
        yield "impact", None
    else:
        yield "impact", rr.Scalars([seconds, *(impact.interval95_s or (np.nan, np.nan))])
