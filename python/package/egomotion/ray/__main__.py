"""The command ``python -m egomotion.ray``."""

from __future__ import annotations

import argparse
import json
import logging
import sys
from collections.abc import Sequence
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError

import egomotion
from egomotion.ray import OVERLAP, Summary, run, study
from egomotion.ray.motion import check


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit codes are those of the command `egomotion`: 0 done, 1 failed, 2 wrong usage, 130 interrupted."""
    parser = _parser()
    asked = parser.parse_args(arguments)
    try:
        # Before a cluster is started, or asked.
        if asked.work == "run":
            check(asked.options, asked.chunk, asked.overlap)
        else:
            egomotion.Study(asked.name, **asked.settings)
    except (TypeError, ValueError, OverflowError) as error:
        parser.error(str(error))
    try:
        ray.init(address=asked.address, log_to_driver=False, logging_level=logging.WARNING)
        if asked.work == "run":
            done = run(asked.sources, asked.out, chunk=asked.chunk, overlap=asked.overlap, **asked.options)
            return _say(done)
        study(asked.name, asked.out, **asked.settings)
        return 0
    except KeyboardInterrupt:
        print("interrupted; the same command goes on with what is left", file=sys.stderr)
        return 130
    except RayTaskError as error:
        print(f"error: {error.cause}", file=sys.stderr)
        return 1
    except (RayError, OSError, RuntimeError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1


def _say(done: Summary) -> int:
    for source, reason in done.unreadable.items():
        print(f"unreadable: {source}: {reason}", file=sys.stderr)
    print(f"{done.rows} rows of {done.recordings} recordings, {len(done.unreadable)} unreadable", file=sys.stderr)
    return 1 if len(done.unreadable) == done.recordings else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m egomotion.ray",
        description="Many recordings, long ones in chunks, and every study, spread over a Ray cluster.",
        epilog="What is finished is not done again: give the same command after a stop. Exit code 0: done, though some "
        "recordings may be unreadable; 1: failed, or none could be read; 2: wrong usage; 130: interrupted.",
    )
    parser.add_argument("--address", help="of the cluster; by default RAY_ADDRESS, one that runs on this machine, or one started for this alone")
    commands = parser.add_subparsers(dest="work", required=True)
    one = commands.add_parser("run", help="run recordings")
    one.add_argument("sources", nargs="+", metavar="SOURCE", help="a recording or a folder of recordings, path or URL")
    one.add_argument("--out", required=True, help="folder of the results, path or URL")
    one.add_argument("--chunk", type=int, metavar="N", help="frames a task, for long recordings")
    one.add_argument("--overlap", type=int, default=OVERLAP, metavar="N", help="frames read before each chunk")
    one.add_argument("--options", type=_object, default={}, metavar="JSON", help="keywords of egomotion.run")
    two = commands.add_parser("study", help="run a study")
    two.add_argument("name", choices=egomotion.Study.names())
    two.add_argument("--out", required=True, help="folder of the results, path or URL")
    two.add_argument("--settings", type=_object, default={}, metavar="JSON", help="settings of the study")
    return parser


def _object(text: str) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except json.JSONDecodeError as error:
        raise argparse.ArgumentTypeError(f"is no JSON: {error}") from error
    if not isinstance(found, dict):
        raise argparse.ArgumentTypeError('is no JSON object, as {"observe": "sparse"}')
    return found


if __name__ == "__main__":
    sys.exit(main())
