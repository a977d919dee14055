"""Does `egomotion evaluate` say what evo says? Writes two trajectories and evo's figures, or checks given ones.

usage: evaluate.py FOLDER            make estimate.txt, truth.txt and expected.json there (the tests' data)
       evaluate.py ESTIMATE TRUTH    print both programs' figures on two TUM files
needs evo (pip install evo); run it in the workspace's root
"""
import json, os, subprocess, sys
import numpy as np
from evo.core import metrics, sync
from evo.core.units import Unit
from evo.tools import file_interface
from scipy.spatial.transform import Rotation

PROGRAM = os.environ.get("EGOMOTION", "target/release/egomotion")
KEYS = ["rmse", "mean", "median", "std", "min", "max", "sse"]


def write_tum(path, times, positions, rotations):
    rows = [" ".join(f"{v:.12f}" for v in (t, *p, *r.as_quat())) for t, p, r in zip(times, positions, rotations)]
    open(path, "w").write("\n".join(rows) + "\n")


def make(folder):
    random = np.random.default_rng(7)
    times = 100 + 0.1 * np.arange(60)
    turn = Rotation.from_rotvec(np.stack([0.002 * np.arange(60), 0.03 * np.arange(60), 0 * times], 1))
    positions = np.cumsum(turn.apply(np.tile([0.05, 0.01, 0.7], (60, 1))), axis=0)
    write_tum(os.path.join(folder, "truth.txt"), times, positions, turn)
    # Another world and scale, noise, clocks that differ a little, and frames that are not there.
    world = Rotation.from_rotvec([0.4, -0.9, 0.3])
    moved = 1.07 * world.apply(positions + 0.02 * random.standard_normal((60, 3))) + [3.0, -2.0, 11.0]
    turned = world * turn * Rotation.from_rotvec(0.003 * random.standard_normal((60, 3)))
    kept = [k for k in range(60) if k not in (7, 8, 31)]
    late = times + 0.004 * random.uniform(-1, 1, 60)
    write_tum(os.path.join(folder, "estimate.txt"), late[kept], moved[kept], turned[kept])
    expected = figures(os.path.join(folder, "estimate.txt"), os.path.join(folder, "truth.txt"))
    json.dump(expected, open(os.path.join(folder, "expected.json"), "w"), indent=1)


def figures(estimate, truth):
    estimate, truth = map(file_interface.read_tum_trajectory_file, (estimate, truth))
    truth, estimate = sync.associate_trajectories(truth, estimate, max_diff=0.01)
    found = {"poses": truth.num_poses}
    for name, options in [("none", None), ("se3", {}), ("sim3", {"correct_scale": True})]:
        laid = sync.associate_trajectories(truth, estimate)[1]
        if options is not None:
            laid.align(truth, **options)
        ape = metrics.APE(metrics.PoseRelation.translation_part)
        ape.process_data((truth, laid))
        found[name] = {"absolute_m": {k: ape.get_all_statistics()[k] for k in KEYS}}
        for label, delta, unit in [("1f", 1, Unit.frames), ("3f", 3, Unit.frames), ("5m", 5, Unit.meters)]:
            for part, relation in [
                ("translation_m", metrics.PoseRelation.translation_part),
                ("rotation_deg", metrics.PoseRelation.rotation_angle_deg),
            ]:
                rpe = metrics.RPE(relation, delta, unit, pairs_from_reference=True)
                rpe.process_data((truth, laid))
                found[name].setdefault(label, {})[part] = {k: rpe.get_all_statistics()[k] for k in KEYS}
    return found


def main():
    if len(sys.argv) == 2:
        return make(sys.argv[1])
    theirs = figures(*sys.argv[1:3])
    for name in ["none", "se3", "sim3"]:
        command = [PROGRAM, "evaluate", *sys.argv[1:3], "--align", name, "--delta", "1f,3f,5m", "--json"]
        ours = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
        print(f"{name}: position {ours['absolute_m']['rmse']:.9f} m, evo {theirs[name]['absolute_m']['rmse']:.9f} m")
        for over in ours["relative"]:
            for part in ("translation_m", "rotation_deg"):
                evo = theirs[name][over["delta"]][part]["rmse"]
                print(f"  over {over['delta']} {part}: {over[part]['rmse']:.9f}, evo {evo:.9f}")


main()
