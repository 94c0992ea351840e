// One table of options per command makes the parser, `hexwalk help`, the man page and the JSON
// record of what was run.
#pragma once
#include "status.h"
#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

typedef enum hw_option_type {
    HW_OPTION_FLAG,   // bool *
    HW_OPTION_STRING, // const char **
    HW_OPTION_UINT,   // uint64_t *
    HW_OPTION_DOUBLE, // double * ; must be finite
    HW_OPTION_SIZE,   // uint32_t[2], "1024x1024"
    HW_OPTION_BYTES,  // uint64_t *, "500M", "2G": K, M, G, T are powers of 1000, Ki ... of 1024
    HW_OPTION_CHOICE, // const char **, one of `choices` separated by '|'
} hw_option_type;

typedef struct hw_option {
    const char *name; // long name without dashes; short ones: "o" beside it
    char short_name;  // 0 if none
    hw_option_type type;
    void *value;         // holds the default before parsing
    const char *metavar; // "FILE", "PX", ...; NULL for flags
    const char *choices; // HW_OPTION_CHOICE
    double min, max;     // inclusive bounds for numbers when min < max
    const char *help;    // one sentence; the default is appended by the generator
} hw_option;

// A key of a window and what it does.
typedef struct hw_command_key {
    char keys[32];
    const char *meaning;
} hw_command_key;

#define HW_COMMAND_KEYS_MAX 64

typedef struct hw_command {
    const char *name, *summary, *arguments; // arguments: "SCENE -o DATASET"
    const char *description;                // a paragraph or two for help and the man page
    // Fills `options` (room for `capacity`), returns how many. Options point at static storage of
    // the command's file.
    uint32_t (*options)(hw_option *options, uint32_t capacity);
    // Fills `keys` as options does; NULL for commands without a window.
    uint32_t (*keys)(hw_command_key *keys, uint32_t capacity);
    int positional_min, positional_max;
    // Runs with parsed options and positional arguments. Errors are returned; main prints them.
    hw_status (*run)(int argc, const char *const *argv);
} hw_command;

// Each in its own cmd_<name>.c.
extern const hw_command hw_cmd_park, hw_cmd_build, hw_cmd_tour, hw_cmd_walk, hw_cmd_render,
    hw_cmd_measure, hw_cmd_compare, hw_cmd_simplify, hw_cmd_info, hw_cmd_merge;
// All commands, in the order of help; ends with NULL.
extern const hw_command *const hw_commands[];

// Parses argv (without program and subcommand). Positional arguments are moved to the front of argv
// and counted in *positional. Every command also knows --quiet, --help. HW_USAGE names the
// offending argument.
HW_MUST_USE hw_status hw_options_parse(const hw_command *command, int argc, const char **argv,
                                       int *positional, bool *help);
// Whether the command line that was parsed last had this option of the command, even with the value
// that is the default.
bool hw_option_given(const hw_command *command, const char *name);
// HW_USAGE "--name reason" for the first of `names` (ends with NULL) that was given: for options
// that would be without effect.
HW_MUST_USE hw_status hw_options_refuse(const hw_command *command, const char *const *names,
                                        const char *reason);
void hw_command_help(const hw_command *command, FILE *out);
void hw_program_help(FILE *out);
// The man page hexwalk(1) from the same tables.
void hw_program_man(FILE *out);
// The options' present values as a JSON object (for reports).
cJSON *hw_options_json(const hw_command *command);
