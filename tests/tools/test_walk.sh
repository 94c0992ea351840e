#!/bin/bash
# hexwalk walk as a person uses it: a window on a virtual display, keys, screenshots. Exits with 77
# (skipped) where Xvfb or xdotool is missing.
#   test_walk.sh PROGRAM
set -uo pipefail

hexwalk=$(realpath "$1")
for tool in Xvfb xdotool; do
    command -v $tool >/dev/null || { echo "skipped: no $tool"; exit 77; }
done

work=$(mktemp -d)
server= walk=
clean_up() {
    [[ -z $walk ]] || kill -9 "$walk" 2>/dev/null
    [[ -z $server ]] || kill "$server" 2>/dev/null
    wait 2>/dev/null
    rm -rf "$work"
}
trap clean_up EXIT
cd "$work" || exit 1
checks=0 failures=0

# check WHAT COMMAND... - counts a failure if the command fails.
check() {
    local what=$1
    shift
    checks=$((checks + 1))
    "$@" >found && return
    printf 'FAILED: %s %s\n' "$what" "$(tr "\n" " " <found)"
    [[ ! -e err ]] || sed 's/^/    err: /' err
    failures=$((failures + 1))
}

# until_true SECONDS COMMAND... - tries until the command succeeds.
until_true() {
    local tries=$(($1 * 10))
    shift
    while ! "$@" >/dev/null 2>&1; do
        ((tries-- > 0)) || return 1
        sleep 0.1
    done
}

# fails_with CODE PATTERN COMMAND...
fails_with() {
    local code=$1 pattern=$2 got
    shift 2
    timeout 60 "$@" >out 2>err </dev/null
    got=$?
    [[ $got -eq $code ]] || { echo "exit code $got"; return 1; }
    grep -qE -- "$pattern" err
}

# does PATTERN COMMAND... - exits with 0 and prints the pattern.
does() {
    local pattern=$1
    shift
    timeout 120 "$@" >out 2>err </dev/null || return 1
    grep -qE -- "$pattern" out
}

# start TITLE ARGUMENT... - opens a window and waits for its title.
start() {
    local title=$1
    shift
    "$hexwalk" walk "$@" >out 2>err </dev/null &
    walk=$!
    until_true 60 window "$title"
}

window() { xdotool search --name "$1"; }

# ended CODE - the walk ends by itself, with that exit code.
ended() {
    local got
    until_true 30 eval '! kill -0 $walk' || return 1
    wait "$walk"
    got=$?
    walk=
    [[ $got -eq $1 ]] || { echo "exit code $got"; return 1; }
}

# size_is FILE WIDTH HEIGHT - of a PNG.
size_is() {
    local sides
    [[ -s $1 ]] || return 1
    sides=$(od -An -tu1 -j16 -N8 "$1")
    # shellcheck disable=SC2086
    set -- $sides "$2" "$3"
    [[ $((($1 << 24) + ($2 << 16) + ($3 << 8) + $4)) -eq $9 ]] &&
        [[ $((($5 << 24) + ($6 << 16) + ($7 << 8) + $8)) -eq ${10} ]]
}

# Six boxes on a plain of 300 x 200.
make_scene() {
    local n=0 x y z
    for y in 50 150; do
        for x in 50 150 250; do
            echo "o box$n"
            for z in 0 25; do
                printf 'v %d %d %d\n' $((x - 8)) $((y - 8)) $z $((x + 8)) $((y - 8)) $z \
                    $((x + 8)) $((y + 8)) $z $((x - 8)) $((y + 8)) $z
            done
            for f in "1 3 2" "1 4 3" "5 6 7" "5 7 8" "1 2 6" "1 6 5" "2 3 7" "2 7 6" "3 4 8" \
                "3 8 7" "4 1 5" "4 5 8"; do
                # shellcheck disable=SC2086
                set -- $f
                echo "f $(($1 + 8 * n)) $(($2 + 8 * n)) $(($3 + 8 * n))"
            done
            n=$((n + 1))
        done
    done
}

make_scene >scene.obj
head -c 60 scene.obj >cut.obj

# ---- Without a display

