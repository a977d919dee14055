"""The Rust programs that the scripts of this folder time, built as they are needed."""
import json
import os
import subprocess

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")


def program(package, name):
    """Path of a package's bench program, built."""
    build = ["cargo", "bench", "--no-run", "--quiet", "--message-format=json", "-p", package, "--bench", name]
    told = subprocess.run(build, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    messages = [json.loads(line) for line in told.stdout.splitlines()]
    return next(m["executable"] for m in messages if m.get("executable") and m["target"]["name"] == name)
