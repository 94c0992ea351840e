#!/bin/bash
# hexwalk simplify as a user meets it: every metric, meshes and progressive meshes out and in again,
# and what happens when something is wrong.
#   test_simplify.sh PROGRAM
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
    "$hexwalk" simplify "$@" >log 2>&1 </dev/null
    got=$?
    [[ $got -eq $code ]] || { fail "hexwalk simplify $* exited with $got, not $code"; return 1; }
    grep -qE -- "$pattern" log || fail "hexwalk simplify $* printed no '$pattern'"
}

# check FILE EXPRESSION - the expression over the report `r` must hold.
check() {
    python3 - "$1" "$2" >log 2>&1 <<'PYTHON' || fail "$1: $2"
import json, sys
r = json.load(open(sys.argv[1]))
assert eval(sys.argv[2]), json.dumps(r, indent=1)
PYTHON
}

# triangles FILE - of a mesh that was written.
triangles() {
    "$hexwalk" info --quiet "$1" --json info.json >/dev/null 2>&1 || { echo unreadable; return; }
    python3 -c 'import json; print(json.load(open("info.json"))["triangles"])'
}

# between FILE LEAST MOST
between() {
    local n
    n=$(triangles "$1")
    : >log
    [[ $n =~ ^[0-9]+$ && $n -ge $2 && $n -le $3 ]] || fail "$1 has $n triangles, not $2 to $3"
}

# A sheet of SIDE x SIDE quads with waves on it, as OFF: sheet SIDE.
sheet() {
    awk -v n="$1" 'BEGIN {
        printf "OFF\n%d %d 0\n", (n + 1) * (n + 1), 2 * n * n
        for (j = 0; j <= n; j++) for (i = 0; i <= n; i++)
            printf "%d %d %.4f\n", i, j, sin(i * 0.7) * cos(j * 0.9)
        for (j = 0; j < n; j++) for (i = 0; i < n; i++) {
            a = j * (n + 1) + i
            printf "3 %d %d %d\n3 %d %d %d\n", a, a + 1, a + n + 2, a, a + n + 2, a + n + 1
        }
    }'
}

make_scene 8 >balls.obj # ten closed balls
sheet 20 >sheet.off
printf 'OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n' >triangle.off
# Two tetrahedra on one edge; three faces on one.
cat >edge.off <<'END'
OFF
6 8 0
0 0 0
0 0 1
1 -1 0.5
1 1 0.5
-1 1 0.5
-1 -1 0.5
3 0 3 2
3 0 1 3
3 0 2 1
3 1 2 3
3 0 5 4
3 0 1 5
3 0 4 1
3 1 4 5
END
cat >fin.off <<'END'
OFF
5 3 0
0 0 0
1 0 0
0 1 0
0 -1 0
0 0 1
3 0 1 2
3 1 0 3
3 0 1 4
END
balls=$(triangles balls.obj)

# ---- every metric, every placement -----------------------------------------------------------

metrics=$("$hexwalk" help simplify | tr -cs 'a-z' '\n' | sort -u)
for metric in quadric volume silhouette hybrid uvol norm pm edge qem screen viewcell; do
    grep -qx "$metric" <<<"$metrics" || { : >log; fail "the help does not tell of $metric"; }
    eye=()
    case $metric in screen | viewcell) eye=(--eye 120,-300,90) ;; esac
    run 0 "$balls triangles.* -> [0-9]+ triangles" balls.obj -o "$metric.ply" --metric "$metric" \
        --ratio 0.5 "${eye[@]}"
    between "$metric.ply" $((balls / 2 - 1)) $((balls / 2))
done
for placement in 0 1 2 optimal default; do
    run 0 '->' balls.obj -o placed.ply --placement "$placement" --faces 600 --json placed.json
    between placed.ply 599 600
    check placed.json "r['options']['placement'] == '$placement'"
