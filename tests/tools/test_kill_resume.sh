#!/bin/bash
# Five of the kills of tools/bench/kill_resume.sh.
#   test_kill_resume.sh PROGRAM
set -uo pipefail

here=$(dirname "${BASH_SOURCE[0]}")
source "$here/scenes.sh"
scene=$(mktemp --suffix=.obj)
trap 'rm -f "$scene"' EXIT
make_scene 9 8 >"$scene"
"$here/../../tools/bench/kill_resume.sh" "$1" "$scene" 5 7 --cell-size 80
