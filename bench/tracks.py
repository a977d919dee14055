"""Four-way sparse tracks on KITTI: ours beside OpenCV's corners and Lucas-Kanade, alternating.

usage: python bench/tracks.py SEQUENCE [ROUNDS]   (SEQUENCE holds image_0, image_1; needs opencv-contrib-python-headless)
Builds and runs the program `time_tracks` of the benches; prints milliseconds a pair, least and median, on two threads.
"""
import os
import subprocess
import sys
import time

import cv2
import numpy as np

from timing import program

FRAMES = 11
THREADS = 2
CORNERS = 2000
LK = dict(winSize=(21, 21), maxLevel=3)


def opencv(frames, wanted):
    """Corners of the left image followed to the right one and to the next left one, each there and back."""
    times, tracks = [], []
    for (left, right), (left_next, right_next) in zip(frames, frames[1:]):
        start = time.perf_counter()
        corners = cv2.goodFeaturesToTrack(left, wanted, 0.001, 7)
        ok = np.ones(len(corners), bool)
        there = corners
        for a, b in ((left, left_next),):
            there, forward, _ = cv2.calcOpticalFlowPyrLK(a, b, corners, None, **LK)
            back, backward, _ = cv2.calcOpticalFlowPyrLK(b, a, there, None, **LK)
            ok &= (forward.ravel() & backward.ravel()).astype(bool)
            ok &= np.linalg.norm((back - corners).reshape(-1, 2), axis=1) < 0.5
        one_way = time.perf_counter() - start
        for a, b, points in ((left, right, corners), (left_next, right_next, there)):
            found, forward, _ = cv2.calcOpticalFlowPyrLK(a, b, points, None, **LK)
            back, backward, _ = cv2.calcOpticalFlowPyrLK(b, a, found, None, **LK)
            ok &= (forward.ravel() & backward.ravel()).astype(bool)
            ok &= np.linalg.norm((back - points).reshape(-1, 2), axis=1) < 0.5
        times.append((one_way * 1e3, (time.perf_counter() - start) * 1e3))
        tracks.append(int(ok.sum()))
    return np.array(times), np.mean(tracks)


def main():
    folder = sys.argv[1]
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    cv2.setNumThreads(THREADS)
    ours = program("egomotion", "time_tracks")
    read = lambda side, k: cv2.imread(os.path.join(folder, f"image_{side}/{k:06d}.png"), cv2.IMREAD_GRAYSCALE)
    frames = [(read(0, k), read(1, k)) for k in range(FRAMES)]
    environment = dict(os.environ, RAYON_NUM_THREADS=str(THREADS))
    theirs, mine = [], {1200: [], 3000: [], 7000: []}
    for _ in range(rounds):
        for cells, found in mine.items():
            command = [ours, folder, str(FRAMES), str(cells)]
            line = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
            found.append([float(x) for x in line.stdout.split()])
        times, survived = opencv(frames, CORNERS)
        theirs.append([survived, *times.min(0), *np.median(times, 0)])
    survived, flow, four = np.min(theirs, 0)[:3]
    flow_median, four_median = np.median(theirs, 0)[3:]
    print(f"load {os.getloadavg()[0]:.1f}; {FRAMES} frames, {rounds} rounds, {THREADS} threads; ms a pair, least (median)")
    print(f"OpenCV     {CORNERS} corners, LK there and back in time: {flow:.1f} ({flow_median:.1f});"
          f" four-way {four:.1f} ({four_median:.1f}), {survived:.0f} tracks left")
    for cells, found in mine.items():
        count, build, _, track, _ = np.min(found, 0)
        _, _, build_median, _, track_median = np.median(found, 0)
        least, median = build + track, build_median + track_median
        print(f"egomotion  {cells} cells: {count:.0f} four-way tracks left; pyramids {build:.1f} ({build_median:.1f}),"
              f" corners and tracks {track:.1f} ({track_median:.1f})")
        print(f"           ratio to there and back {least / flow:.2f} ({median / flow_median:.2f}),"
              f" to four-way {least / four:.2f} ({median / four_median:.2f})")


if __name__ == "__main__":
    main()
