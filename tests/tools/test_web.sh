#!/bin/bash
# A dataset on a web server: nginx on loopback serves it, hexwalk draws from there what it draws from
# the folder, with and without prefetching, and tells what is wrong with a server. Exits with 77
# (skipped) where nginx is missing.
#   test_web.sh PROGRAM
set -uo pipefail

hexwalk=$(realpath "$1")
source "$(dirname "${BASH_SOURCE[0]}")/scenes.sh"
export PATH=$PATH:/usr/sbin:/sbin
command -v nginx >/dev/null || { echo "skipped: no nginx"; exit 77; }

work=$(mktemp -d)
clean_up() {
    [[ ! -s $work/nginx.pid ]] || kill "$(<"$work/nginx.pid")" 2>/dev/null
    rm -rf "$work"
}
trap clean_up EXIT
cd "$work" || exit 1
failures=0

fail() {
    printf 'FAILED: %s\n' "$1"
    sed 's/^/    /' log
    failures=$((failures + 1))
}

# run CODE ARGUMENT... - the exit code must be CODE; output goes to `log`.
run() {
    local code=$1
    shift
    timeout 120 "$hexwalk" "$@" >log 2>&1 </dev/null
    local got=$?
    [[ $got -eq $code ]] || { fail "hexwalk $* exited with $got, not $code"; return 1; }
}

# nginx on the first free port of a few, as the user who runs the test.
start_server() {
    local port
    chmod 755 "$work"
    for port in $(shuf -i 20000-60000 -n 20); do
        cat >nginx.conf <<EOF
pid $work/nginx.pid;
error_log $work/error.log;
events {}
http {
    access_log $work/access.log;
    client_body_temp_path $work/tmp1; proxy_temp_path $work/tmp2; fastcgi_temp_path $work/tmp3;
    uwsgi_temp_path $work/tmp4; scgi_temp_path $work/tmp5;
    server { listen 127.0.0.1:$port; root $work; }
}
EOF
        [[ $EUID -ne 0 ]] || sed -i '1i user root;' nginx.conf
        nginx -c "$work/nginx.conf" -p "$work" 2>nginx.err && { url=http://127.0.0.1:$port; return; }
    done
    cat nginx.err
    exit 1
}

make_tour() {
    awk 'BEGIN {
        printf "{\"fov_degrees\":60,\"frames\":["
        for (i = 0; i < 40; i++)
            printf "%s{\"t\":%.3f,\"eye\":[%.1f,0,12],\"forward\":[1,0.2,0],\"up\":[0,0,1]}",
                i ? "," : "", i / 30, i * 3
        print "]}"
    }'
}

echo 'not run' >log
make_scene 10 >balls.obj
make_tour >tour.json
run 0 build balls.obj -o data --cell-size 40 --quiet || exit 1
start_server

run 0 render data --tour tour.json -o local --size 96x96 --every 8 --quiet
run 0 render "$url/data/" --tour tour.json -o remote --size 96x96 --every 8 --quiet
diff -r local remote >log 2>&1 || fail 'frames from the server differ'
grep -q '"GET /data/meshes/[0-9]*.hxm HTTP/1.1" 206' access.log || fail 'no ranges were asked for'

# Prefetching, with and without a limit of bandwidth.
run 0 render "$url/data" --tour tour.json --prefetch on --no-images --json on.json --quiet
run 0 render "$url/data" --tour tour.json --prefetch on --bandwidth 2M --no-images --json on.json --quiet

# A dataset that is none, a server that is none, a scheme that is none.
run 1 render "$url/nothing" --tour tour.json --no-images --quiet
grep -q "$url/nothing/manifest.json: not found" log || fail 'the missing dataset was not named'
printf '{"version": 2' >data/broken.json
mkdir broken && head -c 100 data/manifest.json >broken/manifest.json
run 1 render "$url/broken" --tour tour.json --no-images --quiet
grep -q "$url/broken/manifest.json" log || fail 'the broken manifest was not named'
run 1 render ftp://127.0.0.1/data --tour tour.json --no-images --quiet

# A cell that is damaged on the server.
cell=$(ls data/cells/0/*.hxc | head -n 1)
for f in data/cells/0/*.hxc; do head -c 200 "$cell" >"$f"; done
run 1 render "$url/data" --tour tour.json --no-images --quiet
grep -q "$url/data/cells/0/.*hxc" log || fail 'the damaged cell was not named'

echo "$failures failures"
[[ $failures -eq 0 ]]
