# Sourced by the tests of the program: made-up scenes.

# Balls along both sides of a path, as OBJ on standard output: make_scene RADIUS [RINGS].
make_scene() {
    awk -v radius="$1" -v rings="${2:-12}" 'BEGIN {
        pi = 3.14159265; sides = rings * 3 / 2; base = 1
        for (ball = 0; ball < 10; ball++) {
            print "o ball" ball
            cx = ball * 25; cy = ball % 2 ? 30 : -30
            for (i = 0; i <= rings; i++) for (j = 0; j < sides; j++) {
                a = pi * i / rings; b = 2 * pi * j / sides
                printf "v %.5f %.5f %.5f\n", cx + radius * sin(a) * cos(b), \
                    cy + radius * sin(a) * sin(b), radius - radius * cos(a)
            }
            for (i = 0; i < rings; i++) for (j = 0; j < sides; j++) {
                p = base + i * sides + j; q = base + i * sides + (j + 1) % sides
                if (i < rings - 1) printf "f %d %d %d\n", p, q + sides, p + sides
                if (i > 0) printf "f %d %d %d\n", p, q, q + sides
            }
            base += (rings + 1) * sides
        }
    }'
}
