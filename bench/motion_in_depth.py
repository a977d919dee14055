"""Motion in depth on KITTI scene flow 2015: |ln(d/d') - truth| x 1e4, and how true the stated sigma is.

usage: python bench/motion_in_depth.py TRAINING_FOLDER [COMMAND]   (COMMAND: the egomotion binary; else it is built)
Runs the command with its default method (rigid prior) and with `--method dv` (none); needs numpy and pillow.
Pixels that move by themselves: the true flow is more than 3 px from that of the estimated rigid motion.
"""
import csv
import os
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image

SHARES = (50, 80, 90, 95, 100)


def pfm(path):
    with open(path, "rb") as file:
        file.readline()
        width, height = map(int, file.readline().split())
        order = "<f4" if float(file.readline()) < 0 else ">f4"
        return np.frombuffer(file.read(), order).reshape(height, width)[::-1].astype(float)


def png16(path):
    """One 16-bit channel."""
    return np.array(Image.open(path)).astype(float)


def flow_png(path):
    """(u, v, valid) of KITTI's three channels of 16 bit, which pillow cannot read."""
    import struct
    import zlib
    data = open(path, "rb").read()
    at, packed, width, height = 8, b"", 0, 0
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if kind == b"IHDR":
            width, height = struct.unpack(">II", body[:8])
        if kind == b"IDAT":
            packed += body
        at += 12 + length
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + 6 * width)
    out, last = np.zeros((height, 6 * width), np.uint8), np.zeros(6 * width, np.uint8)
    for v in range(height):
        kind, row = rows[v, 0], rows[v, 1:].astype(int)
        if kind in (1, 3, 4):
            done = np.zeros(6 * width + 6, int)
            up = np.concatenate([np.zeros(6, int), last.astype(int)])
            for i in range(6 * width):
                a, b, c = done[i], up[i + 6], up[i]
                if kind == 1:
                    guess = a
                elif kind == 3:
                    guess = (a + b) // 2
                else:
                    p = a + b - c
                    near = (abs(p - a), abs(p - b), abs(p - c))
                    guess = a if near[0] <= near[1] and near[0] <= near[2] else b if near[1] <= near[2] else c
                done[i + 6] = (row[i] + guess) & 255
            last = done[6:].astype(np.uint8)
        else:
            last = (row.astype(np.uint8) + (last if kind == 2 else 0)).astype(np.uint8)
        out[v] = last
    wide = out.reshape(height, width, 3, 2).astype(int)
    value = wide[..., 0] * 256 + wide[..., 1]
    return (value[..., 0] - 32768) / 64, (value[..., 1] - 32768) / 64, value[..., 2] > 0


def rotation(w):
    angle = np.linalg.norm(w)
    k = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    s = max(angle, 1e-12)
    r = np.eye(3) + np.sin(s) / s * k + (1 - np.cos(s)) / s**2 * k @ k
    u = np.eye(3) + (1 - np.cos(s)) / s**2 * k + (s - np.sin(s)) / s**3 * k @ k
    return r, u


def moves_by_itself(folder, name, rig, phi, truth):
    """Where the true flow is not that of the rigid motion, with the true disparity."""
    f, cx, cy, b = rig
    d = truth
    u, v = np.meshgrid(np.arange(d.shape[1]), np.arange(d.shape[0]))
    with np.errstate(divide="ignore", invalid="ignore"):
        z = b * f / d
        points = np.stack([(u - cx) * z / f, (v - cy) * z / f, z])
        r, part = rotation(phi[3:])
        moved = np.tensordot(r, points, 1) + (part @ phi[:3])[:, None, None]
        du, dv = f * moved[0] / moved[2] + cx - u, f * moved[1] / moved[2] + cy - v
    tu, tv, valid = flow_png(os.path.join(folder, "flow_occ", name + "_10.png"))
    return (np.hypot(tu - du, tv - dv) > 3) & valid & (d > 0)


