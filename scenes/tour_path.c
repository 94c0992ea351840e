#include "tour_path.h"
#include "alloc.h"
#include "rng.h"
#include <string.h>

#define WAYPOINTS      8
#define NODES_MAX      600000.0
#define POINTS_MAX     2000000.0
#define REACH          4.0 // how many clearances away things matter, and ways lead
#define COMFORT        2.5 // ways keep this many times the clearance if they can
#define NEAR_COST      6.0 // how much dearer a way at no distance is
#define REPEAT_COST    2.0 // how much dearer a way is where the path has been
#define UNREACHED      UINT32_MAX
#define FEW_OBJECTS    3   // so many are circled, not visited one by one
#define MINIMUM_COURSE 0.3 // shorter loops, relative to width + depth, are no tour of the scene

typedef double point[2];

// A growing list of points.
typedef struct polyline {
    point *points;
    size_t count, capacity;
} polyline;

static hw_status polyline_add(polyline *p, double x, double y)
{
    HW_TRY(HW_RESERVE(&p->points, &p->capacity, p->count + 1));
    p->points[p->count][0] = x;
    p->points[p->count][1] = y;
    p->count++;
    return HW_OK;
}

static double distance(const point a, const point b)
{
    return hypot(b[0] - a[0], b[1] - a[1]);
}

static double closed_length(const polyline *p)
{
    double length = 0;
    for (size_t i = 0; i < p->count; i++)
        length += distance(p->points[i], p->points[(i + 1) % p->count]);
    return length;
}

// The rectangle that is visited.
typedef struct region {
    double x, y, width, depth; // centre and size
} region;

// A node is the centre of a square; ways lead to its eight neighbours.
typedef struct node_cost {
    double estimate;
    uint32_t node;
} node_cost;

typedef struct way_grid {
    double origin_x, origin_y, side;
    int32_t columns, rows;
    uint32_t count;
    bool *open;     // free of objects, and part of the largest connected room
    float *gap;     // clearance at the node
    float *weight;  // cost of a unit of way
    double *cost;   // of the search that runs
    uint32_t *from; //
    node_cost *heap;
    size_t heap_count, heap_capacity;
} way_grid;

static void grid_free(way_grid *g)
{
    hw_free(g->open);
    hw_free(g->gap);
    hw_free(g->weight);
    hw_free(g->cost);
    hw_free(g->from);
    hw_free(g->heap);
}

static void node_point(const way_grid *g, uint32_t node, point out)
{
    out[0] = g->origin_x + (node % (uint32_t)g->columns + 0.5) * g->side;
    out[1] = g->origin_y + (node / (uint32_t)g->columns + 0.5) * g->side;
}

