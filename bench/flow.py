"""Dense flow beside OpenCV's DIS, alternating, on pairs with truth.

usage: python bench/flow.py DATA [ROUNDS]   (needs numpy and opencv-contrib-python-headless)
DATA holds kitti_scene_flow_2015, kitti_stereo_flow_2012 and middlebury_flow_rubberwhale. Builds and
runs the program `time_flow` of the benches; least and median milliseconds of all rounds, on two threads. On KITTI ours
is the pipeline's: pyramids and disparity are there, the rigid flow is predicted within the time.

all: mean error (px) and % off by more than 3 px over all pixels with truth; where ours has no answer the
nearest one stands in, as DIS answers everywhere. measured: the same over what ours measured, its share
of the pixels with truth, and z, the robust standard deviation of error / sqrt(sigma^2 + sigma_truth^2)
along u and v about the median (sigma_truth .1 px on rubberwhale, .25 px on KITTI).
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
# As the command has it: freed memory stays with the process.
MEMORY = dict(MALLOC_MMAP_THRESHOLD_=str(1 << 30), MALLOC_TRIM_THRESHOLD_=str(1 << 30))


def read_flow_png(path):
    raw = cv2.imread(path, -1)[..., ::-1].astype(np.float32)
    flow = (raw[..., :2] - 32768) / 64
    flow[raw[..., 2] == 0] = np.nan
    return flow


def read_flo(path):
    with open(path, "rb") as file:
        width, height = np.fromfile(file, np.int32, 3)[1:]
        flow = np.fromfile(file, np.float32).reshape(height, width, 2)
    flow[np.abs(flow).max(-1) > 1e8] = np.nan
    return flow


def numbers(path, left, right):
    """f, cx, cy, b of two projection matrices."""
    rows = dict(line.split(":", 1) for line in open(path) if ":" in line)
    p, q = (np.array(rows[name].split(), float) for name in (left, right))
    return p[0], p[2], p[6], (p[3] - q[3]) / p[0]


def pairs(data):
    """(name, images, camera, truth, sigma of the truth) of every pair; two images are free search."""
    found = []
    for folder, views, calibration, names in (
        ("kitti_scene_flow_2015", ("image_2", "image_3"), ("calib_cam", "P_rect_02", "P_rect_03"), ("000002", "000003")),
        ("kitti_stereo_flow_2012", ("image_0", "image_1"), ("calib", "P0", "P1"), ("000027", "000138")),
    ):
        root = os.path.join(data, folder, "training")
        for name in names:
            images = [os.path.join(root, view, f"{name}_{frame}.png") for frame in (10, 11) for view in views]
            camera = numbers(os.path.join(root, calibration[0], name + ".txt"), *calibration[1:])
            truth = read_flow_png(os.path.join(root, "flow_occ", name + "_10.png"))
            found.append((name, images, [str(n) for n in camera], truth, 0.25))
            found.append((name + " free", images[::2], [], truth, 0.25))
    root = os.path.join(data, "middlebury_flow_rubberwhale")
    images = [os.path.join(root, f"RubberWhale{k}.png") for k in (1, 2)]
    found.append(("rubberwhale", images, [], read_flo(os.path.join(root, "RubberWhale.flo")), 0.1))
    return found


def filled(flow):
    """Holes take the nearest answer."""
    missing = np.isnan(flow[..., 0])
    if not missing.any():
        return flow
    labels = cv2.distanceTransformWithLabels(missing.astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)[1]
    source = np.zeros(labels.max() + 1, np.int64)
    source[labels[~missing]] = np.flatnonzero(~missing)
    return flow.reshape(-1, 2)[source[labels]]


def errors(flow, truth, where):
    error = np.linalg.norm(flow - truth, axis=-1)[where]
    return error.mean(), 100 * (error > 3).mean()


def robust(z):
    return 1.4826 * np.median(np.abs(z - np.median(z)))


def main():
    data = sys.argv[1]
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    cv2.setNumThreads(THREADS)
    ours = program("egomotion", "time_flow")
    environment = dict(os.environ, RAYON_NUM_THREADS=str(THREADS), **MEMORY)
    presets = {"DIS fast": cv2.DISOPTICAL_FLOW_PRESET_FAST, "DIS medium": cv2.DISOPTICAL_FLOW_PRESET_MEDIUM}
    print(f"load {os.getloadavg()[0]:.1f}; {rounds} rounds, {THREADS} threads; ms: least (median); error px, > 3 px %")
    for name, images, camera, truth, sigma_truth in pairs(data):
        grey = [cv2.imread(path, cv2.IMREAD_GRAYSCALE) for path in (images[0], images[len(images) // 2])]
        where = np.isfinite(truth[..., 0])
        theirs = {preset: [] for preset in presets}
        mine = []
        with tempfile.NamedTemporaryFile() as out:
            for _ in range(rounds):
                for preset, number in presets.items():
                    dis = cv2.DISOpticalFlow_create(number)
                    dis.calc(*grey, None)
                    start = time.perf_counter()
                    flow = dis.calc(*grey, None)
                    theirs[preset].append((time.perf_counter() - start) * 1e3)
                    theirs[preset, "flow"] = flow
                line = subprocess.run([ours, "8", out.name, *images, *camera], env=environment, check=True, capture_output=True, text=True)
                mine += [float(x) for x in line.stdout.split()]
            planes = np.fromfile(out.name, np.float32).reshape(6, *truth.shape[:2])
        print(name)
        for preset in presets:
            error, off = errors(theirs[preset, "flow"], truth, where)
            print(f"  {preset:10}  {min(theirs[preset]):6.1f} ({np.median(theirs[preset]):.1f}) ms  all {error:6.3f} {off:5.1f} %")
        medium = errors(theirs["DIS medium", "flow"], truth, where)[0]
        flow, measured = np.moveaxis(planes[:2], 0, -1), planes[5] > 0
        error, off = errors(filled(flow), truth, where)
        ratio = min(mine) / min(theirs["DIS medium"])
        print(f"  egomotion   {min(mine):6.1f} ({np.median(mine):.1f}) ms  all {error:6.3f} {off:5.1f} %"
              f"  to DIS medium: time {ratio:.2f}, error {error / medium:.2f}")
        answered = where & measured
        given = where & np.isfinite(flow[..., 0])
        error, off = errors(flow, truth, answered)
        z = [robust((flow[..., k] - truth[..., k])[answered] / np.sqrt(planes[2 + 2 * k] + sigma_truth**2)[answered]) for k in (0, 1)]
        guess = given & ~measured
        zg = [robust((flow[..., k] - truth[..., k])[guess] / np.sqrt(planes[2 + 2 * k])[guess]) if guess.any() else np.nan for k in (0, 1)]
        print(f"              given {100 * given.sum() / where.sum():.1f} %; measured {100 * answered.sum() / where.sum():.1f} %:"
              f" {error:.3f} {off:.1f} %, z {z[0]:.2f} {z[1]:.2f}; guesses z {zg[0]:.2f} {zg[1]:.2f}", flush=True)


if __name__ == "__main__":
    main()
