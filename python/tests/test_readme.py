"""The README's Python runs on a recording of PNG files, as a new user would make it."""

import re
from pathlib import Path

import egomotion as em
import pytest

README = Path(__file__).resolve().parents[2] / "README.md"


def test_the_program_of_the_readme(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = README.read_text(encoding="utf-8")
    [program] = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    [rig] = [block for block in re.findall(r"```toml\n(.*?)```", text, re.DOTALL) if "baseline_m" in block]
    recording = tmp_path / "my-recording"
    em.simulate("demo", tmp_path / "rendered", frames=3)
    recording.mkdir()
    (tmp_path / "rendered" / "image_0").rename(recording / "left")
    (tmp_path / "rendered" / "image_1").rename(recording / "right")
    (recording / "rig.toml").write_text(rig)
    monkeypatch.chdir(tmp_path)
    exec(compile(program, str(README), "exec"), {})
    statuses = [line.split()[1] for line in capsys.readouterr().out.splitlines() if line[0].isdigit()]
    assert statuses == ["first", "ok", "ok"] or statuses == ["ok", "ok"]
