#include "interrupts.h"
#include <signal.h>
#include <stddef.h>

void hw_interrupts_handle(void (*handler)(int number), int flags)
{
    struct sigaction old, action = {.sa_handler = handler, .sa_flags = flags};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    if (sigaction(SIGHUP, NULL, &old) == 0 && old.sa_handler != SIG_IGN)
        sigaction(SIGHUP, &action, NULL);
}
