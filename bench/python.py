"""The Python package beside the Rust library: `push`, a formula on a million points, two threads.

usage: python bench/python.py SEQUENCE [ROUNDS]   (needs the built wheel, numpy and pillow)
SEQUENCE is a folder in KITTI odometry's layout, such as DATA/kitti_odometry/sequences/06.
Builds and runs the program `time_pipeline` of the benches, alternating with this process; medians over all frames of all rounds.

push      ms a frame with images in memory: of Rust's StereoMotion::push, and of StereoMotion.push with uint8 arrays
formula   ms of a million points' VZ with its variance: Rust's library, and StereoTracks.depth_velocity
threads   frames a second of one Python thread and of two, each with a pipeline of its own on one thread
"""
import json
import os
import subprocess
import sys
import threading
import time

import numpy as np
from PIL import Image

import egomotion

from timing import program

FRAMES = 30
WARM = 3
THREADS = 2
POINTS = 1_000_000


def images(sequence):
    read = lambda side, k: np.asarray(Image.open(os.path.join(sequence, f"image_{side}", f"{k:06}.png")))
    return [(read(0, k), read(1, k)) for k in range(FRAMES)]


def pushes(rig, frames, threads):
    motion = egomotion.StereoMotion(rig, threads=threads)
    times = []
    for k, (left, right) in enumerate(frames):
        begun = time.perf_counter()
        motion.push(left, right, 0.1 * k)
        times.append(1e3 * (time.perf_counter() - begun))
    return times


def points(rig):
    rng = np.random.default_rng(1)
    some = lambda: rng.uniform((0, 0, 5), (1000, 300, 65), (POINTS, 3))
    return egomotion.StereoTracks(some(), some(), np.array([0.01, 0.01, 0.02]), np.array([0.01, 0.01, 0.02]))


def formula(tracks, rig, repeats=10):
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        tracks.depth_velocity(rig)
        times.append(1e3 * (time.perf_counter() - begun))
    return times


def throughput(rig, frames, workers):
    """Frames a second of so many Python threads, each with one thread of the library."""
    some = [threading.Thread(target=pushes, args=(rig, frames, 1)) for _ in range(workers)]
    begun = time.perf_counter()
    for one in some:
        one.start()
    for one in some:
        one.join()
    return workers * len(frames) / (time.perf_counter() - begun)


def main():
    sequence, rounds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    ours = program("egomotion-io", "time_pipeline")
    frames, rig = images(sequence), egomotion.run(sequence).rig
    tracks = points(rig)
    times = {"push": ([], []), "formula": ([], [])}
    for _ in range(rounds):
        told = subprocess.run([ours, sequence, str(FRAMES), str(THREADS)], check=True, capture_output=True)
        rust = json.loads(told.stdout)
        for name, own in (("push", pushes(rig, frames, THREADS)), ("formula", formula(tracks, rig))):
            times[name][0].extend(rust[f"{name}_ms"][WARM:])
            times[name][1].extend(own[WARM:])
    for name, (rust, python) in times.items():
        a, b = np.median(rust), np.median(python)
        print(f"{name:8s} Rust {a:7.2f} ms   Python {b:7.2f} ms   {100 * (b / a - 1):+.1f} %", flush=True)
    one, two = (np.median([throughput(rig, frames, n) for _ in range(3)]) for n in (1, 2))
    print(f"threads  one {one:.2f}, two {two:.2f} frames a second: {two / one:.2f} times")


if __name__ == "__main__":
    main()
