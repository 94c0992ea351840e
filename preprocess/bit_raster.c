#include "bit_raster.h"
#include "vec.h"
#include <math.h>
#include <stddef.h>

// Sets bits [x0, x1) of a row.
static inline void set_span(uint64_t *row, int32_t x0, int32_t x1)
{
    int32_t first = x0 >> 6, last = (x1 - 1) >> 6;
    uint64_t head = ~0ull << (x0 & 63), tail = ~0ull >> (63 - ((x1 - 1) & 63));
    if (first == last) {
        row[first] |= head & tail;
        return;
    }
    row[first] |= head;
    for (int32_t i = first + 1; i < last; i++)
        row[i] = ~0ull;
    row[last] |= tail;
}

// Where the edge crosses the row. Edges always run upwards here, so two triangles that share one
// get the same value and leave no gap.
static inline float crossing(hw_point2 low, hw_point2 high, float inverse_height, float y)
{
    return low.x + (y - low.y) * inverse_height * (high.x - low.x);
}

static inline void sort_pair(hw_point2 *a, hw_point2 *b)
{
    if (b->y < a->y || (b->y == a->y && b->x < a->x)) {
        hw_point2 t = *a;
        *a = *b;
        *b = t;
    }
}

// Index of the first pixel centre at or after a coordinate, within [0, size].
static inline int32_t first_centre(float coordinate, int32_t size)
{
    float first = ceilf(coordinate - 0.5f);
    return !(first > 0) ? 0 : first >= (float)size ? size : (int32_t)first;
}

void hw_raster_fill_triangle(uint64_t *bits, uint32_t side, hw_point2 a, hw_point2 b, hw_point2 c)
{
    int32_t size = (int32_t)side;
    sort_pair(&a, &b);
    sort_pair(&b, &c);
    sort_pair(&a, &b);
    int32_t y_first = first_centre(a.y, size), y_last = first_centre(c.y, size);
    if (y_first >= y_last)
        return;
    float long_side = 1 / (c.y - a.y);
    float lower = b.y > a.y ? 1 / (b.y - a.y) : 0, upper = c.y > b.y ? 1 / (c.y - b.y) : 0;
    size_t words = (size_t)size / 64;
    for (int32_t row = y_first; row < y_last; row++) {
        float y = (float)row + 0.5f;
        float x0 = crossing(a, c, long_side, y);
        float x1 = y < b.y ? crossing(a, b, lower, y) : crossing(b, c, upper, y);
        int32_t first = first_centre(x0 < x1 ? x0 : x1, size);
        int32_t last = first_centre(x0 < x1 ? x1 : x0, size);
        if (first < last)
            set_span(bits + (size_t)row * words, first, last);
    }
}

static uint64_t popcount(uint64_t value)
{
    return (uint64_t)__builtin_popcountll(value);
}

double hw_raster_border_length(const uint64_t *bits, uint32_t size)
{
    size_t words = size / 64;
    uint64_t across = 0, up = 0, diagonal = 0;
    for (size_t y = 0; y < size; y++) {
        const uint64_t *row = bits + y * words, *next = y + 1 < size ? row + words : row;
        for (size_t i = 0; i < words; i++) { // margins are empty: nothing crosses a row's ends
            uint64_t left = row[i] << 1 | (i > 0 ? row[i - 1] >> 63 : 0);
            uint64_t right = row[i] >> 1 | (i + 1 < words ? row[i + 1] << 63 : 0);
            across += popcount(row[i] ^ left);
            up += popcount(row[i] ^ next[i]);
            diagonal += popcount(left ^ next[i]) + popcount(right ^ next[i]);
        }
    }
    return HW_PI / 8 * ((double)(across + up) + (double)diagonal / sqrt(2.0));
}

uint64_t hw_raster_difference(const uint64_t *a, const uint64_t *b, uint32_t size)
{
    uint64_t different = 0;
    for (size_t i = 0; i < (size_t)size * (size / 64); i++)
        different += popcount(a[i] ^ b[i]);
    return different;
}