done
run 0 '->' balls.obj -o balls.glb --vertices 400 --json vertices.json
check vertices.json 'r["vertices"] <= 400 and r["vertices"] >= 399'
between balls.glb 700 800 # closed: about two a vertex
run 0 '->' sheet.off -o stages.ply --metric edge:0.5,quadric --faces 100 --json stages.json
between stages.ply 99 100
run 0 '->' sheet.off -o flat.ply --error 1e9 --faces 50
between flat.ply 49 50
run 0 '->' sheet.off -o strict.ply --error 1e-30 --json strict.json
check strict.json 'r["faces"] == r["faces_before"] == 800'
run 0 '->' sheet.off -o pm.ply --metric pm --kappa 1 --kappa-decay 0.5 --hierarchy batched --ratio 0.2
between pm.ply 159 160

# The same bytes again, with any number of threads.
run 0 '->' balls.obj -o one.ply --metric silhouette --ratio 0.3 --threads 1
run 0 '->' balls.obj -o two.ply --metric silhouette --ratio 0.3 --threads 2
cmp one.ply two.ply >log 2>&1 || fail 'one and two threads differ'

# ---- what is told ----------------------------------------------------------------------------

run 0 '80 edges are open borders' sheet.off -o told.ply --ratio 0.5 --json told.json
check told.json 'set(r) >= {"faces_before", "vertices_before", "faces", "vertices", "dropped_faces",
    "split_vertices", "complex_edges", "border_edges", "batches", "seconds", "rss_bytes_peak", "options"}'
check told.json 'r["border_edges"] == 80 and r["faces_before"] == 800 and r["vertices_before"] == 441'
check told.json 'r["batches"] == 0 and "progressive_bytes" not in r and r["options"]["ratio"] == 0.5'
between told.ply "$(python3 -c 'import json; print(json.load(open("told.json"))["faces"])')" 400
run 0 '2 vertices were copied where sheets touch' edge.off -o told.ply --faces 8
run 0 'vertices were copied|not manifold' fin.off -o told.ply --faces 3
run 0 'warning.*--faces 5000' sheet.off -o told.ply --faces 5000
between told.ply 800 800
run 0 'warning.*--vertices 5000' sheet.off -o told.ply --vertices 5000
between told.ply 800 800
run 0 'warning.*--faces 2' triangle.off -o told.ply --faces 2
between told.ply 1 1
run 0 '1 triangles' triangle.off --progressive told.hxp
run 0 '1 triangles of 1' told.hxp -o told.ply
between told.ply 1 1

# ---- progressive meshes ----------------------------------------------------------------------

# same_mesh A B - the same triangles at the same places.
same_mesh() {
    python3 - "$1" "$2" >log 2>&1 <<'PYTHON' || fail "$1 and $2 are different meshes"
import struct, sys

def read(path):
    header, body = open(path, "rb").read().split(b"end_header\n", 1)
    lines = [line.split() for line in header.decode().split("\n")]
    count = {l[1]: int(l[2]) for l in lines if l and l[0] == "element"}
    kinds = [l[1] for l in lines if l and l[0] == "property" and l[1] != "list"]
    layout = struct.Struct("<" + "".join({"float": "f", "uchar": "B"}[k] for k in kinds))
    points = [layout.unpack_from(body, k * layout.size)[:3] for k in range(count["vertex"])]
    at, faces = count["vertex"] * layout.size, []
    for _ in range(count["face"]):
        n, a, b, c = struct.unpack_from("<B3I", body, at)
        at += 13
        corners = [points[a], points[b], points[c]]
        first = corners.index(min(corners))
        faces.append(tuple(corners[first:] + corners[:first]))
    return sorted(faces)

a, b = read(sys.argv[1]), read(sys.argv[2])
assert a == b, (len(a), len(b), len(set(a) ^ set(b)))
PYTHON
}

# A sheet with one more face on an edge within.
sheet 14 | sed 's/^225 392 0$/226 393 0/' >finned.off
sed -i '227a 7 7 9' finned.off
echo '3 112 113 225' >>finned.off

