#include "walk.h"

static void *run_task(void *argument)
{
    walk_task *task = argument;
    task->status = task->work(task->context);
    if (task->status != HW_OK)
        hw_error_save(task->error);
    atomic_store(&task->done, true);
    return NULL;
}

hw_status walk_task_start(walk_task *task, hw_status (*work)(void *context), void *context)
{
    task->work = work;
    task->context = context;
    atomic_store(&task->done, false);
    if (pthread_create(&task->thread, NULL, run_task, task) != 0)
        return hw_fail(HW_MEMORY, "no thread can be started");
    task->running = true;
    return HW_OK;
}

bool walk_task_ended(walk_task *task)
{
    return task->running && atomic_load(&task->done);
}

hw_status walk_task_join(walk_task *task)
{
    pthread_join(task->thread, NULL);
    task->running = false;
    if (task->status != HW_OK)
        hw_error_restore(task->error);
    return task->status;
}
