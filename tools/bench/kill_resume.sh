#!/bin/bash
# Kills builds with SIGKILL at random moments and lets the next one go on, until KILLS builds were killed; each dataset that
# gets finished on the way must equal an undisturbed one byte by byte, with nothing else in its folder. Every third dataset is
# built within a bound of memory, every third as two shards in one folder.
#   kill_resume.sh PROGRAM SCENE [KILLS [SEED [BUILD-OPTION...]]]
set -uo pipefail

hexwalk=$(realpath "$1") scene=$(realpath "$2") kills_wanted=${3:-50}
RANDOM=${4:-1}
options=("${@:5}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
kills=0 datasets=0 runs=0

die() {
    printf 'FAILED after %d kills: %s\n' "$kills" "$1"
    [[ ! -s log ]] || sed 's/^/    /' log
    exit 1
}
build() { exec "$hexwalk" build "$scene" --quiet "${options[@]}" "$@" >log 2>&1 </dev/null; }

start=$(date +%s%N)
(build -o whole) || die 'the undisturbed build'
duration_ms=$((($(date +%s%N) - start) / 1000000))

# run ARGUMENT... - one build, killed after a random time of at most 1.2 undisturbed builds; true if it came through.
run() {
    local delay child killer code
    delay=$(((RANDOM * 32768 + RANDOM) % (duration_ms * 12 / 10 + 1)))
    runs=$((runs + 1))
    build "$@" &
    child=$!
    (sleep "$((delay / 1000)).$(printf '%03d' $((delay % 1000)))"; kill -9 $child) 2>/dev/null &
    killer=$!
    wait $child 2>/dev/null
    code=$?
    kill $killer 2>/dev/null
    wait $killer 2>/dev/null
    case $code in
    0) return 0 ;;
    137) kills=$((kills + 1)); return 1 ;;
    *) die "a build that goes on exited with $code" ;;
    esac
}

while ((kills < kills_wanted)); do
    rm -rf killed
    extra=()
    ((datasets % 3 != 1)) || extra=(--memory 16G)
    if ((datasets % 3 == 2)); then
        shards=(1/2 2/2)
    else
        shards=(1/1)
    fi
    for shard in "${shards[@]}"; do
        tries=0
        # After many kills of one dataset a run is let through, or a slow machine might never finish.
        until ((kills >= kills_wanted || tries++ >= 12)); do
            run -o killed --shard "$shard" "${extra[@]}" && continue 2
            [[ ! -e killed/manifest.json ]] || diff -rq --exclude=build.json --exclude='*.tmp' whole killed >log ||
                die 'a manifest in a dataset that is not finished'
        done
        (build -o killed --shard "$shard" "${extra[@]}") || die 'the last run'
    done
    diff -rq --exclude=build.json whole killed >log || die 'the dataset differs from an undisturbed one'
    datasets=$((datasets + 1))
done
printf '%d runs, %d killed, %d datasets finished, all as an undisturbed build (%d ms) makes them\n' \
    "$runs" "$kills" "$datasets" "$duration_ms"