// The i-th neighbour (0..7) of a node, UNREACHED beyond the edge of the grid.
static uint32_t neighbour(const way_grid *g, uint32_t node, int i)
{
    static const int steps[8][2] = {{1, 0}, {0, 1},  {-1, 0},  {0, -1},
                                    {1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
    int32_t column = (int32_t)(node % (uint32_t)g->columns) + steps[i][0];
    int32_t row = (int32_t)(node / (uint32_t)g->columns) + steps[i][1];
    if (column < 0 || row < 0 || column >= g->columns || row >= g->rows)
        return UNREACHED;
    return (uint32_t)row * (uint32_t)g->columns + (uint32_t)column;
}

// Marks in g->from the room that holds `seed` and returns its size; `stack` has room for every
// node.
static uint32_t flood(way_grid *g, uint32_t seed, uint32_t *stack)
{
    uint32_t size = 0, depth = 0;
    stack[depth++] = seed;
    g->from[seed] = seed;
    while (depth) {
        uint32_t node = stack[--depth];
        size++;
        for (int i = 0; i < 4; i++) {
            uint32_t next = neighbour(g, node, i);
            if (next == UNREACHED || !g->open[next] || g->from[next] != UNREACHED)
                continue;
            g->from[next] = seed;
            stack[depth++] = next;
        }
    }
    return size;
}

// Closes every node outside the largest connected room. False if there is none.
static hw_status keep_largest_room(way_grid *g, bool *found)
{
    uint32_t *stack = NULL, best = UNREACHED, best_size = 0;
    HW_TRY(HW_NEW(&stack, g->count));
    memset(g->from, 0xff, g->count * sizeof *g->from);
    for (uint32_t node = 0; node < g->count; node++) {
        if (!g->open[node] || g->from[node] != UNREACHED)
            continue;
        uint32_t size = flood(g, node, stack);
        if (size > best_size) {
            best_size = size;
            best = node;
        }
    }
    for (uint32_t node = 0; node < g->count; node++)
        g->open[node] = g->open[node] && g->from[node] == best;
    hw_free(stack);
    *found = best != UNREACHED;
    return HW_OK;
}

static double grid_side(const hw_tour_path_options *o, region r)
{
    double margin = REACH * o->clearance;
    double width = r.width + 2 * margin, depth = r.depth + 2 * margin;
    double side = fmax(o->clearance / 3, sqrt(width * depth / NODES_MAX));
    return fmax(side, fmax(width, depth) / NODES_MAX);
}

static hw_status grid_make(const hw_clearance *clearance, const hw_tour_path_options *o, region r,
                           way_grid *g)
{
    double margin = REACH * o->clearance;
    double width = r.width + 2 * margin, depth = r.depth + 2 * margin;
    g->side = grid_side(o, r);
    g->columns = (int32_t)(width / g->side) + 1;
    g->rows = (int32_t)(depth / g->side) + 1;
    g->origin_x = r.x - g->columns * g->side / 2;
    g->origin_y = r.y - g->rows * g->side / 2;
    g->count = (uint32_t)g->columns * (uint32_t)g->rows;
    HW_TRY(HW_NEW(&g->open, g->count));
    HW_TRY(HW_NEW(&g->gap, g->count));
    HW_TRY(HW_NEW(&g->weight, g->count));
    HW_TRY(HW_NEW(&g->cost, g->count));
    HW_TRY(HW_NEW(&g->from, g->count));
    // Distance changes by at most the way gone, so a diagonal between two nodes loses at most half
    // its length on the way.
    double needed = 1.02 * o->clearance + 0.72 * g->side;
    for (uint32_t node = 0; node < g->count; node++) {
        point p;
        node_point(g, node, p);
        double gap = hw_clearance_at(clearance, p[0], p[1], NULL);
        double lack = fmax(0, 1 - gap / (COMFORT * o->clearance));
        g->gap[node] = (float)fmin(gap, REACH * o->clearance);
        g->open[node] = gap >= needed;
        g->weight[node] = (float)(1 + NEAR_COST * lack * lack);
    }
    return HW_OK;
}

// The open node near `wanted` that passes an object closely: within `radius` the one whose gap is
// nearest to twice the clearance, else just the nearest one.
static uint32_t choose_waypoint(const way_grid *g, const point wanted, double radius,
                                double clearance)
{
    uint32_t best = UNREACHED;
    double best_score = INFINITY;
    for (uint32_t node = 0; node < g->count; node++) {
        if (!g->open[node])
            continue;
        point p;
        node_point(g, node, p);
        double d = distance(p, wanted) / radius;
        double score = d <= 1 ? fabs(g->gap[node] / clearance - 2) + 0.5 * d : 1e6 * d;
        if (score < best_score) {
            best_score = score;
            best = node;
        }
    }
    return best;
}

// Waypoints by turns far out and far in on ellipses round the region's centre.
static uint32_t choose_waypoints(const way_grid *g, region r, const hw_tour_path_options *o,
                                 uint32_t nodes[WAYPOINTS])
{
    hw_rng rng = hw_rng_make(o->seed, 2);
    double phase = 2 * HW_PI * hw_rng_float(&rng);
    uint32_t count = 0;
    for (int i = 0; i < WAYPOINTS; i++) {
        double angle = phase + 2 * HW_PI * (i + 0.3 * (hw_rng_float(&rng) - 0.5)) / WAYPOINTS;
        double out = i % 2 ? 0.1 + 0.35 * hw_rng_float(&rng) : 0.6 + 0.24 * hw_rng_float(&rng);
        const point wanted = {r.x + out * r.width / 2 * cos(angle),
                              r.y + out * r.depth / 2 * sin(angle)};
        uint32_t node = choose_waypoint(g, wanted, 0.04 * (r.width + r.depth), o->clearance);
        if (node != UNREACHED && (count == 0 || nodes[count - 1] != node))
            nodes[count++] = node;
    }
    while (count > 1 && nodes[count - 1] == nodes[0])
        count--;
    return count;
}

static void sift_up(node_cost *heap, size_t i)
{
    for (; i > 0 && heap[i].estimate < heap[(i - 1) / 2].estimate; i = (i - 1) / 2) {
        node_cost swap = heap[i];
        heap[i] = heap[(i - 1) / 2];
        heap[(i - 1) / 2] = swap;
    }
}

static node_cost heap_pop(way_grid *g)
{
    node_cost *heap = g->heap, top = heap[0];
    heap[0] = heap[--g->heap_count];
    for (size_t i = 0, child; (child = 2 * i + 1) < g->heap_count; i = child) {
        if (child + 1 < g->heap_count && heap[child + 1].estimate < heap[child].estimate)
            child++;
        if (heap[i].estimate <= heap[child].estimate)
            break;
        node_cost swap = heap[i];
        heap[i] = heap[child];
        heap[child] = swap;
    }
    return top;
}

static hw_status heap_push(way_grid *g, uint32_t node, double estimate)
{
    HW_TRY(HW_RESERVE(&g->heap, &g->heap_capacity, g->heap_count + 1));
    g->heap[g->heap_count] = (node_cost){estimate, node};
    sift_up(g->heap, g->heap_count++);
    return HW_OK;
}

// A*: fills g->from back from `to`. Both nodes are open, hence connected. The straight distance
// never overestimates because no weight is below one.
static hw_status search(way_grid *g, uint32_t start, uint32_t to)
{
    point goal, p, q;
    node_point(g, to, goal);
    for (uint32_t node = 0; node < g->count; node++)
        g->cost[node] = INFINITY;
    g->heap_count = 0;
    g->cost[start] = 0;
    g->from[start] = start;
    HW_TRY(heap_push(g, start, 0));
    while (g->heap_count) {
        node_cost top = heap_pop(g);
        if (top.node == to)
            return HW_OK;
        node_point(g, top.node, p);
        if (top.estimate > g->cost[top.node] + distance(p, goal) + 1e-9 * top.estimate)
            continue; // a better way was found meanwhile
        for (int i = 0; i < 8; i++) {
            uint32_t next = neighbour(g, top.node, i);
            if (next == UNREACHED || !g->open[next])
                continue;
            double cost = g->cost[top.node] + g->side * (i < 4 ? 1 : sqrt(2)) * 0.5 *
                                                  (g->weight[top.node] + g->weight[next]);
            if (cost >= g->cost[next])
                continue;
            g->cost[next] = cost;
            g->from[next] = top.node;
            node_point(g, next, q);
            HW_TRY(heap_push(g, next, cost + distance(q, goal)));
        }
    }
    return hw_fail(HW_INTERNAL, "a waypoint of the tour cannot be reached");
}

// Makes the surroundings of a way gone dearer.
static void mark_gone(way_grid *g, uint32_t node, double radius)
{
    int32_t reach = (int32_t)(radius / g->side);
    int32_t column = (int32_t)(node % (uint32_t)g->columns);
    int32_t row = (int32_t)(node / (uint32_t)g->columns);
    for (int32_t r = row - reach; r <= row + reach; r++)
        for (int32_t c = column - reach; c <= column + reach; c++)
            if (r >= 0 && c >= 0 && r < g->rows && c < g->columns) {
                float *weight = &g->weight[(size_t)r * (size_t)g->columns + (size_t)c];
                *weight = fmaxf(*weight, (float)REPEAT_COST);
            }
}

// The whole round through the waypoints, node by node.
static hw_status connect_waypoints(way_grid *g, const uint32_t *nodes, uint32_t count,
                                   double clearance, polyline *out)
{
    for (uint32_t i = 0; i < count; i++) {
        uint32_t start = nodes[i], to = nodes[(i + 1) % count];
        // Searched backwards, so that following `from` runs forwards.
        HW_TRY(search(g, to, start));
        for (uint32_t node = start; node != to; node = g->from[node]) {
            point p;
            node_point(g, node, p);
            HW_TRY(polyline_add(out, p[0], p[1]));
        }
        for (uint32_t node = start; node != to; node = g->from[node])
            mark_gone(g, node, 2 * clearance);
    }
    return HW_OK;
}

// Points every `step` (a little less, to come out even) along the closed polyline.
static hw_status resample(const polyline *p, double step, polyline *out)
{
    double length = closed_length(p);
    size_t count = (size_t)fmin(fmax(ceil(length / step), 16), POINTS_MAX);
    double spacing = length / (double)count, gone = 0;
    out->count = 0;
    for (size_t i = 0; i < p->count && out->count < count; i++) {
        const double *a = p->points[i], *b = p->points[(i + 1) % p->count];
        double side = distance(a, b);
        for (; out->count < count && (double)out->count * spacing <= gone + side;) {
            double t = side > 0 ? ((double)out->count * spacing - gone) / side : 0;
            HW_TRY(polyline_add(out, a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])));
        }
        gone += side;
    }
    // Rounding may leave the last point out.
    while (out->count < count)
        HW_TRY(polyline_add(out, p->points[0][0], p->points[0][1]));
    return HW_OK;
}

