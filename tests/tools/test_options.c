#include "alloc.h"
#include "log.h"
#include "options.h"
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static bool flag;
static const char *output, *config;
static uint64_t count, bytes;
static double ratio;
static uint32_t size[2];

static int reset(void **state)
{
    (void)state;
    flag = false;
    output = NULL;
    config = "C";
    count = 4;
    bytes = 0;
    ratio = 0.25;
    size[0] = 1024;
    size[1] = 768;
    hw_log_set_quiet(false);
    return 0;
}

static uint32_t options(hw_option *out, uint32_t capacity)
{
    const hw_option all[] = {
        {"flag", 'f', HW_OPTION_FLAG, &flag, NULL, NULL, 0, 0, "turns something on"},
        {"output", 'o', HW_OPTION_STRING, &output, "FILE", NULL, 0, 0, "File to write."},
        {"count", 'n', HW_OPTION_UINT, &count, "N", NULL, 1, 100, "how many"},
        {"ratio", 0, HW_OPTION_DOUBLE, &ratio, "R", NULL, -1, 1, "a share"},
        {"free", 0, HW_OPTION_DOUBLE, &ratio, "R", NULL, 0, 0, "without bounds (free)"},
        {"size", 0, HW_OPTION_SIZE, size, "WxH", NULL, 16, 4096, "pixels"},
        {"bytes", 0, HW_OPTION_BYTES, &bytes, "BYTES", NULL, 0, 4e12, "room"},
        {"config", 0, HW_OPTION_CHOICE, &config, NULL, "A|B|LL|C", 0, 0, "what to draw"},
    };
    uint32_t n = sizeof all / sizeof *all;
    assert_true(n <= capacity);
    memcpy(out, all, sizeof all);
    return n;
}

static uint32_t keys(hw_command_key *out, uint32_t capacity)
{
    assert_true(capacity >= 2);
    out[0] = (hw_command_key){"Q", "quit"};
    out[1] = (hw_command_key){"Page Up", "look up"};
    return 2;
}

static const hw_command command = {
    .name = "make",
    .summary = "makes things",
    .arguments = "IN [IN2] -o FILE",
    .description = "Makes many things out of few, which takes a sentence long enough to be broken "
                   "over several lines of the help.\n\nA second paragraph.",
    .options = options,
    .keys = keys,
    .positional_min = 1,
    .positional_max = 2,
};
static const hw_command bare = {.name = "bare",
                                .summary = "does nothing",
                                .arguments = "",
                                .description = ".looks like roff\n'so does this \\ line",
                                .positional_max = -1};
const hw_command *const hw_commands[] = {&command, &bare, NULL};

#define WORDS_MAX 12
static const char *words[WORDS_MAX];
static int positional;
static bool help;

// Parses the space-separated words of `line` ("" stands for nothing, '' for an empty word).
static hw_status parse(const hw_command *c, const char *line)
{
    static char buffer[512];
    int n = 0;
    snprintf(buffer, sizeof buffer, "%s", line);
    for (char *p = buffer, *word; (word = strsep(&p, " "));)
        if (*word && n < WORDS_MAX)
            words[n++] = strcmp(word, "''") ? word : "";
    return hw_options_parse(c, n, words, &positional, &help);
}

static void assert_usage(const char *line, const char *expected)
{
    if (parse(&command, line) != HW_USAGE)
        fail_msg("'%s' was accepted", line);
    if (!strstr(hw_error_text(), expected))
        fail_msg("'%s': '%s' does not hold '%s'", line, hw_error_text(), expected);
    assert_null(strchr(hw_error_text(), '\n'));
}

static void values_are_stored(void **state)
{
    (void)state;
    assert_int_equal(parse(&command, "in"), HW_OK);
    assert_int_equal(positional, 1);
    assert_false(help || flag || output);
    assert_int_equal(count, 4);
    assert_int_equal(
        parse(&command, "--flag -o out --count 7 --ratio -0.5 --size 640x480 --config LL in"),
        HW_OK);
    assert_true(flag && ratio == -0.5);
    assert_string_equal(output, "out");
    assert_int_equal(count, 7);
    assert_int_equal(size[0], 640);
    assert_int_equal(size[1], 480);
    assert_string_equal(config, "LL");
    assert_int_equal(positional, 1);
    assert_string_equal(words[0], "in");
}

static void forms_of_the_gnu_style(void **state)
{
    (void)state;
    assert_int_equal(parse(&command, "a --output=x=y --count=9 b -n8 -ofile"), HW_OK);
    assert_string_equal(output, "file"); // the last one holds
    assert_int_equal(count, 8);
    assert_int_equal(positional, 2);
    assert_string_equal(words[0], "a");
    assert_string_equal(words[1], "b");
    assert_int_equal(parse(&command, "-o --count in"), HW_OK); // a value may look like an option
    assert_string_equal(output, "--count");
    assert_int_equal(parse(&command, "- -o - -- --flag"), HW_OK);
    assert_int_equal(positional, 2);
    assert_string_equal(words[0], "-");
    assert_string_equal(words[1], "--flag");
    assert_string_equal(output, "-");
    assert_false(flag);
    assert_int_equal(parse(&command, "in --free 1e30"), HW_OK);
    assert_true(ratio == 1e30);
    assert_int_equal(parse(&bare, "a b c d e f"), HW_OK);
    assert_int_equal(positional, 6);
}

