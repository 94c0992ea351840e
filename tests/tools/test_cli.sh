#!/bin/bash
# The command line as a user meets it: exit codes, messages, and that failures leave nothing behind.
#   test_cli.sh PROGRAM
set -uo pipefail

hexwalk=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
checks=0 failures=0

fail() {
    printf 'FAILED: %s\n' "$1"
    sed 's/^/    out: /' out
    sed 's/^/    err: /' err
    failures=$((failures + 1))
}

# expect CODE PATTERN ARGUMENT... - runs hexwalk. With code 0 PATTERN must be found in what it
# prints; otherwise in its error, the last line on standard error (the only one with --quiet, and
# where the usage was wrong), and nothing may have been printed.
expect() {
    local code=$1 pattern=$2 got
    shift 2
    checks=$((checks + 1))
    "$hexwalk" "$@" >out 2>err </dev/null
    got=$?
    [[ $got -eq $code ]] || { fail "hexwalk $* exited with $got, not $code"; return; }
    if [[ $code -eq 0 ]]; then
        grep -qE -- "$pattern" out || fail "hexwalk $* printed no '$pattern'"
        return
    fi
    if [[ $code -eq 2 || " $* " == *' --quiet '* ]] && [[ $(grep -c '' err) -ne 1 ]]; then
        fail "hexwalk $* wrote more or less than one line of errors"
    fi
    [[ ! -s out ]] || fail "hexwalk $* failed and yet printed something"
    tail -n 1 err | grep -qE '^hexwalk: ' || fail "hexwalk $*: the error does not begin with the program's name"
    tail -n 1 err | grep -qE -- "$pattern" || fail "hexwalk $*: the error does not hold '$pattern'"
    [[ $code -ne 2 ]] || grep -qF "try 'hexwalk help" err || fail "hexwalk $*: no hint at the help"
}

# unchanged FILE TEXT - whether an earlier result is still there.
unchanged() {
    checks=$((checks + 1))
    [[ $(cat "$1") == "$2" ]] || fail "$1 was changed"
}

# no_leftovers FOLDER - whether no temporary file is left in it.
no_leftovers() {
    checks=$((checks + 1))
    [[ -z $(find "$1" -name '*.tmp') ]] || fail "temporary files are left: $(find "$1" -name '*.tmp')"
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
    mkdir bare
    echo '{"fov_degrees": 60, "frames": []}' >none.json
    echo '{"fov_degrees": 60, "frames": [{"t": 0, "eye": [0, 0, 12], "forward": [1, 0, 0], "up": [0, 0, 1]}]}' >one.json
}

commands=(park build tour walk render measure info)

check_usage() {
    local command
    expect 2 'no command'
    expect 2 "unknown command 'bulid'" bulid
    expect 2 "unknown command ''" ''
    expect 2 "unknown command '--frobnicate'" --frobnicate
    expect 2 "unknown command 'nothing'" help nothing
    expect 2 'one argument too many' help build walk
    for command in "${commands[@]}"; do
        expect 2 "unknown option '--frobnicate'.*help $command'" "$command" --frobnicate
        expect 2 "unknown option '-Z'.*help $command'" "$command" -Z
        expect 2 "--quiet takes no value.*help $command'" "$command" --quiet=yes
        expect 2 "help $command'" "$command" a b c d e f
    done
    for command in build tour walk render measure info; do
        expect 2 "missing.*help $command'" "$command"
    done
    expect 2 "did you mean '--cell-size'" build tetra.off -o data --cell-sise 4
    expect 2 '--cell-size needs a value' build tetra.off -o data --cell-size
    expect 2 "--cell-size: '5x' is not" build tetra.off -o data --cell-size 5x
    expect 2 '--cell-size: -5 is not within' build tetra.off -o data --cell-size=-5
    expect 2 "--cell-size: 'nan' is not" build tetra.off -o data --cell-size nan
    expect 2 "--threads: '-1' is not" build tetra.off -o data --threads -1
    expect 2 "--threads: '' is not" build tetra.off -o data --threads=
    expect 2 'screen\|thesis' build tetra.off -o data --policy best
    expect 2 "is not a size" render data --tour one.json -o pictures --size 640
    expect 2 '--tour needs a value' render data --tour
    expect 2 'help build' build tetra.off
    expect 2 'help tour' tour tetra.off
    expect 2 'help render' render data --tour one.json
    expect 2 'help measure' measure data --tour one.json
    expect 2 'help park' park --preset 8m
    expect 2 'help park' park --preset 9m --statues bare -o park.glb
}