// One round of averaging neighbours, then pushing away from objects nearer than `soft` by half the
// lack, and nearer than `hard` by all of it.
static void relax_once(const hw_clearance *clearance, const polyline *in, polyline *out,
                       double soft, double hard)
{
    size_t n = in->count;
    for (size_t i = 0; i < n; i++) {
        const double *a = in->points[(i + n - 1) % n], *b = in->points[i];
        const double *c = in->points[(i + 1) % n];
        double *q = out->points[i], away[2];
        for (int k = 0; k < 2; k++)
            q[k] = 0.5 * b[k] + 0.25 * (a[k] + c[k]);
        double gap = hw_clearance_at(clearance, q[0], q[1], away);
        double push = fmax(0, 0.5 * (soft - gap));
        push = fmax(push, hard - gap);
        for (int k = 0; k < 2; k++)
            q[k] += push * away[k];
    }
}

// Averages over a distance of about `sigma` while keeping clear of objects. p gets points every
// `spacing`.
static hw_status relax(const hw_clearance *clearance, polyline *p, double spacing, double sigma,
                       double soft, double hard)
{
    hw_status status = HW_OK;
    polyline other = {0};
    // One round spreads by a variance of spacing^2 / 2.
    int rounds = (int)fmin(2 * sigma * sigma / (spacing * spacing), 2000) + 1;
    for (int i = 0; i < rounds; i++) {
        if (i % 16 == 0) {
            HW_GO(resample(p, spacing, &other));
            polyline swap = *p;
            *p = other;
            other = swap;
        }
        HW_GO(HW_RESERVE(&other.points, &other.capacity, p->count));
        other.count = p->count;
        relax_once(clearance, p, &other, soft, hard);
        polyline swap = *p;
        *p = other;
        other = swap;
    }
out:
    hw_free(other.points);
    return status;
}

