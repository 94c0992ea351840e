// Mesh files behind their container: the size of a level table (u32), the table, and the rest is
// the chunk of its first level.
#include "bytes.h"
#include "fuzz_target.h"
#include "mesh_level.h"
#include <stdlib.h>

bool fuzz_accepted;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static hw_mesh_level_info infos[HW_MESH_LEVELS_MAX];
    hw_bytes_reader r = hw_bytes_reader_make(data, size);
    uint32_t count = 0, table_bytes = hw_get_u32(&r);
    fuzz_accepted = false;
    if (table_bytes > hw_bytes_left(&r))
        return 0;
    const uint8_t *table = hw_get_span(&r, table_bytes);
    if (hw_mesh_table_decode("fuzz", table, table_bytes, infos, &count) != HW_OK)
        return 0;
    hw_mesh mesh;
    hw_inner_boxes boxes;
    size_t left = hw_bytes_left(&r);
    fuzz_accepted = hw_mesh_level_decode("fuzz", &infos[0], hw_get_span(&r, left), left, &mesh,
                                         &boxes) == HW_OK;
    if (fuzz_accepted &&
        (hw_mesh_validate(&mesh) != HW_OK || hw_mesh_boxes_validate(&mesh, &boxes) != HW_OK))
        abort();
    hw_mesh_free(&mesh);
    return 0;
}
