"""Disparity beside OpenCV's, alternating, on pairs with truth.

usage: python bench/disparity.py DATA [ROUNDS]   (needs numpy and opencv-contrib-python-headless)
DATA holds kitti_scene_flow_2015, kitti_stereo_flow_2012, middlebury_2001_2003, middlebury_2014_motorcycle.
Builds and runs the program `time_disparity` of the benches; least milliseconds of all rounds, on two threads.

bad: off by more than 3 px (KITTI) or 1 px (Middlebury), or missing, in % of the pixels with truth;
answered: % with an answer; off: bad % of those; median: of |error| over those; z: robust standard
deviation of error / sqrt(sigma^2 + sigma_truth^2), >3: % beyond 3 of it (on KITTI about the median,
which is the calibration's). sigma_truth: step / sqrt(12) on Middlebury; 0.25 px on KITTI 2012; 0.6 px on
KITTI 2015, whose truth differs from any matcher's by 0.3 to 1.3 px from region to region.
"""
import os
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

from timing import program

THREADS = 2


def pairs(data):
    """(name, left, right, levels, truth, sigma of the truth, threshold) of every pair."""
    found = []
    for folder, views, truth, names, sigma in (
        ("kitti_scene_flow_2015", ("image_2", "image_3"), "disp_occ_0", ("000002", "000003"), 0.6),
        ("kitti_stereo_flow_2012", ("image_0", "image_1"), "disp_occ", ("000027", "000138"), 0.25),
    ):
        root = os.path.join(data, folder, "training")
        for name in names:
            left, right, map_ = (os.path.join(root, part, f"{name}_10.png") for part in (*views, truth))
            disparity = cv2.imread(map_, -1).astype(np.float32) / 256
            disparity[disparity == 0] = np.nan
            found.append((name, left, right, 128, disparity, sigma, 3.0))
    for name, scale in (("teddy", 4), ("cones", 4), ("venus", 8)):
        root = os.path.join(data, "middlebury_2001_2003", name)
        levels = cv2.imread(os.path.join(root, "disp2.png"), cv2.IMREAD_GRAYSCALE).astype(np.float32)
        disparity = np.where(levels > 0, levels / scale, np.nan)
        left, right = (os.path.join(root, part) for part in ("im2.png", "im6.png"))
        found.append((name, left, right, 64, disparity, 1 / scale / 12**0.5, 1.0))
    root = os.path.join(data, "middlebury_2014_motorcycle")
    stored = np.load(os.path.join(root, "motorcycle_disp.npz"))
    disparity = stored[stored.files[0]].astype(np.float32)
    disparity[~np.isfinite(disparity)] = np.nan
    left, right = (os.path.join(root, f"motorcycle_{side}.png") for side in ("left", "right"))
    found.append(("motorcycle", left, right, 80, disparity, 0.0, 1.0))
    return found


def opencv(levels, name):
    if name == "StereoBM":
        matcher = cv2.StereoBM_create(levels, 15)
        matcher.setUniquenessRatio(10)
        matcher.setSpeckleWindowSize(100)
        matcher.setSpeckleRange(2)
        matcher.setDisp12MaxDiff(1)
        return matcher
    return cv2.StereoSGBM_create(
        0, levels, 3, P1=8 * 9, P2=32 * 9, disp12MaxDiff=1, uniquenessRatio=10, speckleWindowSize=100,
        speckleRange=2, preFilterCap=63, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )


def judged(found, sigma, truth, sigma_truth, threshold):
    known = np.isfinite(truth)
    answered = known & np.isfinite(found)
    error = (found - truth)[answered]
    good = (np.abs(error) <= threshold).sum()
    figures = [
        100 * (1 - good / known.sum()), 100 * len(error) / known.sum(), 100 * (1 - good / len(error)),
        np.median(np.abs(error)), np.nan, np.nan,
    ]
    if sigma is not None:
        z = error / np.hypot(sigma[answered], sigma_truth)
        if threshold == 3.0:
            z = z - np.median(z)
        figures[4:] = [1.4826 * np.median(np.abs(z - np.median(z))), 100 * (np.abs(z) > 3).mean()]
    return figures


def main():
    data, rounds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    cv2.setNumThreads(THREADS)
    ours = subprocess.Popen(
        [program("egomotion", "time_disparity")],
        env=dict(os.environ, RAYON_NUM_THREADS=str(THREADS)),
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1,
    )
    out = os.path.join(tempfile.mkdtemp(), "disparity.raw")
    header = ("ms", "bad", "answered", "off", "median", "z", ">3")
    print(f"{'':12s} {'':26s}" + "".join(f"{h:>9s}" for h in header))
    for name, left, right, levels, truth, sigma_truth, threshold in pairs(data):
        grey = [cv2.imread(path, cv2.IMREAD_GRAYSCALE) for path in (left, right)]
        matchers = {n: opencv(levels, n) for n in ("SGBM 3-way", "StereoBM")}
        times, maps = {}, {}
        for _ in range(rounds):
            for kind in ("semi-global", "semi-global+measured", "area-correlation+measured"):
                ours.stdin.write(f"{left} {right} {levels} {kind} {out}\n")
                times.setdefault(kind, []).append(float(ours.stdout.readline()))
                maps[kind] = np.fromfile(out, "<f4").reshape(2, *truth.shape)
            for kind, matcher in matchers.items():
                start = time.perf_counter()
                found = matcher.compute(*grey)
                times.setdefault(kind, []).append((time.perf_counter() - start) * 1e3)
                maps[kind] = np.where(found >= 0, found / np.float32(16), np.nan), None
        table = {kind: [min(times[kind]), *judged(*maps[kind], truth, sigma_truth, threshold)] for kind in maps}
        for kind, figures in table.items():
            print(f"{name:12s} {kind:26s}" + "".join(f"{x:9.3f}" for x in figures))
        for a, b in (("semi-global", "SGBM 3-way"), ("area-correlation+measured", "StereoBM")):
            ratio = [x / y for x, y in zip(table[a][:5], table[b][:5])]
            print(f"{name:12s} {'ratio to ' + b:26s}" + "".join(f"{x:9.2f}" for x in ratio), flush=True)


if __name__ == "__main__":
    main()
