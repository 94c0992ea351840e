#!/bin/bash
# hexwalk measure from end to end on a small scene: the report's keys, that its summaries follow from
# frames.csv, that the page needs nothing from outside, and what happens when something is missing.
#   test_measure.sh PROGRAM
set -uo pipefail

hexwalk=$(realpath "$1")
source "$(dirname "${BASH_SOURCE[0]}")/scenes.sh"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
# Mesa keeps 480 bytes per context; under the leak sanitizer that is not our failure.
echo 'leak:libOSMesa' >known_leaks
export LSAN_OPTIONS=${LSAN_OPTIONS:+$LSAN_OPTIONS:}suppressions=$work/known_leaks:print_suppressions=0

fail() {
    printf 'FAILED: %s\n' "$1"
    sed 's/^/    /' log
    failures=$((failures + 1))
}

# run CODE ARGUMENT... - the exit code must be CODE; output goes to `log`.
run() {
    local code=$1
    shift
    "$hexwalk" "$@" >log 2>&1 </dev/null
    local got=$?
    [[ $got -eq $code ]] || { fail "hexwalk $* exited with $got, not $code"; return 1; }
}

make_tour() {
    awk 'BEGIN {
        printf "{\"fov_degrees\":60,\"frames\":["
        for (i = 0; i < 24; i++)
            printf "%s{\"t\":%.2f,\"eye\":[%.1f,0,12],\"forward\":[1,0,0],\"up\":[0,0,1]}",
                i ? "," : "", i / 10, i * 9
        print "]}"
    }'
}

# check NAME REPORT_FOLDER FRAMES CONFIGS [EXPRESSION] - reads report.json as `r`, frames.csv as
# `rows`; the expression must hold.
check() {
    python3 - "${@:2}" >log 2>&1 <<'EOF' || fail "$1"
import csv, json, math, sys
folder, frames, names = sys.argv[1], int(sys.argv[2]), sys.argv[3].split(",")
r = json.load(open(folder + "/report.json"))
rows = list(csv.DictReader(open(folder + "/frames.csv")))
assert set(r) >= {"scene", "dataset", "size", "frames", "reference_samples", "configs", "ratios"}, list(r)
assert set(r["scene"]) >= {"triangles", "objects"}
assert set(r["dataset"]) >= {"cells", "bytes", "mesh_bytes", "texture_bytes", "build_seconds"}
assert r["frames"] == frames and list(r["configs"]) == names, (r["frames"], list(r["configs"]))
assert len(rows) == frames * len(names)

def column(name, key):
    text = [row[key] for row in rows if row["config"] == name]
    return sorted(v for v in map(float, filter(None, text)) if math.isfinite(v))

def same(a, b):
    return a is None and b is None or a is not None and math.isclose(a, b, rel_tol=1e-5, abs_tol=1e-9)

for name, c in r["configs"].items():
    for key, parts in {"frame_ms": {"mean", "median", "p99"}, "triangles": {"mean", "max"},
                       "psnr_1spp": {"mean", "min"}, "psnr_reference": {"mean", "min"},
                       "psnr_objects": {"mean", "min"}, "ssim_reference": {"mean", "min"}}.items():
        v = column(name, key)
        assert set(c[key]) == parts, (name, key, c[key])
        assert same(c[key]["mean"], sum(v) / len(v) if v else None), (name, key)
        for part, pick in {"min": 0, "max": -1, "p99": -1}.items():
            if part in parts:
                assert same(c[key][part], v[pick] if v else None), (name, key, part)
    assert c["gpu_bytes_peak"] > 0 and c["rss_bytes_peak"] > 1e6, name
    assert c["psnr_reference"]["mean"] > 20 and c["ssim_reference"]["mean"] > 0.5, name
    assert set(c) >= {"hole_pixels", "hole_largest", "pop", "load"} or name != "C"
for pair, ratio in r["ratios"].items():
    a, b = pair.split("/")
    both = a in names and b in names
    assert same(ratio, r["configs"][a]["frame_ms"]["mean"] / r["configs"][b]["frame_ms"]["mean"]
                if both else None), pair
page = open(folder + "/report.html", encoding="utf-8").read()
for outside in ["http:", "https:", "src=\"/", "@import", "<link"]:
    assert outside not in page.replace("http://www.w3.org/", ""), outside
assert all(x.split('"')[0].startswith("data:image/") for x in page.split('src="')[1:])
assert page.count("<svg") == page.count("</svg>")
if len(sys.argv) > 4:
    assert eval("(" + sys.argv[4] + ")"), sys.argv[4]
EOF
}

echo 'not run' >log
make_scene 10 >balls.obj
make_tour >tour.json
run 0 build balls.obj -o data --cell-size 60 --quiet || exit 1

# Full geometry and culled geometry are the same image; B at one sample is the truth itself.
run 0 measure data --tour tour.json --configs A,B,L,C -o full --every 6 --size 160x120 \
    --reference-samples 4 --repeat 1 --json copy.json --quiet &&
    check 'all configurations' full 4 A,B,L,C '
        r["configs"]["B"]["psnr_1spp"]["mean"] is None and r["configs"]["B"]["ssim_objects"]["mean"] == 1
        and r["configs"]["A"]["psnr_objects"]["min"] is None
        and r["configs"]["A"]["triangles"]["max"] >= r["configs"]["B"]["triangles"]["max"]
        and r["configs"]["C"]["psnr_1spp"]["min"] > 25 and r["configs"]["C"]["load"]["bytes"] > 0
        and r["cell_crossings"] > 0 and r["configs"]["C"]["pop"]["mean"] is not None
        and r["size"] == [160, 120] and r["reference_samples"] == 4
        and json.load(open("copy.json")) == r
        and (page.count("<svg") == 5 or "gnuplot is not installed" in page) and page.count("data:image/") == 18'
