"""The compiled part of the package; its documentation is in the objects themselves."""

from collections.abc import Sequence as _Sequence
from os import PathLike
from typing import Any, Literal, final

import numpy as np
import numpy.typing as npt

_F32 = npt.NDArray[np.float32]
_F64 = npt.NDArray[np.float64]
_Bool = npt.NDArray[np.bool_]
_Motion = tuple[_F64, _F64]
_Rectangle = tuple[int, int, int, int]
_Path = str | PathLike[str]
_Form = Literal["rigid", "affine"]

__all__ = [
    "DepthChanges",
    "DepthFlows",
    "DepthTracks",
    "Estimate",
    "FrameMotion",
    "Impact",
    "MovingGroup",
    "ReadError",
    "RgbdMotion",
    "Rows",
    "Run",
    "Sequence",
    "StereoFlows",
    "StereoMotion",
    "StereoRig",
    "StereoTracks",
    "Study",
    "Unsolvable",
    "align",
    "align_phi",
    "cramer_rao_bound",
    "default_config",
    "disparity",
    "errors_in_variables",
    "evaluate",
    "exact_change",
    "exp",
    "flow",
    "image_flow",
    "instantaneous",
    "irls",
    "least_squares",
    "lmeds",
    "lmeds_search",
    "lmeds_trials",
    "log",
    "maximum_likelihood",
    "robust_scale",
    "rotation_and_u",
    "run",
    "seen_from",
    "sequences",
    "simulate",
    "smallest_change",
    "track",
    "two_step",
    "velocity",
]

class ReadError(Exception):
    """A recording or a file cannot be read."""

class Unsolvable(Exception):
    """The equations have no answer."""

@final
class StereoRig:
    """A rectified stereo rig: pinhole cameras with parallel axes.

    Lengths are metres, image coordinates pixels. x and y count from the principal point, x right, y down, and are
    scaled to the horizontal focal length; d = x_left − x_right = baseline · focal / Z.
    """

    def __new__(
        cls,
        focal: float,
        centre: tuple[float, float],
        baseline: float,
        size: tuple[int, int],
        *,
        doffs: float = 0.0,
        focal_y: float | None = None,
    ) -> StereoRig: ...
    @property
    def focal(self) -> float: ...
    @property
    def focal_y(self) -> float: ...
    @property
    def centre(self) -> tuple[float, float]: ...
    @property
    def baseline(self) -> float: ...
    @property
    def doffs(self) -> float: ...
    @property
    def size(self) -> tuple[int, int]: ...
    def depth(self, d: npt.ArrayLike) -> _F64: ...
    def disparity(self, z: npt.ArrayLike) -> _F64: ...
    def point(self, xyd: npt.ArrayLike) -> _F64: ...
    def project(self, p: npt.ArrayLike) -> _F64: ...
    def image_from_pixel(self, uv: npt.ArrayLike) -> _F64: ...
    def pixel_from_image(self, xy: npt.ArrayLike) -> _F64: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    __hash__: None  # type: ignore[assignment]

@final
class Estimate:
    """An estimate of k unknowns: its value, its covariance, and what could not be determined."""

    @property
    def theta(self) -> _F64: ...
    @property
    def covariance(self) -> _F64: ...
    @property
    def sigma(self) -> _F64: ...
    @property
    def observed(self) -> _Bool: ...
    @property
    def undetermined(self) -> _F64: ...
    @property
    def undetermined_words(self) -> list[str]: ...
    @property
    def rows(self) -> int: ...
    @property
    def inliers(self) -> int: ...
    @property
    def residual_scale(self) -> float: ...
    @property
    def weights(self) -> _F64 | None: ...

@final
class Rows:
    """Linear equations a · θ = b, each with the standard deviation of its residual and its block."""

    def __new__(
        cls,
        a: npt.ArrayLike,
        b: npt.ArrayLike,
        sigma: npt.ArrayLike | None = None,
        block: _Sequence[int] | None = None,
    ) -> Rows: ...
    @property
    def a(self) -> _F64: ...
    @property
    def b(self) -> _F64: ...
    @property
    def sigma(self) -> _F64: ...
    @property
    def block(self) -> npt.NDArray[np.uintp]: ...
    def __len__(self) -> int: ...

