#!/bin/bash
# hexwalk park from made-up statues, hexwalk tour through it, and the seconds that hexwalk build tells
# of its stages.
#   test_park_tour.sh PROGRAM
set -uo pipefail

hexwalk=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0

fail() {
    printf 'FAILED: %s\n' "$1"
    sed 's/^/    /' log
    failures=$((failures + 1))
}

# run ARGUMENT... - must succeed; output goes to `log`.
run() { "$hexwalk" "$@" >log 2>&1 </dev/null || { fail "hexwalk $*"; return 1; }; }

# check NAME FILE EXPRESSION - reads the JSON file as `r`; the expression must hold.
check() {
    python3 - "${@:2}" >log 2>&1 <<'PYTHON' || fail "$1"
import json, math, sys
r = json.load(open(sys.argv[1]))
assert eval("(" + sys.argv[2] + ")"), (sys.argv[2], str(r)[:2000])
PYTHON
}

# A ball of so many rings as OFF, or as OBJ.
ball() {
    awk -v rings="$1" -v format="$2" 'BEGIN {
        pi = 3.14159265; sides = 2 * rings; n = (rings - 1) * sides + 2
        v = format == "obj" ? "v " : ""; f = format == "obj" ? "f " : "3 "; one = format == "obj"
        if (format == "off") print "OFF\n" n, 2 * sides * (rings - 1), 0
        for (i = 1; i < rings; i++) for (j = 0; j < sides; j++) {
            a = pi * i / rings; b = 2 * pi * j / sides
            printf "%s%.5f %.5f %.5f\n", v, sin(a) * cos(b), sin(a) * sin(b), cos(a)
        }
        print v "0 0 1"; print v "0 0 -1"
        for (j = 0; j < sides; j++) {
            k = (j + 1) % sides; last = (rings - 2) * sides
            print f n - 2 + one, j + one, k + one
            print f n - 1 + one, last + k + one, last + j + one
            for (i = 0; i < rings - 2; i++) {
                p = i * sides + j + one; q = i * sides + k + one
                print f p, p + sides, q + sides; print f p, q + sides, q
            }
        }
    }'
}

echo 'not run' >log
mkdir statues
rings=6
for name in man bull cow homer camel head refined_elephant armadillo lion-head mannequin-devil \
    ChineseDragon-10kv triceratops diplodocus dino hand; do
    ball $rings off >"statues/$name.off"
done
ball $rings obj >statues/bunny.obj
# 3DS is chunks of an identifier, a length and a content each.
python3 - statues/man.off statues/horse.3ds <<'PYTHON'
import struct, sys
numbers = open(sys.argv[1]).read().split()[1:]
n, m = int(numbers[0]), int(numbers[1])
points = [float(x) for x in numbers[3:3 + 3 * n]]
faces = [int(x) for x in numbers[3 + 3 * n:]]
chunk = lambda kind, content: struct.pack("<HI", kind, 6 + len(content)) + content
vertices = chunk(0x4110, struct.pack(f"<H{3 * n}f", n, *points))
triangles = chunk(0x4120, struct.pack("<H", m) + b"".join(
    struct.pack("<4H", *faces[4 * i + 1:4 * i + 4], 0) for i in range(m)))
ball = chunk(0x4000, b"horse\0" + chunk(0x4100, vertices + triangles))
open(sys.argv[2], "wb").write(chunk(0x4D4D, chunk(0x3D3D, ball)))
PYTHON
triangles=$((4 * rings * (rings - 1)))

# 12 statues of the triangles above each; the same seed makes the same park, another another.
for park in 'a 5' 'b 5' 'c 6'; do
    run park --objects 12 --seed "${park#* }" --statues statues -o "${park% *}.glb" \
        --json "${park% *}.json" --quiet
done
cmp a.glb b.glb >log 2>&1 || fail 'the same seed made another park'
! cmp -s a.glb c.glb || fail 'another seed made the same park'
run info a.glb --json info.json && check 'the park' info.json "
    r['kind'] == 'scene' and r['objects'] == 12 and r['triangles'] == 12 * $triangles"

# A closed loop at eye height, as fast as it may be and no faster, clear of everything.
if run tour a.glb -o tour.json --json figures.json --speed 20 --turn 90 --eye-height 9 \
    --clearance 3 --quiet; then
    check 'the figures of the tour' figures.json '
        r["closest"] >= 3 and r["length"] > 50 and abs(r["frames"] / 60 - r["seconds"]) < 0.1
        and r["length"] / r["seconds"] <= 20'
    check 'the tour' tour.json '
        len(r["frames"]) > 120 and all(abs(f["t"] - i / 60) < 1e-6 for i, f in enumerate(r["frames"]))
        and all(abs(f["eye"][2] - 9) < 1e-3 and f["up"] == [0, 0, 1]
                and abs(math.hypot(*f["forward"]) - 1) < 1e-5 for f in r["frames"])
        and all(math.dist(a["eye"], b["eye"]) < 20.01 / 60
                and math.dist(a["forward"], b["forward"]) < math.radians(90.1) / 60
                for a, b in zip(r["frames"], r["frames"][1:] + r["frames"][:1]))
        and max(math.dist(a["eye"], b["eye"]) for a, b in zip(r["frames"], r["frames"][1:])) > 15 / 60
        and r["frames"] != [] and len(r["frames"]) == json.load(open("figures.json"))["frames"]'
fi

# Stages follow one another; the parts of cells are added up over the threads.
if run build a.glb -o data --cell-size 60 --threads 2 --json build.json --quiet; then
    stages='["import", "chain", "mesh", "rays", "cell"]'
    parts='["classify", "simplify", "capture", "pack", "write"]'
    check 'the seconds of the build' build.json "
        all(r[s + '_seconds'] >= 0 for s in $stages + ['total'])
        and all(0 <= r['cell_' + p + '_thread_seconds'] <= 2 * r['cell_seconds'] + 0.1 for p in $parts)
        and 0 < sum(r[s + '_seconds'] for s in $stages) <= r['total_seconds'] + 1e-3
        and r['chain_seconds'] > 0 and r['cell_seconds'] > 0 and r['cell_capture_thread_seconds'] > 0"
fi

echo "$failures failures"
[[ $failures -eq 0 ]]
