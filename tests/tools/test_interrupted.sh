#!/bin/bash
# hexwalk build that is killed, interrupted, or runs out of disk: the next run goes on and ends with the same bytes.
#   test_interrupted.sh PROGRAM
set -uo pipefail

hexwalk=$(realpath "$1")
source "$(dirname "${BASH_SOURCE[0]}")/scenes.sh"
work=$(mktemp -d)
mounted=
trap '[[ -z $mounted ]] || umount "$mounted"; rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() {
    printf 'FAILED: %s\n' "$1"
    [[ ! -e log ]] || sed 's/^/    /' log
    failures=$((failures + 1))
}
build() { "$hexwalk" build balls.obj -o "$1" --cell-size 40 --quiet >log 2>&1 </dev/null; }
# For the background: the signals that it gets reach the program, not a shell round it.
start() { exec "$hexwalk" build balls.obj -o "$1" --cell-size 40 --quiet >log 2>&1 </dev/null; }
same() { diff -rq --exclude=build.json whole "$1" >log || fail "$1 differs from an undisturbed build"; }

make_scene 9 24 >balls.obj
build whole || fail 'an undisturbed build'
cells=$(ls whole/cells/0 | wc -l)

# Killed again and again, each time a little later, until a run comes through.
kills=0 finished=false
for ((delay = 20; delay < 60000; delay += delay / 2)); do
    start killed &
    child=$!
    ( sleep "$(printf '0.%03d' $((delay % 1000)))"; sleep $((delay / 1000)); kill -9 $child ) 2>/dev/null &
    killer=$!
    if wait $child 2>/dev/null; then
        kill $killer 2>/dev/null
        finished=true
        break
    fi
    kills=$((kills + 1))
    [[ ! -e killed/manifest.json ]] || break
done
wait 2>/dev/null
$finished || build killed || fail 'the run after the kills'
((kills >= 2)) || fail "only $kills builds were killed"
same killed
[[ -z $(find killed -name '*.tmp') ]] || fail 'temporary files were left behind'

# Interrupted with Ctrl-C when the first of many cells is there: exit 1, no manifest, a word on how to
# go on.
many=(build few.obj --cell-size 14 --threads 1 --quiet -o)
make_scene 9 6 >few.obj
"$hexwalk" "${many[@]}" many >log 2>&1 </dev/null || fail 'an undisturbed build of many cells'
start_many() { exec "$hexwalk" "${many[@]}" stopped >log 2>&1 </dev/null; }
start_many &
child=$!
while [[ -z $(ls stopped/cells/0 2>/dev/null) ]] && kill -0 $child 2>/dev/null; do sleep 0.02; done
kill -INT $child || fail 'the build to interrupt was over before'
wait $child
code=$?
[[ $code -eq 1 ]] || fail "an interrupted build exited with $code"
grep -q 'goes on where it stopped' log || fail 'an interrupted build does not say how to go on'
[[ ! -e stopped/manifest.json ]] || fail 'an interrupted build wrote a manifest'
(($(ls stopped/cells/0 | wc -l) < $(ls many/cells/0 | wc -l))) || fail 'an interrupted build made all cells'
"$hexwalk" "${many[@]}" stopped >log 2>&1 </dev/null || fail 'the run after an interruption'
diff -rq --exclude=build.json many stopped >log || fail 'stopped differs from an undisturbed build'

# A disk that fills up: exit 1, the file and the cause are named, what is there stays; with room again it goes on.
mkdir small
if mount -t tmpfs -o size=256k tmpfs small 2>/dev/null; then
    mounted=$work/small
    build small/data
    [[ $? -eq 1 ]] || fail 'a full disk is not an error'
    grep -q 'small/data/.*[Nn]o space left' log || fail 'the error does not name the file and the full disk'
    [[ ! -e small/data/manifest.json ]] || fail 'a manifest on a full disk'
    mount -o remount,size=64m small
    build small/data || fail 'the run after a full disk'
    same small/data
else
    echo 'no right to mount: the full disk was not tried'
fi

echo "$cells cells, $kills kills, $failures failures"
[[ $failures -eq 0 ]]
