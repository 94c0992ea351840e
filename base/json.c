#include "json.h"
#include "alloc.h"
#include "file.h"
#include <limits.h>
#include <math.h>
#include <string.h>

#define FILE_LIMIT  ((size_t)INT_MAX)  // what cJSON can print
#define WHOLE_LIMIT 9007199254740992.0 // 2^53: beyond it a double no longer holds every integer

static hw_status fail_syntax(const char *name, const char *text, const char *place)
{
    size_t line = 1, column = 1;
    for (const char *p = text; p < place; p++) {
        column = *p == '\n' ? 1 : column + 1;
        line += *p == '\n';
    }
    return hw_fail(HW_FORMAT, "%s: line %zu, column %zu: not valid JSON", name, line, column);
}

hw_status hw_json_parse(const char *name, const char *text, size_t size, cJSON **out)
{
    const char *end = text;
    *out = NULL;
    if (size == 0)
        return hw_fail(HW_FORMAT, "%s: empty, JSON expected", name);
    cJSON *json = cJSON_ParseWithLengthOpts(text, size, &end, 0);
    if (!json)
        return fail_syntax(name, text, end && end >= text && end <= text + size ? end : text);
    while (end < text + size && strchr(" \t\r\n", *end) && *end)
        end++;
    if (end != text + size) {
        cJSON_Delete(json);
        return fail_syntax(name, text, end);
    }
    *out = json;
    return HW_OK;
}

hw_status hw_json_read(const char *path, cJSON **out)
{
    uint8_t *data = NULL;
    size_t size = 0;
    *out = NULL;
    HW_TRY(hw_file_read(path, FILE_LIMIT, &data, &size));
    hw_status status = hw_json_parse(path, (const char *)data, size, out);
    hw_free(data);
    return status;
}

hw_status hw_json_write(const char *path, const cJSON *json)
{
    hw_writer *writer = NULL;
    hw_status status = HW_OK;
    char *text = cJSON_Print(json);
    if (!text)
        return hw_fail(HW_MEMORY, "%s: no memory for the JSON, or 2 GiB of it", path);
    size_t size = strlen(text);
    if (size + 1 > FILE_LIMIT) { // nobody could read it again
        status = hw_fail(HW_LIMIT, "%s: %zu bytes of JSON, the limit is %zu", path, size + 1,
                         FILE_LIMIT);
        goto out;
    }
    HW_GO(hw_writer_open(&writer, path));
    HW_GO(hw_writer_put(writer, text, size));
    HW_GO(hw_writer_put(writer, "\n", 1));
    hw_writer *finished = writer;
    writer = NULL;
    status = hw_writer_commit(finished);
out:
    hw_writer_abort(writer);
    cJSON_free(text);
    return status;
}

static hw_status member(const char *name, const cJSON *object, const char *key, const cJSON **out)
{
    if (!cJSON_IsObject(object))
        return hw_fail(HW_FORMAT, "%s: an object with \"%s\" was expected", name, key);
    *out = cJSON_GetObjectItemCaseSensitive(object, key);
    return *out ? HW_OK : hw_fail(HW_FORMAT, "%s: \"%s\" is missing", name, key);
}

static hw_status fail_type(const char *name, const char *key, const char *expected)
{
    return hw_fail(HW_FORMAT, "%s: \"%s\" is not %s", name, key, expected);
}

hw_status hw_json_object(const char *name, const cJSON *object, const char *key, const cJSON **out)
{
    HW_TRY(member(name, object, key, out));
    return cJSON_IsObject(*out) ? HW_OK : fail_type(name, key, "an object");
}

hw_status hw_json_array(const char *name, const cJSON *object, const char *key, const cJSON **out)
{
    HW_TRY(member(name, object, key, out));
    return cJSON_IsArray(*out) ? HW_OK : fail_type(name, key, "an array");
}

hw_status hw_json_number(const char *name, const cJSON *object, const char *key, double *out)
{
    const cJSON *item = NULL;
    HW_TRY(member(name, object, key, &item));
    if (!cJSON_IsNumber(item) || !isfinite(item->valuedouble))
        return fail_type(name, key, "a finite number");
    *out = item->valuedouble;
    return HW_OK;
}