unset DISPLAY WAYLAND_DISPLAY
check 'no display' fails_with 1 'display.*hexwalk render' "$hexwalk" walk scene.obj
check 'no such file' fails_with 1 'nowhere' "$hexwalk" walk nowhere
check 'no dataset' fails_with 1 'manifest' "$hexwalk" walk "$work"
check 'C on a scene' fails_with 2 'needs a dataset' "$hexwalk" walk scene.obj --config C
check 'no such tour' fails_with 1 'no.json' "$hexwalk" walk scene.obj --tour no.json
check 'no folder to record to' fails_with 1 'no/t.json' "$hexwalk" walk scene.obj --record no/t.json
check 'odd samples' fails_with 2 'samples' "$hexwalk" walk scene.obj --samples 3
check 'odd collision' fails_with 2 'collision' "$hexwalk" walk scene.obj --collision maybe
for key in 'W, Up' 'Ctrl\+V' 'F12' 'F8' 'Escape, Ctrl\+Q' 'Sticks'; do
    check "help tells of $key" does "^  $key(, pad [A-Z]+)? +[a-z]" "$hexwalk" help walk
done
check 'tiny window' fails_with 2 'size' "$hexwalk" walk scene.obj --size 3x3

# ---- A scene

exec 3<>display
Xvfb -displayfd 3 -screen 0 800x600x24 -nolisten tcp -noreset >server.log 2>&1 &
server=$!
until_true 30 test -s display || { cat server.log; echo 'skipped: Xvfb does not start'; exit 77; }
DISPLAY=:$(head -1 display)
export DISPLAY
# Keys go to the window under the pointer.
xdotool mousemove 60 60

size=(--size 320x240)
for config in A B L; do
    check "configuration $config" does '^7 frames in' \
        "$hexwalk" walk scene.obj --config $config --frames 7 "${size[@]}"
done
check '4 samples' does '^7 frames in' "$hexwalk" walk scene.obj --samples 4 --frames 7 "${size[@]}"
check 'broken scene' fails_with 1 'cut.obj' "$hexwalk" walk cut.obj "${size[@]}"
check 'fullscreen' does '^3 frames' "$hexwalk" walk scene.obj --fullscreen --frames 3

echo precious >hexwalk_0001.png
check 'window' start 'scene.obj - B .*Hexwalk' scene.obj "${size[@]}"
xdotool key F12
check 'screenshot' until_true 20 test -s hexwalk_0002.png
check 'nothing overwritten' grep -q precious hexwalk_0001.png
xdotool key r
sleep 0.3
xdotool keydown w
sleep 0.5
xdotool keyup w
xdotool key r
check 'recording' until_true 20 test -s hexwalk_tour_0001.json
xdotool key F1 F2 F12
check 'second screenshot' until_true 20 test -s hexwalk_0003.png
check 'the walker has moved' eval '! cmp -s hexwalk_0002.png hexwalk_0003.png'
check 'size of a screenshot' size_is hexwalk_0003.png 320 240
for step in '1 A' '3 L' '2 B'; do
    xdotool key "${step% *}"
    check "key ${step% *}" until_true 30 window "scene.obj - ${step#* } "
done
xdotool key 4
sleep 0.3
check 'no C for scenes' window 'scene.obj - B '
id=$(window 'scene.obj - B ' | head -1)
xdotool windowsize --sync "$id" 400 300
sleep 0.5
xdotool key F12
check 'third screenshot' until_true 20 test -s hexwalk_0004.png
check 'size after resizing' size_is hexwalk_0004.png 400 300
# A click captures the mouse, the first Escape releases it, the second one quits.
xdotool mousemove 60 60 click 1
sleep 0.3
xdotool key Escape
sleep 0.5
check 'the first Escape releases' kill -0 "$walk"
xdotool key Escape
check 'the second Escape quits' ended 0

check 'playing what was recorded' does '^20 frames' \
    "$hexwalk" walk scene.obj --tour hexwalk_tour_0001.json --frames 20 "${size[@]}"
check 'window' start 'scene.obj - B ' scene.obj --record whole.json "${size[@]}"
xdotool key ctrl+q
check 'Ctrl-Q quits' ended 0
check 'the whole walk recorded' grep -q '"frames"' whole.json
rm -f whole.json
check 'window' start 'scene.obj - B ' scene.obj --record whole.json "${size[@]}"
kill -INT "$walk"
check 'Ctrl-C in the terminal quits' ended 0
check 'and keeps the recording' grep -q '"frames"' whole.json

