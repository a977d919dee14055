"""A Ray cluster of two nodes on the loopback interface, shut with a token."""

import os
import secrets
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

# Ray reads them when it is imported; its processes inherit them.
os.environ.update(RAY_AUTH_MODE="token", RAY_AUTH_TOKEN=secrets.token_hex(32))


@dataclass(frozen=True)
class Cluster:
    """Two nodes of one core each, the processes of each in a session of their own."""

    address: str
    sessions: tuple[int, int]

    def busy(self) -> dict[int, str]:
        """Workers that run a task now, and its name: Ray makes it the title of the process."""
        found = {}
        for folder in Path("/proc").iterdir():
            if not folder.name.isdigit():
                continue
            try:
                title = (folder / "cmdline").read_bytes().strip(b"\0").decode()
                ours = os.getsid(int(folder.name)) in self.sessions
            except (OSError, UnicodeDecodeError):
                continue
            if ours and title.startswith("ray::"):
                found[int(folder.name)] = title.removeprefix("ray::")
        return found


def _free_port(address: str) -> int:
    with socket.socket() as door:
        door.bind((address, 0))
        return int(door.getsockname()[1])


@pytest.fixture(scope="session")
def cluster() -> Iterator[Cluster]:
    ray = pytest.importorskip("ray")
    if not sys.platform.startswith("linux"):
        pytest.skip("two nodes on one machine need the loopback addresses of Linux")
    # Not in pytest's folder: the path of a socket must be short.
    folder = Path(tempfile.mkdtemp(prefix="ray-", dir="/tmp"))
    head = "127.0.0.2"
    address = f"{head}:{_free_port(head)}"

    def start(node: str, *more: str) -> subprocess.Popen[bytes]:
        own = [f"--node-ip-address={node}", f"--temp-dir={folder / node}", "--num-cpus=1", "--block"]
        command = [str(Path(sys.executable).with_name("ray")), "start", *own, "--object-store-memory=100000000", *more]
        with (folder / f"{node}.log").open("wb") as log:
            return subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True)

    ports = [f"--port={address.split(':')[1]}", "--include-dashboard=false", f"--ray-client-server-port={_free_port(head)}"]
    nodes = (start(head, "--head", *ports), start("127.0.0.3", f"--address={address}"))
    try:
        _connect(address)
        yield Cluster(address, (nodes[0].pid, nodes[1].pid))
    finally:
        ray.shutdown()
        for node in reversed(nodes):
            node.terminate()
            node.wait(timeout=60)
        shutil.rmtree(folder, ignore_errors=True)


def _connect(address: str) -> None:
    import ray

    end = time.monotonic() + 60
    while True:
        try:
            ray.init(address=address, log_to_driver=False)
            break
        except (ConnectionError, RuntimeError):
            assert time.monotonic() < end, "the head does not answer"
            time.sleep(0.2)
    while len(ray.nodes()) < 2:  # type: ignore[no-untyped-call, unused-ignore]
        assert time.monotonic() < end, "the second node does not come"
        time.sleep(0.1)