static void wrong_usage_is_named(void **state)
{
    (void)state;
    assert_usage("", "make IN [IN2] -o FILE");
    assert_usage("a b c", "'c'");
    assert_usage("in --outptu x", "did you mean '--output'");
    assert_usage("in --zzzzzzzz", "'--zzzzzzzz'");
    assert_usage("in --outptu=x", "'--outptu', did");
    assert_usage("in -z", "'-z'");
    assert_usage("in -o", "-o needs a value (FILE)");
    assert_usage("in --config", "--config needs a value (A|B|LL|C)");
    assert_usage("in --flag=1", "--flag takes no value");
    assert_usage("in -f1", "--flag takes no value");
    assert_usage("in --output=", "--output: the value is empty");
    assert_usage("in --config D", "A|B|LL|C");
    assert_usage("in --config L", "'L' is not one of");
    assert_usage("in --config A|B", "is not one of");
    assert_usage("in --config ''", "is not one of");
    assert_usage("in --outpu x", "did you mean"); // no abbreviations
}

static void bad_numbers_are_named(void **state)
{
    (void)state;
    static const char *const whole[] = {"x",   "-1",  "+1", "1.5", "1e3",
                                        "0x1", "3.0", "7k", "''",  "99999999999999999999"};
    static const char *const real[] = {"x", "1,5", "nan", "inf", "-inf", "1e999", "''", "0.5x"};
    static const char *const pairs[] = {"x",         "640",      "640x",         "x480",
                                        "640x480x1", "-640x480", "640 480",      "640.x480",
                                        "0x640x480", "''",       "4294967296x16"};
    char line[64];
    for (size_t i = 0; i < sizeof whole / sizeof *whole; i++) {
        snprintf(line, sizeof line, "in --count %s", whole[i]);
        assert_usage(line, "--count: ");
    }
    for (size_t i = 0; i < sizeof real / sizeof *real; i++) {
        snprintf(line, sizeof line, "in --ratio %s", real[i]);
        assert_usage(line, "--ratio: ");
    }
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        snprintf(line, sizeof line, "in --size %s", pairs[i]);
        assert_usage(line, "--size: ");
    }
    assert_usage("in --count 0", "1 to 100");
    assert_usage("in --count 101", "1 to 100");
    assert_usage("in --ratio 1.01", "-1 to 1");
    assert_usage("in --size 640x15", "16 to 4096");
    assert_usage("in --size 5000x480", "16 to 4096");
    // What failed changed nothing.
    assert_int_equal(count, 4);
    assert_true(ratio == 0.25);
    assert_int_equal(size[0], 1024);
}

static void bytes_have_units(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        uint64_t value;
    } good[] = {{"0", 0},
                {"1234", 1234},
                {"500M", 500000000},
                {"500MB", 500000000},
                {"2G", 2000000000},
                {"1.5g", 1500000000},
                {"64KiB", 65536},
                {"2Gi", UINT64_C(2) << 30},
                {"1T", 1000000000000},
                {"12B", 12}};
    static const char *const bad[] = {"x",  "-1",  "G",   "''",    "1e3", "0x10", "2GG",
                                      "2X", "2iB", "inf", "1..5G", "2Gb", "5T"};
    char line[64];
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        snprintf(line, sizeof line, "in --bytes %s", good[i].text);
        assert_int_equal(parse(&command, line), HW_OK);
        assert_true(bytes == good[i].value);
    }
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        snprintf(line, sizeof line, "in --bytes %s", bad[i]);
        assert_usage(line, "--bytes: ");
    }
    // A blank is no unit; parse() splits at blanks.
    static const char *const blank[] = {"512 B", "512 ", "512 M", "5\t"};
    for (size_t i = 0; i < sizeof blank / sizeof *blank; i++) {
        const char *argv[] = {"in", "--bytes", blank[i]};
        assert_int_equal(hw_options_parse(&command, 3, argv, &positional, &help), HW_USAGE);
    }
}

static void given_options_are_known(void **state)
{
    (void)state;
    static const char *const names[] = {"size", "count", "flag", NULL};
    assert_int_equal(parse(&command, "in --count 4 --ratio 0.5"), HW_OK);
    assert_true(hw_option_given(&command, "count")); // the default, yet given
    assert_false(hw_option_given(&command, "size") || hw_option_given(&command, "nothing"));
    assert_int_equal(hw_options_refuse(&command, names, "goes with --ratio"), HW_USAGE);
    assert_string_equal(hw_error_text(), "--count goes with --ratio");
    assert_int_equal(parse(&command, "in -o --flag -- --count"), HW_OK);
    assert_int_equal(hw_options_refuse(&command, names, "goes with --ratio"), HW_OK);
}

