#include "dataset_scene.h"
#include "import.h"

hw_status hw_dataset_scene_import(const char *dataset, const hw_manifest *manifest,
                                  const char *moved_to, hw_scene *out)
{
    const char *path = moved_to ? moved_to : manifest->scene_path;
    HW_TRY(hw_scene_import(path, out));
    if (hw_scene_hash(out) == manifest->scene_hash)
        return HW_OK;
    hw_scene_free(out);
    return hw_fail(HW_FORMAT,
                   "%s: not the scene that %s was built from (it has changed since, or is another "
                   "one); build the dataset again or name the right one with --scene",
                   path, dataset);
}
