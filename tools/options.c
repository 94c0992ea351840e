#include "options.h"
#include "json.h"
#include "log.h"
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define OPTIONS_MAX  64u
#define HELP_COLUMNS 80u

// The command's own options and the two that every command knows.
typedef struct option_list {
    hw_option options[OPTIONS_MAX];
    uint32_t count;
    bool quiet, help;
} option_list;

static uint64_t given; // bit i: the command line had the command's i-th option

static void list_options(const hw_command *command, option_list *list)
{
    *list = (option_list){0};
    if (command->options)
        list->count = command->options(list->options, OPTIONS_MAX - 2);
    list->options[list->count++] =
        (hw_option){.name = "quiet",
                    .short_name = 'q',
                    .type = HW_OPTION_FLAG,
                    .value = &list->quiet,
                    .help = "no progress, no diagnostics other than errors"};
    list->options[list->count++] = (hw_option){.name = "help",
                                               .short_name = 'h',
                                               .type = HW_OPTION_FLAG,
                                               .value = &list->help,
                                               .help = "show this help"};
}

// What stands for the value: the metavar, else the choices themselves. NULL for flags.
static const char *metavar(const hw_option *o)
{
    if (o->type == HW_OPTION_FLAG)
        return NULL;
    if (o->metavar)
        return o->metavar;
    return o->type == HW_OPTION_CHOICE ? o->choices : "VALUE";
}

// --- Finding options ----------------------------------------------------------------------------

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

