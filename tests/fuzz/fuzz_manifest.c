// Manifests, as text.
#include "fuzz_target.h"
#include "manifest.h"

bool fuzz_accepted;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    hw_manifest manifest;
    fuzz_accepted = hw_manifest_parse("fuzz", (const char *)data, size, &manifest) == HW_OK;
    hw_manifest_free(&manifest);
    return 0;
}
