"""Many recordings, long ones in chunks, and every study, spread over a Ray cluster.

    import egomotion.ray
    egomotion.ray.run(["recordings/06", "s3://bucket/07"], "out")
    egomotion.ray.study("table", "out-table", sequence="C", draws=400)

or ``python -m egomotion.ray run recordings/06 recordings/07 --out out``. Sources and results are paths or URLs that
fsspec knows. Each task leaves a file of its own in ``out/parts``, which appears whole or not at all: what is finished is
not done again, and a task whose worker dies is tried again. The numbers are those of one machine: a study's to the
last bit, and a recording's too unless it is cut into chunks, whose first frames know less of the past.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fsspec
import pyarrow as pa
import pyarrow.parquet as pq
import ray
from fsspec.implementations.local import LocalFileSystem

import egomotion
from egomotion import tables

#: A worker that dies is replaced this often for each task.
RETRIES = 5
#: Frames before a chunk whose answers are not kept: the pipeline finds its corners and its velocity again.
OVERLAP = 10


@dataclass(frozen=True)
class Chunk:
    """Frames of one sequence that one task works on."""

    source: str
    sequence: str | None
    #: The first frame that is read, and the first whose answer is kept.
    start: int
    keep: int
    #: Frames to read; None is all.
    frames: int | None

    @property
    def name(self) -> str:
        """A file name that tells chunks apart."""
        path = hashlib.sha256(f"{self.source}\0{self.sequence}".encode()).hexdigest()[:12]
        return f"{path}-{self.keep:09d}"


@dataclass(frozen=True)
class Results:
    """The folder that results go to, by path or URL."""

    url: str

    def write(self, name: str, content: Callable[[Any], None]) -> None:
        """Write a file that appears whole or not at all."""
        files, root = fsspec.core.url_to_fs(self.url)
        place = f"{root}/{name}"
        files.makedirs(place.rsplit("/", 1)[0], exist_ok=True)
        with files.transaction, files.open(place, "wb") as file:
            content(file)

    def read(self, name: str) -> bytes | None:
        """The content of a file; None if it is not there."""
        files, root = fsspec.core.url_to_fs(self.url)
        try:
            return bytes(files.cat_file(f"{root}/{name}"))
        except FileNotFoundError:
            return None

    def begin(self, settings: dict[str, Any]) -> None:
        """Note what these results are of; refuse to mix them with others."""
        text = json.dumps(settings, sort_keys=True, indent=1).encode()
        known = self.read("settings.json")
        if known is None:
            self.write("settings.json", lambda file: file.write(text))
        elif known != text:
            raise ValueError(f"{self.url}: holds results of other settings; choose another folder")


def run(
    sources: Sequence[str | Path],
    out: str | Path,
    *,
    chunk: int | None = None,
    overlap: int = OVERLAP,
    progress: bool = True,
    **options: Any,
) -> pa.Table:
    """Run recordings; `options` are those of `egomotion.run`.

    The table, also in ``out/motion.parquet``, has the columns of ``motion.csv`` behind `source`, `sequence` and `reason`,
    one row a frame. A recording that cannot be read is one row with the status "unreadable". With `chunk` frames a task,
    long recordings are cut, each chunk with `overlap` frames before it that are read and not kept.
    """
    if chunk is not None and chunk < 2:
        raise ValueError("chunk must be at least 2 frames")
    results = Results(str(out))
    results.begin({"run": options, "chunk": chunk, "overlap": overlap, "version": egomotion.__version__})
    work = ray.remote(max_retries=RETRIES)(_chunks)
    cut = _gather([work.remote(str(source), chunk, overlap) for source in sources], "recordings", progress)
    chunks = [piece for pieces in cut for piece in pieces]
    task = ray.remote(max_retries=RETRIES)(_run_chunk)
    _gather([task.remote(piece, results, options) for piece in chunks], "chunks", progress)
    parts = [results.read(f"parts/{piece.name}.parquet") for piece in chunks]
    table = pa.concat_tables([pq.read_table(pa.BufferReader(part)) for part in parts if part is not None])
    results.write("motion.parquet", lambda file: pq.write_table(table, file))
    return table


def study(name: str, out: str | Path, *, progress: bool = True, **settings: Any) -> dict[str, pa.Table]:
    """Run every part of a study; the tables, also in ``out/NAME.parquet``, are those of `egomotion.Study(name).tables()`."""
    whole = egomotion.Study(name, **settings)
    results = Results(str(out))
    results.begin({"study": name, "settings": whole.settings, "version": egomotion.__version__})
    task = ray.remote(max_retries=RETRIES)(_run_part)
    parts = [task.remote(name, whole.settings, part, results) for part in range(len(whole.parts))]
    records = [record for part in _gather(parts, "parts", progress) for record in part]
    found = {title: pa.table(columns) for title, columns in whole.publish(records).items()}
    for title, table in found.items():
        results.write(f"{title}.parquet", _parquet(table))
    return found


def _parquet(table: pa.Table) -> Callable[[Any], None]:
    return lambda file: pq.write_table(table, file)


def _gather(tasks: list[Any], what: str, progress: bool) -> list[Any]:
    """The results of all tasks, in their order."""
    waiting, done = list(tasks), 0
    while waiting:
        ready, waiting = ray.wait(waiting, num_returns=1, timeout=10.0)
        done += len(ready)
        if progress and ready:
            end = "\n" if not waiting else "\r" if sys.stderr.isatty() else "\n"
            print(f"{done} of {len(tasks)} {what}", end=end, file=sys.stderr, flush=True)
    return list(ray.get(tasks))


def _local(source: str, folder: str) -> str:
    """The recording on this machine's disk."""
    files, path = fsspec.core.url_to_fs(source)
    if isinstance(files, LocalFileSystem):
        return str(path)
    place = str(Path(folder) / "recording")
    files.get(path, place, recursive=True)
    return place


