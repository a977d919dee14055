"""What spreading over workers gains, and what will limit it: the figures of docs/clusters.md, as Markdown.

usage: python bench/cluster.py DATA   (DATA holds kitti_odometry; needs egomotion[ray])
Workers of one thread each on this machine, files in its memory. A run is timed after another has started the workers, and
holds everything: finding, running, joining. It takes some three minutes.
"""
import logging
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import egomotion
import egomotion.ray
import pyarrow as pa
import pyarrow.parquet as pq
import ray
from egomotion.ray.motion import join
from egomotion.ray.recordings import Chunk
from egomotion.ray.results import Results
from egomotion.ray.tasks import gather

COPIES, DRAWS, TASKS, PARTS = 4, 40, 10_000, 500
#: Of the estimate: workers, and how long a task should take.
WORKERS, TASK_S = 1000, 60


def timed(work):
    begun = time.perf_counter()
    result = work()
    return time.perf_counter() - begun, result


def nothing(k):
    pass


class Bench:
    def __init__(self, folder):
        self.folder, self.runs = Path(folder), 0

    def recordings(self, name, recording):
        """A folder of links to one recording."""
        (self.folder / name).mkdir()
        for k in range(COPIES):
            (self.folder / name / str(k)).symlink_to(recording.resolve())
        return self.folder / name

    def out(self):
        self.runs += 1
        return self.folder / f"out-{self.runs}"

    def rate(self, source, **options):
        """Frames a second."""
        done = lambda: egomotion.ray.run([source], self.out(), progress=False, **options)
        done()
        seconds, summary = timed(done)
        assert not summary.unreadable
        return (summary.rows + COPIES) / seconds

    def draws(self):
        settings = {"sequence": "C", "draws": DRAWS}
        seconds, _ = timed(lambda: egomotion.ray.study("table", self.out(), progress=False, **settings))
        return DRAWS / seconds

    def joined(self):
        """Parts a second, of 1000 rows, read and written again; bytes a row of a part that a run has left."""
        part = next((self.folder / "out-1" / "parts").iterdir())
        table = pq.read_table(part)
        results, chunks = Results(str(self.out())), [Chunk(str(k)) for k in range(PARTS)]
        long = pa.concat_tables([table] * (1000 // len(table)))
        for chunk in chunks:
            with results.writing(f"parts/{chunk.name}.parquet") as file:
                pq.write_table(long, file)
        seconds, _ = timed(lambda: join(chunks, {}, results))
        return PARTS / seconds, part.stat().st_size / len(table)


def start(workers):
    ray.init("local", num_cpus=workers, log_to_driver=False, logging_level=logging.ERROR)


def bytes_a_frame(recording):
    files = [file for name in ("image_0", "image_1") for file in (recording / name).iterdir()]
    return sum(file.stat().st_size for file in files) / (len(files) / 2)


def main(data):
    with tempfile.TemporaryDirectory() as folder:
        measure(Bench(folder), Path(data) / "kitti_odometry" / "sequences" / "06")


def measure(bench, kitti):
    egomotion.simulate("C", bench.folder / "C", frames=30, size_px=(320, 240))
    cases = [
        ("KITTI 06, sparse", bench.recordings("kitti", kitti), {"observe": "sparse"}),
        ("KITTI 06, dense", bench.folder / "kitti", {"frames": 26}),
        ("rendered 320×240, sparse", bench.recordings("rendered", bench.folder / "C"), {"observe": "sparse"}),
    ]
    rates = {name: [] for name, *_ in cases} | {"study `table`, C": []}
    for workers in (1, 2):
        start(workers)
        first, _ = timed(lambda: gather(nothing, [(0,)], "first"))
        for name, source, options in cases:
            rates[name].append(bench.rate(source, **options))
        rates["study `table`, C"].append(bench.draws())
        if workers == 2:
            before = time.process_time()
            tasks, _ = timed(lambda: gather(nothing, [(k,) for k in range(TASKS)], "nothing"))
            driver = (time.process_time() - before) / TASKS
        ray.shutdown()
    imported, _ = timed(lambda: subprocess.run([sys.executable, "-c", "import egomotion.ray"], check=True))
    parts, row_bytes = bench.joined()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    frame_bytes = bytes_a_frame(kitti)

    print("| a second | 1 worker | 2 workers | ratio |\n|---|---|---|---|")
    for name, (one, two) in rates.items():
        what = "draws" if name.startswith("study") else "frames"
        print(f"| {name}, {what} | {one:.3g} | {two:.3g} | {two / one:.2f} |")
    print("\n| | |\n|---|---|")
    print(f"| tasks that do nothing, a second | {TASKS / tasks:.0f} |")
    print(f"| of it the driver's own time, a task | {driver * 1e3:.2f} ms |")
    print(f"| first task of a new cluster | {first:.1f} s |")
    print(f"| `import egomotion.ray` | {imported:.1f} s |")
    print(f"| images of a frame, KITTI 06 | {frame_bytes / 1e6:.2f} MB |")
    print(f"| a row of a part | {row_bytes:.0f} bytes |")
    print(f"| joining parts of 1000 rows, a second | {parts:.0f} |")
    print(f"| memory of the driver, most | {memory:.0f} MB |")
    estimate(rates, driver, frame_bytes, row_bytes, parts)


def estimate(rates, driver, frame_bytes, row_bytes, parts):
    print(f"\n| {WORKERS} workers, tasks of {TASK_S} s | sparse | dense |\n|---|---|---|")
    each = [rates["KITTI 06, sparse"][1] / 2, rates["KITTI 06, dense"][1] / 2]
    print("| frames a second | " + " | ".join(f"{WORKERS * rate:.0f}" for rate in each) + " |")
    print("| frames a task | " + " | ".join(f"{TASK_S * rate:.0f}" for rate in each) + " |")
    print("| read from the store | " + " | ".join(f"{WORKERS * rate * frame_bytes / 1e9:.1f} GB/s" for rate in each) + " |")
    print("| written | " + " | ".join(f"{WORKERS * rate * row_bytes / 1e6:.1f} MB/s" for rate in each) + " |")
    print("| the driver's part of its core | " + " | ".join(f"{WORKERS / TASK_S * driver:.2%}" for _ in each) + " |")
    print("| joining what an hour has left | " + " | ".join(f"{WORKERS * 3600 / TASK_S / parts:.0f} s" for _ in each) + " |")


if __name__ == "__main__":
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
