"""Arrays of every kind: what fits is taken, what does not is refused in words, and nothing crashes."""

from collections.abc import Callable
from typing import Any

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import egomotion as em

RIG = em.StereoRig(100.0, (15.5, 11.5), 0.1, (32, 24))
REFUSALS = (TypeError, ValueError, em.Unsolvable)


def texture(height: int = 24, width: int = 32) -> Any:
    return np.random.default_rng(1).integers(0, 256, (height, width)).astype(np.uint8)


def test_types_and_strides_do_not_matter() -> None:
    grey = texture()
    plain = em.disparity(grey, grey)
    framed = np.zeros((26, 34), np.uint8)
    framed[1:-1, 1:-1] = grey
    read_only = grey.copy()
    read_only.flags.writeable = False
    unaligned = np.frombuffer(b"\0" + grey.astype(np.float32).tobytes(), np.float32, offset=1).reshape(24, 32)
    assert not unaligned.flags.aligned
    kinds: list[Any] = [
        grey.astype(np.uint16) * 257,
        grey.astype(np.float32),
        np.asfortranarray(grey),
        grey[::-1, ::-1].copy()[::-1, ::-1],
        framed[1:-1, 1:-1],
        np.repeat(grey, 2, axis=1)[:, ::2],
        read_only,
        unaligned,
        memoryview(grey),
    ]
    for kind in kinds:
        found = em.disparity(kind, kind)
        for a, b in zip(plain, found):
            np.testing.assert_array_equal(a, b)


