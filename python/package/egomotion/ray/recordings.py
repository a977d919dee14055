"""Which recordings there are, how they are cut, and as much of them as is needed on this machine's disk."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import fsspec
from fsspec.implementations.local import LocalFileSystem

import egomotion

#: A folder of more files than this holds one a frame, of which only those that are needed are copied.
MANY = 20
#: Files copied before and behind those of a chunk: two cameras do not always have as many images.
MARGIN = 2


@dataclass(frozen=True)
class Chunk:
    """Frames of a recording that one task works on."""

    source: str
    #: None is every sequence of the recording.
    sequence: str | None = None
    #: The first frame that is read, and the first whose answer is kept, counted in frames that are used.
    start: int = 0
    keep: int = 0
    #: Frames to read; None is all.
    frames: int | None = None
    #: The part of the recording's files to copy; None is all, or that they lie here.
    span: tuple[float, float] | None = None

    @property
    def name(self) -> str:
        """A file name that tells chunks apart."""
        path = hashlib.sha256(f"{self.source}\0{self.sequence}".encode()).hexdigest()[:12]
        return f"{path}-{self.keep:09d}"


def find(source: str, calibration: str | None) -> list[str]:
    """The source itself, or the recordings in it: it is none, but a folder in it is.

    Where nothing can be read the source is left to its task, which says why.
    """
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(outline(source, folder))
            if _is_recording(path, calibration) or not path.is_dir() or "::" in source:
                return [source]
            inside = sorted(entry for entry in path.iterdir() if entry.is_dir() and not entry.name.startswith("."))
            if not any(_is_recording(entry, calibration) for entry in inside):
                return [source]
            return [f"{source.rstrip('/')}/{entry.name}" for entry in inside]
    except Exception:
        return [source]


def _is_recording(path: Path, calibration: str | None) -> bool:
    try:
        return bool(egomotion.sequences(path, calibration=calibration))
    except egomotion.FileError:
        return False


def cut(source: str, chunk: int, overlap: int, options: dict[str, Any]) -> list[Chunk]:
    """The chunks of a recording; one that cannot be read is left to its task, which says why."""
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = outline(source, folder)
            names = egomotion.sequences(path, calibration=options.get("calibration"))
            lengths = {name: len(egomotion.run(path, sequence=name, **options)) for name in names}
            copies = Path(folder) in Path(path).parents
    except Exception:
        return [Chunk(source)]
    if len(lengths) > 1:
        # The files of a set's scenes lie in common folders.
        return [Chunk(source, name) for name in lengths]
    [(name, frames)] = lengths.items()
    pieces = []
    # Each chunk begins with the last frame of the one before, so that no motion is lost.
    for keep in range(0, max(frames - 1, 1), chunk):
        start, end = max(keep - overlap, 0), min(keep + chunk + 1, frames)
        span = (start / frames, end / frames) if copies else None
        pieces.append(Chunk(source, name, start, keep, end - start, span))
    return pieces


def outline(source: str, folder: str) -> str:
    """The recording on this machine's disk; of one that lies elsewhere only what tells its layout and length."""
    return _local(source, folder, lambda place, of: False)


def copied(source: str, folder: str, span: tuple[float, float] | None) -> str:
    """The recording on this machine's disk, so far as its frames lie in that part of it."""
    if span is None:
        return _local(source, folder, lambda place, of: True)
    first, last = span
    return _local(source, folder, lambda place, of: first * of - MARGIN <= place <= last * of + MARGIN)


def _local(source: str, folder: str, wanted: Callable[[int, int], bool]) -> str:
    """Its path where it lies on this machine, else a copy whose unwanted frames are empty files."""
    files, path = fsspec.core.url_to_fs(source)
    if isinstance(files, LocalFileSystem):
        return str(path)
    root = path.rstrip("/")
    here = Path(folder) / (root.rpartition("/")[2] or "recording")
    if root.endswith(".npz"):
        files.get_file(root, str(here))
        return str(here)
    get: dict[str, str] = {}
    found = sorted(file.rpartition("/")[::2] for file in files.find(path))
    for parent, group in groupby(found, key=lambda file: file[0]):
        names = [name for _, name in group]
        place = here / parent[len(root) :].lstrip("/")
        place.mkdir(parents=True, exist_ok=True)
        for k, name in enumerate(names):
            # The first image tells the size of all.
            if k == 0 or len(names) <= MANY or wanted(k, len(names)):
                get[f"{parent}/{name}" if parent else name] = str(place / name)
            else:
                (place / name).touch()
    if not get:
        raise FileNotFoundError(f"{source}: nothing is there")
    files.get(list(get), list(get.values()))
    return str(here)
