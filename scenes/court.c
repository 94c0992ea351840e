#include "court.h"
#include "alloc.h"
#include "masonry.h"
#include "rng.h"
#include <string.h>

#define SLOTS        4 // pieces along a side of a court; a doorway is one left out
#define PIECE        (HW_COURT_SIDE / SLOTS)
#define FLOOR_MARGIN 30.0
#define EXTRA_DOORS  4 // beyond those that connect everything: one boundary in so many

typedef enum finish { BRICK, YEW, PORTLAND, FINISH_COUNT } finish;
static const struct {
    const char *name;
    float color[3];
} finishes[FINISH_COUNT] = {{"brick", {0.78f, 0.52f, 0.42f}},
                            {"yew", {0.36f, 0.50f, 0.28f}},
                            {"portland stone", {0.93f, 0.91f, 0.86f}}};
static const finish finish_of[HW_MASONRY_COUNT] = {
    [HW_MASONRY_WALL] = BRICK,
    [HW_MASONRY_HEDGE] = YEW,
    [HW_MASONRY_COLONNADE] = PORTLAND,
    [HW_MASONRY_PIER] = PORTLAND,
};

// Work in progress: the raster, and which mesh of the scene is which piece.
typedef struct courts {
    hw_scene *scene;
    uint32_t columns, rows;
    uint32_t meshes[HW_MASONRY_COUNT];
    uint32_t first_material;
    uint32_t *parents; // courts that doorways connect, as a forest
    hw_rng rng;
} courts;

// A boundary between two courts, or of one court and the outside.
typedef struct boundary {
    uint32_t column, row; // of the court to the east or north
    bool turned;          // along y, its courts to the west and east
    bool outer, door;
} boundary;

hw_court_floor hw_court_floor_of(uint32_t columns, uint32_t rows, uint32_t index)
{
    double x = (index % columns - columns / 2.0) * HW_COURT_SIDE;
    double y = (index / columns - rows / 2.0) * HW_COURT_SIDE;
    return (hw_court_floor){x + FLOOR_MARGIN, y + FLOOR_MARGIN, HW_COURT_SIDE - 2 * FLOOR_MARGIN};
}

static hw_status add_meshes(courts *c)
{
    hw_scene *scene = c->scene;
    HW_TRY(HW_RESIZE(&scene->meshes, scene->mesh_count + HW_MASONRY_COUNT));
    for (int kind = 0; kind < HW_MASONRY_COUNT; kind++) {
        HW_TRY(hw_masonry_make((hw_masonry)kind, PIECE, &scene->meshes[scene->mesh_count]));
        c->meshes[kind] = scene->mesh_count++;
    }
    return HW_OK;
}

static hw_status add_materials(courts *c)
{
    hw_scene *scene = c->scene;
    c->first_material = scene->material_count;
    HW_TRY(HW_RESIZE(&scene->materials, scene->material_count + FINISH_COUNT));
    for (int i = 0; i < FINISH_COUNT; i++) {
        hw_material *material = &scene->materials[scene->material_count];
        *material = (hw_material){0};
        HW_TRY(hw_strdup(&material->name, finishes[i].name));
        memcpy(material->base_color, finishes[i].color, sizeof material->base_color);
        scene->material_count++;
    }
    return HW_OK;
}

static hw_status add_piece(courts *c, hw_masonry kind, hw_mat4 transform)
{
    hw_scene *scene = c->scene;
    HW_TRY(HW_RESIZE(&scene->objects, scene->object_count + 1));
    hw_object *object = &scene->objects[scene->object_count++];
    *object = (hw_object){.mesh_idx = c->meshes[kind],
                          .material_idx = c->first_material + finish_of[kind],
                          .transform = transform};
    // Turned by right angles, so that the box of the box is exact.
    hw_box bounds = hw_mesh_bounds(&scene->meshes[object->mesh_idx]);
    object->bounds = hw_mat4_box(&transform, bounds);
    return HW_OK;
}

