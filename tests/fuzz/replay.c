// Runs a fuzz target over every file of a folder: the corpus as a test, with any compiler. Files
// whose name begins with "valid" must be accepted, the others must not crash.
#include "alloc.h"
#include "file.h"
#include "fuzz_target.h"
#include <dirent.h>
#include <stdio.h>
#include <string.h>

static bool replay(const char *folder, const char *name)
{
    char *path = NULL;
    uint8_t *bytes = NULL;
    size_t size = 0;
    bool fine = false;
    if (hw_path_join(&path, folder, name) == HW_OK &&
        hw_file_read(path, 0, &bytes, &size) == HW_OK) {
        LLVMFuzzerTestOneInput(bytes, size);
        fine = fuzz_accepted || strncmp(name, "valid", 5) != 0;
    }
    if (!fine)
        fprintf(stderr, "%s/%s: %s\n", folder, name, hw_error_text());
    hw_free(bytes);
    hw_free(path);
    return fine;
}

int main(int argc, char **argv)
{
    DIR *folder = argc == 2 ? opendir(argv[1]) : NULL;
    if (!folder) {
        fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
        return 2;
    }
    unsigned files = 0, bad = 0;
    for (const struct dirent *entry; (entry = readdir(folder));) {
        if (entry->d_name[0] == '.')
            continue;
        files++;
        bad += !replay(argv[1], entry->d_name);
    }
    closedir(folder);
    printf("%u files, %u bad\n", files, bad);
    return files == 0 || bad > 0;
}
