"""Tasks on a Ray cluster, and what comes of them."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError

#: A worker that dies is replaced this often for each task.
RETRIES = 5
#: Tasks that the cluster knows of at a time: enough for thousands of workers, few enough for the driver.
IN_FLIGHT = 4096


def gather(
    work: Callable[..., Any],
    calls: Sequence[tuple[Any, ...]],
    what: str,
    *,
    names: Sequence[str] | None = None,
    cpus: int = 1,
    died: Callable[[RayError], Any] | None = None,
    progress: bool = False,
) -> list[Any]:
    """What `work` gives for each of the calls, in their order; `died` is asked about a task that no retry saves."""
    task = ray.remote(max_retries=RETRIES, num_cpus=cpus)(work)
    found: list[Any] = [None] * len(calls)
    flying: dict[Any, int] = {}
    begun, report = 0, _Progress(what, len(calls), progress)
    try:
        while begun < len(calls) or flying:
            while begun < len(calls) and len(flying) < IN_FLIGHT:
                name = names[begun] if names else f"{what} {begun}"
                flying[task.options(name=name).remote(*calls[begun])] = begun
                begun += 1
            # Asking for all and waiting a while is one look at every task a second, not one a task.
            ready, _ = ray.wait(list(flying), num_returns=len(flying), timeout=1.0, fetch_local=False)
            for ref in ready:
                found[flying.pop(ref)] = _outcome(ref, died)
            report.show(begun - len(flying))
    finally:
        for ref in flying:
            ray.cancel(ref, force=True)
    return found


def one_task_of_many(cores: int = 1) -> None:
    """Take no more cores of a machine than the cluster has given; to be called before anything is computed."""
    os.environ.setdefault("RAYON_NUM_THREADS", str(cores))


def _outcome(ref: Any, died: Callable[[RayError], Any] | None) -> Any:
    try:
        return ray.get(ref)
    except RayTaskError:
        raise
    except RayError as error:
        if died is None:
            raise
        return died(error)


class _Progress:
    """How many of all are done, on standard error: over itself on a terminal, in a file a line now and then."""

    def __init__(self, what: str, of: int, wanted: bool) -> None:
        self.what, self.of, self.wanted = what, of, wanted and of > 0
        self.terminal = sys.stderr.isatty()
        self.said, self.next = 0, 0.0

    def show(self, done: int) -> None:
        if not self.wanted or done == self.said or (done < self.of and time.monotonic() < self.next):
            return
        end = "\r" if self.terminal and done < self.of else "\n"
        print(f"{done} of {self.of} {self.what}", end=end, file=sys.stderr, flush=True)
        self.said, self.next = done, time.monotonic() + (1.0 if self.terminal else 10.0)
