// Checked access to cJSON documents: every getter names the missing or ill-typed key in its error.
#pragma once
#include "status.h"
#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stdint.h>

// Parses the file (limit 2 GiB - 1, HW_LIMIT). HW_FORMAT names the file and the place of a syntax
// error. Free with cJSON_Delete.
HW_MUST_USE hw_status hw_json_read(const char *path, cJSON **out);
// Parses text; `name` is for messages.
HW_MUST_USE hw_status hw_json_parse(const char *name, const char *text, size_t size, cJSON **out);
// Writes atomically, indented, with a final newline. HW_LIMIT: more than could be read again.
HW_MUST_USE hw_status hw_json_write(const char *path, const cJSON *json);

// Members of an object. `name` (a file name) is for messages. Numbers must be finite; integers must
// be whole and within [min, max].
HW_MUST_USE hw_status hw_json_object(const char *name, const cJSON *object, const char *key,
                                     const cJSON **out);
HW_MUST_USE hw_status hw_json_array(const char *name, const cJSON *object, const char *key,
                                    const cJSON **out);
HW_MUST_USE hw_status hw_json_number(const char *name, const cJSON *object, const char *key,
                                     double *out);
HW_MUST_USE hw_status hw_json_integer(const char *name, const cJSON *object, const char *key,
                                      int64_t min, int64_t max, int64_t *out);
// *out points into the document.
HW_MUST_USE hw_status hw_json_string(const char *name, const cJSON *object, const char *key,
                                     const char **out);
HW_MUST_USE hw_status hw_json_bool(const char *name, const cJSON *object, const char *key,
                                   bool *out);
// An array member of exactly `count` finite numbers.
HW_MUST_USE hw_status hw_json_numbers(const char *name, const cJSON *object, const char *key,
                                      double *out, size_t count);

// Adds a number, or null where it is not finite (infinite PSNR).
void hw_json_add_number(cJSON *object, const char *key, double value);
void hw_json_add_numbers(cJSON *object, const char *key, const double *values, size_t count);

// A string item that is UTF-8, as JSON has to be: bytes of the text that are not become '_' (names
// and paths may be of any encoding); null for NULL. NULL without memory.
cJSON *hw_json_make_string(const char *text);
// Adds it; false without memory.
bool hw_json_add_string(cJSON *object, const char *key, const char *text);
