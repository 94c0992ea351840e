#!/bin/bash
# The command line as a user meets it: exit codes, messages, and that failures leave nothing behind.
#   test_cli.sh PROGRAM
set -uo pipefail

hexwalk=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
mkdir checks
checks=0

# Every check runs in the background with files of its own; what it finds wrong it writes into
# checks/<number>.failed. Loading the program's libraries takes most of the time.
start() {
    while [[ $(jobs -rp | wc -l) -ge $(nproc) ]]; do
        wait -n
    done
    checks=$((checks + 1))
    "$@" "checks/$checks" &
}

# fail BASE MESSAGE
fail() {
    {
        printf 'FAILED: %s\n' "$2"
        sed 's/^/    out: /' "$1.out"
        sed 's/^/    err: /' "$1.err"
    } >>"$1.failed" 2>/dev/null
}

# expect CODE PATTERN ARGUMENT... - runs hexwalk. With code 0 PATTERN must be found in what it
# prints; otherwise in its error, the last line on standard error (the only one with --quiet, and
# where the usage was wrong), and nothing may have been printed.
expect() {
    start check_run "$@"
}

check_run() {
    local code=$1 pattern=$2 base=${*: -1} got
    set -- "${@:3:$#-3}"
    "$hexwalk" "$@" >"$base.out" 2>"$base.err" </dev/null
    got=$?
    [[ $got -eq $code ]] || { fail "$base" "hexwalk $* exited with $got, not $code"; return; }
    if [[ $code -eq 0 ]]; then
        grep -qE -- "$pattern" "$base.out" || fail "$base" "hexwalk $* printed no '$pattern'"
        return
    fi
    if [[ $code -eq 2 || " $* " == *' --quiet '* ]] && [[ $(grep -c '' "$base.err") -ne 1 ]]; then
        fail "$base" "hexwalk $* wrote more or less than one line of errors"
    fi
    [[ ! -s $base.out ]] || fail "$base" "hexwalk $* failed and yet printed something"
    tail -n 1 "$base.err" | grep -qE '^hexwalk: ' ||
        fail "$base" "hexwalk $*: the error does not begin with the program's name"
    tail -n 1 "$base.err" | grep -qE -- "$pattern" ||
        fail "$base" "hexwalk $*: the error does not hold '$pattern'"
    [[ $code -ne 2 ]] || grep -qF "try 'hexwalk help" "$base.err" ||
        fail "$base" "hexwalk $*: no hint at the help"
}

# unchanged FILE TEXT - whether an earlier result is still there.
unchanged() {
    [[ $(cat "$1") == "$2" ]] || fail checks/0 "$1 was changed"
}

no_leftovers() {
    [[ -z $(find . -name '*.tmp') ]] || fail checks/0 "temporary files are left: $(find . -name '*.tmp')"
}

make_inputs() {
    cat >tetra.off <<'EOF'
OFF
4 4 0
0 0 0
10 0 0
0 10 0
0 0 10
3 0 2 1
3 0 1 3
3 1 2 3
3 2 0 3
EOF
    cat >tetra.obj <<'EOF'
v 0 0 0
v 10 0 0
v 0 10 0
v 0 0 10
f 1 3 2
f 1 2 4
f 2 3 4
f 3 1 4
EOF
    cat >tetra.ply <<'EOF'
ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
10 0 0
0 10 0
0 0 10
3 0 2 1
3 0 1 3
3 1 2 3
3 2 0 3
EOF
    head -c 100 tetra.ply >cut.ply
    sed '$d' tetra.ply | sed '$d' >short.ply
    sed 's/^10 0 0$/nan 0 0/' tetra.ply >nan.ply
    sed 's/^v 10 0 0$/v inf 0 0/' tetra.obj >inf.obj
    sed 's/^3 2 0 3$/3 2 0 9/' tetra.ply >range.ply
    sed 's/^3 2 0 3$/3 2 0 9/' tetra.off >range.off
    printf 'ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n' >nothing.ply
    printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 1\n' >flat.obj
    : >empty.ply
    : >empty.hxc
    : >empty.hxm
    : >empty.json
    echo 'This is a letter, not a mesh.' >letter.txt
    cp letter.txt letter.ply
    cp letter.txt letter.glb
    cp letter.txt letter.hxc
    cp letter.txt letter.hxm
    cp letter.txt letter.json
    printf '\x89PNG\r\n\x1a\n' >picture.png
    printf 'HXWC' >cut.hxc
    mkdir folder
    echo '{"version": 99}' >folder/manifest.json
    cp tetra.obj $'t\xe4tra.obj'
    mkdir bare
    ln -s tetra.off link.off
    md5sum tetra.* >sums
    echo '{"fov_degrees": 60, "frames": []}' >none.json
    echo '{"fov_degrees": 60, "frames": [{"t": 0, "eye": [0, 0, 12], "forward": [1, 0, 0], "up": [0, 0, 1]}]}' >one.json
}

