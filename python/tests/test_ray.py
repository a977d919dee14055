"""A cluster of two nodes on this machine: the same numbers as one process, and nothing lost when a worker dies."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import egomotion as em
from egomotion import tables

ray = pytest.importorskip("ray")
pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    from ray.cluster_utils import Cluster

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    nodes.add_node(num_cpus=1)
    ray.init(address=nodes.address, log_to_driver=False)
    yield nodes
    ray.shutdown()  # type: ignore[no-untyped-call, unused-ignore]
    nodes.shutdown()  # type: ignore[no-untyped-call, unused-ignore]


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("recordings")
    for name in ("A", "C", "drive"):
        em.simulate(name, folder / name, frames=6, size=(160, 120))
    (folder / "empty").mkdir()
    return sorted(folder.iterdir())


def alone(path: Path) -> list[dict[str, Any]]:
    return [tables.row(answer) for answer in em.run(path, observe="sparse")][1:]


def rows_of(table: Any, source: Path) -> list[dict[str, Any]]:
    found = [row for row in table.to_pylist() if row["source"] == str(source)]
    return [{name: row[name] for name in tables.COLUMNS} for row in found]


def test_recordings_give_the_numbers_of_one_process(cluster: Any, recordings: list[Path], tmp_path: Path) -> None:
    import egomotion.ray

    assert len([node for node in ray.nodes() if node["Alive"]]) == 2
    table = egomotion.ray.run(recordings, tmp_path, observe="sparse", progress=False)
    for path in recordings:
        if path.name == "empty":
            [row] = [row for row in table.to_pylist() if row["source"] == str(path)]
            assert row["status"] == "unreadable" and "empty" in row["reason"]
        else:
            assert rows_of(table, path) == alone(path)
    with pytest.raises(ValueError, match="other settings"):
        egomotion.ray.run(recordings, tmp_path, observe="dense", progress=False)
    # What is finished is not done again: the parts are older than the second table.
    before = {part.name: part.stat().st_mtime_ns for part in (tmp_path / "parts").iterdir()}
    assert egomotion.ray.run(recordings, tmp_path, observe="sparse", progress=False) == table
    assert {part.name: part.stat().st_mtime_ns for part in (tmp_path / "parts").iterdir()} == before


def test_chunks_are_joined_again(cluster: Any, recordings: list[Path], tmp_path: Path) -> None:
    import egomotion.ray

    path = next(path for path in recordings if path.name == "drive")
    table = egomotion.ray.run([path], tmp_path, chunk=2, overlap=1, observe="sparse", progress=False)
    joined, whole = rows_of(table, path), alone(path)
    assert len(list((tmp_path / "parts").iterdir())) == 3
    assert [row["frame"] for row in joined] == [row["frame"] for row in whole]
    for a, b in zip(joined, whole):
        for i, name in enumerate(("tx", "ty", "tz", "wx", "wy", "wz")):
            assert abs(a[name] - b[name]) < 3 * b[f"cov_{i}{i}"] ** 0.5


def test_a_study_gives_the_numbers_of_one_process_though_a_worker_dies(cluster: Any, tmp_path: Path) -> None:
    import egomotion.ray

    settings = {"sequence": "C", "draws": 40, "measuring": {"features": 256}}
    killed: list[int] = []

    def kill() -> None:
        """End the first worker that has begun."""
        from ray.util.state import list_workers

        while not killed:
            workers = list_workers(filters=[("worker_type", "=", "WORKER"), ("is_alive", "=", True)])
            for worker in workers:
                if worker["pid"] > 0 and not killed:
                    os.kill(worker["pid"], signal.SIGKILL)
                    killed.append(worker["pid"])
            time.sleep(0.05)

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    found = egomotion.ray.study("table", tmp_path, progress=False, **settings)
    thread.join(timeout=30)
    assert killed
    whole = em.Study("table", **settings).tables()
    assert {name: table.to_pydict() for name, table in found.items()} == whole
    assert (tmp_path / "table.parquet").is_file()
