// Being asked to stop: Ctrl-C, kill, or the end of the terminal.
#pragma once

// From now on `handler` is called for each of them, with flags as of sigaction; the end of the
// terminal stays without effect where it was (nohup).
void hw_interrupts_handle(void (*handler)(int number), int flags);