def calibration(folder, name):
    for line in open(os.path.join(folder, "calib_cam_to_cam", name + ".txt") if os.path.isdir(
            os.path.join(folder, "calib_cam_to_cam")) else os.path.join(folder, "calib_cam", name + ".txt")):
        key, *rest = line.split()
        if key == "P_rect_02:":
            left = [float(x) for x in rest]
        if key == "P_rect_03:":
            right = [float(x) for x in rest]
    return left[0], left[2], left[6], (left[3] - right[3]) / left[0]


def motion(out, name):
    row = next(csv.DictReader(open(os.path.join(out, name, "motion.csv"))))
    return np.array([float(row[k]) for k in ("tx", "ty", "tz", "wx", "wy", "wz")])


def figures(name, error, sigma, known, answered):
    """Mean error of the share of the known pixels with the least stated sigma; coverage of 2 sigma."""
    both = known & answered
    ranked = error[both][np.argsort(sigma[both], kind="stable")]
    total = known.sum()
    if total == 0:
        return
    parts = []
    for share in SHARES:
        count = total * share // 100
        parts.append(f"{1e4 * ranked[:count].mean():6.1f}" if 0 < count <= len(ranked) else "     -")
    within = np.mean(error[both] <= 2 * sigma[both]) if both.any() else np.nan
    print(f"  {name:34s} {total:6d} px, {100 * len(ranked) / total:5.1f} % answered: "
          + " ".join(parts) + f" | all {1e4 * ranked.mean() if len(ranked) else np.nan:6.1f}"
          + f" median {1e4 * np.median(ranked) if len(ranked) else np.nan:5.1f}; {100 * within:4.1f} % within 2 sigma")


def scene(folder, out, name, phi):
    where = os.path.join(out, name)
    frame = next(f for f in os.listdir(os.path.join(where, "depth_velocity")))
    read = lambda kind: pfm(os.path.join(where, kind, frame))
    f, cx, cy, b = rig = calibration(folder, name)
    d0 = png16(os.path.join(folder, "disp_occ_0", name + "_10.png")) / 256
    d1 = png16(os.path.join(folder, "disp_occ_1", name + "_10.png")) / 256
    known = (d0 > 0) & (d1 > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        truth = np.log(d0 / d1)
        z = b * f / read("disparity")
        vz, sigma = read("depth_velocity"), read("depth_velocity_sigma")
        answer = np.log((z + vz) / z)
        spread = sigma / (z + vz)
    answered = np.isfinite(answer)
    alone = moves_by_itself(folder, name, rig, phi, d0)
    error = np.abs(answer - truth)
    figures(name + " all", error, spread, known, answered)
    figures(name + " moving by themselves", error, spread, known & alone, answered)


def main():
    folder = sys.argv[1]
    root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
    if len(sys.argv) > 2:
        command = sys.argv[2]
    else:
        subprocess.run(["cargo", "build", "--release", "-q", "-p", "egomotion-cli"], cwd=root, check=True)
        target = os.environ.get("CARGO_TARGET_DIR", os.path.join(root, "target"))
        command = os.path.join(target, "release", "egomotion")
    names = sorted({name[:6] for name in os.listdir(os.path.join(folder, "disp_occ_1"))})
    print("mean of |ln(d/d') - truth| x 1e4 over the share of the pixels with truth that have least stated sigma:",
          ", ".join(f"{s} %" for s in SHARES))
    phi = {}
    for label, method in (("rigid prior (default method)", "ml"), ("no rigid prior (dv)", "dv")):
        with tempfile.TemporaryDirectory() as out:
            subprocess.run([command, "run", folder, "--maps", "--quiet", "--method", method, "--out", out],
                           check=True, capture_output=True)
            print(label)
            for name in names:
                scene(folder, out, name, phi.setdefault(name, motion(out, name)))


if __name__ == "__main__":
    main()
