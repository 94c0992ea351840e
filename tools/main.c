// hexwalk: finds the subcommand, runs it, prints its error. The only place that prints errors and
// exits.
#include "log.h"
#include "options.h"
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>

enum { EXIT_DONE = 0, EXIT_FAILED = 1, EXIT_USAGE = 2 };

static const hw_command *find_command(const char *name)
{
    for (const hw_command *const *c = hw_commands; *c; c++)
        if (!strcmp((*c)->name, name))
            return *c;
    return NULL;
}

static hw_status fail_command(const char *name)
{
    return hw_fail(HW_USAGE, "unknown command '%s'", name);
}

static hw_status show_help(int argc, const char *const *argv)
{
    if (argc > 1)
        return hw_fail(HW_USAGE, "'%s' is one argument too many", argv[1]);
    if (argc == 0) {
        hw_program_help(stdout);
        return HW_OK;
    }
    const hw_command *command = find_command(argv[0]);
    if (!command)
        return fail_command(argv[0]);
    hw_command_help(command, stdout);
    return HW_OK;
}

static hw_status run_command(const hw_command *command, int argc, const char **argv)
{
    int positional;
    bool help;
    HW_TRY(hw_options_parse(command, argc, argv, &positional, &help));
    if (!help)
        return command->run(positional, argv);
    hw_command_help(command, stdout);
    return HW_OK;
}

static bool is_one_of(const char *word, const char *a, const char *b)
{
    return !strcmp(word, a) || !strcmp(word, b);
}

// *command gets the subcommand, if there is one.
static hw_status dispatch(int argc, const char **argv, const hw_command **command)
{
    if (argc < 2)
        return hw_fail(HW_USAGE, "no command given");
    const char *name = argv[1];
    if (is_one_of(name, "--version", "version")) {
        printf("hexwalk %s\n", HW_PROGRAM_VERSION);
        return HW_OK;
    }
    if (is_one_of(name, "--help", "-h") || !strcmp(name, "help"))
        return show_help(argc - 2, argv + 2);
    if (!strcmp(name, "man")) {
        hw_program_man(stdout);
        return HW_OK;
    }
    *command = find_command(name);
    return *command ? run_command(*command, argc - 2, argv + 2) : fail_command(name);
}

// What was printed must have arrived: a full disk behind a redirection is a failure. A reader that
// went away (head) is one too, but needs no words.
static bool output_arrived(void)
{
    bool earlier = ferror(stdout) != 0;
    if (fflush(stdout) == 0 && !earlier)
        return true;
    if (errno != EPIPE)
        fprintf(stderr, "hexwalk: cannot write to standard output: %s\n", strerror(errno));
    return false;
}

// A file opened while a standard descriptor is closed (2>&-) would get its number, and what is
// meant for that stream. Read-only, so that writing to it still fails. False if the null device
// cannot be opened.
static bool fill_descriptors(void)
{
    int fd;
    do
        fd = open("/dev/null", O_RDONLY);
    while (fd >= 0 && fd <= STDERR_FILENO);
    return fd >= 0 && close(fd) == 0;
}

int main(int argc, const char **argv)
{
    const hw_command *command = NULL;
    if (!fill_descriptors())
        return EXIT_FAILED;
    // Both arrive as errors of the write instead, which are reported and cleaned up after.
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN);
    hw_status status = dispatch(argc, argv, &command);
    bool arrived = output_arrived();
    if (status == HW_OK)
        return arrived ? EXIT_DONE : EXIT_FAILED;
    const char *text = *hw_error_text() ? hw_error_text() : hw_status_text(status);
    if (status != HW_USAGE) {
        fprintf(stderr, "hexwalk: %s\n", text);
        return EXIT_FAILED;
    }
    fprintf(stderr, "hexwalk: %s (try 'hexwalk help%s%s')\n", text, command ? " " : "",
            command ? command->name : "");
    return EXIT_USAGE;
}