commands=(park build tour walk render measure compare simplify info)

# The forms of wrong options are tested with the parser (test_options.c); here, that they arrive.
check_usage() {
    local command
    expect 2 'no command'
    expect 2 "unknown command 'bulid'" bulid
    expect 2 "unknown command ''" ''
    expect 2 "unknown command 'nothing'" help nothing
    expect 2 'one argument too many' help build walk
    for command in "${commands[@]}"; do
        expect 2 "unknown option '--frobnicate'.*help $command'" "$command" --frobnicate
        expect 2 "help $command'" "$command" a b c d e f
    done
    for command in build tour walk render measure compare simplify info; do
        expect 2 "missing.*help $command'" "$command"
    done
    expect 2 "did you mean '--cell-size'" build tetra.off -o data --cell-sise 4
    expect 2 '--cell-size needs a value' build tetra.off -o data --cell-size
    expect 2 "--cell-size: 'nan' is not" build tetra.off -o data --cell-size nan
    expect 2 '--cell-size: -5 is not within' build tetra.off -o data --cell-size=-5
    expect 2 "--threads: '-1' is not" build tetra.off -o data --threads -1
    expect 2 'screen\|thesis' build tetra.off -o data --policy best
    expect 2 'is not a size' render data --tour one.json -o pictures --size 640
    expect 2 'help build' build tetra.off
    expect 2 'help tour' tour tetra.off
    expect 2 'help render' render data --tour one.json
    expect 2 'help measure' measure data --tour one.json
    expect 2 'help park' park --preset 8m
    expect 2 'help park' park --preset 9m --statues bare -o park.glb
    expect 2 '--output park.obj: .*.glb' park --preset demo --statues bare -o park.obj
    # What would be without effect, and what would write over what is read.
    expect 2 '--every is about --along' build tetra.off -o data --every 1
    expect 2 '--cluster-error is about --clusters on' build tetra.off -o data --cluster-error 3
    expect 2 '--map-by is about --map' info tetra.off --map-by bytes
    expect 2 '--map-side is about --map' info tetra.off --map-side 1200
    expect 2 '--heatmap heat.obj: .*.ply' compare tetra.off tetra.ply --heatmap heat.obj
    expect 2 'file to be read' compare tetra.off tetra.ply --heatmap tetra.ply
    expect 2 'file to be read' compare tetra.off tetra.ply --json tetra.off
    expect 2 'file to be read' tour tetra.off -o bare/../tetra.off
    expect 2 'file to be read' tour tetra.off -o result.json --json tetra.off
    expect 2 'file to be read' info tetra.off --json link.off
    expect 2 'file to be read' build tetra.off -o data --json tetra.off
    expect 2 'file to be read' simplify tetra.off -o small.ply --faces 2 --json tetra.off
    expect 2 'file to be read' measure data --tour one.json -o report --json one.json
}

check_help() {
    local command
    for command in "${commands[@]}"; do
        expect 0 "^Usage: hexwalk $command" help "$command"
    done
    expect 0 '^  -q, --quiet' build --help
    expect 0 '^Usage: hexwalk COMMAND' help
    expect 0 '^Usage: hexwalk COMMAND' --help
    expect 0 '^hexwalk [0-9]+\.[0-9]+\.[0-9]+$' --version
    start check_man_page
    start check_broken_pipe
}

check_man_page() {
    local command
    "$hexwalk" man >hexwalk.1
    for command in "${commands[@]}"; do
        grep -q "^\.SS hexwalk $command " hexwalk.1 || fail "$1" "the man page lacks $command"
    done
    command -v man >/dev/null || return
    LC_ALL=C MANROFFSEQ='' man --warnings -l hexwalk.1 >"$1.out" 2>"$1.err" ||
        fail "$1" 'man cannot show the page'
    [[ ! -s $1.err ]] || fail "$1" 'the man page has flaws'
}

# A reader that goes away is no reason for noise, nor for a signal.
check_broken_pipe() {
    { "$hexwalk" man 2>"$1.err"; echo $? >code; } | head -c 1 >/dev/null
    [[ $(cat code) -le 1 && ! -s $1.err ]] || fail "$1" "hexwalk man | head: exit code $(cat code)"
}