// A Catmull-Rom curve through the points, four pieces a side.
static hw_status round_off(const polyline *p, polyline *out)
{
    size_t n = p->count;
    out->count = 0;
    for (size_t i = 0; i < 4 * n; i++) {
        const double *a = p->points[(i / 4 + n - 1) % n], *b = p->points[i / 4];
        const double *c = p->points[(i / 4 + 1) % n], *d = p->points[(i / 4 + 2) % n];
        double t = (double)(i % 4) / 4, q[2];
        for (int k = 0; k < 2; k++)
            q[k] = b[k] + 0.5 * t *
                              (c[k] - a[k] +
                               t * (2 * a[k] - 5 * b[k] + 4 * c[k] - d[k] +
                                    t * (3 * (b[k] - c[k]) + d[k] - a[k])));
        HW_TRY(polyline_add(out, q[0], q[1]));
    }
    return HW_OK;
}

// Whether every place on the curve keeps the clearance, float rounding of the eye included.
static bool keeps_clear(const hw_clearance *clearance, const polyline *p, double needed)
{
    for (size_t i = 0; i < p->count; i++) {
        const double *a = p->points[i];
        double half = distance(a, p->points[(i + 1) % p->count]) / 2;
        double rounding = 2.4e-7 * (fabs(a[0]) + fabs(a[1]));
        if (hw_clearance_at(clearance, a[0], a[1], NULL) < needed + half + rounding)
            return false;
    }
    return true;
}