[[ -z $(find full -name '*.tmp') ]] || fail 'temporary files are left'

# One frame, one configuration, four samples: nothing to compare frame times with.
run 0 measure data --tour tour.json --configs C -o one --every 1000 --size 96x96 --samples 4 \
    --reference-samples 1 --repeat 2 --quiet &&
    check 'one frame' one 1 C 'r["ratios"] == {"A/C": None, "B/C": None, "L/C": None} and r["samples"] == 4'

# With four samples a pixel the pictures of every configuration are closer to the truth.
for samples in 1 4; do
    run 0 measure data --tour tour.json --configs A,B,L,C -o "samples$samples" --every 12 --size 96x96 \
        --samples $samples --reference-samples 32 --repeat 1 --quiet
done
check 'four samples' samples4 2 A,B,L,C '
    all(c["psnr_reference"]["mean"] > before[name]["psnr_reference"]["mean"] + 1
        for before in [json.load(open("samples1/report.json"))["configs"]]
        for name, c in r["configs"].items())'

# The tour played at its own time: with prefetching no frame waits, and the limit of bandwidth is a
# run of its own. (How many frames lack data depends on how fast this machine reads and decodes, but
# there is little to read: on an idle one there is none.)
run 0 measure data --tour tour.json --configs C -o stream --every 1000 --size 64x64 \
    --reference-samples 1 --repeat 1 --streaming --bandwidth 2M --quiet &&
    check 'streaming' stream 1 C '
        list(r["streaming"]["runs"]) == ["no_prefetch", "cold", "warm", "limited"]
        and r["streaming"]["frames"] > 60 and r["streaming"]["bandwidth"] == 2000000
        and r["streaming"]["rss_bytes_peak"] > 1e6
        and r["streaming"]["runs"]["no_prefetch"]["stalls"] > 0
        and r["streaming"]["runs"]["no_prefetch"]["frames_missing"] == 0
        and all(run["frames_missing"] <= 10 and run["stalls"] == 0 and run["bytes"] > 0
                for key, run in r["streaming"]["runs"].items() if key != "no_prefetch")
        and (page.count("<svg") == 8 or "gnuplot is not installed" in page)'
# Budgets reach the renderer: less than the run above took.
run 0 measure data --tour tour.json --configs C -o budgets --every 1000 --size 64x64 \
    --reference-samples 1 --repeat 1 --streaming --gpu-budget 600K --ram-budget 200K --quiet &&
    check 'budgets' budgets 1 C '
        all(run["gpu_bytes_peak"] <= 600000 and run["ram_bytes_peak"] <= 200000
            for run in r["streaming"]["runs"].values())
        and all(run["gpu_bytes_peak"] > 600000 and run["ram_bytes_peak"] > 200000
                for run in [json.load(open("stream/report.json"))["streaming"]["runs"]["warm"]])'
run 2 measure data --tour tour.json --configs C -o wrong --bandwidth 2M

# Of one cell of many there is no crossing; memory that cannot be told is a warning, and a note.
run 0 build balls.obj -o part --cell-size 60 --along tour.json --every 1000 --quiet
mkdir -p noted/memory_C.json.tmp
run 0 measure part --tour tour.json --configs C -o noted --every 1000 --size 64x64 \
    --reference-samples 1 --repeat 1
grep -q 'warning: The process memory of configuration C is unknown' log || fail 'no warning of unknown memory'
grep -q 'memory of configuration C is unknown' noted/report.json || fail 'no note of unknown memory'
grep -q 'no crossing between cells that the dataset has' noted/report.html || fail 'crossings of a part'

# Without gnuplot the page says so in place of the plots.
mkdir empty
PATH=$work/empty run 0 measure data --tour tour.json --configs B,C -o bare --every 12 --size 64x64 \
    --reference-samples 2 --repeat 1 --streaming --quiet &&
    check 'without gnuplot' bare 2 B,C 'page.count("<svg") == 0 and page.count("gnuplot is not installed") == 8'

# Another scene than the dataset's is refused by name, and a failure leaves no report.
make_scene 9 >balls.obj
run 1 measure data --tour tour.json -o wrong --quiet
grep -q 'balls.obj.*not the scene' log || fail 'the changed scene was not named'
make_scene 10 >moved.obj
run 0 measure data --tour tour.json --configs C --scene moved.obj -o moved --every 24 --size 32x32 \
    --reference-samples 1 --repeat 1 --quiet
run 1 measure data --tour none.json -o wrong --quiet
[[ ! -e wrong/report.json ]] || fail 'a failed measurement wrote a report'
for list in '' A,,B A,X AB A,A; do
    run 2 measure data --tour tour.json --configs "$list" -o wrong
done

echo "$failures failures"
[[ $failures -eq 0 ]]