check_scenes() {
    local file
    for file in absent.glb empty.ply cut.ply short.ply letter.txt letter.glb picture.png nan.ply \
        inf.obj range.ply range.off nothing.ply flat.obj bare; do
        expect 1 "$file" build --quiet "$file" -o result
    done
    for file in absent.hxc empty.ply empty.hxc empty.hxm empty.json cut.hxc letter.txt letter.ply letter.hxc \
        letter.hxm letter.json range.ply none.json bare folder; do
        expect 1 "$file" info "$file"
    done
    expect 1 'absent.glb.*No such file' tour absent.glb -o result.json
    expect 1 'range.off' tour range.off -o result.json
    expect 0 '^triangles +4$' info tetra.off
    expect 0 '^triangles +4$' info -q -- tetra.ply
    expect 0 '^objects +1$' info tetra.obj --json info.json
    expect 0 '^frames +1$' info one.json
    start check_encoding
}

# JSON is UTF-8, whatever a file is called.
check_encoding() {
    "$hexwalk" info $'t\xe4tra.obj' --json latin.json >"$1.out" 2>"$1.err" &&
        python3 -c 'import json; assert json.load(open("latin.json", encoding="utf-8"))["path"] == "t_tra.obj"' 2>>"$1.err" ||
        fail "$1" 'a name in Latin-1'
}

check_datasets() {
    local data
    for data in absent bare folder; do
        expect 1 "$data" render "$data" --tour one.json -o pictures
        expect 1 "$data" measure "$data" --tour one.json --configs C -o report
    done
    expect 1 'letter.txt' render letter.txt --config B --tour one.json -o pictures
}

check_outputs() {
    echo kept >kept
    expect 1 'kept/info.json' info tetra.off --json kept/info.json
    expect 1 'absent/info.json' info tetra.off --json absent/info.json
    expect 1 '/dev/full.*No space left' info tetra.off --json /dev/full
    expect 1 'kept/tour.json' tour tetra.off -o kept/tour.json
    expect 1 '/dev/full.*No space left' tour tetra.off -o /dev/full
    expect 1 'kept: is a file' build tetra.off -o kept/data
    expect 1 'kept' build tetra.off -o kept
    start check_full_stdout
    start check_full_disk
    start check_closed_descriptors
}

# A closed standard descriptor is taken at once, so that no file gets its number. Yet printing to a
# closed output fails as ever.
check_closed_descriptors() {
    python3 - "$hexwalk" >"$1.out" 2>"$1.err" <<'PYTHON' || fail "$1" 'with standard error closed, its number is free'
import os, subprocess, sys
build = subprocess.Popen([sys.argv[1], "build", "tetra.off", "-o", "closed"], stdout=subprocess.DEVNULL,
                         preexec_fn=lambda: os.close(2))
seen = set()
while build.poll() is None:
    try:
        seen.add(os.readlink(f"/proc/{build.pid}/fd/2"))
    except OSError:
        pass
assert build.returncode == 0 and "/dev/null" in seen, (build.returncode, seen)
PYTHON
    "$hexwalk" help 2>"$1.err" >&-
    [[ $? -eq 1 ]] && grep -q 'standard output' "$1.err" || fail "$1" 'hexwalk help >&-'
}

# A full disk behind a redirection is a failure too.
check_full_stdout() {
    "$hexwalk" help >/dev/full 2>"$1.err"
    [[ $? -eq 1 ]] && grep -q 'No space left' "$1.err" || fail "$1" 'hexwalk help >/dev/full'
}

# A file size limit acts like a disk that fills up: the earlier result stays. Without a folder for temporary files, as the
# thread sanitizer maps one of its own, which the limit would cut short.
check_full_disk() {
    echo earlier >tour.json
    (ulimit -f 1 && TMPDIR=absent "$hexwalk" tour tetra.off -o tour.json --quiet >"$1.out" 2>"$1.err")
    [[ $? -eq 1 ]] && grep -q 'tour.json.*File too large' "$1.err" || fail "$1" 'tour on a full disk'
}

make_inputs
check_usage
check_help
check_scenes
check_datasets
check_outputs
wait
unchanged kept kept
md5sum --quiet -c sums || fail checks/0 'an input was changed'
unchanged tour.json earlier
no_leftovers
grep -q '"triangles":[[:space:]]*4' info.json || fail checks/0 'info.json lacks the triangles'
[[ ! -e report/report.json ]] || fail checks/0 'a failed measurement wrote a report'
failed=$(find checks -name '*.failed' | wc -l)
[[ $failed -eq 0 ]] || cat checks/*.failed
printf '%d checks, %d failed\n' "$checks" "$failed"
[[ $failed -eq 0 ]]
