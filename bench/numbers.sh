#!/usr/bin/env bash
# SHA-256 of every number that the command writes, to prove that a change of structure changes none.
#
#   bench/numbers.sh BINARY OUT_FOLDER [DATA] > before.txt
#
# Run it with the binaries before and after the change and compare the two lists. Times, words, pages and lists of
# settings are outside the record. Without DATA (default: ../shared/data) only rendered scenes are run.
set -euo pipefail
binary=$(realpath "$1")
mkdir -p "$2"
out=$(realpath "$2")
data=${3:-../shared/data}
if [ -d "$data" ]; then data=$(realpath "$data"); else data=; fi
cd "$out"

# Run the command into the folder of that name; its own words go to a log.
record() {
    local name=$1
    shift
    "$binary" "$@" --out "$out/$name" >"$out/$name.log" 2>&1 || { echo "failed: $name: $*" >&2; exit 1; }
}

record demo demo
record simulate simulate --sequence C --frames 4 --size 320x240 --seed 3
record simulated-maps run "$out/simulate" --maps --maps-as pfm,npy,kitti
record sparse-left-right run "$out/simulate" --observe sparse
record table study table --sequence C --draws 3
record consistency study consistency --sequence C,lab-E --draws 2
record efficiency study efficiency --sequence C,lab-E --draws 20
record sensitivity study sensitivity --sequence B --draws 1
record uncertainty study uncertainty --draws 20
record assumptions study assumptions
for choice in "ml discrete irls" "ml differential irls" "dcce discrete ls" "dcce discrete eiv" \
    "dcce differential irls" "dcce differential lmeds" "dv discrete lmeds" "dv differential irls" "joint discrete irls" \
    "joint differential ls" "rigid discrete lmeds" "linear22 discrete irls"; do
    read -r method approach estimator <<<"$choice"
    record "$method-$approach-$estimator" run "$out/simulate" --method "$method" --approach "$approach" \
        --estimator "$estimator" --maps
done
record given run "$out/simulate" --disparity "$out/simulated-maps/disparity" --flow "$out/simulated-maps/flow" --maps

if [ -n "$data" ]; then
    kitti=$data/kitti_odometry/sequences
    record kitti06 run "$kitti/06"
    record kitti06-sparse run "$kitti/06" --observe sparse
    record kitti06-dcce run "$kitti/06" --method dcce --approach differential
    record kitti06-reverse run "$kitti/06" --stride 2 --reverse --frames 8 --maps
    record kitti05 run "$kitti/05" --frames 12
    record karlsruhe run "$data/karlsruhe_0019" --frames 8
    record euroc run "$data/euroc_mh01"
    record euroc-static run "$data/euroc_v101_static"
    record desk run "$data/tum_rgbd/freiburg1_desk" --maps
    record rpy run "$data/tum_rgbd/freiburg1_rpy" --frames 6
    record tartanair1 run "$data/tartanair_v1/P"
    record tartanair2 run "$data/tartanair_v2/P000" --maps
    record tartanair2-depth run "$data/tartanair_v2/P000" --sensor depth
    record feature-tracks run "$data/kitti_feature_tracks/0027.npz" --frames 300
    record scenes2012 run "$data/kitti_stereo_flow_2012/training" --maps
    record scenes2015 run "$data/kitti_scene_flow_2015/training" --maps
    record motorcycle run "$data/middlebury_2014_motorcycle" --maps
    record real study real "$kitti/06" --frames 6
fi

find . -type f \( -name '*.csv' -o -name 'trajectory_*' -o -name '*.pfm' -o -name '*.flo' -o -name '*.npy' -o -name '*.png' \
    -o -name '*.txt' -o -name 'motion.toml' \) ! -name 'settings*' -print0 | LC_ALL=C sort -z | xargs -0 sha256sum