for input in balls.obj sheet.off finned.off; do
    # The whole mesh as Hexwalk imports it: what a limit beyond it leaves.
    run 0 '->' "$input" -o whole.ply --faces 100000
    whole=$(triangles whole.ply)
    for options in '--hierarchy linear' '--hierarchy batched --keep-order' \
        '--hierarchy batched --placement 0 --metric edge'; do
        # shellcheck disable=SC2086
        run 0 'bytes, [0-9.]+ a vertex' "$input" -o coarse.ply --progressive all.hxp --ratio 0.1 \
            --json all.json $options
        check all.json "r['progressive_bytes'] == $(stat -c %s all.hxp)"
        run 0 "$whole triangles of $whole" all.hxp -o back.ply
        same_mesh back.ply whole.ply
        run 0 "triangles of $whole" all.hxp -o back.ply --faces 1
        same_mesh back.ply coarse.ply
        middle=$((whole / 2))
        run 0 "triangles of $whole" all.hxp -o back.ply --faces $middle
        between back.ply 1 $middle
        run 0 "triangles of $whole" all.hxp -o ratio.ply --ratio 0.5
        same_mesh back.ply ratio.ply
    done
done
# What cannot get smaller comes back too.
for input in triangle.off fin.off edge.off; do
    run 0 '->' "$input" -o whole.ply --faces 100000
    run 0 'bytes' "$input" --progressive all.hxp --hierarchy batched
    run 0 'triangles of' all.hxp -o back.ply
    same_mesh back.ply whole.ply
done
run 0 '-> 1 triangles' fin.off -o back.ply --ratio 0.1 # a share of less than one triangle is one
run 0 '->' balls.obj --progressive all.hxp
run 0 "of $balls" all.hxp -o back.glb --faces 700
between back.glb 696 700

run 0 '->' sheet.off --progressive exact.hxp --ratio 0.05
run 0 'triangles of 800' exact.hxp -o back.ply --faces 100 --json back.json
check back.json "r['faces_original'] == 800 and 0 < r['faces'] <= 100 and r['options']['faces'] == 100"
run 0 '->' sheet.off --progressive rough.hxp --ratio 0.05 --precision 10
[[ $(stat -c %s rough.hxp) -lt $(stat -c %s exact.hxp) ]] || { : >log; fail '10 bits take no less'; }
run 0 '800 triangles of 800' rough.hxp -o rough.ply
"$hexwalk" compare sheet.off rough.ply --no-images --json rough.json >log 2>&1 || fail 'compare'
# A step is 20 / 2^10 or so; half of it on each axis, in percent of the diagonal (28.4).
check rough.json '0 < r["metro"]["forward"]["max"] < 100 * 20 / 1024 / 28'

# --bytes: the file is that small, and the mesh is what it holds.
for bytes in 1500 3000 5000; do
    run 0 "bytes, " sheet.off -o fits.ply --progressive fits.hxp --ratio 0.02 --bytes $bytes
    : >log
    [[ $(stat -c %s fits.hxp) -le $bytes ]] || fail "--bytes $bytes: $(stat -c %s fits.hxp)"
    n=$(triangles fits.ply)
    run 0 "$n triangles of $n" fits.hxp -o back.ply
    same_mesh fits.ply back.ply
    [[ $bytes -eq 1500 || $n -gt $last ]] || fail "more bytes give no more triangles: $n"
    last=$n
done
run 0 'bytes, ' sheet.off -o fits.ply --progressive fits.hxp --ratio 0.02 --bytes 10000000
between fits.ply 800 800

# A folder of levels, each about half the one before.
run 0 '[0-9]+ batches' balls.obj -o last.ply --hierarchy batched --ratio 0.05 --levels levels --json levels.json
batches=$(find levels -name 'level_*.ply' | wc -l)
check levels.json "r['batches'] == $batches and $batches > 3"
before=$balls
for level in levels/level_*.ply; do
    between "$level" $((before * 3 / 10)) $((before * 8 / 10))
    before=$(triangles "$level")
done
same_mesh "$(printf 'levels/level_%02d.ply' "$batches")" last.ply