// Smooths the course as much as the objects allow: less and less, at last not at all.
static hw_status smooth(const hw_clearance *clearance, const hw_tour_path_options *o,
                        const polyline *course, double least, polyline *out, bool *found)
{
    static const double degrees[] = {1, 0.6, 0.3, 0.1, 0};
    hw_status status = HW_OK;
    polyline work = {0}, curve = {0};
    double length = closed_length(course);
    double spacing = fmax(o->clearance / 2, length / 5000);
    double step = fmin(o->step, o->clearance / 16);
    *found = false;
    for (size_t i = 0; i < sizeof degrees / sizeof *degrees && !*found; i++) {
        double sigma = fmin(degrees[i] * o->turn_radius, length / 24);
        double hard = o->clearance * 1.1 + spacing * 0.1;
        HW_GO(resample(course, degrees[i] > 0 ? spacing : step, &work));
        if (degrees[i] > 0) {
            HW_GO(relax(clearance, &work, spacing, sigma, 1.8 * o->clearance, hard));
            HW_GO(relax(clearance, &work, spacing, sigma / 4, hard, hard));
            HW_GO(round_off(&work, &curve));
            HW_GO(resample(&curve, step, &work));
        }
        *found = closed_length(&work) >= least && keeps_clear(clearance, &work, o->clearance);
    }
    if (*found) {
        *out = work;
        work = (polyline){0};
    }
out:
    hw_free(work.points);
    hw_free(curve.points);
    return status;
}

// A course through the region; *found tells whether there is one.
static hw_status plan_course(const hw_clearance *clearance, const hw_tour_path_options *o, region r,
                             polyline *out, bool *found)
{
    hw_status status = HW_OK;
    way_grid g = {0};
    polyline course = {0};
    uint32_t nodes[WAYPOINTS];
    *found = false;
    HW_GO(grid_make(clearance, o, r, &g));
    HW_GO(keep_largest_room(&g, found));
    uint32_t count = *found ? choose_waypoints(&g, r, o, nodes) : 0;
    *found = false;
    if (count < 3)
        goto out;
    HW_GO(connect_waypoints(&g, nodes, count, o->clearance, &course));
    HW_GO(smooth(clearance, o, &course, MINIMUM_COURSE * (r.width + r.depth), out, found));
out:
    hw_free(course.points);
    grid_free(&g);
    return status;
}

// A circle round everything always keeps clear.
static hw_status circle(const hw_tour_path_options *o, region r, polyline *out)
{
    double half = hypot(r.width, r.depth) / 2;
    double radius = half + 2 * o->clearance + 0.25 * half;
    size_t count = (size_t)fmin(fmax(ceil(2 * HW_PI * radius / o->step), 64), POINTS_MAX);
    for (size_t i = 0; i < count; i++) {
        double angle = 2 * HW_PI * (double)i / (double)count;
        HW_TRY(polyline_add(out, r.x + radius * cos(angle), r.y + radius * sin(angle)));
    }
    return HW_OK;
}

static region whole_region(const hw_scene *scene)
{
    hw_box box = hw_scene_bounds(scene);
    return (region){0.5 * ((double)box.min.x + box.max.x), 0.5 * ((double)box.min.y + box.max.y),
                    (double)box.max.x - box.min.x, (double)box.max.y - box.min.y};
}

// The squares of a wide scene may be wider than the clearance; grid_make asks for a gap of 0.72 of
// one.
double hw_tour_path_reach(const hw_scene *scene, const hw_tour_path_options *options)
{
    double side = grid_side(options, whole_region(scene));
    return fmax(REACH * options->clearance, 1.02 * options->clearance + 1.5 * side);
}

void hw_tour_path_free(hw_tour_path *path)
{
    hw_free(path->points);
    *path = (hw_tour_path){0};
}

hw_status hw_tour_path_plan(const hw_scene *scene, const hw_clearance *clearance,
                            const hw_tour_path_options *options, hw_tour_path *out)
{
    hw_status status = HW_OK;
    polyline course = {0};
    bool found = false;
    *out = (hw_tour_path){0};
    if (scene->object_count == 0)
        return hw_fail(HW_FORMAT, "%s: no objects to tour", scene->path ? scene->path : "scene");
    region all = whole_region(scene);
    region part = all;
    double excess = (all.width + all.depth) / options->span;
    if (excess > 1) {
        part.width /= excess;
        part.depth /= excess;
    }
    if (scene->object_count > FEW_OBJECTS)
        HW_GO(plan_course(clearance, options, part, &course, &found));
    if (!found && scene->object_count > FEW_OBJECTS && excess > 1)
        HW_GO(plan_course(clearance, options, all, &course, &found));
    if (!found)
        HW_GO(circle(options, all, &course));
    out->points = course.points;
    out->count = (uint32_t)course.count;
    out->around = !found;
    course = (polyline){0};
out:
    hw_free(course.points);
    return status;
}