def _chunks(source: str, chunk: int | None, overlap: int) -> list[Chunk]:
    """The tasks of a recording; one that cannot be read is left to its task, which says why."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            path = _local(source, folder)
            sequences = egomotion.sequences(path)
            if chunk is None or len(sequences) > 1:
                return [Chunk(source, name, 0, 0, None) for name in sequences]
            frames = len(egomotion.run(path))
        except Exception:
            return [Chunk(source, None, 0, 0, None)]
    return list(_cut(source, sequences[0], frames, chunk, overlap))


def _cut(source: str, sequence: str, frames: int, chunk: int, overlap: int) -> Iterator[Chunk]:
    """Each chunk begins with the last frame of the one before, so that no motion is lost."""
    for keep in range(0, max(frames - 1, 1), chunk):
        start = max(keep - overlap, 0)
        yield Chunk(source, sequence, start, keep, min(keep + chunk + 1, frames) - start)


def _run_chunk(chunk: Chunk, results: Results, options: dict[str, Any]) -> None:
    """Run one chunk, unless that was done before, and leave its rows."""
    name = f"parts/{chunk.name}.parquet"
    if results.read(name) is not None:
        return
    with tempfile.TemporaryDirectory() as folder:
        reason = None
        answers = []
        try:
            path = _local(chunk.source, folder)
            run = egomotion.run(
                path, sequence=chunk.sequence, start=chunk.start, frames=chunk.frames, **options
            )
            for k, answer in enumerate(run):
                # Maps are not kept: a row is all that is left of an answer.
                if k + chunk.start > chunk.keep:
                    answers.append({**tables.row(answer), "reason": answer.reason})
        except (egomotion.ReadError, ValueError, OSError) as error:
            reason = str(error)
    if reason is not None:
        answers = [{**dict.fromkeys(tables.COLUMNS), "status": "unreadable", "reason": reason}]
    head = {"source": chunk.source, "sequence": chunk.sequence}
    table = pa.Table.from_pylist([{**head, **row} for row in answers], schema=_schema())
    results.write(name, _parquet(table))


def _schema() -> pa.Schema:
    words = [pa.field(name, pa.string()) for name in ("source", "sequence", "reason")]
    return pa.schema(words + list(tables.arrow_schema()))


def _run_part(name: str, settings: dict[str, Any], part: int, results: Results) -> list[str]:
    """The records of one part of a study, from its file if it was done before."""
    place = f"parts/{part:06d}.json"
    known = results.read(place)
    if known is not None:
        return list(json.loads(known))
    records = egomotion.Study(name, **settings).run(part)
    results.write(place, lambda file: file.write(json.dumps(records).encode()))
    return records


def main(arguments: Sequence[str] | None = None) -> None:
    """The command ``python -m egomotion.ray``."""
    parser = argparse.ArgumentParser(prog="python -m egomotion.ray", description=__doc__.split("\n")[0])
    parser.add_argument("--address", help="of the cluster; by default RAY_ADDRESS, or this machine alone")
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("run", help="run recordings")
    one.add_argument("sources", nargs="+")
    one.add_argument("--out", required=True)
    one.add_argument("--chunk", type=int, help="frames a task, for long recordings")
    one.add_argument("--options", type=json.loads, default={}, metavar="JSON", help="of egomotion.run")
    one.set_defaults(work=lambda a: run(a.sources, a.out, chunk=a.chunk, **a.options))
    two = commands.add_parser("study", help="run a study")
    two.add_argument("name", choices=egomotion.Study.names())
    two.add_argument("--out", required=True)
    two.add_argument("--settings", type=json.loads, default={}, metavar="JSON", help="of the study")
    two.set_defaults(work=lambda a: study(a.name, a.out, **a.settings))
    asked = parser.parse_args(arguments)
    ray.init(address=asked.address, log_to_driver=False)
    asked.work(asked)


if __name__ == "__main__":
    main()
