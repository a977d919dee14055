"""Arrays of other packages: what has the array interface, the buffer protocol or DLPack goes in as it is."""

import array
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import egomotion as em

RIG = em.StereoRig(100.0, (15.5, 11.5), 0.1, (32, 24))
GREY = np.random.default_rng(1).integers(0, 256, (24, 32)).astype(np.float32)
POINTS = np.random.default_rng(2).uniform(1, 2, (20, 3))


class Dlpack:
    """A tensor that has DLPack and nothing else."""

    def __init__(self, values: Any) -> None:
        self.values = np.ascontiguousarray(values)

    def __dlpack__(self, **choices: Any) -> Any:
        return self.values.__dlpack__(**choices)

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.values.__dlpack_device__()


class Buffer:
    """The array interface of NumPy and nothing else."""

    def __init__(self, values: Any) -> None:
        self.values = np.ascontiguousarray(values)
        self.__array_interface__ = self.values.__array_interface__


def torch_tensor(values: Any) -> Any:
    return pytest.importorskip("torch").from_numpy(np.ascontiguousarray(values))


def flat(values: Any) -> memoryview:
    """An `array.array`, which has one dimension, in the shape of the values."""
    plain = array.array(values.dtype.char, values.ravel().tolist())
    return memoryview(plain).cast("B").cast(values.dtype.char, values.shape)


KINDS = [Dlpack, Buffer, torch_tensor, memoryview, flat]


@pytest.mark.parametrize("kind", KINDS)
def test_images_and_maps(kind: Callable[[Any], Any]) -> None:
    for plain, found in zip(em.disparity(GREY, GREY), em.disparity(kind(GREY), kind(GREY))):
        np.testing.assert_array_equal(plain, found)
    world = em.Sequence("C", size_px=(160, 120), frames=2)

    def pushed(take: Callable[[Any], Any]) -> em.FrameMotion:
        motion = em.StereoMotion(world.rig)
        for k in range(2):
            (left, _), disparity = world.render(k), world.truth(k)["disparity"]
            sigma = np.full_like(disparity, 0.1)
            m = motion.push(take(left), None, 0.1 * k, disparity=take(disparity), disparity_sigma=take(sigma))
        return m

    answer, same = pushed(np.asarray), pushed(kind)
    assert answer.status == same.status == "ok"
    assert answer.phi.tobytes() == same.phi.tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_numbers(kind: Callable[[Any], Any]) -> None:
    np.testing.assert_array_equal(RIG.project(kind(POINTS)), RIG.project(POINTS))
    plain, found = em.align_phi(POINTS, 1.01 * POINTS), em.align_phi(kind(POINTS), kind(1.01 * POINTS))
    assert plain.theta.tobytes() == found.theta.tobytes()
    rows = em.Rows(kind(POINTS), kind(POINTS.sum(axis=1)))
    np.testing.assert_allclose(em.least_squares(rows).theta, [1, 1, 1])


def test_torch_tensors_that_are_not_contiguous() -> None:
    torch = pytest.importorskip("torch")
    tensor = torch.from_numpy(GREY.T.copy()).T
    assert not tensor.is_contiguous()
    for plain, found in zip(em.disparity(GREY, GREY), em.disparity(tensor, tensor)):
        np.testing.assert_array_equal(plain, found)


def test_what_is_no_array_is_refused() -> None:
    class Nothing:
        pass

    for wrong in (Nothing(), None, "image", {1, 2}):
        with pytest.raises(TypeError, match="left"):
            em.disparity(wrong, GREY)  # type: ignore[arg-type]


def test_a_tensor_elsewhere_is_refused_in_its_own_words() -> None:
    class Elsewhere(Dlpack):
        def __dlpack__(self, **choices: Any) -> Any:
            raise BufferError("the tensor is on another device")

    with pytest.raises(BufferError, match="on another device"):
        em.disparity(Elsewhere(GREY), GREY)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [np.asarray, np.asfortranarray, *KINDS])
def test_nothing_is_copied_on_the_way(kind: Callable[[Any], Any]) -> None:
    """NumPy tells `tracemalloc` of all that it allocates; what must be put in order (Fortran's is not) shows that it does."""
    image, points = kind(np.ones((512, 512), np.float32)), kind(np.random.default_rng(4).uniform(1, 2, (50_000, 3)))
    small = np.zeros((3, 3), np.float32)
    calls: list[tuple[int, Callable[[], object]]] = [
        (512 * 512 * 4, lambda: em.disparity(image, small)),
        (512 * 512 * 4, lambda: em.flow(image, small)),
        (50_000 * 3 * 8, lambda: em.align(points, points)),
    ]
    for size, call in calls:
        tracemalloc.start()
        try:
            call()
        except ValueError:
            pass  # Images of two sizes, which is found out when both have been taken.
        finally:
            _, most = tracemalloc.get_traced_memory()
            tracemalloc.stop()
        assert (most >= size) if kind is np.asfortranarray else (most < size / 10)
