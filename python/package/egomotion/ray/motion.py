"""The motion of chunks, and of all of them in one table."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

import egomotion
from egomotion import tables

from .recordings import Chunk, copied
from .results import Results
from .tasks import one_task_of_many

#: Rows of the joined table that are held at a time.
HELD = 100_000


def check(options: dict[str, Any], chunk: int | None, overlap: int) -> None:
    """Refuse options that no task could use."""
    if chunk is not None and chunk < 2:
        raise ValueError("chunk must be at least 2 frames")
    if overlap < 0:
        raise ValueError("overlap must not be negative")
    own = {"sequence"} if chunk is None else {"sequence", "start", "frames", "reverse"}
    if taken := sorted(own & set(options)):
        raise ValueError(f"{', '.join(taken)}: each task has its own")
    try:
        # Settings are looked at before the recording.
        egomotion.run("", **options)
    except egomotion.FileError:
        pass


def leave(chunk: Chunk, results: Results, options: dict[str, Any]) -> str | None:
    """Leave the rows of a chunk as its part; where it cannot be read, say why."""
    one_task_of_many(options.get("threads") or 1)
    try:
        rows = _rows(chunk, options)
    except (egomotion.FileError, ValueError) as error:
        return str(error)
    except Exception as error:
        # Whatever the library of a store may raise: one recording must not end all.
        return f"{type(error).__name__}: {error}"
    with results.writing(f"parts/{chunk.name}.parquet") as file:
        pq.write_table(pa.Table.from_pylist(rows, schema=_schema()), file)
    return None


def _rows(chunk: Chunk, options: dict[str, Any]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    calibration = options.get("calibration")
    # A bad image may be one that was not copied, if the cameras' files do not go side by side.
    for span in dict.fromkeys([chunk.span, None]):
        with tempfile.TemporaryDirectory() as folder:
            path = copied(chunk.source, folder, span)
            names = [chunk.sequence] if chunk.sequence else egomotion.sequences(path, calibration=calibration)
            rows = [row for name in names for row in _sequence(path, name, chunk, options)]
        if all(row["status"] != "bad_image" for row in rows):
            break
    return rows


def _sequence(path: str, name: str, chunk: Chunk, options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    own = {}
    if chunk.frames is not None:
        own = {"start": chunk.start * options.get("stride", 1), "frames": chunk.frames}
    run = egomotion.run(path, sequence=name, **{"threads": 1, **options, **own})
    head = {"source": chunk.source, "sequence": name}
    for k, answer in enumerate(run):
        # Maps are not kept: a row is all that is left of an answer.
        if k + chunk.start > chunk.keep:
            yield {**head, **tables.row(answer), "reason": answer.reason}


def join(chunks: Sequence[Chunk], unreadable: Mapping[Chunk, str], results: Results) -> int:
    """Write the rows of all chunks, in their order, to one table; the number of rows."""
    parts = results.parts([f"{piece.name}.parquet" for piece in chunks if piece not in unreadable])
    held, count = [_schema().empty_table()], 0
    with results.writing("motion.parquet") as file, pq.ParquetWriter(file, _schema()) as writer:
        for piece in chunks:
            reason = unreadable.get(piece)
            held.append(_table(next(parts)) if reason is None else _unread(piece, reason))
            count += len(held[-1])
            # Many small parts make few groups of rows, and all of them never lie in memory.
            if sum(map(len, held)) > HELD:
                writer.write_table(pa.concat_tables(held))
                held.clear()
        if held:
            writer.write_table(pa.concat_tables(held))
    return count


def _table(part: bytes) -> pa.Table:
    return pq.ParquetFile(pa.BufferReader(part)).read()


def _unread(chunk: Chunk, reason: str) -> pa.Table:
    words = {"source": chunk.source, "sequence": chunk.sequence, "status": "unreadable", "reason": reason}
    return pa.Table.from_pylist([words], schema=_schema())


def _schema() -> pa.Schema:
    words = [pa.field(name, pa.string()) for name in ("source", "sequence", "reason")]
    return pa.schema(words + list(tables.arrow_schema()))