hw_status hw_json_integer(const char *name, const cJSON *object, const char *key, int64_t min,
                          int64_t max, int64_t *out)
{
    double value = 0;
    HW_TRY(hw_json_number(name, object, key, &value));
    if (value != floor(value) || fabs(value) > WHOLE_LIMIT)
        return fail_type(name, key, "a whole number");
    int64_t whole = (int64_t)value;
    if (whole < min || whole > max)
        return hw_fail(HW_FORMAT, "%s: \"%s\" is %lld, not within %lld to %lld", name, key,
                       (long long)whole, (long long)min, (long long)max);
    *out = whole;
    return HW_OK;
}

hw_status hw_json_string(const char *name, const cJSON *object, const char *key, const char **out)
{
    const cJSON *item = NULL;
    HW_TRY(member(name, object, key, &item));
    if (!cJSON_IsString(item) || !item->valuestring)
        return fail_type(name, key, "a string");
    *out = item->valuestring;
    return HW_OK;
}

hw_status hw_json_bool(const char *name, const cJSON *object, const char *key, bool *out)
{
    const cJSON *item = NULL;
    HW_TRY(member(name, object, key, &item));
    if (!cJSON_IsBool(item))
        return fail_type(name, key, "true or false");
    *out = cJSON_IsTrue(item);
    return HW_OK;
}

hw_status hw_json_numbers(const char *name, const cJSON *object, const char *key, double *out,
                          size_t count)
{
    const cJSON *array = NULL, *item = NULL;
    size_t i = 0;
    HW_TRY(hw_json_array(name, object, key, &array));
    cJSON_ArrayForEach(item, array)
    {
        if (i == count || !cJSON_IsNumber(item) || !isfinite(item->valuedouble))
            break;
        out[i++] = item->valuedouble;
    }
    if (i != count || item)
        return hw_fail(HW_FORMAT, "%s: \"%s\" is not an array of %zu finite numbers", name, key,
                       count);
    return HW_OK;
}

void hw_json_add_number(cJSON *object, const char *key, double value)
{
    if (isfinite(value))
        cJSON_AddNumberToObject(object, key, value);
    else
        cJSON_AddNullToObject(object, key);
}

void hw_json_add_numbers(cJSON *object, const char *key, const double *values, size_t count)
{
    cJSON *array = cJSON_AddArrayToObject(object, key);
    for (size_t i = 0; array && i < count; i++) {
        cJSON *item = isfinite(values[i]) ? cJSON_CreateNumber(values[i]) : cJSON_CreateNull();
        if (item)
            cJSON_AddItemToArray(array, item);
    }
}

// Length of the UTF-8 sequence at s; 0 if malformed (RFC 3629, section 4).
static size_t utf8_length(const unsigned char *s)
{
    if (s[0] < 0x80)
        return 1;
    if (s[0] < 0xc2 || s[0] > 0xf4)
        return 0;
    size_t n = s[0] < 0xe0 ? 2 : s[0] < 0xf0 ? 3 : 4;
    // The second byte also tells what is too long, a surrogate, or beyond the last character.
    unsigned low = s[0] == 0xe0 ? 0xa0 : s[0] == 0xf0 ? 0x90 : 0x80;
    unsigned high = s[0] == 0xed ? 0x9f : s[0] == 0xf4 ? 0x8f : 0xbf;
    if (s[1] < low || s[1] > high)
        return 0;
    for (size_t i = 2; i < n; i++)
        if ((s[i] & 0xc0) != 0x80)
            return 0;
    return n;
}

cJSON *hw_json_make_string(const char *text)
{
    char *copy;
    if (!text)
        return cJSON_CreateNull();
    if (hw_strdup(&copy, text) != HW_OK)
        return NULL;
    for (size_t i = 0; copy[i];) {
        size_t n = utf8_length((const unsigned char *)copy + i);
        if (n == 0)
            copy[i] = '_';
        i += n ? n : 1;
    }
    cJSON *item = cJSON_CreateString(copy);
    hw_free(copy);
    return item;
}

bool hw_json_add_string(cJSON *object, const char *key, const char *text)
{
    cJSON *item = hw_json_make_string(text);
    if (item && cJSON_AddItemToObject(object, key, item))
        return true;
    cJSON_Delete(item);
    return false;
}