@final
class DepthChanges:
    """Change of depth at points: what the depth change constraint needs, from depth itself."""

    def __new__(
        cls,
        xy: npt.ArrayLike,
        depth: npt.ArrayLike,
        flow: npt.ArrayLike,
        depth_cov: npt.ArrayLike,
        flow_cov: npt.ArrayLike,
    ) -> DepthChanges: ...
    @property
    def depth(self) -> _F64: ...
    @property
    def depth_cov(self) -> _F64: ...
    def depth_velocity(self) -> tuple[_F64, _F64]: ...
    def variance_with_product(self) -> _F64: ...
    def equations(
        self, rig: StereoRig, *, at: npt.ArrayLike | None = None, block_px: float | None = None
    ) -> Rows: ...
    def __len__(self) -> int: ...

@final
class DepthFlows:
    """Disparity with its derivatives, and flow, at points."""

    def __new__(
        cls,
        xy: npt.ArrayLike,
        disparity: npt.ArrayLike,
        flow: npt.ArrayLike,
        disparity_cov: npt.ArrayLike,
        flow_cov: npt.ArrayLike,
    ) -> DepthFlows: ...
    def depth_change(self, rig: StereoRig) -> DepthChanges: ...
    def depth_velocity(self, rig: StereoRig) -> tuple[_F64, _F64]: ...
    def variance_as_printed(self, rig: StereoRig) -> _F64: ...
    def coefficients(self, rig: StereoRig) -> _F64: ...
    def __len__(self) -> int: ...

@final
class DepthTracks:
    """Disparity before, disparity with its slopes after, and the displacement of points."""

    def __new__(
        cls,
        xy: npt.ArrayLike,
        disparity: npt.ArrayLike,
        displacement: npt.ArrayLike,
        disparity_cov: npt.ArrayLike,
        displacement_cov: npt.ArrayLike,
    ) -> DepthTracks: ...
    def depth_change(self, rig: StereoRig) -> DepthChanges: ...
    def depth_velocity(self, rig: StereoRig) -> tuple[_F64, _F64]: ...
    def variance_as_printed(self, rig: StereoRig) -> _F64: ...
    def __len__(self) -> int: ...

@final
class StereoFlows:
    """Disparity, and flow of both cameras, at points."""

    def __new__(cls, xy: npt.ArrayLike, measured: npt.ArrayLike, measured_cov: npt.ArrayLike) -> StereoFlows: ...
    def depth_velocity(self, rig: StereoRig) -> tuple[_F64, _F64]: ...
    def coefficients(self, rig: StereoRig) -> _F64: ...
    def equations(
        self,
        rig: StereoRig,
        *,
        at: npt.ArrayLike | None = None,
        block_px: float | None = None,
        as_printed: bool = False,
    ) -> Rows: ...
    def flow_equations(
        self, rig: StereoRig, *, at: npt.ArrayLike | None = None, block_px: float | None = None
    ) -> Rows: ...
    def __len__(self) -> int: ...

@final
class StereoTracks:
    """(x, y, d) of points before and after."""

    def __new__(
        cls,
        before: npt.ArrayLike,
        after: npt.ArrayLike,
        before_cov: npt.ArrayLike,
        after_cov: npt.ArrayLike,
    ) -> StereoTracks: ...
    @property
    def before(self) -> _F64: ...
    @property
    def after(self) -> _F64: ...
    @property
    def before_cov(self) -> _F64: ...
    @property
    def after_cov(self) -> _F64: ...
    def depth_velocity(self, rig: StereoRig) -> tuple[_F64, _F64]: ...
    def variance_as_printed(self, rig: StereoRig) -> _F64: ...
    def discrete_flow(self) -> StereoFlows: ...
    def midpoint_flow(self) -> StereoFlows: ...
    def __len__(self) -> int: ...

@final
class Impact:
    """Time to impact, counted from the later frame."""

    @property
    def seconds(self) -> float | None: ...
    @property
    def interval95(self) -> tuple[float, float] | None: ...
    @property
    def looming(self) -> float: ...
    @property
    def looming_sigma(self) -> float: ...
    @property
    def bounds(self) -> _Rectangle | None: ...
    @property
    def points(self) -> int | None: ...

@final
class MovingGroup:
    """Something that moves by itself."""

    @property
    def pixels(self) -> int: ...
    @property
    def bounds(self) -> _Rectangle: ...
    @property
    def depth(self) -> float: ...
    @property
    def motion(self) -> Estimate | None: ...
    @property
    def depth_velocity(self) -> tuple[float, float]: ...
    @property
    def impact(self) -> Impact | None: ...