# ---- Motion

# moves KEY EXPRESSION [WITH] - records a tour while the key is held, and WITH, and looks at what it
# did: ways ahead, to the right and up as seen at first, the angles turned to the left and up in
# degrees, the largest speed.
tours=$(ls hexwalk_tour_*.json | wc -l)
moves() {
    tours=$((tours + 1))
    local made
    made=$(printf 'hexwalk_tour_%04d.json' $tours)
    xdotool key r
    sleep 0.3
    [[ -z ${3-} ]] || xdotool keydown "$3"
    xdotool keydown "$1"
    sleep 0.6
    xdotool keyup "$1"
    [[ -z ${3-} ]] || xdotool keyup "$3"
    sleep 0.3
    xdotool key r
    until_true 20 test -s "$made" || { echo 'nothing recorded'; return 1; }
    python3 - "$made" "$2" <<'PYTHON'
import json, math, sys
frames = json.load(open(sys.argv[1]))["frames"]
a, b = frames[0], frames[-1]
yaw = [math.atan2(f["forward"][1], f["forward"][0]) for f in (a, b)]
pitch = [math.asin(f["forward"][2]) for f in (a, b)]
way = [y - x for x, y in zip(a["eye"], b["eye"])]
ahead = way[0] * math.cos(yaw[0]) + way[1] * math.sin(yaw[0])
right = way[0] * math.sin(yaw[0]) - way[1] * math.cos(yaw[0])
up = way[2]
left = math.degrees((yaw[1] - yaw[0] + math.pi) % (2 * math.pi) - math.pi)
look = math.degrees(pitch[1] - pitch[0])
speed = max(math.dist(x["eye"], y["eye"]) / (y["t"] - x["t"]) for x, y in zip(frames, frames[1:]))
still = all(abs(v) < 0.01 for v in (left, look))
stays = all(abs(v) < 0.01 for v in way)
print(f"ahead {ahead:.2f} right {right:.2f} up {up:.2f} left {left:.2f} look {look:.2f} speed {speed:.1f}")
assert eval(sys.argv[2])
PYTHON
}
level='still and abs(up) < 0.01'
check 'window' start 'scene.obj - B ' scene.obj --collision off "${size[@]}"
sleep 1
for key in w Up; do
    check "$key goes ahead" moves $key "$level and ahead > 2 and abs(right) < 0.01"
done
walking=$(sed 's/.*speed //' found)
check 'Shift runs' moves w "$level and ahead > 2 and abs(right) < 0.01 and speed > 1.3 * $walking" shift
for key in s Down; do
    check "$key goes back" moves $key "$level and ahead < -2 and abs(right) < 0.01"
done
check 'a goes to the left' moves a "$level and right < -2 and abs(ahead) < 0.01"
check 'd goes to the right' moves d "$level and right > 2 and abs(ahead) < 0.01"
check 'e rises' moves e 'still and up > 1 and abs(ahead) + abs(right) < 0.01'
check 'q sinks' moves q 'still and up < -1 and abs(ahead) + abs(right) < 0.01'
check 'Left turns left' moves Left 'stays and left > 5 and abs(look) < 0.01'
check 'Right turns right' moves Right 'stays and left < -5 and abs(look) < 0.01'
check 'Page Up looks up' moves Prior 'stays and look > 5 and abs(left) < 0.01'
check 'Page Down looks down' moves Next 'stays and look < -5 and abs(left) < 0.01'
xdotool key Escape
check 'quits' ended 0

# ---- Views

# shot NAME - takes a screenshot, the next of the series, as NAME.png.
shots=$(ls hexwalk_*.png | wc -l)
shot() {
    shots=$((shots + 1))
    local made
    made=$(printf 'hexwalk_%04d.png' $shots)
    xdotool key F12
    until_true 20 test -s "$made" || return 1
    sleep 0.1
    cp "$made" "$1.png"
}
same() { cmp -s "$1.png" "$2.png"; }
differ() { ! cmp -s "$1.png" "$2.png"; }

