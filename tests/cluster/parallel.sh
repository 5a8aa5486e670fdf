#!/usr/bin/env bash
# A bake in shards by GNU parallel, with the lines of `haptize plan`; each shard has one thread. Needs parallel, and the program.
#
#   cargo build --release && bash tests/cluster/parallel.sh [PROGRAM]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
program=$(realpath "${1:-$here/../../target/release/haptize}")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
mkdir bin
ln -s "$program" bin/haptize
PATH=$folder/bin:$PATH
cp "$here/../scenes/sphere.toml" scene.toml
haptize plan scene.toml --shards 8 --json >plan.json
python3 -c 'import json; print("\n".join(json.load(open("plan.json"))["lines"]["parallel"]))' >lines.sh
cat lines.sh
time haptize bake scene.toml --backend cpu -o one.haptize
time bash -e lines.sh
data() { python3 -c 'import sys; b = open(sys.argv[1], "rb").read(); sys.stdout.buffer.write(b[8 + int.from_bytes(b[:8], "little"):])' "$1"; }
cmp <(data one.haptize) <(data scene.haptize)
echo 'the merged dataset has the bits of one bake'
