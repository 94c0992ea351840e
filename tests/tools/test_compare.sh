#!/bin/bash
# hexwalk compare as a user meets it: figures of meshes with known answers, the heat map, and what
# happens when something is wrong.
#   test_compare.sh PROGRAM
set -uo pipefail

hexwalk=$(realpath "$1")
source "$(dirname "${BASH_SOURCE[0]}")/scenes.sh"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0

fail() {
    printf 'FAILED: %s\n' "$1"
    sed 's/^/    /' log
    failures=$((failures + 1))
}

# run CODE PATTERN ARGUMENT... - the exit code must be CODE, and what is printed hold PATTERN.
run() {
    local code=$1 pattern=$2 got
    shift 2
    "$hexwalk" "$@" >log 2>&1 </dev/null
    got=$?
    [[ $got -eq $code ]] || { fail "hexwalk $* exited with $got, not $code"; return 1; }
    grep -qE -- "$pattern" log || fail "hexwalk $* printed no '$pattern'"
}

# check FILE EXPRESSION - the expression over the report `r` must hold.
check() {
    python3 - "$1" "$2" >log 2>&1 <<'PYTHON' || fail "$1: $2"
import json, sys
r = json.load(open(sys.argv[1]))
assert eval(sys.argv[2]), json.dumps(r, indent=1)
PYTHON
}

# cube SIDE - one with its corner at the origin.
cube() {
    cat <<END
OFF
8 6 0
0 0 0
$1 0 0
$1 $1 0
0 $1 0
0 0 $1
$1 0 $1
$1 $1 $1
0 $1 $1
4 0 3 2 1
4 4 5 6 7
4 0 1 5 4
4 1 2 6 5
4 2 3 7 6
4 3 0 4 7
END
}

cube 1 >a.off
cube 2 >b.off
sed 's/^8 6 0/8 5 0/; $d' <(cube 1) >open.off
make_scene 8 >balls.obj

run 0 '^K_vol +8\.0' compare a.off b.off --json ab.json
grep -q '^K_sil ' log && grep -qE '^A to B ' log || fail 'the table lacks lines'
check ab.json 'set(r) >= {"metro", "k_vol", "k_sliver", "k_l1", "k_l2", "k_sil"}'
check ab.json 'all(set(r["metro"][s]) >= {"max", "mean", "rms"} for s in ("forward", "backward"))'
check ab.json 'abs(r["k_vol"] - 8) < 1e-6 and abs(r["k_sliver"] - (2 + 2 ** .5) / 3) < 1e-6'
# Percent of the diagonal of A: the corner (2, 2, 2) of B is sqrt(3) away, the diagonal of A. Three
# faces of A lie in faces of B; over the others the nearest wall is min(u, v) away, 1/3 on average.
check ab.json 'abs(r["metro"]["backward"]["max"] - 100) < 1e-3'
check ab.json 'abs(r["metro"]["forward"]["mean"] / (100 / 3 ** .5 / 6) - 1) < 0.03'
check ab.json 'abs(r["metro"]["forward"]["max"] - 100 / 3 ** .5) < 1e-3'
check ab.json 'r["metro"]["forward"]["converged"] and r["metro"]["forward"]["samples"] >= 16384'
# B's picture holds A's and is four times as large.
check ab.json 'abs(r["k_sil_share"] - 3) < 0.03 and r["k_l1"] > 0 and r["k_l2"] > 0'
check ab.json 'abs(r["k_sil"] / r["model_pixels"] - r["k_sil_share"]) < 1e-9'

run 0 '^K_vol +1\.0' compare a.off a.off --json aa.json --heatmap aa.ply
check aa.json 'r["k_l1"] == r["k_l2"] == r["k_sil"] == 0 and r["k_vol"] == 1'
check aa.json 'r["metro"]["forward"]["max"] < 1e-3 and r["metro"]["backward"]["max"] < 1e-3'

run 0 '^K_vol +[0-9.]+ +not closed' compare a.off open.off --json open.json --no-images
check open.json 'r["k_vol"] is not None and r["mesh_b"]["open_edges"] == 4'
check open.json 'r["k_l1"] is None and r["k_l2"] is None and r["k_sil"] is None'
! grep -q K_L1 log || fail 'pictures were not left out'

# The same figures with any number of threads; the cap.
run 0 'samples' compare a.off balls.obj --json one.json --threads 1 --seed 7
run 0 'samples' compare a.off balls.obj --json two.json --threads 2 --seed 7
diff <(grep -v '"threads"\|"json"' one.json) <(grep -v '"threads"\|"json"' two.json) >log ||
    fail 'one and two threads differ'
run 0 'not converged' compare a.off b.off --samples 1000 --tolerance 0.0001 --no-images --json cap.json
check cap.json 'r["metro"]["forward"]["samples"] == 1008 and not r["metro"]["forward"]["converged"]'

# The heat map can be read again, has A's triangles, and its colours follow the distance: seven
# corners lie in B's faces, the eighth is one unit away from them.
run 0 'heat map' compare a.off b.off --heatmap heat.ply --json heat.json --no-images
check heat.json 'abs(r["heatmap_max"] - 100 / 3 ** .5) < 1e-3'
run 0 '^triangles +12$' info heat.ply
python3 - heat.ply >log 2>&1 <<'PYTHON' || fail 'the colours of the heat map'
import struct, sys
header, body = open(sys.argv[1], "rb").read().split(b"end_header\n", 1)
lines = [line.split() for line in header.decode().split("\n")]
kinds = [l[1] for l in lines if l and l[0] == "property" and l[1] != "list"]
names = [l[2] for l in lines if l and l[0] == "property" and l[1] != "list"]
layout = struct.Struct("<" + "".join({"float": "f", "uchar": "B"}[kind] for kind in kinds))
for k in range(8):
    v = dict(zip(names, layout.unpack_from(body, k * layout.size)))
    far = v["x"] == v["y"] == v["z"] == 1
    assert (v["red"], v["green"], v["blue"]) == ((253, 231, 37) if far else (68, 1, 84)), v
PYTHON

# What is wrong is named; nothing is written.
printf 'ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n' >nothing.ply
head -c 300 heat.ply >cut.ply
: >empty.off
echo 'This is a letter.' >letter.obj
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 1\n' >flat.obj
before=$(ls)
for file in absent.off nothing.ply cut.ply empty.off letter.obj flat.obj .; do
    run 1 "^hexwalk: .*${file}" compare "$file" a.off --json new.json --heatmap new.ply
    run 1 "^hexwalk: .*${file}" compare a.off "$file" --json new.json --heatmap new.ply
done
run 1 'absent/new.ply' compare a.off b.off --no-images --heatmap absent/new.ply --json new.json
run 1 'absent/new.json' compare a.off b.off --no-images --json absent/new.json
run 2 'missing' compare a.off
run 2 'help compare' compare a.off b.off c.off
run 2 '--tolerance' compare a.off b.off --tolerance 0
run 2 '--samples' compare a.off b.off --samples 1
[[ $(ls) == "$before" ]] || { ls >log; fail 'a failure left something behind'; }

[[ $failures -eq 0 ]]
