#!/usr/bin/env bash
# Imports ten robots of others as their makers wrote them, bakes and plays each, and prints a table (docs/robots.md).
# Takes some minutes, and 280 MB from the Python package index.
#
#   bash docs/robots.sh [HAPTIZE]        the program; by default it is built
set -euo pipefail
cd "$(dirname "$0")/.."
haptize=${1:-}
if [[ -z $haptize ]]; then
    cargo build --locked --release
    haptize=$PWD/target/release/haptize
fi
haptize=$(realpath "$haptize")
robots=$PWD/out/robots
mkdir -p "$robots"
cd "$robots"

# Robots as they are published: URDF with STL and COLLADA meshes, MJCF with STL and OBJ meshes.
if ! python3 -m pip download --quiet --no-deps --only-binary :all: example-robot-data==6.0.0 robosuite==1.5.2; then
    echo "the Python package index is out of reach: no robot is imported" >&2
    exit 1
fi
for wheel in *.whl; do python3 -m zipfile -e "$wheel" .; done
urdf=$(find . -path '*/example-robot-data/robots' -print -quit)
mjcf=robosuite/models/assets/robots

# Name, file, tip, and joints that are held.
table="Franka Panda|$urdf/panda_description/urdf/panda.urdf|panda_link8|panda_joint7=0
UR5|$urdf/ur_description/urdf/ur5_robot.urdf|tool0|
Kinova j2s6s200|$urdf/kinova_description/robots/kinova.urdf|j2s6s200_end_effector|
Unitree Z1|$urdf/z1_description/urdf/z1.urdf|gripperStator|
SO-101|$urdf/so_arm_description/urdf/so101.urdf|gripper_link|
Allegro finger|$urdf/allegro_hand_description/urdf/allegro_right_hand.urdf|link_3.0_tip|
Sawyer|$mjcf/sawyer/robot.xml|right_hand|right_j6=0
LBR iiwa|$mjcf/iiwa/robot.xml|right_hand|joint_7=0
Kinova Gen3|$mjcf/kinova3/robot.xml|right_hand|Actuator7=0
UR5e|$mjcf/ur5e/robot.xml|right_hand|"

# The value of a key in the report of a command, as it is or in other digits; a dash where there is none.
field() {
    python3 -c 'import json, sys; print(f"{json.load(open(sys.argv[1]))[sys.argv[2]]:{sys.argv[3]}}")' \
        "$1.json" "$2" "${3:-}" 2>/dev/null || echo "-"
}

echo "| robot | format | joints | contact nodes | points, in contact | not converged | torque (N m) |"
echo "|---|---|---|---|---|---|---|"
number=0
while IFS='|' read -r name file tip held; do
    number=$((number + 1))
    scene=robot$number.toml
    format=URDF
    [[ $file == *.xml ]] && format=MJCF
    log=robot$number.log
    rm -f import.json bake.json play.json
    if ! "$haptize" import "$file" --tip "$tip" ${held:+--lock "$held"} --force -o "$scene" --json >import.json 2>"$log"; then
        echo "| $name | $format | refused: $(tail -1 "$log") | | | | |"
        continue
    fi
    read -r joints nodes < <(python3 -c 'import json; i = json.load(open("import.json")); print(len(i["joints"]), sum(i["nodes"]))')
    "$haptize" bake "$scene" --backend cpu --force --json -o "robot$number.haptize" >bake.json 2>>"$log" || true
    "$haptize" play "robot$number.haptize" --json >play.json 2>>"$log" || true
    echo "| $name | $format | $joints | $nodes | $(field bake points), $(field bake contact_points) |" \
        "$(field bake unconverged) | $(field play max_device_torque .2f) |"
done <<<"$table"
