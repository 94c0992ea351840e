// A small web server for the files of a folder that misbehaves on demand. Include cmocka.h before.
#pragma once
#include "alloc.h"
#include "file.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

typedef enum web_fault {
    WEB_FINE,
    WEB_HANG_UP,   // closes without a word
    WEB_BUSY,      // 503
    WEB_GONE,      // 404
    WEB_CUT,       // closes after half of the body
    WEB_LONG,      // says more bytes than come
    WEB_SHORT,     // sends half a body with a length that fits it: a file cut at the server
    WEB_CORRUPT,   // one byte in the middle is another
    WEB_NO_RANGE,  // sends everything whatever was asked for
    WEB_RANGE,     // another range than was asked for
    WEB_SLOW,      // half a body, then nothing for as long as the client stands it
    WEB_NO_LENGTH, // does not say how long the body is
    WEB_GONE_CUT,  // 404, but the page that says so is cut off
    WEB_HUGE,      // knows no ranges, and the file has WEB_HUGE_BYTES
    WEB_ENDLESS    // knows no ranges, says no length and does not end
} web_fault;

#define WEB_HUGE_BYTES (UINT64_C(1) << 40)

typedef struct web {
    char folder[96], location[64];
    int socket;
    pthread_t thread;
    atomic_int fault, faults_left; // faults_left < 0: for ever
    atomic_int requests;
    atomic_bool closing;
} web;

// False once nobody listens any more.
static bool web_say(int to, const void *data, size_t size)
{
    const char *p = data;
    while (size > 0) {
        ssize_t sent = send(to, p, size, MSG_NOSIGNAL);
        if (sent <= 0)
            return false;
        p += sent;
        size -= (size_t)sent;
    }
    return true;
}

static void web_error(int to, int code)
{
    char text[128];
    snprintf(text, sizeof text,
             "HTTP/1.1 %d No\r\nContent-Length: 6\r\nConnection: close\r\n\r\nsorry\n", code);
    web_say(to, text, strlen(text));
}

static web_fault web_next_fault(web *w)
{
    int left = atomic_load(&w->faults_left);
    if (left == 0)
        return WEB_FINE;
    if (left > 0)
        atomic_fetch_sub(&w->faults_left, 1);
    return (web_fault)atomic_load(&w->fault);
}

