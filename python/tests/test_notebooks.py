"""The notebooks run, and what they find is right; what is committed of them is fit to be read."""

import ast
import os
import re
from pathlib import Path
from typing import Any

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
pytest.importorskip("matplotlib")

NOTEBOOKS = sorted((Path(__file__).resolve().parents[1] / "notebooks").glob("*.ipynb"))


def facts(name: str, folder: Path) -> dict[str, Any]:
    """The value of the last cell, when the notebook runs in a folder of its own."""
    [path] = [path for path in NOTEBOOKS if path.stem == name]
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(folder)}}).execute()
    assert os.listdir(folder) == []
    found = ast.literal_eval(notebook.cells[-1].outputs[-1].data["text/plain"])
    assert isinstance(found, dict)
    return found


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("EGOMOTION_RECORDING", raising=False)
    monkeypatch.setenv("EGOMOTION_FRAMES", "4")
    monkeypatch.setenv("EGOMOTION_DRAWS", "8")


def test_motion(tmp_path: Path) -> None:
    found = facts("motion", tmp_path)
    assert (found["answered"], found["frames"]) == (3, 4)
    assert found["rms_mm"] < 0.2 and found["rms_deg"] < 0.004
    assert found["within_4_sigma"] == 1 and 0.2 < found["nees_over_6"] < 3


def test_motion_of_a_recording_of_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import egomotion as em

    recording, folder = tmp_path / "recording", tmp_path / "empty"
    folder.mkdir()
    em.simulate("drive", recording, frames=6, size_px=(160, 120))
    # A recording whose motion nobody knows.
    (recording / "poses.txt").unlink()
    monkeypatch.setenv("EGOMOTION_RECORDING", str(recording))
    assert facts("motion", folder) == {"answered": 3, "frames": 4}


def test_own_disparity(tmp_path: Path) -> None:
    found = facts("own_disparity", tmp_path)
    assert found["pixels_within_2_sigma"] > 0.9
    assert found["ml_within_3_sigma"] > 0.9
    assert found["ml_mm"] < 0.5 < found["others_least_mm"] / 4
    # Less noise in the disparity, less error of the motion.
    assert found["ml_mm_exact_disparity"] < found["ml_mm"]


def test_own_method(tmp_path: Path) -> None:
    found = facts("own_method", tmp_path)
    assert found["study_differs_by"] < 1e-6
    methods = ("your own", "alignment", "maximum likelihood")
    # No method gets below the bound by more than chance.
    assert all(found[name]["lowest"] > -4 for name in methods)
    assert found["maximum likelihood"]["ratio"] < 1.25 and found["maximum likelihood"]["most"] < 1.6
    assert 2 < found["your own"]["most"] < found["alignment"]["most"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_is_committed(path: Path) -> None:
    """Outputs of one whole run, without an error, a path of a machine, or more bytes than they are worth."""
    assert path.stat().st_size < 600_000
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    outputs = [output for cell in code for output in cell.outputs]
    assert all(output.output_type in ("stream", "display_data", "execute_result") for output in outputs)
    assert all(output.name == "stdout" for output in outputs if output.output_type == "stream")
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= 1
    # Pictures are base64, which holds slashes.
    words = [output.get("text") or output.data.get("text/plain", "") for output in outputs]
    words += [cell.source for cell in notebook.cells]
    assert not any(re.search(r"(?<![\w.°:/])/\w+/|[A-Z]:\\", text) for text in words)


def test_all_are_here() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["motion", "own_disparity", "own_method"]
