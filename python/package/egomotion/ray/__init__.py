"""Many recordings, long ones in chunks, and every study, spread over a Ray cluster.

    import egomotion.ray
    egomotion.ray.run(["recordings/06", "s3://bucket/drives"], "out")
    egomotion.ray.study("table", "out-table", sequence="C", draws=400)

or ``python -m egomotion.ray run recordings/06 recordings/07 --out out``. Sources and results are paths or URLs that
fsspec knows. Each task leaves a file of its own in ``out/parts``, which appears whole or not at all: what is finished is
not done again, and a task whose worker dies is tried again. The numbers are those of one machine: a study's to the
last bit, and a recording's too unless it is cut into chunks, whose first frames know less of the past.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

import egomotion

from . import motion, recordings
from .results import Results
from .tasks import gather, one_task_of_many

__all__ = ["Summary", "run", "study"]

#: Frames before a chunk whose answers are not kept: the pipeline finds its corners and its velocity again.
OVERLAP = 10


@dataclass(frozen=True)
class Summary:
    """What a run of recordings came to; the rows are in ``out/motion.parquet``."""

    #: Recordings, and rows of them.
    recordings: int
    rows: int
    #: Source and reason of each that could not be read.
    unreadable: dict[str, str]


def run(
    sources: Sequence[str | Path],
    out: str | Path,
    *,
    chunk: int | None = None,
    overlap: int = OVERLAP,
    progress: bool = True,
    **options: Any,
) -> Summary:
    """Run recordings; `options` are those of `egomotion.run`, on one thread a task unless they say `threads`.

    A source is a recording or a folder of recordings: one that is no recording itself, but has folders that are. In
    ``out/motion.parquet`` is one row a frame: the columns of ``motion.csv`` behind `source`, `sequence` and `reason`. A
    recording that cannot be read is one row with the status "unreadable", and is tried again by the next run. With
    `chunk` frames a task, long recordings are cut, each chunk with `overlap` frames before it that are read and not kept.
    """
    motion.check(options, chunk, overlap)
    results = Results(_everywhere(out))
    results.begin({"run": options, "chunk": chunk, "overlap": overlap, "version": egomotion.__version__})
    given = [(_everywhere(source), options.get("calibration")) for source in sources]
    found = gather(recordings.find, given, "sources", progress=progress)
    # A folder and a recording in it may both be given.
    paths = list(dict.fromkeys(path for some in found for path in some))
    if chunk is None:
        chunks = [recordings.Chunk(path) for path in paths]
    else:
        asked = [(path, chunk, overlap, options) for path in paths]
        cut = gather(recordings.cut, asked, "lengths", progress=progress)
        chunks = [piece for pieces in cut for piece in pieces]
    done = results.done()
    left = [piece for piece in chunks if f"{piece.name}.parquet" not in done]
    reasons = gather(
        motion.leave,
        [(piece, results, options) for piece in left],
        "recordings" if chunk is None else "chunks",
        names=[piece.name for piece in left],
        cpus=options.get("threads") or 1,
        died=lambda error: f"its worker died again and again: {error}",
        progress=progress,
    )
    unreadable = {piece: reason for piece, reason in zip(left, reasons) if reason is not None}
    rows = motion.join(chunks, unreadable, results)
    return Summary(len(paths), rows, {piece.source: reason for piece, reason in unreadable.items()})


def study(name: str, out: str | Path, *, progress: bool = True, **settings: Any) -> dict[str, pa.Table]:
    """Run every part of a study; the tables, also in ``out/NAME.parquet``, are those of `egomotion.Study(name).tables()`."""
    whole = egomotion.Study(name, **settings)
    results = Results(_everywhere(out))
    results.begin({"study": name, "settings": whole.settings, "version": egomotion.__version__})
    places = [f"{part:06d}.json" for part in range(len(whole.parts))]
    done = results.done()
    left = [part for part, place in enumerate(places) if place not in done]
    calls = [(name, whole.settings, part, places[part], results) for part in left]
    gather(_run_part, calls, "parts", names=[f"{part:06d}" for part in left], progress=progress)
    records = [record for part in results.parts(places) for record in json.loads(part)]
    found = {title: pa.table(columns) for title, columns in whole.publish(records).items()}
    for title, table in found.items():
        with results.writing(f"{title}.parquet") as file:
            pq.write_table(table, file)
    return found


def _everywhere(place: str | Path) -> str:
    """A path or URL that means the same in every task."""
    text = str(place)
    return text if "://" in text or "::" in text else os.path.abspath(text)


def _run_part(name: str, settings: dict[str, Any], part: int, place: str, results: Results) -> None:
    """Leave the records of one part of a study."""
    one_task_of_many()
    records = egomotion.Study(name, **settings).run(part)
    with results.writing(f"parts/{place}") as file:
        file.write(json.dumps(records).encode())