// Edit distance (Levenshtein) of two short words, at most `limit` + 1 of which is of interest.
static uint32_t edit_distance(const char *a, size_t a_length, const char *b)
{
    uint32_t row[64];
    size_t b_length = strlen(b);
    if (a_length >= 64 || b_length >= 64)
        return UINT32_MAX;
    for (uint32_t j = 0; j <= b_length; j++)
        row[j] = j;
    for (uint32_t i = 0; i < a_length; i++) {
        uint32_t diagonal = row[0];
        row[0] = i + 1;
        for (uint32_t j = 0; j < b_length; j++) {
            uint32_t changed = diagonal + (a[i] != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = least(changed, least(row[j], row[j + 1]) + 1);
        }
    }
    return row[b_length];
}

static const hw_option *find_option(const option_list *list, const char *name, size_t length)
{
    for (uint32_t i = 0; i < list->count; i++)
        if (!strncmp(list->options[i].name, name, length) && !list->options[i].name[length])
            return &list->options[i];
    return NULL;
}

static hw_status fail_unknown(const option_list *list, const char *name, size_t length)
{
    const char *best = NULL;
    uint32_t best_distance = 3;
    for (uint32_t i = 0; i < list->count; i++) {
        uint32_t distance = edit_distance(name, length, list->options[i].name);
        if (distance < best_distance) {
            best_distance = distance;
            best = list->options[i].name;
        }
    }
    if (best)
        return hw_fail(HW_USAGE, "unknown option '--%.*s', did you mean '--%s'?", (int)length, name,
                       best);
    return hw_fail(HW_USAGE, "unknown option '--%.*s'", (int)length, name);
}

// --- Values -------------------------------------------------------------------------------------

// Whether `text` is exactly one of the words of "a|b|c"; *word gets the word's place there.
static bool is_choice(const char *choices, const char *text)
{
    size_t length = strlen(text);
    for (const char *p = choices; length && *p;) {
        size_t word = strcspn(p, "|");
        if (word == length && !strncmp(p, text, length))
            return true;
        p += word + (p[word] == '|');
    }
    return false;
}

static bool parse_uint(const char *text, const char **end, uint64_t *out)
{
    char *stop;
    if (*text < '0' || *text > '9')
        return false;
    errno = 0;
    *out = strtoull(text, &stop, 10);
    *end = stop;
    return errno == 0;
}

static hw_status fail_value(const hw_option *option, const char *text, const char *expected)
{
    return hw_fail(HW_USAGE, "--%s: '%s' is not %s", option->name, text, expected);
}

static hw_status check_bounds(const hw_option *option, const char *text, double value)
{
    if (!(option->min < option->max) || (value >= option->min && value <= option->max))
        return HW_OK;
    return hw_fail(HW_USAGE, "--%s: %s is not within %.15g to %.15g", option->name, text,
                   option->min, option->max);
}

static hw_status store_uint(const hw_option *option, const char *text)
{
    const char *end;
    uint64_t value;
    if (!parse_uint(text, &end, &value) || *end)
        return fail_value(option, text, "a whole number of at least 0");
    HW_TRY(check_bounds(option, text, (double)value));
    *(uint64_t *)option->value = value;
    return HW_OK;
}

static hw_status store_double(const hw_option *option, const char *text)
{
    char *end;
    double value = strtod(text, &end);
    if (end == text || *end || !isfinite(value))
        return fail_value(option, text, "a finite number");
    HW_TRY(check_bounds(option, text, value));
    *(double *)option->value = value;
    return HW_OK;
}

static hw_status store_size(const hw_option *option, const char *text)
{
    const char *end;
    uint64_t width, height;
    uint32_t *out = option->value;
    if (!parse_uint(text, &end, &width) || *end != 'x' || !parse_uint(end + 1, &end, &height) ||
        *end || width - 1 >= UINT32_MAX || height - 1 >= UINT32_MAX)
        return fail_value(option, text, "a size such as 1024x768");
    HW_TRY(check_bounds(option, text, (double)width));
    HW_TRY(check_bounds(option, text, (double)height));
    out[0] = (uint32_t)width;
    out[1] = (uint32_t)height;
    return HW_OK;
}

// What a unit behind a number of bytes stands for; 0 if it is none.
static double unit_bytes(const char *unit)
{
    static const char letters[] = "KMGT";
    double bytes = 1;
    const char *letter = *unit > ' ' ? strchr(letters, *unit & ~0x20) : NULL; // in lower case
    if (letter) {
        bool binary = unit[1] == 'i';
        unit += binary ? 2 : 1;
        for (long k = letter - letters; k >= 0; k--)
            bytes *= binary ? 1024 : 1000;
    }
    return !*unit || !strcmp(unit, "B") ? bytes : 0;
}

static hw_status store_bytes(const hw_option *option, const char *text)
{
    char *end = NULL;
    double value = *text >= '0' && *text <= '9' ? strtod(text, &end) : 0;
    double bytes = end ? value * unit_bytes(end) : 0;
    // strtod also reads hexadecimal numbers and exponents.
    if (!end || strspn(text, "0123456789.") != (size_t)(end - text) || unit_bytes(end) == 0 ||
        !(bytes <= 1e18))
        return fail_value(option, text, "a number of bytes such as 500M or 2G");
    HW_TRY(check_bounds(option, text, bytes));
    *(uint64_t *)option->value = (uint64_t)bytes;
    return HW_OK;
}

static hw_status store(const hw_option *option, const char *text)
{
    switch (option->type) {
    case HW_OPTION_FLAG:
        *(bool *)option->value = true;
        return HW_OK;
    case HW_OPTION_STRING:
        if (!*text)
            return hw_fail(HW_USAGE, "--%s: the value is empty", option->name);
        *(const char **)option->value = text;
        return HW_OK;
    case HW_OPTION_UINT:
        return store_uint(option, text);
    case HW_OPTION_DOUBLE:
        return store_double(option, text);
    case HW_OPTION_SIZE:
        return store_size(option, text);
    case HW_OPTION_BYTES:
        return store_bytes(option, text);
    case HW_OPTION_CHOICE:
        if (!is_choice(option->choices, text))
            return hw_fail(HW_USAGE, "--%s: '%s' is not one of %s", option->name, text,
                           option->choices);
        *(const char **)option->value = text;
        return HW_OK;
    }
    return hw_fail(HW_INTERNAL, "--%s: unknown type of option", option->name);
}

// --- Parsing ------------------------------------------------------------------------------------

// One argument of the command line, understood: an option with its value, or a positional one
// (option NULL). `used` is how many words of argv it takes.
typedef struct argument {
    const hw_option *option;
    const char *value;
    int used;
} argument;

static hw_status take_value(argument *a, const char *attached, int left, const char *const *words)
{
    a->used = 1;
    a->value = attached;
    if (a->option->type == HW_OPTION_FLAG)
        return attached ? hw_fail(HW_USAGE, "--%s takes no value", a->option->name) : HW_OK;
    if (attached)
        return HW_OK;
    if (left < 2)
        return hw_fail(HW_USAGE, "%s needs a value (%s)", words[0], metavar(a->option));
    a->value = words[1];
    a->used = 2;
    return HW_OK;
}

static hw_status read_long(const option_list *list, int left, const char *const *words, argument *a)
{
    const char *name = words[0] + 2;
    size_t length = strcspn(name, "=");
    a->option = find_option(list, name, length);
    if (!a->option)
        return fail_unknown(list, name, length);
    return take_value(a, name[length] == '=' ? name + length + 1 : NULL, left, words);
}

static hw_status read_short(const option_list *list, int left, const char *const *words,
                            argument *a)
{
    const char *word = words[0];
    for (uint32_t i = 0; i < list->count && !a->option; i++)
        if (list->options[i].short_name == word[1])
            a->option = &list->options[i];
    if (!a->option)
        return hw_fail(HW_USAGE, "unknown option '%s'", word);
    return take_value(a, word[2] ? word + 2 : NULL, left, words);
}

static hw_status read_argument(const option_list *list, int left, const char *const *words,
                               argument *a)
{
    *a = (argument){.value = words[0], .used = 1};
    if (words[0][0] != '-' || !words[0][1])
        return HW_OK;
    return words[0][1] == '-' ? read_long(list, left, words, a) : read_short(list, left, words, a);
}

static hw_status check_positional(const hw_command *command, int count, const char **argv)
{
    if (count < command->positional_min)
        return hw_fail(HW_USAGE, "an argument is missing: hexwalk %s %s", command->name,
                       command->arguments);
    if (command->positional_max >= 0 && count > command->positional_max)
        return hw_fail(HW_USAGE, "'%s' is one argument too many", argv[command->positional_max]);
    return HW_OK;
}

hw_status hw_options_parse(const hw_command *command, int argc, const char **argv, int *positional,
                           bool *help)
{
    option_list list;
    argument a;
    list_options(command, &list);
    *help = false;
    *positional = 0;
    // First a look for --help only, so that help shows the defaults and not what was given.
    for (int i = 0; i < argc && strcmp(argv[i], "--"); i += a.used) {
        HW_TRY(read_argument(&list, argc - i, argv + i, &a));
        if (a.option && a.option->value == &list.help) {
            *help = true;
            return HW_OK;
        }
    }
    bool ended = false;
    given = 0;
    for (int i = 0; i < argc; i += a.used) {
        if (!ended && !strcmp(argv[i], "--")) {
            ended = true;
            a.used = 1;
            continue;
        }
        a = (argument){.value = argv[i], .used = 1};
        if (!ended)
            HW_TRY(read_argument(&list, argc - i, argv + i, &a));
        if (a.option) {
            HW_TRY(store(a.option, a.value));
            given |= UINT64_C(1) << (a.option - list.options);
        } else
            argv[(*positional)++] = a.value;
    }
    if (list.quiet)
        hw_log_set_quiet(true);
    return check_positional(command, *positional, argv);
}

bool hw_option_given(const hw_command *command, const char *name)
{
    option_list list;
    list_options(command, &list);
    const hw_option *option = find_option(&list, name, strlen(name));
    return option && given >> (option - list.options) & 1;
}

hw_status hw_options_refuse(const hw_command *command, const char *const *names, const char *reason)
{
    for (; *names; names++)
        if (hw_option_given(command, *names))
            return hw_fail(HW_USAGE, "--%s %s", *names, reason);
    return HW_OK;
}

// --- Help ---------------------------------------------------------------------------------------

// The present value as text; false when there is nothing worth showing.
static bool format_value(const hw_option *o, char *out, size_t size)
{
    const char *text;
    switch (o->type) {
    case HW_OPTION_FLAG:
        return false;
    case HW_OPTION_STRING:
    case HW_OPTION_CHOICE:
        text = *(const char *const *)o->value;
        snprintf(out, size, "%s", text ? text : "");
        return text && *text;
    case HW_OPTION_BYTES:
        if (*(const uint64_t *)o->value == 0)
            return false;
        // fallthrough
    case HW_OPTION_UINT:
        snprintf(out, size, "%llu", *(const unsigned long long *)o->value);
        return true;
    case HW_OPTION_DOUBLE:
        snprintf(out, size, "%g", *(const double *)o->value);
        return true;
    case HW_OPTION_SIZE:
        snprintf(out, size, "%ux%u", ((const uint32_t *)o->value)[0],
                 ((const uint32_t *)o->value)[1]);
        return true;
    }
    return false;
}

// Text as a sentence: a capital, one full stop. `note`, if any, goes in parentheses before the
// stop, or into those that end the text already.
static void format_sentence(const char *text, const char *note, char *out, size_t size)
{
    size_t length = strlen(text);
    if (length && text[length - 1] == '.')
        length--;
    bool open = *note && length && text[length - 1] == ')';
    snprintf(out, size, "%.*s%s%s%s.", (int)(length - open), text,
             open    ? "; "
             : *note ? " ("
                     : "",
             note, *note ? ")" : "");
    if (out[0] >= 'a' && out[0] <= 'z')
        out[0] = (char)(out[0] - 'a' + 'A');
}

// The help sentence with choices and default: "Sentence (a|b|c; default: a)."
static void format_help(const hw_option *o, char *out, size_t size)
{
    char value[256], note[600];
    bool shown = format_value(o, value, sizeof value);
    bool choices = o->type == HW_OPTION_CHOICE && o->metavar;
    snprintf(note, sizeof note, "%s%s%s%s", choices ? o->choices : "", choices && shown ? "; " : "",
             shown ? "default: " : "", shown ? value : "");
    format_sentence(o->help, note, out, size);
}

static const char *command_text(const hw_command *command)
{
    return command->description ? command->description : command->summary;
}

// Writes the words of `text` from column `column` on, broken at HELP_COLUMNS, further lines
// indented. Newlines in the text start a new line.
static void write_wrapped(FILE *out, const char *text, size_t column, size_t indent)
{
    bool first = true;
    for (const char *p = text; *p;) {
        size_t word = strcspn(p, " \n");
        if (word && !first && column + 1 + word > HELP_COLUMNS) {
            fprintf(out, "\n%*s", (int)indent, "");
            column = indent;
            first = true;
        }
        if (word) {
            fprintf(out, "%s%.*s", first ? "" : " ", (int)word, p);
            column += word + !first;
            first = false;
        }
        p += word;
        if (*p == '\n') {
            fprintf(out, "\n%*s", p[1] == '\n' ? 0 : (int)indent, "");
            column = indent;
            first = true;
        }
        p += *p != 0;
    }
    fputc('\n', out);
}

static void write_keys(FILE *out, const hw_command *command)
{
    hw_command_key keys[HW_COMMAND_KEYS_MAX];
    uint32_t count = command->keys ? command->keys(keys, HW_COMMAND_KEYS_MAX) : 0;
    size_t widest = 0;
    for (uint32_t i = 0; i < count; i++)
        widest = strlen(keys[i].keys) > widest ? strlen(keys[i].keys) : widest;
    if (count > 0)
        fprintf(out, "\nKeys:\n");
    for (uint32_t i = 0; i < count; i++)
        fprintf(out, "  %-*s  %s\n", (int)widest, keys[i].keys, keys[i].meaning);
}

void hw_command_help(const hw_command *command, FILE *out)
{
    option_list list;
    list_options(command, &list);
    fprintf(out, "Usage: hexwalk %s %s [OPTION]...\n\n", command->name, command->arguments);
    write_wrapped(out, command_text(command), 0, 0);
    fprintf(out, "\nOptions:\n");
    size_t widest = 0;
    for (uint32_t i = 0; i < list.count; i++) {
        const hw_option *o = &list.options[i];
        size_t width = strlen(o->name) + (metavar(o) ? 1 + strlen(metavar(o)) : 0);
        widest = width > widest ? width : widest;
    }
    size_t indent = 10 + widest;
    for (uint32_t i = 0; i < list.count; i++) {
        const hw_option *o = &list.options[i];
        char help[1024], name[128];
        snprintf(name, sizeof name, "%s%s%s", o->name, metavar(o) ? " " : "",
                 metavar(o) ? metavar(o) : "");
        fprintf(out, o->short_name ? "  -%c, " : "  %c   ", o->short_name ? o->short_name : ' ');
        fprintf(out, "--%-*s  ", (int)widest, name);
        format_help(o, help, sizeof help);
        write_wrapped(out, help, indent, indent);
    }
    write_keys(out, command);
}

void hw_program_help(FILE *out)
{
    fprintf(out, "Usage: hexwalk COMMAND [ARGUMENT]...\n\n"
                 "Precomputes hexagonal view cells of large scenes and walks through them.\n\n"
                 "Commands:\n");
    for (const hw_command *const *c = hw_commands; *c; c++) {
        char summary[256];
        format_sentence((*c)->summary, "", summary, sizeof summary);
        fprintf(out, "  %-10s %s\n", (*c)->name, summary);
    }
    fprintf(out, "  %-10s Show help on a command.\n", "help");
    fprintf(out, "  %-10s Write the man page to standard output.\n\n", "man");
    fprintf(out, "'hexwalk help COMMAND' lists a command's options; 'hexwalk --version' tells the "
                 "version.\n");
}

// --- Man page -----------------------------------------------------------------------------------

// Text as roff source: hyphens that may be copied, no control characters at a line's start.
static void write_roff(FILE *out, const char *text)
{
    bool line_start = true;
    for (const char *p = text; *p; p++) {
        if (line_start && (*p == '.' || *p == '\''))
            fputs("\\&", out);
        line_start = *p == '\n';
        if (*p == '-')
            fputs("\\-", out);
        else if (*p == '\\')
            fputs("\\e", out);
        else if (*p == '\n' && p[1] == '\n')
            fputs("\n.PP", out);
        else if (*p != '\n' || p[1] != 0)
            fputc(*p, out);
    }
    fputc('\n', out);
}

static void write_man_option(FILE *out, const hw_option *o)
{
    char help[1024];
    fprintf(out, ".TP\n");
    if (o->short_name)
        fprintf(out, "\\fB\\-%c\\fR, ", o->short_name);
    fputs("\\fB\\-\\-", out);
    for (const char *p = o->name; *p; p++)
        fprintf(out, *p == '-' ? "\\-" : "%c", *p);
    fputs("\\fR", out);
    if (metavar(o))
        fprintf(out, " \\fI%s\\fR", metavar(o));
    fputc('\n', out);
    format_help(o, help, sizeof help);
    write_roff(out, help);
}

static void write_man_command(FILE *out, const hw_command *command)
{
    option_list list;
    list_options(command, &list);
    fprintf(out, ".SS ");
    char usage[512];
    snprintf(usage, sizeof usage, "hexwalk %s %s", command->name, command->arguments);
    write_roff(out, usage);
    write_roff(out, command_text(command));
    for (uint32_t i = 0; i + 2 < list.count; i++) // without --quiet and --help
        write_man_option(out, &list.options[i]);
    hw_command_key keys[HW_COMMAND_KEYS_MAX];
    uint32_t count = command->keys ? command->keys(keys, HW_COMMAND_KEYS_MAX) : 0;
    if (count > 0)
        fputs(".PP\nKeys:\n", out);
    for (uint32_t i = 0; i < count; i++) {
        fputs(".TP\n", out);
        write_roff(out, keys[i].keys);
        write_roff(out, keys[i].meaning);
    }
}

void hw_program_man(FILE *out)
{
    fprintf(out, ".TH HEXWALK 1 \"\" \"hexwalk %s\" \"User Commands\"\n", HW_PROGRAM_VERSION);
    fputs(".SH NAME\n"
          "hexwalk \\- walk through scenes of many millions of polygons\n"
          ".SH SYNOPSIS\n"
          ".B hexwalk\n"
          ".I COMMAND\n"
          "[\\fIARGUMENT\\fR]...\n"
          ".SH DESCRIPTION\n"
          "Hexwalk divides the space where a viewer may be into hexagonal cells and precomputes,\n"
          "for each of them, what can be seen from there: near objects as geometry, far ones as\n"
          "textured meshes of few polygons. A walk then loads cell by cell, so that the cost of a\n"
          "frame depends on the view and not on the size of the scene.\n"
          ".PP\n"
          "Human\\-readable output goes to standard output, progress and diagnostics to standard\n"
          "error.\n"
          ".SH COMMANDS\n",
          out);
    for (const hw_command *const *c = hw_commands; *c; c++)
        write_man_command(out, *c);
    fputs(".SS hexwalk help [COMMAND]\n"
          "Show help on a command, or list the commands.\n"
          ".SS hexwalk man\n"
          "Write this page to standard output.\n"
          ".SH OPTIONS OF EVERY COMMAND\n",
          out);
    option_list list;
    list_options(&(hw_command){0}, &list);
    for (uint32_t i = 0; i < list.count; i++)
        write_man_option(out, &list.options[i]);
    fputs(".SH EXIT STATUS\n"
          ".TP\n.B 0\nDone.\n"
          ".TP\n.B 1\nThe command failed; a message on standard error tells why.\n"
          ".TP\n.B 2\nThe command line was wrong.\n",
          out);
}

// --- Report -------------------------------------------------------------------------------------

static void add_value(cJSON *json, const hw_option *o)
{
    const char *text;
    switch (o->type) {
    case HW_OPTION_FLAG:
        cJSON_AddBoolToObject(json, o->name, *(const bool *)o->value);
        break;
    case HW_OPTION_STRING:
    case HW_OPTION_CHOICE:
        text = *(const char *const *)o->value;
        if (text)
            hw_json_add_string(json, o->name, text);
        else
            cJSON_AddNullToObject(json, o->name);
        break;
    case HW_OPTION_UINT:
    case HW_OPTION_BYTES:
        cJSON_AddNumberToObject(json, o->name, (double)*(const uint64_t *)o->value);
        break;
    case HW_OPTION_DOUBLE:
        cJSON_AddNumberToObject(json, o->name, *(const double *)o->value);
        break;
    case HW_OPTION_SIZE: {
        const uint32_t *size = o->value;
        cJSON *pair = cJSON_AddArrayToObject(json, o->name);
        for (int i = 0; pair && i < 2; i++)
            cJSON_AddItemToArray(pair, cJSON_CreateNumber(size[i]));
        break;
    }
    }
}

cJSON *hw_options_json(const hw_command *command)
{
    option_list list;
    cJSON *json = cJSON_CreateObject();
    list_options(command, &list);
    for (uint32_t i = 0; json && i + 2 < list.count; i++)
        add_value(json, &list.options[i]);
    return json;
}
