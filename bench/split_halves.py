"""Is the covariance of the motion true on a real recording, whose truth is too coarse to tell?

Two runs use disjoint checkerboards of the image, so that their errors are independent but for what is
common to all matches (calibration, a common bias of localisation), which cancels. Then the difference
of the two motions, squared in units of the sum of their covariances, is one for each degree of freedom.

usage: split_halves.py SOURCE [--cell PX] [run options …]     needs numpy and pillow; run it in the workspace's root
"""
import csv, json, os, subprocess, sys, tempfile
import numpy as np
from PIL import Image

PROGRAM = os.environ.get("EGOMOTION", "target/release/egomotion")
COLUMNS = ["tx", "ty", "tz", "wx", "wy", "wz"]


def size_of(source):
    folder = os.path.join(source, "image_0")
    return Image.open(os.path.join(folder, sorted(os.listdir(folder))[0])).size


def run(source, out, mask, options):
    command = [PROGRAM, "run", source, "--out", out, "--mask", mask, "--quiet", *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    motions = {}
    for row in csv.DictReader(open(os.path.join(out, "motion.csv"))):
        if row["status"] != "ok":
            continue
        cov = np.zeros((6, 6))
        for i in range(6):
            for j in range(i, 6):
                cov[i, j] = cov[j, i] = float(row[f"own_{i}{j}"])  # what both halves share is not in their difference
        motions[int(row["frame"])] = np.array([float(row[c]) for c in COLUMNS]), cov
    return motions


def main():
    source, options, cell = sys.argv[1], sys.argv[2:], 64
    if "--cell" in options:
        at = options.index("--cell")
        cell = int(options[at + 1])
        del options[at : at + 2]
    width, height = size_of(source)
    board = np.add.outer(np.arange(height) // cell, np.arange(width) // cell) % 2
    with tempfile.TemporaryDirectory() as folder:
        halves = []
        for half in range(2):
            mask = os.path.join(folder, f"mask{half}.png")
            Image.fromarray(((board == half) * 255).astype(np.uint8)).save(mask)
            halves.append(run(source, os.path.join(folder, f"half{half}"), mask, options))
    a, b = halves
    nees, squares = [], []
    for frame in sorted(a.keys() & b.keys()):
        error, cov = a[frame][0] - b[frame][0], a[frame][1] + b[frame][1]
        nees.append(error @ np.linalg.solve(cov, error) / 6)
        squares.append(error**2 / np.diag(cov))
    print(f"{len(nees)} pairs: NEES/6 {np.mean(nees):.2f} (median {np.median(nees):.2f}, largest {np.max(nees):.2f})")
    print("normalised variance", dict(zip(COLUMNS, np.mean(squares, axis=0).round(2).tolist())))


main()
