#!/bin/bash
# hexwalk build --shard and hexwalk merge, --memory, info on cells and maps: as a user runs them.
#   test_shards.sh PROGRAM
set -uo pipefail

hexwalk=$(realpath "$1")
source "$(dirname "${BASH_SOURCE[0]}")/scenes.sh"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() {
    printf 'FAILED: %s\n' "$1"
    [[ ! -e log ]] || sed 's/^/    /' log
    failures=$((failures + 1))
}
build() { "$hexwalk" build balls.obj --cell-size 60 --quiet "$@" >log 2>&1 </dev/null; }
same() { diff -rq --exclude=build.json whole "$1" >log || fail "$1 differs from a build in one go"; }
# refused CODE PATTERN ARGUMENT...
refused() {
    local code=$1 pattern=$2
    "$hexwalk" "${@:3}" >log 2>&1
    [[ $? -eq $code ]] || fail "hexwalk ${*:3} did not exit with $code"
    grep -qE -- "$pattern" log || fail "hexwalk ${*:3} does not say '$pattern'"
}

make_scene 9 16 >balls.obj
build -o whole --threads 1 || fail 'a build in one go'

for n in 1 2 3; do
    shards=()
    for ((k = n; k >= 1; k--)); do
        build -o "part$k" --shard "$k/$n" --threads "$k" || fail "shard $k/$n"
        shards+=("part$k")
    done
    "$hexwalk" merge "${shards[@]}" -o "merged$n" --quiet >log 2>&1 || fail "the merge of $n shards"
    grep -q "^merged$n: $n shards, $(find whole/cells -name '*.hxc' | wc -l) cells" log ||
        fail "the merge of $n shards does not tell what it joined"
    same "merged$n"
    ((n == 3)) || rm -rf part*
done
"$hexwalk" info merged3 >log || fail 'info on a merged dataset'
grep -q '^kind  *dataset' log || fail 'info on a merged dataset does not tell that it is one'

# One folder for all, in any order: nothing is left of the shards.
for k in 2 3 1; do
    [[ ! -e together/manifest.json ]] || fail 'a manifest before the last shard'
    build -o together --shard $k/3 || fail "shard $k/3 in one folder"
done
same together

refused 1 'shard 1 of 3 is missing' merge part2 part3 -o none
refused 1 'absent' merge part1 part2 absent -o none
refused 1 'part1: holds shard 1 of 3, which part1' merge part1 part1 part2 part3 -o none
refused 1 'merged1: is a finished dataset already' merge part1 part2 part3 -o merged1
refused 1 'part1: is one of the shards' merge part1 part2 part3 -o part1
refused 2 'help merge' merge part1
refused 2 'with 1 <= K <= N' build balls.obj -o none --shard 4/3
refused 2 'with 1 <= K <= N' build balls.obj -o none --shard 0/3
[[ ! -e none ]] || fail 'a refused merge left something behind'

# A bound of memory: the same bytes, and an error that tells what is needed.
build -o bounded --memory 8G || fail 'a build with a bound of memory'
same bounded
refused 1 '1M of memory are not enough: .*[0-9]M' build balls.obj -o none --memory 1M --quiet
refused 2 'number of bytes' build balls.obj -o none --memory much

# What info tells of cells, and maps.
cell=$(find whole/cells -name '*.hxc' | sort | head -n 1)
"$hexwalk" info "$cell" --json cell.json >log || fail "info $cell"
for word in INFO NEAR FARS VERT INDX VIEW RNGE COLR ATLS COVR triangles; do
    grep -q "$word" log || fail "info on a cell tells no $word"
done
stored=$(awk -F: '/"bytes":/ { sum += $2; n++ } END { print n + 0, sum + 0 }' cell.json)
size=$(stat -c %s "$cell")
# A head of 40 bytes, and an entry of 40 bytes in its table for each of ten chunks.
[[ $stored == "10 $((size - 40 - 10 * 40))" ]] || fail "the chunks of a cell of $size bytes sum up to $stored"
# colors PICTURE - how many a PNG of our own (8 bits, no interlacing) has; exits 1 if it is none.
colors() {
    python3 - "$1" <<'PYTHON'
import struct, sys, zlib
data = open(sys.argv[1], "rb").read()
assert data[:8] == b"\x89PNG\r\n\x1a\n"
packed, at = b"", 8
while at < len(data):
    size, kind = struct.unpack(">I4s", data[at:at + 8])
    body = data[at + 8:at + 8 + size]
    if kind == b"IHDR":
        width, height, depth, model = struct.unpack(">IIBB", body[:10])
    packed += body if kind == b"IDAT" else b""
    at += 12 + size
channels = {0: 1, 2: 3, 6: 4}[model]
assert depth == 8 and max(width, height) == 200
raw, row, seen = zlib.decompress(packed), bytes(width * channels), set()
for y in range(height):
    start = y * (width * channels + 1)
    rule, line = raw[start], bytearray(raw[start + 1:start + 1 + width * channels])
    for i in range(len(line)):
        a = line[i - channels] if i >= channels else 0
        b, c = row[i], row[i - channels] if i >= channels else 0
        near = min((a, b, c), key=lambda v: abs(a + b - c - v))
        line[i] = (line[i] + (0, a, b, (a + b) // 2, near)[rule]) & 255
    row = line
    seen |= {bytes(line[i:i + channels]) for i in range(0, len(line), channels)}
print(len(seen))
PYTHON
}
for by in bytes triangles far near; do
    "$hexwalk" info whole --map "$by.png" --map-by "$by" --map-side 200 >log || fail "a map by $by"
    grep -q "^map by *$by" log && grep -q '^map darkest' log || fail "no legend of the map by $by"
    (($(colors "$by.png" 2>log || echo 0) > 2)) || fail "$by.png has no cells of several colours"
done
! cmp -s bytes.png near.png || fail 'the maps by bytes and by near objects are the same'
# A grid of four thousand million cells of which few are there, and an object far away: no matter.
mkdir wide
python3 - <<'PYTHON'
import json
m = json.load(open("whole/manifest.json"))
m["grid"].update(columns=65535, rows=65535)
m["objects"][0]["bounds"] = [1e9, 1e9, 0, 1.1e9, 1.1e9, 10]
json.dump(m, open("wide/manifest.json", "w"))
PYTHON
if ! grep -q __asan_init "$hexwalk" && ! grep -q __tsan_init "$hexwalk"; then # they map far more
    (ulimit -v 8000000 && "$hexwalk" info wide --map wide.png --map-side 64 >log 2>&1) || fail 'a map of a wide grid'
fi
refused 2 'map is for datasets' info balls.obj --map no.png

echo "$failures failures"
[[ $failures -eq 0 ]]
