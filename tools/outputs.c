#include "outputs.h"
#include <string.h>
#include <sys/stat.h>

bool hw_path_ends_with(const char *path, const char *end)
{
    size_t n = strlen(path), m = strlen(end);
    return n >= m && strcmp(path + n - m, end) == 0;
}

hw_status hw_output_extension(const char *option, const char *path, const char *extension)
{
    if (!path || hw_path_ends_with(path, extension))
        return HW_OK;
    return hw_fail(HW_USAGE, "--%s %s: what is written is a %s", option, path, extension);
}

static bool same_file(const char *a, const char *b)
{
    struct stat x, y;
    return stat(a, &x) == 0 && stat(b, &y) == 0 && S_ISREG(x.st_mode) && x.st_dev == y.st_dev &&
           x.st_ino == y.st_ino;
}

hw_status hw_output_apart(const char *option, const char *path, uint32_t input_count,
                          const char *const *inputs)
{
    for (uint32_t i = 0; path && i < input_count; i++)
        if (inputs[i] && same_file(path, inputs[i]))
            return hw_fail(HW_USAGE, "--%s %s: that is the file to be read", option, path);
    return HW_OK;
}
