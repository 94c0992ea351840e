#!/bin/bash
# hexwalk render --video, with a stand-in for ffmpeg that notes what it is given; and with the real
# one where it is installed.
#   test_video.sh PROGRAM
set -uo pipefail

hexwalk=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
checks=0 failures=0

# check WHAT COMMAND... - counts a failure if the command fails.
check() {
    local what=$1
    shift
    checks=$((checks + 1))
    "$@" >found 2>&1 && return
    printf 'FAILED: %s %s\n' "$what" "$(tr "\n" " " <found)"
    [[ ! -e err ]] || sed 's/^/    err: /' err
    failures=$((failures + 1))
}

# video CODE PATTERN FILE ARGUMENT... - renders; an error must hold the pattern.
video() {
    local code=$1 pattern=$2 file=$3 got
    shift 3
    timeout 60 "$hexwalk" render scene.obj --tour tour.json --config B --video "$file" "$@" \
        >out 2>err </dev/null
    got=$?
    [[ $got -eq $code ]] || { echo "exit code $got"; return 1; }
    if [[ $code -eq 0 ]]; then
        grep -qE -- "$pattern" out
    else
        grep -E "^hexwalk: " err | tail -1 | grep -qE -- "$pattern"
    fi
}

# no_trace FILE - neither the video nor anything beside it.
no_trace() { [[ -z $(find . -name "*$1*") ]]; }

cat >scene.obj <<'END'
o thing
v -5 20 0
v 5 20 0
v 0 20 9
v 0 25 4
f 1 2 3
f 2 1 4
f 3 2 4
f 1 3 4
END
# Two seconds, with frames that no video falls on.
cat >tour.json <<'END'
{"fov_degrees": 60, "frames": [
{"t": 5.0, "eye": [0, 0, 4], "forward": [0, 1, 0], "up": [0, 0, 1]},
{"t": 5.7, "eye": [0, 2, 4], "forward": [0, 1, 0], "up": [0, 0, 1]},
{"t": 7.0, "eye": [0, 4, 4], "forward": [0, 1, 0], "up": [0, 0, 1]}]}
END

# ---- Without ffmpeg

real=$(command -v ffmpeg)
mkdir with
saved=$PATH
no_ffmpeg() {
    PATH=/nowhere "$hexwalk" render scene.obj --tour tour.json --config B --video a.mp4 >out 2>err
}
no_ffmpeg
check 'exit code without ffmpeg' test $? -eq 1
check 'ffmpeg is named' grep -q 'ffmpeg, which is not installed' err
check 'nothing is left' no_trace a.mp4

# ---- With a stand-in

cat >with/ffmpeg <<'END'
#!/bin/bash
out=${@: -1}
out=${out#file:}
printf '%s\n' "$@" >arguments
case $(cat mode) in
works) wc -c >bytes; echo video >"$out" ;;
fails) cat >/dev/null; echo 'stand-in: no such codec' >&2; echo half >"$out"; exit 3 ;;
stops) head -c 100 >/dev/null; echo half >"$out"; exit 1 ;;
writes-nothing) cat >/dev/null ;;
killed) cat >/dev/null; echo half >"$out"; kill -9 $$ ;;
waits) echo half >"$out"; touch waiting; exec sleep 60 ;;
esac
END
chmod +x with/ffmpeg
PATH=$work/with:$PATH

echo works >mode
check 'a video' video 0 'B: 61 frames' a.mp4 --size 64x48
check 'is in place' grep -qx video a.mp4
check 'has all frames' test "$(cat bytes)" -eq $((61 * 64 * 48 * 4))
for word in rawvideo 64x48 30 mp4 rgb0; do
    check "ffmpeg is told $word" grep -qx -- "$word" arguments
done
check 'other rate' video 0 'B: 21 frames' --fps.mkv --fps 10 --size 32x32
check 'a name like an option' grep -qx video ./--fps.mkv
check 'has all its frames' test "$(cat bytes)" -eq $((21 * 32 * 32 * 4))
check 'matroska' grep -qx matroska arguments
check 'nothing temporary' no_trace .tmp
for mode in 'fails ffmpeg failed \(3\)' 'stops ffmpeg (takes no more frames|failed \(1\))' \
    'writes-nothing ffmpeg wrote nothing' 'killed ffmpeg was ended by signal 9'; do
    echo "${mode%% *}" >mode
    check "$mode" video 1 "b.mp4: ${mode#* }" b.mp4 --size 640x480
    check 'leaves nothing' no_trace b.mp4
    check 'keeps an older one' video 1 "${mode#* }" a.mp4 --size 64x48
    check 'as it was' grep -qx video a.mp4
done
echo waits >mode
"$hexwalk" render scene.obj --tour tour.json --config B --video c.mp4 --fps 240 >out 2>err &
render=$!
for ((i = 0; i < 100; i++)); do
    [[ -e waiting ]] && break
    sleep 0.1
done
# The stand-in takes nothing: once the pipe is full, writing waits, and is interrupted.
sleep 0.5
kill -TERM $render
wait $render
check 'an interrupted one fails' test $? -eq 1
check 'says so' grep -qE 'interrupted' err
check 'leaves nothing' no_trace c.mp4
echo works >mode
check 'no such folder' video 1 'ffmpeg wrote nothing|ffmpeg failed' nowhere/a.mp4
check 'odd ending' video 2 'a.gif' a.gif
check 'not with -o' video 2 'video' a.mp4 -o pictures
check 'not with --every' video 2 'video' a.mp4 --every 2
check 'odd rate' video 2 'fps' a.mp4 --fps 0

# ---- The real one

if [[ -n $real ]]; then
    PATH=$saved
    check 'ffmpeg itself' video 0 'B: 61 frames' real.mp4 --size 65x49
    check 'makes an MP4' eval 'head -c 12 real.mp4 | grep -q ftyp'
fi

echo "$checks checks, $failures failures"
[[ $failures -eq 0 ]]
