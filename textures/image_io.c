// Loads the OpenImageIO shim on first use (see CMakeLists.txt for why) and passes calls on to it.
#include "image_io.h"
#include "alloc.h"
#include "file.h"
#include <assert.h>
#include <dlfcn.h>
#include <pthread.h>
#include <string.h>

#define MODULE_NAME "hexwalk_images.so" // found by the program's run path

typedef struct image_module {
    hw_status (*read)(const char *, hw_image *);
    hw_status (*decode)(const char *, const void *, size_t, hw_image *);
    hw_status (*write)(const char *, const hw_image *);
    hw_status (*encode_png)(const hw_image *, uint8_t **, size_t *);
    hw_status (*encode_jpeg)(const hw_image *, int, uint8_t **, size_t *);
    hw_status (*sampler_create)(hw_sampler **, const hw_image *);
    void (*sampler_destroy)(hw_sampler *);
    void (*sampler_lookup)(const hw_sampler *, float, float, const float[2], const float[2],
                           float[3]);
} image_module;

static image_module module;
static char load_error[HW_ERROR_CAPACITY];
static pthread_once_t once = PTHREAD_ONCE_INIT;

// What the module calls: named here so that the linker keeps it in every program.
typedef void (*any_function)(void);
__attribute__((used)) static const any_function needed_by_module[] = {
    (any_function)hw_alloc,       (any_function)hw_free,       (any_function)hw_fail,
    (any_function)hw_fail_prefix, (any_function)hw_image_make, (any_function)hw_image_free,
    (any_function)hw_file_write,  (any_function)hw_file_read,
};

static void load(void)
{
    void *handle = dlopen(MODULE_NAME, RTLD_NOW | RTLD_LOCAL);
    const struct {
        const char *name;
        void *slot;
    } symbols[] = {
        {"hw_image_read", &module.read},
        {"hw_image_decode", &module.decode},
        {"hw_image_write", &module.write},
        {"hw_image_encode_png", &module.encode_png},
        {"hw_image_encode_jpeg", &module.encode_jpeg},
        {"hw_sampler_create", &module.sampler_create},
        {"hw_sampler_destroy", &module.sampler_destroy},
        {"hw_sampler_lookup", &module.sampler_lookup},
    };
    for (size_t i = 0; handle && i < sizeof symbols / sizeof *symbols; i++)
        *(void **)symbols[i].slot = dlsym(handle, symbols[i].name);
    const char *reason = dlerror();
    if (reason) {
        hw_fail(HW_INTERNAL, "image files cannot be handled: %s", reason);
        hw_error_save(load_error);
        module = (image_module){0};
    }
}

static hw_status ensure_loaded(void)
{
    pthread_once(&once, load);
    if (module.read)
        return HW_OK;
    hw_error_restore(load_error);
    return HW_INTERNAL;
}

hw_status hw_image_read(const char *path, hw_image *out)
{
    *out = (hw_image){0};
    HW_TRY(ensure_loaded());
    return module.read(path, out);
}

hw_status hw_image_decode(const char *name, const void *bytes, size_t size, hw_image *out)
{
    *out = (hw_image){0};
    HW_TRY(ensure_loaded());
    return module.decode(name, bytes, size, out);
}

hw_status hw_image_write(const char *path, const hw_image *image)
{
    HW_TRY(ensure_loaded());
    return module.write(path, image);
}

hw_status hw_image_write_opaque(const char *path, const hw_image *rgba)
{
    hw_image rgb = {0};
    assert(rgba->channels == 4);
    HW_TRY(hw_image_make(&rgb, rgba->width, rgba->height, 3));
    size_t pixels = (size_t)rgba->width * rgba->height;
    for (size_t i = 0; i < pixels; i++)
        memcpy(rgb.data + 3 * i, rgba->data + 4 * i, 3);
    hw_status status = hw_image_write(path, &rgb);
    hw_image_free(&rgb);
    return status;
}

hw_status hw_image_encode_png(const hw_image *image, uint8_t **bytes, size_t *size)
{
    HW_TRY(ensure_loaded());
    return module.encode_png(image, bytes, size);
}

hw_status hw_image_encode_jpeg(const hw_image *image, int quality, uint8_t **bytes, size_t *size)
{
    HW_TRY(ensure_loaded());
    return module.encode_jpeg(image, quality, bytes, size);
}

hw_status hw_sampler_create(hw_sampler **out, const hw_image *image)
{
    *out = NULL;
    HW_TRY(ensure_loaded());
    return module.sampler_create(out, image);
}

void hw_sampler_destroy(hw_sampler *sampler)
{
    if (sampler)
        module.sampler_destroy(sampler);
}

void hw_sampler_lookup(const hw_sampler *sampler, float u, float v, const float dx[2],
                       const float dy[2], float rgb[3])
{
    module.sampler_lookup(sampler, u, v, dx, dy, rgb);
}
