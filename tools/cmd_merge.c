// hexwalk merge: joins shards into a dataset.
#include "interrupts.h"
#include "json.h"
#include "merge.h"
#include "options.h"
#include <signal.h>
#include <string.h>

static const char *output, *json_file;
static uint64_t threads;
static atomic_bool stop;

static uint32_t options(hw_option *out, uint32_t capacity)
{
    const hw_option table[] = {
        {"output", 'o', HW_OPTION_STRING, &output, "DATASET", NULL, 0, 0, "folder to write"},
        {"threads", 0, HW_OPTION_UINT, &threads, "N", NULL, 0, 1024,
         "threads; 0 means one per processor"},
        {"json", 0, HW_OPTION_STRING, &json_file, "FILE", NULL, 0, 0, "write the figures as JSON"},
    };
    uint32_t count = sizeof table / sizeof *table;
    memcpy(out, table, (count < capacity ? count : capacity) * sizeof *table);
    return count;
}

static void on_signal(int number)
{
    (void)number;
    atomic_store(&stop, true);
}

static hw_status write_json(const hw_merge_report *r)
{
    cJSON *json = cJSON_CreateObject();
    hw_json_add_number(json, "shards", r->shards);
    hw_json_add_number(json, "cells", r->cells);
    hw_json_add_number(json, "meshes", r->meshes);
    hw_json_add_number(json, "bytes", (double)r->bytes);
    hw_json_add_number(json, "build_seconds", r->build_seconds);
    hw_status status = hw_json_write(json_file, json);
    cJSON_Delete(json);
    return status;
}

static hw_status run(int argc, const char *const *argv)
{
    hw_merge_report r;
    if (!output)
        return hw_fail(HW_USAGE, "merge needs -o DATASET");
    hw_interrupts_handle(on_signal, 0);
    hw_status status = hw_merge_run(argv, (uint32_t)argc, output, (uint32_t)threads, &stop, &r);
    if (status == HW_USAGE) // not of the command line but of what is in the folders
        status = HW_FORMAT;
    HW_TRY(status);
    printf("%s: %u shards, %u cells, %u near meshes, %.1f MB\n", output, r.shards, r.cells,
           r.meshes, (double)r.bytes / 1e6);
    return json_file ? write_json(&r) : HW_OK;
}

const hw_command hw_cmd_merge = {
    .name = "merge",
    .summary = "join shards of a build into a dataset",
    .arguments = "SHARD... -o DATASET",
    .description =
        "Joins the folders that 'hexwalk build --shard K/N' has made, in any order, into a dataset "
        "that has the same bytes as if one build had made it. All N shards must be there, each "
        "once, of the same scene and options; every file is checked before the first is written. A "
        "failure leaves nothing behind.",
    .options = options,
    .positional_min = 1,
    .positional_max = -1,
    .run = run,
};