check 'window' start 'scene.obj - L ' scene.obj --config L "${size[@]}"
sleep 1
check 'plain' shot plain
# view KEY NAME - the key changes the picture, and changes it back.
for view in 'F3 tint' 'F4 wireframe'; do
    xdotool key "${view% *}"
    check "$view" shot "${view#* }"
    check "$view shows" differ plain "${view#* }"
    xdotool key "${view% *}"
    check 'and back' shot back
    check "$view goes" same plain back
done
# Figures, help and map are not in a screenshot.
xdotool key F1 F2 F5
check 'HUD' shot hud
check 'a screenshot has no HUD' same plain hud
xdotool key F1 F2 F5
# Looking away with culling frozen leaves out what is there otherwise.
xdotool key F6
xdotool keydown Right
sleep 1.5
xdotool keyup Right
sleep 0.3
check 'frozen' shot frozen
xdotool key F6
check 'thawed' shot thawed
check 'frozen culling shows' differ frozen thawed
# L against B: the picture is B's on the right of the seam, wherever that is.
xdotool key F7
sleep 2
check 'split' shot split
check 'the split shows' differ split thawed
xdotool keydown comma
sleep 3
xdotool keyup comma
check 'all B' shot all_b
xdotool keydown period
sleep 4
xdotool keyup period
check 'all L' shot all_l
check 'the seam moves' differ all_b all_l
xdotool key F8
sleep 1
check 'errors' shot errors
check 'the error map shows' differ errors split
xdotool key F8
check 'plain again' shot plain_again
check 'views are gone' same plain_again thawed
# The camera by way of the clipboard.
xdotool key ctrl+c
sleep 0.3
xdotool keydown w
sleep 0.5
xdotool keyup w
sleep 0.2
check 'walked' shot walked
check 'somewhere else' differ walked thawed
xdotool key ctrl+v
sleep 0.5
check 'pasted' shot pasted
check 'pasting goes back' same pasted thawed
xdotool key F11
sleep 1
check 'fullscreen' shot full
check 'it fills the screen' size_is full.png 800 600
xdotool key F11
sleep 1
check 'window again' shot small
check 'of the old size' size_is small.png 320 240
xdotool key Escape
check 'quits' ended 0

# ---- At random

check 'a random walk' does '^random walk: 600 frames' \
    "$hexwalk" walk scene.obj --random-walk 20 "${size[@]}"
mv out first
check 'again' does '^random walk' "$hexwalk" walk scene.obj --random-walk 20 "${size[@]}"
check 'is the same' eval 'cmp <(head -1 first) <(head -1 out)'
check 'another' does '^random walk' "$hexwalk" walk scene.obj --random-walk 20 --seed 2 "${size[@]}"
check 'is another' eval '! cmp -s <(head -1 first) <(head -1 out)'

# ---- A dataset

check 'build' eval '"$hexwalk" build scene.obj -o data --quiet >out 2>err'
check 'configuration C' does '^7 frames in' "$hexwalk" walk data --frames 7 "${size[@]}"
check 'window' start 'data - C ' data "${size[@]}"
xdotool key 2
check 'the scene is loaded' until_true 30 window 'data - B '
xdotool key 4
check 'and back' until_true 30 window 'data - C '
mv scene.obj away.obj
xdotool key 1
sleep 1
check 'the loaded scene serves A too' until_true 30 window 'data - A '
xdotool key Escape
check 'quits' ended 0
check 'window' start 'data - C ' data "${size[@]}"
xdotool key 2
check 'a scene that has moved is told of' until_true 20 grep -q 'scene.obj' err
check 'and C goes on' window 'data - C '
xdotool key Escape
check 'quits' ended 0
check '--scene' does '^7 frames in' \
    "$hexwalk" walk data --scene away.obj --config L --frames 7 "${size[@]}"
for cell in data/cells/*/*.hxc; do
    printf 'rubbish' | dd of="$cell" bs=1 seek=8 conv=notrunc status=none
done
check 'broken cell' fails_with 1 '\.hxc' "$hexwalk" walk data "${size[@]}"
rm -rf data/cells
check 'missing cell' fails_with 1 '\.hxc' "$hexwalk" walk data "${size[@]}"

echo "$checks checks, $failures failures"
[[ $failures -eq 0 ]]
