#!/bin/bash
# A long walk at random through a dataset, off screen and as fast as it goes: no error, nobody inside
# of an object, no growth of memory. HEXWALK_RANDOM_WALK: how many seconds are walked.
#   test_random_walk.sh PROGRAM
set -euo pipefail

hexwalk=$(realpath "$1")
here=$(cd "$(dirname "$0")" && pwd)
seconds=${HEXWALK_RANDOM_WALK:-600}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
# shellcheck source=scenes.sh
source "$here/scenes.sh"

make_scene 12 >scene.obj
"$hexwalk" build scene.obj -o data --cell-size 30 --levels 2 --quiet >/dev/null
"$hexwalk" walk data --random-walk "$seconds" --size 160x160 --quiet >out || {
    echo 'FAILED: the walk'
    exit 1
}
cat out
read -r frames crossings bumps < <(sed -nE \
    's/^random walk: ([0-9]+) frames, .*, ([0-9]+) crossings, ([0-9]+) bumps$/\1 \2 \3/p' out)
read -r half end < <(sed -nE 's/^memory +([0-9]+).* MB half way, ([0-9]+).* MB at the end.*/\1 \2/p' out)
[[ $frames -eq $((seconds * 30)) ]] || { echo "FAILED: $frames frames"; exit 1; }
[[ $crossings -gt $((seconds / 10)) ]] || { echo "FAILED: only $crossings crossings"; exit 1; }
[[ $bumps -gt $((seconds / 10)) ]] || { echo "FAILED: only $bumps bumps"; exit 1; }
[[ $end -le $((half + 10)) ]] || { echo "FAILED: memory grew from $half to $end MB"; exit 1; }
