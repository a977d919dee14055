"""Milliseconds a frame of the whole command: on real recordings, over image sizes, over a long run.

usage: python bench/frame.py DATA [speed|growth|memory ...]   (needs numpy; DATA holds kitti_odometry)

speed   five runs of KITTI odometry 06 by each way of observing: median of frame_ms, stages, errors
growth  a rendered sequence in four sizes, and with four numbers of levels: frame_ms
memory  1000 frames (KITTI 06 forth and back): resident memory every 100 frames
"""
import json
import os
import subprocess
import sys
import tempfile
import time

import numpy as np

RUNS = 5
ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
TARGET = os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target"))
COMMAND = os.path.join(TARGET, "release", "egomotion")
WAYS = {
    "sparse": ["--observe", "sparse"],
    "dense": ["--observe", "dense"],
    "dense, differential": ["--observe", "dense", "--approach", "differential"],
}


def run(source, out, *options):
    command = [COMMAND, "run", source, "--out", out, "--quiet", *options]
    subprocess.run(command, check=True, capture_output=True)
    with open(os.path.join(out, "summary.json")) as file:
        return json.load(file)


def print_row(name, summaries):
    times = [s["frame_ms"] for s in summaries]
    truth = summaries[0].get("truth")
    errors = f"{1e3 * truth['t_rmse_m']:.2f} mm {truth['r_rmse_deg']:.4f}°" if truth else ""
    stages = {k: np.median([s["stages_ms"][k] for s in summaries]) for k in summaries[0]["stages_ms"]}
    busy = ", ".join(f"{k} {ms:.1f}" for k, ms in stages.items() if ms > 0)
    print(f"{name:22s} {np.median(times):7.1f} ms (least {min(times):.1f})  {errors}  [{busy}]", flush=True)


def speed(data, out):
    source = os.path.join(data, "kitti_odometry", "sequences", "06")
    for name, options in WAYS.items():
        print_row(name, [run(source, out, *options) for _ in range(RUNS)])


def growth(_, out):
    for width, height in ((320, 240), (640, 480), (960, 720), (1280, 960)):
        scene = os.path.join(out, f"{width}")
        simulate = [COMMAND, "simulate", "--sequence", "C", "--frames", "8", "--noise", "sensor", "--quiet"]
        subprocess.run([*simulate, "--size", f"{width}x{height}", "--out", scene], check=True, capture_output=True)
        for name, options in list(WAYS.items())[:2]:
            summaries = [run(scene, os.path.join(out, "run"), *options) for _ in range(RUNS)]
            ms = np.median([s["frame_ms"] for s in summaries])
            print_row(f"{width}x{height} {name}", summaries)
            print(f"{'':22s} {1e6 * ms / (width * height):7.1f} ns a pixel", flush=True)
    for levels in (32, 64, 128, 256):
        settings = os.path.join(out, "levels.toml")
        with open(settings, "w") as file:
            file.write(f"[disparity]\nlevels = {levels}\n")
        summaries = [run(scene, os.path.join(out, "run"), "--config", settings) for _ in range(RUNS)]
        print_row(f"{width}x{height} {levels} levels", summaries)


def memory(data, out):
    source, long = os.path.join(data, "kitti_odometry"), os.path.join(out, "long", "sequences", "06")
    frames = sorted(os.listdir(os.path.join(source, "sequences", "06", "image_0")))
    there_and_back = frames + frames[-2:0:-1]
    for side in ("image_0", "image_1"):
        os.makedirs(os.path.join(long, side))
        for k in range(1000):
            image = os.path.join(source, "sequences", "06", side, there_and_back[k % len(there_and_back)])
            os.symlink(os.path.abspath(image), os.path.join(long, side, f"{k:06d}.png"))
    with open(os.path.join(source, "sequences", "06", "calib.txt")) as file:
        calibration = file.read()
    with open(os.path.join(long, "calib.txt"), "w") as file:
        file.write(calibration)
    with open(os.path.join(long, "times.txt"), "w") as file:
        file.writelines(f"{0.1 * k:.6e}\n" for k in range(1000))
    for name, options in list(WAYS.items())[:2]:
        command = [COMMAND, "run", long, "--out", os.path.join(out, "long-run"), "--quiet", *options]
        process, samples = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL), []
        while process.poll() is None:
            with open(f"/proc/{process.pid}/statm") as file:
                samples.append(int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6)
            time.sleep(0.2)
        tenths = [max(part) for part in np.array_split(samples[:-1], 10)]
        print(f"{name:22s} MB by tenths of the run: {' '.join(f'{mb:.0f}' for mb in tenths)}", flush=True)


def main():
    parts = {"speed": speed, "growth": growth, "memory": memory}
    subprocess.run(["cargo", "build", "--release", "-q"], cwd=ROOT, check=True)
    for name in sys.argv[2:] or parts:
        print(f"# {name}; load {os.getloadavg()[0]:.1f}")
        with tempfile.TemporaryDirectory() as out:
            parts[name](sys.argv[1], out)


if __name__ == "__main__":
    main()
