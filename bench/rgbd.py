"""Frame-to-frame motion of depth cameras beside OpenCV's Odometry (depth, RGB, RGB + depth), and of stereo images whose
disparity SGBM gives to it.

usage: python bench/rgbd.py DATA   (DATA holds tum_rgbd, tartanair_v1, tartanair_v2; needs numpy and OpenCV 5)
Root mean square of the relative translation and rotation error, in mm and degrees, against the sets' poses. OpenCV
gets the images that egomotion gets: freiburg1's are undistorted. Its limits are set as suits it best: on motion none, and
on the change of depth that two matched points may show what gave the smallest errors. It takes depths of which one is
beyond 10 m for levels of 1/5000 m, so it gets none that is: its motions came out 5000 times too small.
"""
import glob
import json
import os
import subprocess
import sys
import tempfile

import cv2
import numpy as np

from motion import COMMAND, errors

FREIBURG1 = np.array([[517.3, 0, 318.6], [0, 516.5, 255.3], [0, 0, 1]])
LENS = np.array([0.2624, -0.9531, -0.0054, 0.0026, 1.1633])


def ours(folder, sensor):
    with tempfile.TemporaryDirectory() as out:
        command = [COMMAND, "run", folder, "--out", out, "--quiet", "--sensor", sensor]
        subprocess.run(command, check=True, capture_output=True)
        with open(os.path.join(out, "summary.json")) as file:
            return json.load(file)["truth"]


def tum(folder):
    """Images with the nearest depth, undistorted alike; poses interpolated by egomotion's own info are not needed."""
    stamped = lambda name: sorted((float(os.path.basename(f)[:-4]), f) for f in glob.glob(f"{folder}/{name}/*.png"))
    depths = stamped("depth")
    maps = cv2.initUndistortRectifyMap(FREIBURG1, LENS, None, FREIBURG1, (640, 480), cv2.CV_32FC1)
    for time, image in stamped("rgb"):
        depth = min(depths, key=lambda d: abs(d[0] - time))[1]
        yield (
            cv2.remap(cv2.imread(image), *maps, cv2.INTER_CUBIC),
            cv2.remap(cv2.imread(depth, -1), *maps, cv2.INTER_NEAREST).astype(np.float32) / 5000,
        )


def tartanair(folder, version):
    if version == 1:
        for image in sorted(glob.glob(f"{folder}/image_left/*.png")):
            name = os.path.basename(image)[:-4]
            yield cv2.imread(image), np.load(f"{folder}/depth_left/{name}_depth.npy")
    else:
        for image in sorted(glob.glob(f"{folder}/image_lcam_front/*.png")):
            name = os.path.basename(image)[:-4]
            depth = cv2.imread(f"{folder}/depth_lcam_front/{name}_depth.png", -1)
            yield cv2.imread(image), depth.view("<f4")[..., 0]


def stereo(folder):
    """The left images of TartanAir 2 with depth by SGBM; the baseline is .25 m."""
    matcher = cv2.StereoSGBM_create(0, 128, 5, 200, 800, 1, 0, 10, 100, 2, cv2.STEREO_SGBM_MODE_SGBM_3WAY)
    for image in sorted(glob.glob(f"{folder}/image_lcam_front/*.png")):
        left, right = cv2.imread(image), cv2.imread(image.replace("lcam", "rcam"))
        grey = [cv2.cvtColor(side, cv2.COLOR_BGR2GRAY) for side in (left, right)]
        disparity = matcher.compute(*grey).astype(np.float32) / 16
        yield left, np.where(disparity > 0, 320 * 0.25 / np.maximum(disparity, 1e-6), 0)


def rotation(q):
    x, y, z, w = q / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def pose(row):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation(row[3:]), row[:3]
    return matrix


def slerp(a, b, share):
    b = b if a @ b >= 0 else -b
    angle = np.arccos(np.clip(a @ b, -1, 1))
    if angle < 1e-9:
        return a
    return (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)


def truth_tum(folder):
    rows = np.loadtxt(f"{folder}/groundtruth.txt")
    for image in sorted(glob.glob(f"{folder}/rgb/*.png")):
        time = float(os.path.basename(image)[:-4])
        k = np.searchsorted(rows[:, 0], time)
        a, b = rows[k - 1], rows[k]
        share = (time - a[0]) / (b[0] - a[0])
        unit = lambda q: q / np.linalg.norm(q)
        yield pose(np.r_[a[1:4] + share * (b[1:4] - a[1:4]), slerp(unit(a[4:]), unit(b[4:]), share)])


def truth_tartanair(folder):
    axes = np.eye(4)
    axes[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    file = glob.glob(f"{folder}/pose_l*.txt")[0]
    return [pose(row) @ axes for row in np.loadtxt(file)]


def opencv(frames, camera, kind, largest_m, change_m):
    settings = cv2.OdometrySettings()
    settings.setCameraMatrix(camera.astype(np.float32))
    settings.setMaxDepth(largest_m)
    settings.setMaxDepthDiff(change_m)
    settings.setMaxTranslation(1e3)
    settings.setMaxRotation(90)
    odometry = cv2.Odometry(kind, settings, cv2.OdometryAlgoType_COMMON)
    motions, last = [], None
    for image, depth in frames:
        usable = np.where((depth > 0) & (depth < largest_m), depth, np.nan).astype(np.float32)
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        frame = cv2.OdometryFrame(usable, grey)
        odometry.prepareFrame(frame)
        if last is not None:
            found, motion = odometry.compute(last, frame, np.eye(4))
            motions.append((motion[:3, :3], motion[:3, 3]) if found else (np.eye(3), np.zeros(3)))
        last = frame
    return motions


def main():
    data = sys.argv[1]
    virtual = lambda w, h: np.array([[320, 0, (w - 1) / 2], [0, 320, (h - 1) / 2], [0, 0, 1.0]])
    sets = [
        ("tum_rgbd/freiburg1_desk", tum, truth_tum, FREIBURG1, 4.0, 0.07),
        ("tum_rgbd/freiburg1_rpy", tum, truth_tum, FREIBURG1, 4.0, 0.07),
        ("tartanair_v1/P", lambda f: tartanair(f, 1), truth_tartanair, virtual(640, 480), 10.0, 0.07),
        ("tartanair_v2/P000", lambda f: tartanair(f, 2), truth_tartanair, virtual(640, 640), 10.0, 0.7),
        # Of .07, .2, .7 and 2 m this limit is best with stereo's noise.
        ("tartanair_v2/P000", stereo, truth_tartanair, virtual(640, 640), 10.0, 0.2),
    ]
    kinds = [("depth", cv2.OdometryType_DEPTH), ("RGB", cv2.OdometryType_RGB), ("RGB-D", cv2.OdometryType_RGB_DEPTH)]
    for name, read, truth_of, camera, largest_m, change_m in sets:
        folder = os.path.join(data, name)
        frames, truth = list(read(folder)), list(truth_of(folder))
        for kind, number in kinds:
            t, r = errors(opencv(frames, camera, number, largest_m, change_m), truth)
            print(f"{name:24s} OpenCV {kind:6s} {1e3 * t:8.3f} mm {r:.4f}°", flush=True)
        found = ours(folder, "stereo" if read is stereo else "depth")
        nees = found["nees_per_component"]
        print(f"{name:24s} egomotion     {1e3 * found['t_rmse_m']:8.3f} mm {found['r_rmse_deg']:.4f}°  NEES/6 {nees:.2f}")


if __name__ == "__main__":
    main()
