#!/usr/bin/env bash
# Prints a table of the hard cases (docs/stability.md): of each measure of the hard cases the worst figure over all that was varied.
#
# bash docs/stability.sh [FILE]    FILE: what the hard cases printed; without it they are run, which takes minutes.
set -euo pipefail
cd "$(dirname "$0")/.."
if [ $# -gt 0 ]; then
    cat "$1"
else
    cargo test --locked --release --test contact hard_cases -- --nocapture
fi | awk -F ' *[|] *' '
    /^### / { room = substr($0, 5); next }
    room == "" || NF < 8 || $2 == "case" || $2 ~ /^-/ { next }
    {
        sub(/, worst combination/, "", $4)
        key = room SUBSEP $4 SUBSEP $6
        if (!rows[key]++) { keys[++count] = key; worst[key] = $5 }
        if ($6 ~ /^>/ ? $5 + 0 < worst[key] + 0 : $5 + 0 > worst[key] + 0) worst[key] = $5
        if (!((key, $2) in seen)) { seen[key, $2] = 1; cases[key] = cases[key] (cases[key] == "" ? "" : ", ") $2 }
        if ($7 != "pass") failed[key] = " **failed**"
    }
    END {
        for (k = 1; k <= count; k++) {
            split(keys[k], part, SUBSEP)
            if (part[1] != last) printf "\n### %s\n\n| case: measure | worst | bound |\n|---|---:|---:|\n", part[1]
            last = part[1]
            names = split(cases[keys[k]], name, ", ")
            printf "| %s: %s | %s%s | %s |\n", (names > 2 ? names " cases" : cases[keys[k]]), part[2], worst[keys[k]], failed[keys[k]], part[3]
        }
    }'
