#include "recorder.h"
#include "alloc.h"
#include <string.h>

struct hw_recorder {
    hw_collapser *collapser;
    const hw_position_grid *grid;
    hw_progressive_collapse *collapses;
    uint32_t *corners, *batches;
    size_t collapse_count, collapse_capacity, corner_count, corner_capacity, batch_count,
        batch_capacity;
    size_t batch_start; // first collapse of the batch in progress
    bool *dropped;      // per face: took no part
    hw_status status;   // of the first failure; nothing is recorded after it
};

static void to_float(const double p[3], float out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = (float)p[i];
}

static hw_status record(hw_recorder *r, const hw_collapser *c, const hw_collapse *collapse)
{
    uint32_t kept = collapse->kept, removed = collapse->removed, faces = 0;
    HW_TRY(HW_RESERVE(&r->collapses, &r->collapse_capacity, r->collapse_count + 1));
    hw_progressive_collapse *out = &r->collapses[r->collapse_count];
    *out = (hw_progressive_collapse){.kept = kept,
                                     .removed = removed,
                                     .faces = {UINT32_MAX, UINT32_MAX},
                                     .first_corner = (uint32_t)r->corner_count};
    to_float(c->positions[kept], out->kept_before);
    to_float(c->positions[removed], out->removed_before);
    to_float(collapse->position, out->merged);
    for (uint32_t k = c->first_corner[removed]; k != HW_NO_VERTEX; k = hw_next_corner(c, k)) {
        const uint32_t *face = c->faces[k / 4];
        if (hw_face_has(face, kept)) { // at most two: collapse_valid
            memcpy(out->face_corners[faces], face, sizeof out->face_corners[0]);
            out->faces[faces++] = k / 4;
            continue;
        }
        HW_TRY(HW_RESERVE(&r->corners, &r->corner_capacity, r->corner_count + 1));
        r->corners[r->corner_count++] = k / 4 * 3 + k % 4;
        out->corner_count++;
    }
    r->collapse_count++;
    return HW_OK;
}

static void observe(void *context, const hw_collapser *c, const hw_collapse *collapse)
{
    hw_recorder *r = context;
    if (r->status == HW_OK)
        r->status = record(r, c, collapse);
}

static void snap(const void *context, double position[3])
{
    hw_position_grid_snap(context, position);
}

hw_status hw_recorder_create(hw_collapser *c, const hw_position_grid *grid, hw_recorder **out)
{
    hw_status status;
    hw_recorder *r = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&r, 1));
    HW_GO(HW_NEW(&r->dropped, c->face_count));
    for (uint32_t f = 0; f < c->face_count; f++)
        r->dropped[f] = c->faces[f][0] == HW_NO_VERTEX;
    r->collapser = c;
    r->grid = grid;
    c->observer = observe;
    c->observer_context = r;
    c->snap = snap;
    c->snap_context = grid;
    c->keep_components = true;
    *out = r;
    r = NULL;
out:
    hw_recorder_destroy(r);
    return status;
}

void hw_recorder_destroy(hw_recorder *r)
{
    if (!r)
        return;
    hw_free(r->collapses);
    hw_free(r->corners);
    hw_free(r->batches);
    hw_free(r->dropped);
    hw_free(r);
}

hw_status hw_recorder_end_batch(hw_recorder *r)
{
    HW_TRY(r->status);
    if (r->collapse_count == r->batch_start)
        return HW_OK;
    HW_TRY(HW_RESERVE(&r->batches, &r->batch_capacity, r->batch_count + 1));
    r->batches[r->batch_count++] = (uint32_t)(r->collapse_count - r->batch_start);
    r->batch_start = r->collapse_count;
    return HW_OK;
}

static hw_status copy_state(const hw_recorder *r, const uint32_t *indices, float (**positions)[3],
                            uint32_t (**faces)[3], uint32_t (**loose)[3], uint32_t *loose_count)
{
    const hw_collapser *c = r->collapser;
    HW_TRY(HW_NEW(positions, c->vertex_count));
    HW_TRY(HW_NEW(faces, c->face_count));
    *loose_count = 0;
    for (uint32_t f = 0; f < c->face_count; f++)
        *loose_count += r->dropped[f];
    HW_TRY(HW_NEW(loose, *loose_count));
    for (uint32_t v = 0; v < c->vertex_count; v++)
        to_float(c->positions[v], (*positions)[v]);
    *loose_count = 0;
    for (uint32_t f = 0; f < c->face_count; f++) {
        memcpy((*faces)[f], c->faces[f], sizeof **faces);
        if (r->dropped[f])
            memcpy((*loose)[(*loose_count)++], indices + 3 * (size_t)f, sizeof **loose);
    }
    return HW_OK;
}

hw_status hw_recorder_finish(hw_recorder *r, const uint32_t *indices,
                             uint32_t original_vertex_count, bool keep_order, hw_progressive **out)
{
    hw_status status;
    float(*positions)[3] = NULL;
    uint32_t(*faces)[3] = NULL, (*loose)[3] = NULL, loose_count = 0;
    const hw_collapser *c = r->collapser;
    *out = NULL;
    HW_GO(r->status);
    if (r->batch_count > 0)
        HW_GO(hw_recorder_end_batch(r));
    HW_GO(copy_state(r, indices, &positions, &faces, &loose, &loose_count));
    const hw_progressive_source source = {.vertex_count = c->vertex_count,
                                          .face_count = c->face_count,
                                          .positions = (const float(*)[3])positions,
                                          .faces = (const uint32_t(*)[3])faces,
                                          .collapses = r->collapses,
                                          .collapse_count = (uint32_t)r->collapse_count,
                                          .corners = r->corners,
                                          .batches = r->batches,
                                          .batch_count = (uint32_t)r->batch_count,
                                          .source = c->source,
                                          .original_vertex_count = original_vertex_count,
                                          .loose_faces = (const uint32_t(*)[3])loose,
                                          .loose_face_count = loose_count};
    HW_GO(hw_progressive_create(out, r->grid, &source, keep_order));
out:
    hw_free(positions);
    hw_free(faces);
    hw_free(loose);
    return status;
}
