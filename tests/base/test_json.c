#include "alloc.h"
#include "file.h"
#include "json.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static const char document[] =
    "{\"object\": {\"a\": 1}, \"array\": [1, 2.5, -3], \"number\": 2.5,\n"
    " \"integer\": -7, \"string\": \"text\", \"yes\": true, \"no\": false,\n"
    " \"null\": null, \"huge\": 1e999, \"mixed\": [1, \"2\", 3],\n"
    " \"large\": 9007199254740994}\n";

static cJSON *parse(const char *text)
{
    cJSON *json = NULL;
    assert_int_equal(hw_json_parse("doc", text, strlen(text), &json), HW_OK);
    assert_non_null(json);
    return json;
}

static void assert_error_has(const char *a, const char *b)
{
    if (!strstr(hw_error_text(), a) || !strstr(hw_error_text(), b))
        fail_msg("'%s' names not both of '%s' and '%s'", hw_error_text(), a, b);
}

static void getters_get(void **state)
{
    (void)state;
    cJSON *json = parse(document);
    const cJSON *item;
    const char *text;
    double number, numbers[3];
    int64_t integer;
    bool flag;
    assert_int_equal(hw_json_object("doc", json, "object", &item), HW_OK);
    assert_int_equal(hw_json_number("doc", item, "a", &number), HW_OK);
    assert_true(number == 1);
    assert_int_equal(hw_json_array("doc", json, "array", &item), HW_OK);
    assert_int_equal(cJSON_GetArraySize(item), 3);
    assert_int_equal(hw_json_number("doc", json, "number", &number), HW_OK);
    assert_true(number == 2.5);
    assert_int_equal(hw_json_integer("doc", json, "integer", -7, -7, &integer), HW_OK);
    assert_int_equal(integer, -7);
    assert_int_equal(hw_json_string("doc", json, "string", &text), HW_OK);
    assert_string_equal(text, "text");
    assert_int_equal(hw_json_bool("doc", json, "yes", &flag), HW_OK);
    assert_true(flag);
    assert_int_equal(hw_json_bool("doc", json, "no", &flag), HW_OK);
    assert_false(flag);
    assert_int_equal(hw_json_numbers("doc", json, "array", numbers, 3), HW_OK);
    assert_true(numbers[0] == 1 && numbers[1] == 2.5 && numbers[2] == -3);
    cJSON_Delete(json);
}

static void missing_and_ill_typed_keys_are_named(void **state)
{
    (void)state;
    cJSON *json = parse(document);
    const cJSON *item;
    const char *text;
    double number, numbers[4];
    int64_t integer;
    bool flag;
    assert_int_equal(hw_json_number("doc", json, "absent", &number), HW_FORMAT);
    assert_error_has("doc", "absent");
    assert_int_equal(hw_json_object("doc", json, "array", &item), HW_FORMAT);
    assert_error_has("doc", "array");
    assert_int_equal(hw_json_array("doc", json, "object", &item), HW_FORMAT);
    assert_error_has("doc", "object");
    assert_int_equal(hw_json_number("doc", json, "string", &number), HW_FORMAT);
    assert_int_equal(hw_json_number("doc", json, "huge", &number), HW_FORMAT);
    assert_error_has("huge", "finite");
    assert_int_equal(hw_json_number("doc", json, "null", &number), HW_FORMAT);
    assert_int_equal(hw_json_string("doc", json, "number", &text), HW_FORMAT);
    assert_int_equal(hw_json_bool("doc", json, "integer", &flag), HW_FORMAT);
    assert_int_equal(hw_json_integer("doc", json, "number", -9, 9, &integer), HW_FORMAT);
    assert_error_has("number", "whole");
    assert_int_equal(hw_json_integer("doc", json, "integer", -6, 9, &integer), HW_FORMAT);
    assert_error_has("integer", "-6 to 9");
    assert_int_equal(hw_json_integer("doc", json, "integer", -9, -8, &integer), HW_FORMAT);
    assert_int_equal(hw_json_integer("doc", json, "large", 0, INT64_MAX, &integer), HW_FORMAT);
    assert_int_equal(hw_json_numbers("doc", json, "array", numbers, 2), HW_FORMAT);
    assert_int_equal(hw_json_numbers("doc", json, "array", numbers, 4), HW_FORMAT);
    assert_int_equal(hw_json_numbers("doc", json, "mixed", numbers, 3), HW_FORMAT);
    assert_error_has("mixed", "3 finite numbers");
    // Not an object at all, or none.
    assert_int_equal(hw_json_array("doc", json, "array", &item), HW_OK);
    assert_int_equal(hw_json_number("doc", item, "a", &number), HW_FORMAT);
    assert_int_equal(hw_json_number("doc", NULL, "a", &number), HW_FORMAT);
    cJSON_Delete(json);
}

static void syntax_errors_name_the_place(void **state)
{
    (void)state;
    cJSON *json = NULL;
    static const char bad[] = "{\"a\": 1,\n \"b\": }";
    assert_int_equal(hw_json_parse("bad.json", bad, strlen(bad), &json), HW_FORMAT);
    assert_null(json);
    assert_error_has("bad.json", "line 2, column 7");
    static const char trailing[] = "{}\n{}";
    assert_int_equal(hw_json_parse("bad.json", trailing, strlen(trailing), &json), HW_FORMAT);
    assert_error_has("bad.json", "line 2, column 1");
    assert_int_equal(hw_json_parse("bad.json", "{}\0", 3, &json), HW_FORMAT);
    assert_int_equal(hw_json_parse("bad.json", "", 0, &json), HW_FORMAT);
    assert_error_has("bad.json", "empty");
    // Nesting that would exhaust the stack.
    size_t depth = 1000000;
    char *deep = malloc(depth);
    assert_non_null(deep);
    memset(deep, '[', depth);
    assert_int_equal(hw_json_parse("deep.json", deep, depth, &json), HW_FORMAT);
    free(deep);
}