# ---- what is wrong ---------------------------------------------------------------------------

printf 'ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n' >nothing.ply
head -c 3000 quadric.ply >cut.ply
: >empty.off
: >empty.hxp
echo 'This is a letter.' >letter.obj
cp letter.obj letter.hxp
cp quadric.ply renamed.hxp
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 1\n' >flat.obj
echo kept >kept
run 0 '->' sheet.off --progressive small.hxp --ratio 0.02 --precision 12
before=$(ls)

for file in absent.off absent.hxp nothing.ply cut.ply empty.off empty.hxp letter.obj letter.hxp \
    renamed.hxp flat.obj; do
    run 1 "^hexwalk: .*$file" "$file" -o new.ply --faces 10
done
for file in absent.off nothing.ply cut.ply flat.obj; do
    run 1 "^hexwalk: .*$file" "$file" --progressive new.hxp
    run 1 "^hexwalk: .*$file" "$file" --progressive new.hxp --hierarchy batched --levels newlevels
done
usage=(
    '--faces and --ratio' 'sheet.off -o new.ply --faces 10 --ratio 0.5'
    '--faces and --ratio' 'exact.hxp -o new.ply --faces 10 --ratio 0.5'
    'how far' 'sheet.off -o new.ply'
    '--ratio: 0 is not within' 'sheet.off -o new.ply --ratio 0'
    '--error: 0 is not within' 'sheet.off -o new.ply --faces 10 --error 0'
    '--ratio' 'sheet.off -o new.ply --ratio 1.5'
    '--ratio' 'sheet.off -o new.ply --ratio -1'
    '--faces' 'sheet.off -o new.ply --faces 0'
    '--faces' 'sheet.off -o new.ply --faces many'
    '--error' 'sheet.off -o new.ply --error nan'
    "no metric 'best'" 'sheet.off -o new.ply --faces 10 --metric best'
    "no metric ''" 'sheet.off -o new.ply --faces 10 --metric edge:0.5,'
    'share' 'sheet.off -o new.ply --faces 10 --metric edge,quadric'
    'share' 'sheet.off -o new.ply --faces 10 --metric edge:0.5'
    'share' 'sheet.off -o new.ply --faces 10 --metric edge:2,quadric'
    'share' 'sheet.off -o new.ply --faces 10 --metric edge:0.5x,quadric'
    'falling' 'sheet.off -o new.ply --faces 10 --metric edge:0.2,hybrid:0.5,quadric'
    'more than' 'sheet.off -o new.ply --faces 10 --metric edge:.9,edge:.8,edge:.7,edge:.6,edge:.5,edge:.4,edge:.3,edge:.2,edge'
    '--placement' 'sheet.off -o new.ply --faces 10 --placement 3'
    '--hierarchy' 'sheet.off -o new.ply --faces 10 --hierarchy tree'
    'needs --eye' 'sheet.off -o new.ply --faces 10 --metric screen'
    'needs --eye' 'sheet.off -o new.ply --faces 10 --metric edge:0.5,viewcell'
    '--eye' 'sheet.off -o new.ply --faces 10 --metric screen --eye 1,2'
    '--eye' 'sheet.off -o new.ply --faces 10 --metric screen --eye 1,2,3,4'
    '--eye' 'sheet.off -o new.ply --faces 10 --metric screen --eye 1,2,inf'
    'eye' 'sheet.off -o new.ply --faces 10 --metric viewcell --eye 10,10,0'
    '--precision' 'sheet.off --progressive new.hxp --precision 7'
    '--precision' 'sheet.off --progressive new.hxp --precision 25'
    '--precision' 'sheet.off --progressive new.hxp --precision fine'
    'new.obj' 'sheet.off -o new.obj --faces 10'
    'new.hxm' 'sheet.off --progressive new.hxm --faces 10'
    'needed' 'sheet.off --faces 10'
    '--bytes' 'sheet.off -o new.ply --faces 10 --bytes 1000'
    '--bytes' 'sheet.off --progressive new.hxp --bytes 0'
    '--levels' 'sheet.off -o new.ply --faces 10 --levels newlevels'
    '--keep-order' 'sheet.off -o new.ply --faces 10 --keep-order'
    '--kappa-decay' 'sheet.off -o new.ply --faces 10 --metric pm --kappa-decay 0'
    '--kappa-decay' 'sheet.off -o new.ply --faces 10 --metric pm --kappa-decay 1.5'
    'progressive mesh' 'exact.hxp --progressive new.hxp'
    'progressive mesh' 'exact.hxp -o new.ply --vertices 10'
    '--metric is without effect' 'exact.hxp -o new.ply --faces 10 --metric quadric'
    '--fit is without effect' 'exact.hxp -o new.ply --faces 10 --fit 1'
    '--precision is without effect' 'exact.hxp -o new.ply --faces 10 --precision lossless'
    '--hierarchy is without effect' 'exact.hxp -o new.ply --faces 10 --hierarchy linear'
    '--placement is without effect' 'exact.hxp -o new.ply --faces 10 --placement 1'
    '--eye is without effect' 'exact.hxp -o new.ply --faces 10 --eye 1,2,3'
    'missing' '-o new.ply --faces 10'
    'one argument too many' 'sheet.off sheet.off -o new.ply --faces 10'
    "did you mean '--faces'" 'sheet.off -o new.ply --facs 10'
)
for ((i = 0; i < ${#usage[@]}; i += 2)); do
    # shellcheck disable=SC2086
    run 2 "^hexwalk: .*${usage[i]}.*try 'hexwalk help" ${usage[i + 1]}
done
run 1 'base mesh alone takes' sheet.off --progressive new.hxp --bytes 10
run 1 'absent/new.ply' sheet.off -o absent/new.ply --faces 10
run 1 'kept/new.ply' sheet.off -o kept/new.ply --faces 10
run 1 'absent/new.glb' sheet.off -o absent/new.glb --faces 10
run 1 'absent/new.hxp' sheet.off --progressive absent/new.hxp -o new.ply --faces 10
run 1 'kept: is a file|kept' sheet.off -o new.ply --hierarchy batched --levels kept --ratio 0.1
run 1 'absent/new.ply' exact.hxp -o absent/new.ply --faces 10
[[ $(ls) == "$before" ]] || { ls >log; fail 'a failure left something behind'; }
[[ $(cat kept) == kept ]] || fail 'kept was changed'

# A progressive mesh cut off or changed anywhere is refused, and leaves nothing.
python3 - "$hexwalk" small.hxp >log 2>&1 <<'PYTHON' || fail 'damaged progressive meshes'
import os, subprocess, sys
from concurrent.futures import ThreadPoolExecutor
program, path = sys.argv[1:]
good = open(path, "rb").read()

def refused(case):
    number, what, data = case
    bad, out = f"bad{number}.hxp", f"bad{number}.ply"
    open(bad, "wb").write(data)
    r = subprocess.run([program, "simplify", bad, "-o", out], capture_output=True, text=True)
    assert r.returncode == 1, (what, r.returncode, r.stderr)
    assert r.stderr.startswith("hexwalk: ") and bad in r.stderr, (what, r.stderr)
    assert not os.path.exists(out) and not r.stdout, what
    os.remove(bad)

cases = [("with a tail", good + b"!")]
for cut in list(range(0, len(good), len(good) // 40)) + [len(good) - 1]:
    cases.append((f"cut at {cut}", good[:cut]))
for at in range(0, len(good), len(good) // 60):
    changed = good[:at] + bytes([good[at] ^ (1 << at % 8)]) + good[at + 1 :]
    cases.append((f"changed at {at}", changed))
with ThreadPoolExecutor(os.cpu_count()) as pool:
    assert len(list(pool.map(refused, [(k, *c) for k, c in enumerate(cases)]))) > 100
PYTHON
[[ -z $(find . -name '*.tmp') ]] || { find . -name '*.tmp' >log; fail 'temporary files are left'; }

[[ $failures -eq 0 ]]