static void help_and_quiet(void **state)
{
    (void)state;
    assert_int_equal(parse(&command, "--count 9 --help"), HW_OK); // without the needed argument
    assert_true(help);
    assert_int_equal(count, 4); // so that the help shows the defaults
    assert_int_equal(parse(&command, "-h"), HW_OK);
    assert_true(help);
    assert_int_equal(parse(&command, "a -- --help"), HW_OK);
    assert_false(help);
    assert_int_equal(parse(&command, "-o --help a"), HW_OK); // a value
    assert_false(help);
    assert_false(hw_log_quiet());
    assert_int_equal(parse(&command, "a --quiet"), HW_OK);
    assert_true(hw_log_quiet());
}

static char *text_of(void (*write)(FILE *))
{
    char *text = NULL;
    size_t length = 0;
    FILE *file = open_memstream(&text, &length);
    assert_non_null(file);
    write(file);
    fclose(file);
    return text;
}

static void write_command_help(FILE *file)
{
    hw_command_help(&command, file);
}

static void help_comes_from_the_table(void **state)
{
    (void)state;
    char *text = text_of(write_command_help);
    assert_non_null(strstr(text, "Usage: hexwalk make IN [IN2] -o FILE"));
    assert_non_null(strstr(text, "  -o, --output FILE "));
    assert_non_null(strstr(text, "      --ratio R "));
    assert_non_null(strstr(text, "      --config A|B|LL|C "));
    assert_non_null(strstr(text, "How many (default: 4).\n"));
    assert_non_null(strstr(text, "\nKeys:\n  Q        quit\n  Page Up  look up\n"));
    assert_non_null(strstr(text, "File to write.\n"));
    assert_non_null(strstr(text, "Without bounds (free; default: 0.25).\n"));
    assert_non_null(strstr(text, "Pixels (default: 1024x768).\n"));
    assert_non_null(strstr(text, "What to draw (default: C).\n"));
    assert_non_null(strstr(text, "  -q, --quiet "));
    assert_non_null(strstr(text, "\n\nA second paragraph.\n"));
    for (const char *p = text; *p; p += strcspn(p, "\n") + 1)
        assert_true(strcspn(p, "\n") <= 80);
    free(text);
    text = text_of(hw_program_help);
    assert_non_null(strstr(text, "  make       Makes things.\n"));
    assert_non_null(strstr(text, "  bare       Does nothing.\n"));
    free(text);
}

static void the_man_page_is_sound_roff(void **state)
{
    (void)state;
    char *text = text_of(hw_program_man);
    assert_non_null(strstr(text, ".TP\nPage Up\nlook up\n"));
    assert_memory_equal(text, ".TH HEXWALK 1 ", 14);
    assert_non_null(strstr(text, ".SH NAME\n"));
    assert_non_null(
        strstr(text, "\\fB\\-o\\fR, \\fB\\-\\-output\\fR \\fIFILE\\fR\nFile to write.\n"));
    assert_non_null(strstr(text, "\n.PP\nA second paragraph."));
    assert_non_null(strstr(text, "\n\\&.looks like roff\n\\&'so does this \\e line\n"));
    assert_null(strstr(text, "\n\n")); // blank lines make gaps
    free(text);
}

static void values_become_json(void **state)
{
    (void)state;
    assert_int_equal(parse(&command, "in --flag --size 64x32 --count 5"), HW_OK);
    cJSON *json = hw_options_json(&command);
    assert_true(cJSON_IsTrue(cJSON_GetObjectItem(json, "flag")));
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(json, "output")));
    assert_true(cJSON_GetObjectItem(json, "count")->valuedouble == 5);
    assert_true(cJSON_GetObjectItem(json, "ratio")->valuedouble == 0.25);
    assert_true(cJSON_GetArrayItem(cJSON_GetObjectItem(json, "size"), 1)->valuedouble == 32);
    assert_string_equal(cJSON_GetObjectItem(json, "config")->valuestring, "C");
    assert_null(cJSON_GetObjectItem(json, "help"));
    cJSON_Delete(json);
}

#define FRESH(test) cmocka_unit_test_setup(test, reset)

int main(void)
{
    const struct CMUnitTest tests[] = {
        FRESH(values_are_stored),         FRESH(forms_of_the_gnu_style),
        FRESH(wrong_usage_is_named),      FRESH(bad_numbers_are_named),
        FRESH(bytes_have_units),          FRESH(help_and_quiet),
        FRESH(help_comes_from_the_table), FRESH(the_man_page_is_sound_roff),
        FRESH(values_become_json),        FRESH(given_options_are_known),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
