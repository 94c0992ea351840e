#include "status.h"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static _Thread_local char slot[HW_ERROR_CAPACITY];

const char *hw_status_text(hw_status status)
{
    static const char *const texts[] = {
#define X(name, text) [HW_##name] = (text),
        HW_STATUS_LIST(X)
#undef X
    };
    size_t count = sizeof texts / sizeof *texts;
    return (size_t)status < count ? texts[status] : "unknown status";
}

hw_status hw_fail(hw_status status, const char *format, ...)
{
    // Through a second buffer: the arguments may contain hw_error_text() itself.
    char text[HW_ERROR_CAPACITY];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    memcpy(slot, text, strlen(text) + 1);
    return status;
}

hw_status hw_fail_prefix(hw_status status, const char *prefix)
{
    char text[HW_ERROR_CAPACITY];
    memcpy(text, slot, sizeof text);
    return hw_fail(status, "%s: %s", prefix, text);
}

const char *hw_error_text(void)
{
    return slot;
}

void hw_error_save(char buffer[HW_ERROR_CAPACITY])
{
    memcpy(buffer, slot, HW_ERROR_CAPACITY);
}

void hw_error_restore(const char buffer[HW_ERROR_CAPACITY])
{
    memmove(slot, buffer, HW_ERROR_CAPACITY);
    slot[HW_ERROR_CAPACITY - 1] = 0;
}
