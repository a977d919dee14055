"""The folder that results go to, by path or URL."""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import fsspec
from fsspec.implementations.local import LocalFileSystem

#: Parts that are read at once: a store takes long to answer, and answers many.
AT_ONCE = 32


@dataclass(frozen=True)
class Results:
    """A folder of files that appear whole or not at all."""

    url: str

    @contextmanager
    def writing(self, name: str) -> Iterator[BinaryIO]:
        """A file to write; it appears when the block ends, and never if that fails or the process dies."""
        files, root = fsspec.core.url_to_fs(self.url)
        place = f"{root}/{name}"
        files.makedirs(place.rsplit("/", 1)[0], exist_ok=True)
        if isinstance(files, LocalFileSystem):
            # fsspec's own transaction copies from the system's temporary folder, which is not one step.
            with _renamed(Path(place)) as file:
                yield file
        else:
            # A store shows an object when all of it is there; the transaction drops it if the block fails.
            with files.transaction, files.open(place, "wb") as file:
                yield file

    def read(self, name: str) -> bytes:
        """The content of a file."""
        files, root = fsspec.core.url_to_fs(self.url)
        return bytes(files.cat_file(f"{root}/{name}"))

    def done(self) -> set[str]:
        """The names of the parts that are there."""
        files, root = fsspec.core.url_to_fs(self.url)
        # What another process of this machine noted is not what is there now.
        files.invalidate_cache()
        try:
            return {path.rsplit("/", 1)[-1] for path in files.ls(f"{root}/parts", detail=False)}
        except FileNotFoundError:
            return set()

    def parts(self, names: Sequence[str]) -> Iterator[bytes]:
        """The contents of parts, in that order; a few of them are held at a time."""
        with ThreadPoolExecutor(AT_ONCE) as pool:
            for k in range(0, len(names), AT_ONCE):
                yield from pool.map(self.read, [f"parts/{name}" for name in names[k : k + AT_ONCE]])

    def begin(self, settings: dict[str, Any]) -> None:
        """Note what these results are of; refuse to mix them with others."""
        text = json.dumps(settings, sort_keys=True, indent=1, default=str).encode()
        try:
            known = self.read("settings.json")
        except FileNotFoundError:
            with self.writing("settings.json") as file:
                file.write(text)
        else:
            if known != text:
                raise ValueError(f"{self.url}: holds results of other settings (settings.json); choose another folder")


@contextmanager
def _renamed(path: Path) -> Iterator[BinaryIO]:
    """A file beside `path` that takes its name in the end."""
    beside = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        with open(beside, "xb") as file:
            yield file
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