def test_colours_become_grey_as_in_files() -> None:
    colour = np.random.default_rng(2).integers(0, 256, (24, 32, 3)).astype(np.uint8)
    luma = colour.astype(np.float32) @ np.array([0.299, 0.587, 0.114], np.float32)
    a, b = em.flow(colour, colour[:, ::-1]), em.flow(luma, luma[:, ::-1])
    np.testing.assert_allclose(a[0], b[0], atol=1e-3)
    alpha = np.concatenate([colour, colour[..., :1]], axis=2)
    for with_alpha, without in zip(em.disparity(alpha, alpha), em.disparity(colour, colour)):
        np.testing.assert_array_equal(with_alpha, without)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: em.disparity(np.zeros((4, 4), complex), texture()), TypeError, "left has dtype complex128"),
        (lambda: em.disparity(texture(), np.zeros(4, np.uint8)), ValueError, r"right has shape \[4\]"),
        (lambda: em.disparity(texture(), texture(24, 31)), ValueError, "rectified pair has one size"),
        (lambda: em.disparity(np.zeros((0, 4), np.uint8), texture()), ValueError, "not empty"),
        (lambda: em.disparity(texture(), texture(), levels=0.5), ValueError, "expected usize"),
        (lambda: em.disparity(texture(), texture(), level=5), ValueError, "unknown field `level`"),
        (lambda: em.disparity("image.png", texture()), TypeError, "left has dtype <U9"),
        (lambda: em.exp(np.zeros(5)), ValueError, r"phi has shape \[5\]; give \(6,\)"),
        (lambda: em.exp(["a"] * 6), TypeError, "phi has dtype"),
        (lambda: em.log(2 * np.eye(3), np.zeros(3)), ValueError, "no rotation matrix"),
        (lambda: em.Rows(np.zeros((4, 7)), np.zeros(4)), ValueError, "k from 1 to 6"),
        (lambda: em.Rows(np.zeros((4, 3)), np.zeros(5)), ValueError, "b has 5 rows; give 4"),
        (lambda: em.Rows(np.zeros((4, 3)), np.zeros(4), np.zeros(4)), ValueError, "sigma must be positive"),
        (lambda: em.Rows(np.zeros((4, 3)), np.zeros(4), None, [9, 9, 9, 9]), ValueError, "block"),
        (lambda: em.least_squares(em.Rows(np.zeros((2, 3)), np.zeros(2))), em.Unsolvable, "2 equations for 3"),
        (lambda: em.least_squares(em.Rows(np.full((9, 3), np.nan), np.zeros(9))), em.Unsolvable, "finite"),
        (lambda: em.StereoRig(-1.0, (0, 0), 0.1, (32, 24)), ValueError, "focal length -1 px is not positive"),
        (lambda: em.StereoRig(1.0, (0, 0), 0.1, (-32, 24)), OverflowError, "negative"),
        (lambda: em.StereoMotion(RIG, method="magic"), ValueError, "unknown variant `magic`"),
        (lambda: em.StereoMotion(RIG, method="dcce", observe="sparse"), ValueError, "gradient of disparity"),
        (lambda: em.StereoMotion(RIG, mask=np.zeros((3, 3), bool)), ValueError, "mask is"),
        (lambda: em.StereoMotion(RIG, threads=0), ValueError, "threads is 0"),
        (lambda: em.StereoMotion(RIG).push(texture(), None, 0.0), ValueError, "right image, or a disparity"),
        (lambda: em.RgbdMotion(100.0, (1, 1), (32, 24), noise="some"), ValueError, "noise"),  # type: ignore[arg-type]
        (lambda: em.Sequence("Z"), ValueError, "no sequence"),
        (lambda: em.Sequence("C").render(99), IndexError, "so many frames"),
        (lambda: em.Study("weather"), ValueError, "no study"),
        (lambda: em.Study("table").run(7), IndexError, "part 7"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(
    call: Callable[[], object], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        call()


def test_an_image_that_cannot_be_used_is_an_answer() -> None:
    motion = em.StereoMotion(RIG)
    assert motion.push(texture(), texture(), 0.0).status == "first"
    for left, reason in [
        (np.zeros((24, 32), np.uint8), "constant"),
        (np.full((24, 32), np.nan, np.float32), "not numbers"),
        (texture(24, 30), "30x24"),
    ]:
        answer = motion.push(left, texture(), 0.1)
        assert answer.status == "bad_image" and answer.reason is not None and reason in answer.reason
        assert np.isnan(answer.phi).all() and answer.motion is None and answer.depth_velocity is None
    assert motion.push(texture(), texture(), -1.0).status == "bad_time"


ANY_DTYPE = st.one_of(
    hnp.boolean_dtypes(),
    hnp.integer_dtypes(),
    hnp.unsigned_integer_dtypes(),
    hnp.floating_dtypes(),
    hnp.complex_number_dtypes(),
    hnp.unicode_string_dtypes(),
    hnp.datetime64_dtypes(),
    st.just(np.dtype(object)),
)


@st.composite
def any_array(draw: st.DrawFn) -> Any:
    dtype = draw(ANY_DTYPE)
    shape = draw(hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=12))
    array = np.zeros(shape, dtype) if dtype == object else draw(hnp.arrays(dtype, shape))
    if draw(st.booleans()) and array.ndim > 0:
        array = array[:: draw(st.sampled_from([-2, -1, 2]))]
    if draw(st.booleans()):
        array = array.T
    if draw(st.booleans()):
        array.flags.writeable = False
    return array


CALLS: list[Callable[[Any, Any], object]] = [
    lambda a, b: em.disparity(a, b),
    lambda a, b: em.flow(a, b),
    lambda a, b: em.track((a, b), (b, a), RIG),
    lambda a, b: em.StereoMotion(RIG).push(a, b, 0.0),
    lambda a, b: em.StereoMotion(RIG).push(a, None, 0.0, disparity=b),
    lambda a, b: em.StereoMotion(RIG, mask=a),
    lambda a, b: em.RgbdMotion(100.0, (15.5, 11.5), (32, 24)).push(a, b, 0.0),
    lambda a, b: em.exp(a),
    lambda a, b: em.log(a, b),
    lambda a, b: em.velocity(a, b),
    lambda a, b: RIG.point(a),
    lambda a, b: RIG.depth(a),
    lambda a, b: em.least_squares(em.Rows(a, b)),
    lambda a, b: em.lmeds(em.Rows(a, b)),
    lambda a, b: em.irls(em.Rows(a, b)),
    lambda a, b: em.align_phi(a, b),
    lambda a, b: em.align(a, b, form="affine"),
    lambda a, b: em.maximum_likelihood(em.StereoTracks(a, a, b, b), RIG),
    lambda a, b: em.cramer_rao_bound(em.StereoTracks(a, a, b, b), RIG, np.zeros(6)),
    lambda a, b: em.StereoFlows(a, b, np.ones(4)).depth_velocity(RIG),
    lambda a, b: em.errors_in_variables(em.DepthChanges(a, b, a, np.ones(4), np.ones(2)), RIG),
    lambda a, b: em.exact_depth_change(a, b, a, RIG),
]


@settings(max_examples=1000, deadline=None, suppress_health_check=list(HealthCheck))
@given(call=st.sampled_from(CALLS), a=any_array(), b=any_array())
def test_any_array_is_answered_or_refused(call: Callable[[Any, Any], object], a: Any, b: Any) -> None:
    try:
        call(a, b)
    except REFUSALS as error:
        assert str(error)


@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    call=st.sampled_from(CALLS[12:]),
    n=st.integers(0, 20),
    columns=st.sampled_from([1, 2, 3, 4, 6]),
    rest=st.sampled_from([(), (1,), (3,), (4,)]),
    data=st.data(),
)
def test_any_numbers_are_answered_or_refused(
    call: Callable[[Any, Any], object], n: int, columns: int, rest: tuple[int, ...], data: st.DataObject
) -> None:
    """Shapes that nearly fit, with any numbers."""
    a = data.draw(hnp.arrays(np.float64, (n, columns)))
    b = data.draw(hnp.arrays(np.float64, (n, *rest)))
    try:
        call(a, b)
    except REFUSALS as error:
        assert str(error)