// By quarters, exactly.
static hw_mat4 placed(double x, double y, bool turned)
{
    hw_mat4 m = hw_mat4_translation(x, y, 0);
    if (turned) {
        m.m[0] = m.m[5] = 0;
        m.m[1] = 1;
        m.m[4] = -1;
    }
    return m;
}

static hw_masonry choose_kind(courts *c, bool outer)
{
    uint32_t dice = hw_rng_below(&c->rng, 100);
    if (outer)
        return HW_MASONRY_WALL;
    return dice < 50 ? HW_MASONRY_WALL : dice < 90 ? HW_MASONRY_HEDGE : HW_MASONRY_COLONNADE;
}

static hw_status add_boundary(courts *c, const boundary *b)
{
    hw_masonry kind = choose_kind(c, b->outer);
    uint32_t door = hw_rng_below(&c->rng, SLOTS);
    for (uint32_t slot = 0; slot < SLOTS; slot++) {
        double x = (b->column - c->columns / 2.0) * HW_COURT_SIDE;
        double y = (b->row - c->rows / 2.0) * HW_COURT_SIDE;
        *(b->turned ? &y : &x) += (slot + 0.5) * PIECE;
        if (!b->door || slot != door)
            HW_TRY(add_piece(c, kind, placed(x, y, b->turned)));
    }
    return HW_OK;
}

static uint32_t root_of(const courts *c, uint32_t court)
{
    while (c->parents[court] != court)
        court = c->parents[court];
    return court;
}

// Boundaries in random order get a doorway when it connects what is not connected yet (Kruskal
// 1956), and a few more do.
static void open_doors(courts *c, boundary *list, uint32_t count)
{
    for (uint32_t i = count; i > 1; i--) {
        uint32_t k = hw_rng_below(&c->rng, i);
        boundary swap = list[i - 1];
        list[i - 1] = list[k];
        list[k] = swap;
    }
    for (uint32_t i = 0; i < count; i++) {
        if (list[i].outer)
            continue;
        uint32_t court = list[i].row * c->columns + list[i].column;
        uint32_t a = root_of(c, court);
        uint32_t b = root_of(c, list[i].turned ? court - 1 : court - c->columns);
        list[i].door = a != b || hw_rng_below(&c->rng, EXTRA_DOORS) == 0;
        c->parents[a] = b;
    }
}

static hw_status add_boundaries(courts *c)
{
    hw_status status = HW_OK;
    boundary *list = NULL;
    uint32_t count = 0, courts_count = c->columns * c->rows;
    HW_GO(HW_NEW(&c->parents, courts_count));
    HW_GO(HW_NEW(&list, 2 * courts_count + c->columns + c->rows));
    for (uint32_t i = 0; i < courts_count; i++)
        c->parents[i] = i;
    for (uint32_t row = 0; row <= c->rows; row++)
        for (uint32_t column = 0; column <= c->columns; column++) {
            if (row < c->rows)
                list[count++] =
                    (boundary){column, row, true, column == 0 || column == c->columns, false};
            if (column < c->columns)
                list[count++] = (boundary){column, row, false, row == 0 || row == c->rows, false};
        }
    open_doors(c, list, count);
    for (uint32_t i = 0; i < count; i++)
        HW_GO(add_boundary(c, &list[i]));
out:
    hw_free(list);
    hw_free(c->parents);
    return status;
}

hw_status hw_court_build(hw_scene *scene, uint32_t columns, uint32_t rows, uint64_t seed)
{
    courts c = {.scene = scene, .columns = columns, .rows = rows, .rng = hw_rng_make(seed, 3)};
    HW_TRY(add_meshes(&c));
    HW_TRY(add_materials(&c));
    HW_TRY(add_boundaries(&c));
    for (uint32_t row = 0; row <= rows; row++)
        for (uint32_t column = 0; column <= columns; column++)
            HW_TRY(add_piece(&c, HW_MASONRY_PIER,
                             placed((column - columns / 2.0) * HW_COURT_SIDE,
                                    (row - rows / 2.0) * HW_COURT_SIDE, false)));
    return HW_OK;
}