@final
class FrameMotion:
    """What one frame says about motion since its reference frame."""

    @property
    def frame(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def dt(self) -> float | None: ...
    @property
    def status(self) -> str: ...
    @property
    def reason(self) -> str | None: ...
    @property
    def motion(self) -> Estimate | None: ...
    @property
    def phi(self) -> _F64: ...
    @property
    def covariance(self) -> _F64: ...
    @property
    def pose(self) -> _Motion | None: ...
    @property
    def true_pose(self) -> _Motion | None: ...
    @property
    def impact(self) -> Impact | None: ...
    @property
    def no_obstacle(self) -> str | None: ...
    @property
    def moving(self) -> list[MovingGroup]: ...
    @property
    def row_disagreement(self) -> float | None: ...
    @property
    def disparity(self) -> _F32 | None: ...
    @property
    def disparity_sigma(self) -> _F32 | None: ...
    @property
    def flow(self) -> _F32 | None: ...
    @property
    def flow_covariance(self) -> _F32 | None: ...
    @property
    def depth_velocity(self) -> _F32 | None: ...
    @property
    def depth_velocity_sigma(self) -> _F32 | None: ...
    @property
    def looming(self) -> _F32 | None: ...
    @property
    def looming_sigma(self) -> _F32 | None: ...
    @property
    def impact_map(self) -> _F32 | None: ...
    @property
    def impact_low(self) -> _F32 | None: ...
    @property
    def impact_high(self) -> _F32 | None: ...
    @property
    def stages(self) -> dict[str, float]: ...

@final
class StereoMotion:
    """Turns a sequence of rectified stereo images into motion."""

    def __new__(
        cls,
        rig: StereoRig,
        *,
        threads: int | None = None,
        mask: npt.ArrayLike | None = None,
        **settings: Any,
    ) -> StereoMotion: ...
    def push(
        self,
        left: npt.ArrayLike,
        right: npt.ArrayLike | None,
        time: float,
        *,
        disparity: npt.ArrayLike | None = None,
        disparity_sigma: npt.ArrayLike | None = None,
    ) -> FrameMotion: ...

@final
class RgbdMotion:
    """Turns a sequence of depth images with intensity into motion."""

    def __new__(
        cls,
        focal: float,
        centre: tuple[float, float],
        size: tuple[int, int],
        *,
        focal_y: float | None = None,
        noise: Literal["kinect", "time-of-flight", "exact"] = "kinect",
        threads: int | None = None,
        **settings: Any,
    ) -> RgbdMotion: ...
    def push(self, image: npt.ArrayLike, depth: npt.ArrayLike, time: float) -> FrameMotion: ...

@final
class Run:
    """A recording on its way through the pipeline: an iterator of `FrameMotion`."""

    @property
    def name(self) -> str: ...
    @property
    def rig(self) -> StereoRig: ...
    @property
    def poses(self) -> _F64: ...
    @property
    def times(self) -> _F64: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Run: ...
    def __next__(self) -> FrameMotion: ...

@final
class Sequence:
    """A rendered sequence: poses, exact motions, images, true maps."""

    def __new__(
        cls, name: str, *, size: tuple[int, int] | None = None, frames: int | None = None, step: float = 1.0
    ) -> Sequence: ...
    @staticmethod
    def names() -> list[str]: ...
    @property
    def rig(self) -> StereoRig: ...
    @property
    def interval(self) -> float: ...
    def pose(self, k: int) -> _Motion: ...
    def phi(self, k: int) -> _F64: ...
    def clearance(self, k: int) -> float: ...
    def render(
        self, k: int, *, noise: bool = True, seed: int = 1, samples: int = 4
    ) -> tuple[_F32, _F32]: ...
    def truth(self, k: int) -> dict[str, npt.NDArray[Any]]: ...
    def __len__(self) -> int: ...

@final
class Study:
    """A study: independent parts, each of which gives records, and what the records of all of them show.

    Parts may run in any order and on any machine: the numbers are the same.
    """

    def __new__(cls, name: str, **settings: Any) -> Study: ...
    @staticmethod
    def names() -> list[str]: ...
    @property
    def name(self) -> str: ...
    @property
    def settings(self) -> dict[str, Any]: ...
    @property
    def parts(self) -> list[str]: ...
    def run(self, part: int) -> list[str]: ...
    def publish(self, records: _Sequence[str]) -> dict[str, dict[str, list[str | float | int | None]]]: ...
    def tables(self) -> dict[str, dict[str, list[str | float | int | None]]]: ...

def align(before: npt.ArrayLike, after: npt.ArrayLike, *, form: _Form = "rigid") -> _Motion: ...
def align_phi(
    before: npt.ArrayLike,
    after: npt.ArrayLike,
    *,
    form: _Form = "rigid",
    estimator: Literal["ls", "lmeds"] = "ls",
) -> Estimate: ...
def cramer_rao_bound(tracks: StereoTracks, rig: StereoRig, phi: npt.ArrayLike) -> _F64: ...
def default_config() -> dict[str, Any]: ...
def disparity(left: npt.ArrayLike, right: npt.ArrayLike, **settings: Any) -> tuple[_F32, _F32]: ...
def errors_in_variables(
    changes: DepthChanges, rig: StereoRig, *, start: npt.ArrayLike | None = None, block_px: float = 48.0
) -> Estimate: ...
def evaluate(
    estimate: _Path,
    truth: _Path,
    *,
    align: Literal["none", "se3", "sim3"] = "se3",
    associate: Literal["time", "row"] = "time",
    max_diff: float = 0.01,
    lengths: _Sequence[float] | None = None,
    delta: _Sequence[str] | None = None,
    truth_sigma: tuple[float, float] | None = None,
) -> dict[str, Any]: ...
def exact_change(z: npt.ArrayLike, after: npt.ArrayLike, uv: npt.ArrayLike, rig: StereoRig) -> _F64: ...
def exp(phi: npt.ArrayLike, dt: float = 1.0) -> _Motion: ...
def flow(before: npt.ArrayLike, after: npt.ArrayLike, **settings: Any) -> tuple[_F32, _F32]: ...
def image_flow(phi: npt.ArrayLike, xyz: npt.ArrayLike, focal: float) -> _F64: ...
def instantaneous(rotation: npt.ArrayLike, translation: npt.ArrayLike) -> _F64: ...
def irls(rows: Rows, *, start: _Sequence[float] | None = None, nu: float | None = None) -> Estimate: ...
def least_squares(rows: Rows, *, weighted: bool = False) -> Estimate: ...
def lmeds(
    rows: Rows,
    *,
    weighted: bool = False,
    confidence: float | None = None,
    outliers: float | None = None,
    cut: float | None = None,
    reweights: int | None = None,
    seed: int | None = None,
) -> Estimate: ...
def lmeds_search(rows: Rows, subsets: _Sequence[_Sequence[int]]) -> tuple[_F64, float]: ...
def lmeds_trials(confidence: float, outliers: float, p: int) -> int: ...
def log(rotation: npt.ArrayLike, translation: npt.ArrayLike) -> _F64: ...
def maximum_likelihood(
    tracks: StereoTracks,
    rig: StereoRig,
    *,
    start: npt.ArrayLike | None = None,
    nu: float | None = None,
    block_px: float | None = None,
    iterations: int | None = None,
    tolerance: float | None = None,
) -> tuple[Estimate, float]: ...
def robust_scale(median_square: float, n: int, p: int) -> float: ...
def rotation_and_u(phi: npt.ArrayLike, dt: float = 1.0) -> tuple[_F64, _F64]: ...
def run(
    path: _Path,
    *,
    sequence: str | None = None,
    calibration: _Path | None = None,
    start: int = 0,
    frames: int | None = None,
    stride: int = 1,
    reverse: bool = False,
    sensor: Literal["stereo", "depth"] | None = None,
    disparity: _Path | None = None,
    flow: _Path | None = None,
    tracks: _Path | None = None,
    mask: _Path | None = None,
    threads: int | None = None,
    **settings: Any,
) -> Run: ...
def sequences(path: _Path, *, calibration: _Path | None = None) -> list[str]: ...
def seen_from(phi: npt.ArrayLike, centre: npt.ArrayLike) -> _F64: ...
def simulate(
    name: str,
    out: _Path,
    *,
    step: float = 1.0,
    frames: int | None = None,
    size: tuple[int, int] | None = None,
    noise: bool | None = None,
    seed: int | None = None,
    texture: int | None = None,
    scene: _Path | None = None,
) -> int: ...
def smallest_change(d: npt.ArrayLike, step: float, rig: StereoRig) -> _F64: ...
def track(
    before: tuple[npt.ArrayLike, npt.ArrayLike],
    after: tuple[npt.ArrayLike, npt.ArrayLike],
    rig: StereoRig,
    *,
    expected: npt.ArrayLike | None = None,
    **settings: Any,
) -> StereoTracks: ...
def two_step(dv: Rows, flow: Rows, *, estimator: Literal["ls", "lmeds"] = "ls") -> Estimate: ...
def velocity(phi: npt.ArrayLike, p: npt.ArrayLike) -> _F64: ...
