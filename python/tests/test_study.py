"""Studies in Python: the draws are the study's own, settings are checked, Ctrl-C is heard."""

import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest

import egomotion as em

SETTINGS: dict[str, Any] = {"sequence": "C", "draws": 6, "measuring": {"features": 300}}


def test_a_method_on_the_draws_has_the_figures_of_the_study() -> None:
    """Rigid alignment of the triangulated points, the study's `rigid` by least squares, done here by hand."""
    errors = []
    for draw in em.study_draws("discrete", **SETTINGS):
        assert isinstance(draw.binocular_flow, em.StereoTracks)
        before, after = draw.rig.point(draw.binocular_flow.before), draw.rig.point(draw.binocular_flow.after)
        there = (before[:, 2] > 0) & (after[:, 2] > 0)
        rotation, translation = em.align(before[there], after[there])
        found = em.seen_from(em.log(rotation, translation), draw.cyclopean_centre)
        truth = em.seen_from(draw.phi, draw.cyclopean_centre)
        errors.append(np.abs(found - truth)[:3] / np.abs(truth[:3]))
    table = em.Study("table", **SETTINGS).tables()["table"]
    rows = [dict(zip(table, values)) for values in zip(*table.values())]
    for i, quantity in enumerate(("tx", "ty", "tz")):
        who = {"approach": "discrete", "method": "rigid", "estimator": "ls", "quantity": quantity}
        [row] = [row for row in rows if who.items() <= row.items()]
        assert row["n"] == len(errors) == 6
        assert np.mean(errors, axis=0)[i] * 100 == pytest.approx(row["erm_abs"], rel=1e-6)


def test_a_draw_holds_truth_and_measurements() -> None:
    draws = em.study_draws("differential", **{**SETTINGS, "draws": 1})
    assert len(draws) == 1
    [draw] = draws
    assert isinstance(draw.binocular_flow, em.StereoFlows) and isinstance(draw.dcce, em.DepthFlows)
    n = len(draw)
    assert draw.binocular_flow.measured.shape == (n, 4) and draw.binocular_flow.measured_cov.shape == (n, 4, 4)
    assert draw.dcce.xy.shape == draw.dcce.flow.shape == (n, 2) and draw.exact_tracks is None
    assert np.array_equal(draw.dcce.disparity[:, 0], draw.binocular_flow.measured[:, 0])
    # Both cameras' v_y together are surer than one.
    assert isinstance(draw.maximum_likelihood, em.StereoFlows)
    assert np.allclose(draw.maximum_likelihood.measured_cov[:, 2, 2], 0.5 * draw.binocular_flow.measured_cov[:, 2, 2])
    [draw] = em.study_draws("discrete", **{**SETTINGS, "draws": 1})
    assert isinstance(draw.binocular_flow, em.StereoTracks) and isinstance(draw.dcce, em.DepthTracks)
    assert draw.exact_tracks is not None and len(draw) == 300
    z_before, z_after = (draw.rig.point(at)[:, 2] for at in (draw.exact_tracks.before, draw.exact_tracks.after))
    assert np.allclose(z_after - z_before, draw.depth_velocity, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("table", {"measuring": {"std_disp_px": -1.0}}, "std_disp_px is -1.0; give 0 to 1000"),
        ("table", {"measuring": {"round": 0}}, "round is 0"),
        ("table", {"draws": 0}, "draws is 0"),
        ("table", {"sequence": "Z"}, "sequence is Z; give one of A, B, C"),
        ("sensitivity", {"sequences": ["A", "?"]}, "sequence is ?"),
        ("uncertainty", {"size_px": [2, 2]}, "width in pixels is 2"),
        ("consistency", {"height_px": 10**9}, "height in pixels is 1000000000"),
        ("real", {"seeds": 0}, "seeds is 0"),
        ("efficiency", {"draws": -1}, "invalid value"),
        ("table", {"draughts": 1}, "unknown field `draughts`"),
    ],
)
def test_settings_without_a_meaning_are_named(name: str, settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError) as refused:
        em.Study(name, **settings)
    assert words in str(refused.value)


def test_draws_are_of_a_known_approach() -> None:
    with pytest.raises(ValueError, match="no approach 'both'|no approach \"both\""):
        em.study_draws("both")  # type: ignore[arg-type]


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_ctrl_c_is_heard_within_a_part() -> None:
    code = (
        "import egomotion as em\n"
        "study = em.Study('uncertainty', draws=100_000_000)\n"
        "print('begun', flush=True)\n"
        "try:\n    study.run(0)\n"
        "except KeyboardInterrupt:\n    print('heard', flush=True)\n"
    )
    python = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert python.stdout is not None and python.stdout.readline() == "begun\n"
    time.sleep(0.5)
    sent = time.monotonic()
    python.send_signal(signal.SIGINT)
    words, _ = python.communicate(timeout=60)
    assert words == "heard\n" and python.returncode == 0
    # Far less than the part takes; a loaded machine is slow to answer.
    assert time.monotonic() - sent < 10