check_help() {
    local command
    for command in "${commands[@]}"; do
        expect 0 "^Usage: hexwalk $command" help "$command"
        expect 0 "^Usage: hexwalk $command" "$command" --help
        expect 0 "^  -q, --quiet" "$command" -h
    done
    expect 0 '^Usage: hexwalk COMMAND' help
    expect 0 '^Usage: hexwalk COMMAND' --help
    expect 0 '^hexwalk [0-9]+\.[0-9]+\.[0-9]+$' --version
    expect 0 '^\.TH HEXWALK 1 ' man
    for command in "${commands[@]}"; do
        expect 0 "^\.SS hexwalk $command " man
    done
    if command -v man >/dev/null; then
        checks=$((checks + 1))
        "$hexwalk" man >hexwalk.1
        LC_ALL=C MANROFFSEQ='' man --warnings -l hexwalk.1 >out 2>err || fail 'man cannot show the page'
        [[ ! -s err ]] || fail 'the man page has flaws'
    fi
    # Options are read in the same way from either side of the arguments.
    expect 0 '^triangles +4$' info --quiet tetra.off
    expect 0 '^triangles +4$' info -q -- tetra.off
}

check_bad_scenes() {
    local command file
    for command in build tour; do
        for file in absent.glb empty.ply cut.ply short.ply letter.txt letter.ply letter.glb picture.png \
            nan.ply inf.obj range.ply range.off nothing.ply flat.obj bare; do
            expect 1 "$file" "$command" "$file" -o result
            expect 1 "$file" "$command" --quiet "$file" -o result
        done
    done
    for file in absent.glb absent.hxc absent.json empty.ply empty.hxc empty.hxm empty.json cut.ply short.ply \
        cut.hxc letter.txt letter.ply letter.glb letter.hxc letter.hxm letter.json picture.png nan.ply inf.obj \
        range.ply range.off nothing.ply flat.obj none.json bare folder; do
        expect 1 "$file" info "$file"
    done
    expect 1 'No such file' info absent.glb
    expect 1 'empty' info empty.ply
    expect 1 'manifest' info bare
    expect 1 'version' info folder
}

check_bad_datasets() {
    local data
    for data in absent bare folder letter.txt; do
        expect 1 "$data" render "$data" --tour one.json -o pictures
        expect 1 "$data" measure "$data" --tour one.json --configs C -o report
    done
    checks=$((checks + 1))
    [[ ! -e report/report.json ]] || fail 'a failed measurement wrote a report'
}

check_good_scenes() {
    expect 0 '^triangles +4$' info tetra.off
    expect 0 '^triangles +4$' info tetra.ply
    expect 0 '^objects +1$' info tetra.obj --json info.json
    checks=$((checks + 1))
    grep -q '"triangles":[[:space:]]*4' info.json || fail 'info.json lacks the triangles'
    expect 0 '^frames +1$' info one.json
}

check_bad_outputs() {
    echo kept >kept
    expect 1 'kept/info.json' info tetra.off --json kept/info.json
    expect 1 'absent/info.json' info tetra.off --json absent/info.json
    expect 1 '/dev/full.*No space left' info tetra.off --json /dev/full
    expect 1 'kept/tour.json' tour tetra.off -o kept/tour.json
    expect 1 '/dev/full.*No space left' tour tetra.off -o /dev/full
    expect 1 'kept: is a file' build tetra.off -o kept/data
    expect 1 'kept' build tetra.off -o kept
    unchanged kept kept
    no_leftovers .
    # A full disk behind a redirection is a failure too.
    checks=$((checks + 1))
    : >out
    "$hexwalk" help >/dev/full 2>err
    [[ $? -eq 1 ]] && grep -q 'No space left' err || fail 'hexwalk help >/dev/full did not fail'
    # A reader that goes away is no reason for noise, nor for a signal.
    checks=$((checks + 1))
    { "$hexwalk" man 2>err; echo $? >code; } | head -c 1 >/dev/null
    [[ $(cat code) -le 1 && ! -s err ]] || fail "hexwalk man | head: exit code $(cat code)"
}

# A file size limit acts like a disk that fills up: the earlier result stays.
check_full_disk() {
    expect 0 '' tour tetra.off -o tour.json --quiet
    cp tour.json before.json
    checks=$((checks + 1))
    (ulimit -f 1 && "$hexwalk" tour tetra.off -o tour.json --quiet >out 2>err)
    [[ $? -eq 1 ]] && grep -q 'tour.json.*File too large' err || fail 'tour on a full disk'
    unchanged tour.json "$(cat before.json)"
    no_leftovers .
}

make_inputs
: >out
: >err
check_usage
check_help
check_bad_scenes
check_bad_datasets
check_good_scenes
check_bad_outputs
check_full_disk
printf '%d checks, %d failures\n' "$checks" "$failures"
[[ $failures -eq 0 ]]