// Waits until the other side has had enough.
static void web_wait_for_end(const web *w, int client)
{
    char byte;
    struct timeval patience = {0, 50000};
    setsockopt(client, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    while (!atomic_load(&w->closing) && recv(client, &byte, 1, 0) != 0)
        ;
}

static void web_send(const web *w, int client, web_fault fault, uint8_t *data, size_t size,
                     size_t first, size_t last)
{
    char head[256], length[64] = "";
    bool partial = last + 1 < size || first > 0;
    if (fault == WEB_NO_RANGE) {
        partial = false;
        first = 0;
        last = size - 1;
    }
    size_t count = size > 0 ? last - first + 1 : 0, said = count, sent = count;
    if (fault == WEB_CUT || fault == WEB_SLOW)
        sent /= 2;
    if (fault == WEB_SHORT)
        said = sent = count / 2;
    if (fault == WEB_LONG)
        said += 100;
    if (fault == WEB_CORRUPT)
        data[first + count / 2] ^= 0x40;
    if (fault != WEB_NO_LENGTH)
        snprintf(length, sizeof length, "Content-Length: %zu\r\n", said);
    size_t named = fault == WEB_RANGE ? first + 1 : first;
    snprintf(head, sizeof head, "HTTP/1.1 %s\r\nConnection: close\r\n%s",
             partial ? "206 Partial Content" : "200 OK", length);
    web_say(client, head, strlen(head));
    snprintf(head, sizeof head, "Content-Range: bytes %zu-%zu/%zu\r\n", named, last, size);
    if (partial)
        web_say(client, head, strlen(head));
    web_say(client, "\r\n", 2);
    web_say(client, data + first, sent);
    if (fault == WEB_SLOW)
        web_wait_for_end(w, client);
}

// The file and then anything, for as long as the other side takes it.
static void web_send_on(const web *w, int client, web_fault fault, const uint8_t *data, size_t size)
{
    static const uint8_t more[1 << 16];
    char head[128], length[64] = "";
    if (fault == WEB_HUGE)
        snprintf(length, sizeof length, "Content-Length: %llu\r\n",
                 (unsigned long long)WEB_HUGE_BYTES);
    snprintf(head, sizeof head, "HTTP/1.1 200 OK\r\nConnection: close\r\n%s\r\n", length);
    web_say(client, head, strlen(head));
    web_say(client, data, size);
    while (!atomic_load(&w->closing) && web_say(client, more, sizeof more))
        ;
}

static void web_gone_cut(int client)
{
    static const char page[] = "HTTP/1.1 404 No\r\nContent-Length: 600\r\n\r\nsor";
    web_say(client, page, sizeof page - 1);
}

static void web_answer(web *w, int client)
{
    char request[4096], path[512], name[256];
    size_t have = 0, first = 0, last = SIZE_MAX, size = 0;
    uint8_t *data = NULL;
    ssize_t got;
    while (have + 1 < sizeof request &&
           (got = recv(client, request + have, sizeof request - 1 - have, 0)) > 0) {
        have += (size_t)got;
        request[have] = 0;
        if (strstr(request, "\r\n\r\n"))
            break;
    }
    if (have == 0 || sscanf(request, "GET /%255s", name) != 1)
        return;
    atomic_fetch_add(&w->requests, 1);
    web_fault fault = web_next_fault(w);
    const char *range = strstr(request, "Range: bytes=");
    if (range)
        sscanf(range, "Range: bytes=%zu-%zu", &first, &last);
    snprintf(path, sizeof path, "%s/%s", w->folder, name);
    if (fault == WEB_HANG_UP)
        return;
    if (fault == WEB_BUSY || fault == WEB_GONE) {
        web_error(client, fault == WEB_BUSY ? 503 : 404);
    } else if (fault == WEB_GONE_CUT) {
        web_gone_cut(client);
    } else if (hw_file_read(path, 0, &data, &size) != HW_OK) {
        web_error(client, 404);
    } else if (fault == WEB_HUGE || fault == WEB_ENDLESS) {
        web_send_on(w, client, fault, data, size);
    } else if (first >= size && size > 0) {
        web_error(client, 416);
    } else {
        last = last < size ? last : size - 1;
        web_send(w, client, fault, data, size, first, last);
    }
    hw_free(data);
}

static void *web_serve(void *argument)
{
    web *w = argument;
    while (!atomic_load(&w->closing)) {
        int client = accept(w->socket, NULL, NULL);
        if (client < 0)
            break;
        if (!atomic_load(&w->closing))
            web_answer(w, client);
        close(client);
    }
    return NULL;
}

static void web_open(web *w, const char *folder)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    memset(w, 0, sizeof *w);
    snprintf(w->folder, sizeof w->folder, "%s", folder);
    w->socket = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_true(w->socket >= 0);
    assert_int_equal(bind(w->socket, (struct sockaddr *)&address, sizeof address), 0);
    assert_int_equal(listen(w->socket, 16), 0);
    assert_int_equal(getsockname(w->socket, (struct sockaddr *)&address, &size), 0);
    snprintf(w->location, sizeof w->location, "http://127.0.0.1:%d", ntohs(address.sin_port));
    assert_int_equal(pthread_create(&w->thread, NULL, web_serve, w), 0);
}

static void web_close(web *w)
{
    atomic_store(&w->closing, true);
    shutdown(w->socket, SHUT_RDWR);
    pthread_join(w->thread, NULL);
    close(w->socket);
}

static inline void web_misbehave(web *w, web_fault fault, int times)
{
    atomic_store(&w->fault, (int)fault);
    atomic_store(&w->faults_left, times);
    atomic_store(&w->requests, 0);
}