// Blocks of exactly the prefix's size, so that a sanitizer sees one byte too many.
static void every_prefix_is_malformed(void **state)
{
    (void)state;
    size_t whole = strlen(document) - 1; // without the newline
    for (size_t size = 0; size < whole; size++) {
        char *prefix = malloc(size ? size : 1);
        cJSON *json = NULL;
        assert_non_null(prefix);
        memcpy(prefix, document, size);
        assert_int_equal(hw_json_parse("prefix", prefix, size, &json), HW_FORMAT);
        assert_null(json);
        free(prefix);
    }
}

static void documents_survive_the_disk(void **state)
{
    (void)state;
    char path[] = "json.XXXXXX";
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    const double values[] = {0.1, INFINITY, -1e300};
    cJSON *json = cJSON_CreateObject(), *back = NULL;
    hw_json_add_number(json, "psnr", INFINITY);
    hw_json_add_number(json, "third", 1.0 / 3);
    hw_json_add_numbers(json, "values", values, 3);
    assert_int_equal(hw_json_write(path, json), HW_OK);
    uint8_t *bytes;
    size_t size;
    assert_int_equal(hw_file_read(path, 0, &bytes, &size), HW_OK);
    assert_int_equal(bytes[size - 1], '\n');
    assert_true(strstr((char *)bytes, "\n\t\"third\"") != NULL); // indented
    hw_free(bytes);
    assert_int_equal(hw_json_read(path, &back), HW_OK);
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(back, "psnr")));
    double third;
    const cJSON *array;
    assert_int_equal(hw_json_number(path, back, "third", &third), HW_OK);
    assert_true(third == 1.0 / 3);
    assert_int_equal(hw_json_array(path, back, "values", &array), HW_OK);
    assert_true(cJSON_GetArrayItem(array, 0)->valuedouble == 0.1);
    assert_true(cJSON_IsNull(cJSON_GetArrayItem(array, 1)));
    assert_true(cJSON_GetArrayItem(array, 2)->valuedouble == -1e300);
    cJSON_Delete(back);
    cJSON_Delete(json);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(hw_json_read(path, &back), HW_NOT_FOUND);
    assert_null(back);
    assert_error_has(path, "No such file");
}

static void a_failed_write_is_told(void **state)
{
    (void)state;
    cJSON *json = parse(document);
    assert_int_equal(hw_json_write("no/such/folder.json", json), HW_IO);
    assert_error_has("no/such/folder.json", "No such file");
    assert_int_equal(hw_json_write("/dev/full", json), HW_IO);
    assert_error_has("/dev/full", "No space left");
    cJSON_Delete(json);
}

// A park of a million objects has a manifest of hundreds of megabytes.
static void large_files_are_read(void **state)
{
    (void)state;
    static const char path[] = "json.large";
    cJSON *json = NULL;
    assert_int_equal(hw_file_write(path, "[1]", 3), HW_OK);
    assert_int_equal(truncate(path, 300 << 20), 0); // zeros follow
    assert_int_equal(hw_json_read(path, &json), HW_FORMAT);
    assert_error_has(path, "line 1, column 4");
    assert_int_equal(truncate(path, (off_t)1 << 31), 0);
    assert_int_equal(hw_json_read(path, &json), HW_LIMIT);
    assert_int_equal(unlink(path), 0);
}

static void strings_become_utf8(void **state)
{
    (void)state;
    static const struct {
        const char *text, *expected;
    } cases[] = {
        {"", ""},
        {"plain", "plain"},
        {"\xc3\xa4 \xe2\x82\xac \xf0\x9f\x97\xbf", "\xc3\xa4 \xe2\x82\xac \xf0\x9f\x97\xbf"},
        {"t\xe4tra", "t_tra"},
        {"\x80\xff", "__"},
        {"cut \xe2\x82", "cut __"},
        {"\xc0\xaf \xe0\x80\xaf \xed\xa0\x80 \xf4\x90\x80\x80", "__ ___ ___ ____"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        cJSON *json = cJSON_CreateObject();
        assert_true(hw_json_add_string(json, "key", cases[i].text));
        assert_string_equal(cJSON_GetObjectItem(json, "key")->valuestring, cases[i].expected);
        hw_alloc_fail_after(1);
        assert_false(hw_json_add_string(json, "other", cases[i].text));
        hw_alloc_fail_after(0);
        assert_null(cJSON_GetObjectItem(json, "other"));
        cJSON_Delete(json);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(getters_get),
        cmocka_unit_test(missing_and_ill_typed_keys_are_named),
        cmocka_unit_test(syntax_errors_name_the_place),
        cmocka_unit_test(every_prefix_is_malformed),
        cmocka_unit_test(documents_survive_the_disk),
        cmocka_unit_test(a_failed_write_is_told),
        cmocka_unit_test(large_files_are_read),
        cmocka_unit_test(strings_become_utf8),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
