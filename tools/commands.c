#include "options.h"

const hw_command *const hw_commands[] = {
    &hw_cmd_park,    &hw_cmd_build,    &hw_cmd_merge,   &hw_cmd_tour, &hw_cmd_walk, &hw_cmd_render,
    &hw_cmd_measure, &hw_cmd_simplify, &hw_cmd_compare, &hw_cmd_info, NULL,
};
