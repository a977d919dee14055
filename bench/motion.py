"""Frame-to-frame motion beside OpenCV's (SGBM 3-way, pyramidal LK, PnP-RANSAC with refinement).

usage: python bench/motion.py SEQUENCE ...   (KITTI odometry layout with poses, as `simulate` writes it;
needs numpy and opencv-contrib-python-headless)
Root mean square of the relative translation and rotation error, in mm and degrees.
"""
import os
import subprocess
import sys
import tempfile

import cv2
import numpy as np

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
TARGET = os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target"))
COMMAND = os.path.join(TARGET, "release", "egomotion")
LK = dict(winSize=(21, 21), maxLevel=3, criteria=(3, 30, 0.01))


def poses(path):
    rows = np.loadtxt(path).reshape(-1, 3, 4)
    return [np.vstack([row, [0, 0, 0, 1]]) for row in rows]


def calibration(folder):
    with open(os.path.join(folder, "calib.txt")) as file:
        lines = dict(line.split(":", 1) for line in file if ":" in line)
    left, right = (np.array(lines[k].split(), float).reshape(3, 4) for k in ("P0", "P1"))
    return left[:, :3], (left[0, 3] - right[0, 3]) / left[0, 0]


def opencv(folder, count):
    """Motion from each frame to the next: where its points are seen from the later camera."""
    camera, baseline = calibration(folder)
    matcher = cv2.StereoSGBM_create(
        0, 128, 5, P1=8 * 25, P2=32 * 25, disp12MaxDiff=1, uniquenessRatio=10, speckleWindowSize=100,
        speckleRange=2, preFilterCap=63, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    read = lambda side, k: cv2.imread(os.path.join(folder, f"image_{side}/{k:06d}.png"), cv2.IMREAD_GRAYSCALE)
    motions, left = [], read(0, 0)
    for k in range(count - 1):
        disparity = matcher.compute(left, read(1, k)).astype(np.float32) / 16
        after = read(0, k + 1)
        corners = cv2.goodFeaturesToTrack(left, 2000, 0.001, 7)
        there, forward, _ = cv2.calcOpticalFlowPyrLK(left, after, corners, None, **LK)
        back, backward, _ = cv2.calcOpticalFlowPyrLK(after, left, there, None, **LK)
        at, there = corners.reshape(-1, 2), there.reshape(-1, 2)
        u, v = np.round(at).astype(int).T
        d = disparity[v, u]
        ok = (forward & backward).ravel().astype(bool) & (d > 1)
        ok &= np.linalg.norm(back.reshape(-1, 2) - at, axis=1) < 0.5
        rays = np.column_stack([at, np.ones(len(at))]) @ np.linalg.inv(camera).T
        points = (rays * (camera[0, 0] * baseline / np.where(ok, d, 1))[:, None])[ok]
        _, r, t, inliers = cv2.solvePnPRansac(
            points, there[ok], camera, None, reprojectionError=1.0, iterationsCount=300, confidence=0.999
        )
        inliers = inliers.ravel()
        r, t = cv2.solvePnPRefineLM(points[inliers], there[ok][inliers], camera, None, r, t)
        motions.append((cv2.Rodrigues(r)[0], t.ravel()))
        left = after
    return motions


def errors(motions, truth):
    """Root mean square of translation (m) and rotation (degrees) of what remains against the truth."""
    translation, rotation = [], []
    for k, (r, t) in enumerate(motions):
        found = np.eye(4)
        found[:3, :3], found[:3, 3] = r, t
        rest = found @ np.linalg.inv(truth[k]) @ truth[k + 1]
        translation.append(np.linalg.norm(rest[:3, 3]))
        rotation.append(np.degrees(np.arccos(np.clip((np.trace(rest[:3, :3]) - 1) / 2, -1, 1))))
    rms = lambda x: float(np.sqrt(np.mean(np.square(x))))
    return rms(translation), rms(rotation)


def ours(folder, observe):
    with tempfile.TemporaryDirectory() as out:
        command = [COMMAND, "run", folder, "--out", out, "--quiet", "--observe", observe]
        subprocess.run(command, check=True, capture_output=True)
        chain = poses(os.path.join(out, "trajectory_kitti.txt"))
    steps = [np.linalg.inv(b) @ a for a, b in zip(chain, chain[1:])]
    return [(step[:3, :3], step[:3, 3]) for step in steps]


def main():
    subprocess.run(["cargo", "build", "--release", "-q"], cwd=ROOT, check=True)
    for folder in sys.argv[1:]:
        folder = folder.rstrip("/")
        name = os.path.basename(folder)
        truth = next(
            poses(path)
            for path in (os.path.join(folder, "..", "..", "poses", f"{name}.txt"), os.path.join(folder, "poses.txt"))
            if os.path.exists(path)
        )
        cv2.setRNGSeed(1)
        reference = errors(opencv(folder, len(truth)), truth)
        print(f"{name:16s} OpenCV           {1e3 * reference[0]:8.4f} mm {reference[1]:.5f}°")
        for observe in ("sparse", "dense"):
            found = errors(ours(folder, observe), truth)
            print(
                f"{name:16s} egomotion {observe:6s} {1e3 * found[0]:8.4f} mm {found[1]:.5f}°"
                f"  ratio {found[0] / reference[0]:.3f} {found[1] / reference[1]:.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
