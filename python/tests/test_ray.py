"""Two nodes on this machine: the numbers of one process, and nothing lost when a worker dies."""

import functools
import http.server
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

import egomotion as em
from conftest import Cluster
from egomotion import tables

ray = pytest.importorskip("ray")
pq = pytest.importorskip("pyarrow.parquet")
fsspec = pytest.importorskip("fsspec")

import egomotion.ray  # noqa: E402
from egomotion.ray import tasks  # noqa: E402
from egomotion.ray.results import Results  # noqa: E402

#: Two parts.
TABLE: dict[str, Any] = {"sequence": "C", "draws": 20, "measuring": {"features": 64}}
#: Fourteen.
EFFICIENCY: dict[str, Any] = {"sequences": ["C"], "draws": 1, "methods": ["dv"]}
#: Names of tasks that leave a part.
PART = re.compile(r"[0-9a-f]{12}-\d{9}|\d{6}")


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of three recordings and one that is none."""
    folder = tmp_path_factory.mktemp("recordings")
    for name, frames in (("A", 6), ("C", 6), ("drive", 30)):
        em.simulate(name, folder / name, frames=frames, size_px=(160, 120))
    (folder / "empty").mkdir()
    return folder


def alone(path: Path, **options: Any) -> list[dict[str, Any]]:
    return [tables.row(answer) for answer in em.run(path, **options)][1:]


def rows_of(out: Path, source: str | Path) -> list[dict[str, Any]]:
    rows = pq.read_table(out / "motion.parquet").to_pylist()
    return [{name: row[name] for name in tables.COLUMNS} for row in rows if row["source"] == str(source)]


def times(out: Path) -> dict[str, int]:
    """When each part was written."""
    return {part.stem: part.stat().st_mtime_ns for part in (out / "parts").glob("[0-9a-f]*")}


@dataclass
class Killed:
    """A task whose worker was killed in the middle of it, and the parts that were there then."""

    task: str = ""
    finished: dict[str, int] = field(default_factory=dict)


@contextmanager
def one_worker_killed(cluster: Cluster, out: Path, after: int = 0) -> Iterator[Killed]:
    """Kill a worker while it works on a part, as soon as so many other parts are finished."""
    killed = Killed()

    def kill() -> None:
        end = time.monotonic() + 60
        hit: set[str] = set()
        while not killed.task and time.monotonic() < end:
            time.sleep(0.005)
            if len(times(out)) >= after:
                for worker, task in cluster.busy().items():
                    if PART.fullmatch(task) and not killed.task:
                        os.kill(worker, signal.SIGKILL)
                        hit.add(task)
                        # It may have left its part and not said so: then it is done again, and another one is killed.
                        finished = {name: moment for name, moment in times(out).items() if name not in hit}
                        if task not in times(out):
                            killed.task, killed.finished = task, finished

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    yield killed
    thread.join(timeout=60)
    # The task was done again; what was finished was not.
    now = times(out)
    assert killed.task in now
    assert {name: now[name] for name in killed.finished} == killed.finished


def test_a_folder_of_recordings_gives_the_numbers_of_one_process_though_a_worker_dies(
    cluster: Cluster, recordings: Path, tmp_path: Path
) -> None:
    assert {node["NodeManagerAddress"] for node in ray.nodes()} == {"127.0.0.2", "127.0.0.3"}
    with one_worker_killed(cluster, tmp_path, after=1):
        done = egomotion.ray.run([recordings], tmp_path, progress=False)
    for name in ("A", "C", "drive"):
        assert rows_of(tmp_path, recordings / name) == alone(recordings / name)
    [row] = rows_of(tmp_path, recordings / "empty")
    assert row["status"] == "unreadable" and row["frame"] is None
    [(source, reason)] = done.unreadable.items()
    assert source == str(recordings / "empty") and "is an empty folder" in reason
    assert (done.recordings, done.rows) == (4, 5 + 5 + 29 + 1)


def test_what_is_finished_is_not_done_again(cluster: Cluster, recordings: Path, tmp_path: Path) -> None:
    sources = [recordings, recordings / "A"]
    done = egomotion.ray.run(sources, tmp_path, observe="sparse", progress=False)
    before, table = times(tmp_path), pq.read_table(tmp_path / "motion.parquet")
    lost = sorted(before)[1]
    (tmp_path / "parts" / f"{lost}.parquet").unlink()
    assert egomotion.ray.run(sources, tmp_path, observe="sparse", progress=False) == done
    after = times(tmp_path)
    assert pq.read_table(tmp_path / "motion.parquet") == table
    assert {name for name in after if after[name] != before[name]} == {lost}
    with pytest.raises(ValueError, match="other settings"):
        egomotion.ray.run([recordings], tmp_path, observe="dense", progress=False)


def test_chunks_are_joined_again(cluster: Cluster, recordings: Path, tmp_path: Path) -> None:
    options: dict[str, Any] = {"observe": "sparse", "stride": 2}
    path = recordings / "drive"
    egomotion.ray.run([path], tmp_path, chunk=6, overlap=2, progress=False, **options)
    joined, whole = rows_of(tmp_path, path), alone(path, **options)
    assert len(times(tmp_path)) == 3
    assert [row["frame"] for row in joined] == [row["frame"] for row in whole]
    # The first chunk knows all that one process knows.
    assert joined[:6] == whole[:6]
    for a, b in zip(joined, whole):
        assert a["observed"] == b["observed"]
        seen = zip(("tx", "ty", "tz", "wx", "wy", "wz"), b["observed"])
        for i, name in [(i, name) for i, (name, there) in enumerate(seen) if there == "1"]:
            assert abs(a[name] - b[name]) < 3 * b[f"cov_{i}{i}"] ** 0.5


def test_recordings_with_one_calibration_for_all(cluster: Cluster, recordings: Path, tmp_path: Path) -> None:
    options: dict[str, Any] = {"observe": "sparse", "calibration": str(recordings / "A" / "calib.txt")}
    shutil.copytree(recordings / "A", tmp_path / "in" / "bare", ignore=shutil.ignore_patterns("calib.txt"))
    for chunk in (None, 5):
        egomotion.ray.run([tmp_path / "in"], tmp_path / str(chunk), chunk=chunk, progress=False, **options)
        assert rows_of(tmp_path / str(chunk), tmp_path / "in" / "bare") == alone(recordings / "A", observe="sparse")


def test_a_study_gives_the_numbers_of_one_process_though_a_worker_dies(cluster: Cluster, tmp_path: Path) -> None:
    with one_worker_killed(cluster, tmp_path):
        found = egomotion.ray.study("table", tmp_path, progress=False, **TABLE)
    whole = em.Study("table", **TABLE)
    assert {name: table.to_pydict() for name, table in found.items()} == whole.tables()
    assert {name: pq.read_table(tmp_path / f"{name}.parquet") for name in found} == found
    assert sorted(times(tmp_path)) == ["000000", "000001"]


def test_a_task_that_kills_every_worker_does_not_end_all(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks, "RETRIES", 1)

    def work(code: int) -> int:
        return os._exit(1) if code else code

    found = tasks.gather(work, [(1,), (0,)], "calls", died=lambda error: type(error).__name__)
    assert found == ["WorkerCrashedError", 0]


class Server(http.server.ThreadingHTTPServer):
    """Takes as many connections at once as a store."""

    request_queue_size = 256


class Files(http.server.SimpleHTTPRequestHandler):
    """A folder by HTTP, and the images that were asked for."""

    asked: list[str] = []

    def log_message(self, format: str, *words: Any) -> None:
        if str(words[0]).startswith("GET") and "/image_" in str(words[0]):
            self.asked.append(str(words[0]).split()[1])


@pytest.fixture
def server(recordings: Path) -> Iterator[str]:
    handler = functools.partial(Files, directory=str(recordings))
    with Server(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_sources_and_results_by_url(cluster: Cluster, recordings: Path, server: str, tmp_path: Path) -> None:
    options: dict[str, Any] = {"observe": "sparse"}
    out = f"file://{tmp_path / 'whole'}"
    egomotion.ray.run([server], out, progress=False, **options)
    for name in ("A", "C", "drive"):
        assert rows_of(tmp_path / "whole", f"{server}/{name}") == alone(recordings / name, **options)
    # Of a long recording each task reads the frames that it needs.
    Files.asked.clear()
    asked: dict[str, Any] = {"chunk": 10, "overlap": 2, "progress": False, **options}
    egomotion.ray.run([f"{server}/drive"], tmp_path / "chunks", **asked)
    assert len(times(tmp_path / "chunks")) == 3
    assert 2 * 30 <= len([name for name in Files.asked if name.endswith(".png")]) < 2 * 2 * 30
    egomotion.ray.run([recordings / "drive"], tmp_path / "here", **asked)
    assert rows_of(tmp_path / "chunks", f"{server}/drive") == rows_of(tmp_path / "here", recordings / "drive")


def test_a_recording_in_an_archive(cluster: Cluster, recordings: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "A.zip", "w") as archive:
        for file in sorted((recordings / "A").rglob("*")):
            archive.write(file, file.relative_to(recordings / "A"))
    source = f"zip://::{tmp_path / 'A.zip'}"
    egomotion.ray.run([source, tmp_path / "gone"], tmp_path / "out", observe="sparse", progress=False)
    assert rows_of(tmp_path / "out", source) == alone(recordings / "A", observe="sparse")
    assert [row["status"] for row in rows_of(tmp_path / "out", tmp_path / "gone")] == ["unreadable"]


@pytest.mark.parametrize("kind", ["local", "memory"])
def test_a_file_appears_whole_or_not_at_all(kind: str, tmp_path: Path) -> None:
    url = str(tmp_path) if kind == "local" else f"memory:/{tmp_path}"
    results = Results(url)
    with results.writing("parts/a") as file:
        file.write(b"whole")
        assert "a" not in results.done()
    with pytest.raises(KeyboardInterrupt), results.writing("parts/b") as file:
        file.write(b"ha")
        raise KeyboardInterrupt
    assert results.done() == {"a"} and list(results.parts(["a"])) == [b"whole"]


def command(*words: str | Path) -> list[str]:
    return [sys.executable, "-m", "egomotion.ray", *map(str, words)]


def ran(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(*words), capture_output=True, text=True, timeout=120)


def test_the_command_runs_recordings(cluster: Cluster, recordings: Path, tmp_path: Path) -> None:
    options = ("--options", '{"observe": "sparse"}')
    done = ran("--address", cluster.address, "run", recordings, *options, "--out", tmp_path)
    assert done.returncode == 0 and done.stdout == ""
    lines = done.stderr.splitlines()
    assert "4 of 4 recordings" in lines
    assert any(line.startswith(f"unreadable: {recordings / 'empty'}: ") for line in lines)
    assert lines[-1] == "40 rows of 4 recordings, 1 unreadable"
    assert rows_of(tmp_path, recordings / "A") == alone(recordings / "A", observe="sparse")
    other = ran("--address", cluster.address, "run", recordings, "--out", tmp_path)
    assert other.returncode == 1
    assert other.stderr.splitlines()[-1].startswith(f"error: {tmp_path}: holds results of other settings")
    wrong = ran("--address", cluster.address, "study", "table", "--settings", '{"sequence": "Q"}', "--out", tmp_path / "Q")
    assert wrong.returncode == 2 and "Traceback" not in wrong.stderr
    assert "error: sequence is Q; give one of A, B, C, " in wrong.stderr.splitlines()[-1]
    # None can be read.
    none = ran("--address", cluster.address, "run", recordings / "empty", "--out", tmp_path / "none")
    assert none.returncode == 1 and "Traceback" not in none.stderr
    assert (tmp_path / "none" / "motion.parquet").is_file()


def test_the_command_goes_on_with_a_study_that_was_interrupted(cluster: Cluster, tmp_path: Path) -> None:
    # Where the tests themselves run in the background the interrupt is ignored, and a child inherits that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    words = ("--address", cluster.address, "study", "efficiency", "--settings", json.dumps(EFFICIENCY), "--out", tmp_path)
    first = subprocess.Popen(command(*words), stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60
    while not (tmp_path / "parts" / "000000.json").is_file():
        assert time.monotonic() < end and first.poll() is None
        time.sleep(0.01)
    first.send_signal(signal.SIGINT)
    said = first.communicate(timeout=60)[1]
    assert first.returncode == 130 and said.splitlines()[-1].startswith("interrupted")
    before = times(tmp_path)
    left = 14 - len(before)
    assert left > 0 and not list(tmp_path.glob("*.parquet"))
    second = ran(*words)
    assert second.returncode == 0 and second.stderr.splitlines()[-1] == f"{left} of {left} parts"
    assert {name: time for name, time in times(tmp_path).items() if name in before} == before
    assert list(tmp_path.glob("*.parquet"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["study", "tabel", "--out", "x"], "invalid choice: 'tabel'"),
        (["run", "x", "--out", "x", "--options", "{observe"], "is no JSON"),
        (["run", "x", "--out", "x", "--options", "[1]"], "is no JSON object"),
        (["run", "x", "--out", "x", "--options", '{"obsere": 1}'], "unknown field `obsere`"),
        (["study", "table", "--out", "x", "--settings", '{"draw": 1}'], "unknown field `draw`"),
        (["run", "x", "--out", "x", "--chunk", "1"], "chunk must be at least 2"),
    ],
)
def test_wrong_usage_is_said_in_a_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    from egomotion.ray.__main__ import main

    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 2 and said in capsys.readouterr().err.splitlines()[-1]


def test_help() -> None:
    for words in (["--help"], ["run", "--help"]):
        done = ran(*words)
        assert done.returncode == 0 and "usage: python -m egomotion.ray" in done.stdout
