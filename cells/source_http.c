// Files of a web server; the only file that knows libcurl. It is loaded when it is first needed:
// its two dozen libraries take memory that a walk through a folder is better without.
#define CURL_DISABLE_TYPECHECK
#include "alloc.h"
#include "source_internal.h"
#include "system.h"
#include <curl/curl.h>
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define REDIRECTS_MAX 3L
#define HTTP_PARTIAL  206L

static pthread_once_t curl_once = PTHREAD_ONCE_INIT;
static char load_error[256];

// What is called of it.
static struct {
    CURLcode (*global_init)(long);
    CURL *(*init)(void);
    void (*cleanup)(CURL *);
    void (*reset)(CURL *);
    CURLcode (*setopt)(CURL *, CURLoption, ...);
    CURLcode (*getinfo)(CURL *, CURLINFO, ...);
    CURLcode (*perform)(CURL *);
    const char *(*strerror)(CURLcode);
    bool loaded;
} curl;

// ISO C has no conversion between pointers to objects and to functions; POSIX has.
static bool find(void *library, const char *name, void *function)
{
    void *symbol = dlsym(library, name);
    memcpy(function, &symbol, sizeof symbol);
    return symbol != NULL;
}

static void load_curl(void)
{
    void *library = dlopen("libcurl.so.4", RTLD_NOW | RTLD_LOCAL);
    curl.loaded = library && find(library, "curl_global_init", &curl.global_init) &&
                  find(library, "curl_easy_init", &curl.init) &&
                  find(library, "curl_easy_cleanup", &curl.cleanup) &&
                  find(library, "curl_easy_reset", &curl.reset) &&
                  find(library, "curl_easy_setopt", &curl.setopt) &&
                  find(library, "curl_easy_getinfo", &curl.getinfo) &&
                  find(library, "curl_easy_perform", &curl.perform) &&
                  find(library, "curl_easy_strerror", &curl.strerror) &&
                  curl.global_init(CURL_GLOBAL_DEFAULT) == CURLE_OK;
    const char *reason = curl.loaded ? NULL : dlerror();
    snprintf(load_error, sizeof load_error, "%s", reason ? reason : "it does not start");
}

// One attempt as curl's callbacks see it.
typedef struct transfer {
    hw_fetch *fetch;
    CURL *handle;
    uint64_t passed;                  // body bytes seen, those before a wanted range too
    uint64_t range_first, file_bytes; // of Content-Range
    bool has_range, sized;
    bool complete; // all that is wanted is there, and more was to come: ended for that
    size_t capacity;
    double moved_ms;  // when bytes came last
    bool stalled;     // ended for that
    hw_status status; // of our own doing
} transfer;

static long response_code(const transfer *t)
{
    long code = 0;
    curl.getinfo(t->handle, CURLINFO_RESPONSE_CODE, &code);
    return code;
}

// "Content-Range: bytes 0-4095/123456"; headers of a redirection come first and are overwritten.
static size_t take_header(char *data, size_t size, size_t count, void *context)
{
    static const char name[] = "content-range:";
    transfer *t = context;
    char text[128];
    size_t n = size * count;
    unsigned long long first, last, all;
    if (n >= sizeof text || n < sizeof name || strncasecmp(data, name, sizeof name - 1) != 0)
        return n;
    memcpy(text, data, n);
    text[n] = 0;
    if (sscanf(text + sizeof name - 1, " bytes %llu-%llu/%llu", &first, &last, &all) == 3) {
        t->has_range = true;
        t->range_first = first;
        t->file_bytes = all;
    }
    return n;
}

// Before the first byte of a body: how much of it is wanted.
static hw_status size_block(transfer *t)
{
    hw_fetch *f = t->fetch;
    curl_off_t length = -1;
    bool partial = response_code(t) == HTTP_PARTIAL;
    curl.getinfo(t->handle, CURLINFO_CONTENT_LENGTH_DOWNLOAD_T, &length);
    t->sized = true;
    if (partial && (!t->has_range || t->range_first != f->offset))
        return hw_fail(HW_IO, "%s: the server sent another range than was asked for", f->path);
    if (!partial)
        t->file_bytes = length >= 0 ? (uint64_t)length : 0;
    // A server that knows no ranges sends everything: what lies before is passed over.
    uint64_t wanted = f->size ? f->size : t->file_bytes;
    if (t->file_bytes > f->offset && wanted > t->file_bytes - f->offset)
        wanted = t->file_bytes - f->offset;
    if (wanted > HW_SOURCE_FILE_MAX)
        return hw_fail(HW_LIMIT, "%s: %llu bytes are too many", f->path,
                       (unsigned long long)wanted);
    t->capacity = (size_t)wanted;
    return HW_NEW(&f->block.data, t->capacity + 1);
}

// Copies what is wanted of the next n bytes of the body.
static hw_status copy_wanted(transfer *t, const uint8_t *data, size_t n)
{
    hw_fetch *f = t->fetch;
    hw_block *b = &f->block;
    uint64_t start = response_code(t) == HTTP_PARTIAL ? 0 : f->offset;
    uint64_t skip = t->passed < start ? start - t->passed : 0;
    if (skip >= n)
        return HW_OK;
    data += skip;
    n -= (size_t)skip;
    if (f->size && n > t->capacity - b->size)
        n = t->capacity - b->size;   // what lies behind
    if (b->size + n > t->capacity) { // no Content-Length
        size_t grown = 2 * t->capacity > b->size + n ? 2 * t->capacity : b->size + n;
        HW_TRY(HW_RESIZE(&b->data, grown + 1));
        t->capacity = grown;
    }
    memcpy(b->data + b->size, data, n);
    b->size += n;
    b->data[b->size] = 0;
    return HW_OK;
}

// A server that knows no ranges may go on for gigabytes behind what is wanted, or for ever.
static hw_status append(transfer *t, const uint8_t *data, size_t n)
{
    hw_fetch *f = t->fetch;
    HW_TRY(copy_wanted(t, data, n));
    t->passed += n;
    bool all = f->size && t->file_bytes && f->block.size == t->capacity;
    uint64_t end = response_code(t) == HTTP_PARTIAL ? t->capacity : t->file_bytes;
    t->complete = all && t->passed != end;
    if (!t->complete && t->passed > HW_SOURCE_FILE_MAX)
        return hw_fail(HW_LIMIT, "%s: it does not end", f->path);
    return HW_OK;
}

static size_t take_body(char *data, size_t size, size_t count, void *context)
{
    transfer *t = context;
    size_t n = size * count;
    long code = response_code(t);
    if (code != 200 && code != HTTP_PARTIAL)
        return n; // a page that says so
    if (!t->sized)
        t->status = size_block(t);
    if (t->status == HW_OK)
        t->status = append(t, (const uint8_t *)data, n);
    if (t->status == HW_OK && !hw_fetch_pace(t->fetch, n))
        t->status = hw_fail(HW_INTERRUPTED, "%s: cancelled", t->fetch->path);
    t->moved_ms = hw_clock_ms();
    return t->status == HW_OK && !t->complete ? n : 0;
}

static int watch(void *context, curl_off_t total, curl_off_t now, curl_off_t up, curl_off_t up_now)
{
    transfer *t = context;
    (void)total;
    (void)now;
    (void)up;
    (void)up_now;
    t->stalled = hw_clock_ms() - t->moved_ms > t->fetch->timeout_ms;
    return t->stalled || atomic_load(t->fetch->cancelled);
}

static void set_options(transfer *t)
{
    CURL *c = t->handle;
    const hw_fetch *f = t->fetch;
    char range[64];
    curl.reset(c); // keeps the connection
    curl.setopt(c, CURLOPT_URL, f->path);
    curl.setopt(c, CURLOPT_PROTOCOLS_STR, "http,https");
    curl.setopt(c, CURLOPT_REDIR_PROTOCOLS_STR, "http,https");
    curl.setopt(c, CURLOPT_FOLLOWLOCATION, 1L);
    curl.setopt(c, CURLOPT_MAXREDIRS, REDIRECTS_MAX);
    curl.setopt(c, CURLOPT_NOSIGNAL, 1L);
    curl.setopt(c, CURLOPT_CONNECTTIMEOUT_MS, (long)f->timeout_ms);
    curl.setopt(c, CURLOPT_USERAGENT, "hexwalk");
    curl.setopt(c, CURLOPT_HEADERFUNCTION, take_header);
    curl.setopt(c, CURLOPT_HEADERDATA, t);
    curl.setopt(c, CURLOPT_WRITEFUNCTION, take_body);
    curl.setopt(c, CURLOPT_WRITEDATA, t);
    curl.setopt(c, CURLOPT_NOPROGRESS, 0L);
    curl.setopt(c, CURLOPT_XFERINFOFUNCTION, watch);
    curl.setopt(c, CURLOPT_XFERINFODATA, t);
    if (f->size == 0)
        return;
    snprintf(range, sizeof range, "%llu-%llu", (unsigned long long)f->offset,
             (unsigned long long)(f->offset + f->size - 1));
    curl.setopt(c, CURLOPT_RANGE, range);
}

static hw_status fail_code(hw_fetch *f, long code)
{
    f->again = code >= 500 || code == 408 || code == 429;
    if (code == 404 || code == 410)
        return hw_fail(HW_NOT_FOUND, "%s: not found (HTTP %ld)", f->path, code);
    if (code == 416)
        return hw_fail(HW_FORMAT, "%s: truncated: it ends before byte %llu", f->path,
                       (unsigned long long)f->offset);
    return hw_fail(HW_IO, "%s: the server answered %ld", f->path, code);
}

// That all bytes are there.
static hw_status check_length(transfer *t)
{
    hw_fetch *f = t->fetch;
    hw_block *b = &f->block;
    if (!t->sized) // an empty body
        HW_TRY(size_block(t));
    b->file_bytes = t->file_bytes ? t->file_bytes : t->passed;
    if (f->offset > b->file_bytes)
        return hw_fail(HW_FORMAT, "%s: truncated: %llu bytes", f->path,
                       (unsigned long long)b->file_bytes);
    uint64_t wanted = b->file_bytes - f->offset;
    if (f->size && f->size < wanted)
        wanted = f->size;
    if (b->size == wanted)
        return HW_OK;
    f->again = true;
    return hw_fail(HW_IO, "%s: %zu bytes came, not %llu", f->path, b->size,
                   (unsigned long long)wanted);
}

static hw_status read_url(void *connection, hw_fetch *f)
{
    transfer t = {.fetch = f, .handle = connection, .moved_ms = hw_clock_ms()};
    set_options(&t);
    CURLcode code = curl.perform(t.handle);
    if (t.status != HW_OK)
        return t.status;
    if (atomic_load(f->cancelled))
        return hw_fail(HW_INTERRUPTED, "%s: cancelled", f->path);
    // What the server says counts, even if the page that says so is cut off.
    long answer = response_code(&t);
    if (answer >= 400)
        return fail_code(f, answer);
    if (code != CURLE_OK && !t.complete) {
        f->again = code != CURLE_OUT_OF_MEMORY && code != CURLE_URL_MALFORMAT &&
                   code != CURLE_UNSUPPORTED_PROTOCOL && code != CURLE_TOO_MANY_REDIRECTS;
        return hw_fail(code == CURLE_OUT_OF_MEMORY ? HW_MEMORY : HW_IO, "%s: %s", f->path,
                       t.stalled ? "nothing came for too long" : curl.strerror(code));
    }
    if (answer != 200 && answer != HTTP_PARTIAL)
        return fail_code(f, answer);
    return check_length(&t);
}

static hw_status connect_curl(void **connection)
{
    pthread_once(&curl_once, load_curl);
    if (!curl.loaded)
        return hw_fail(HW_IO, "web servers need libcurl, which cannot be loaded: %s", load_error);
    *connection = curl.init();
    return *connection ? HW_OK : hw_fail(HW_MEMORY, "out of memory for a connection");
}

static void disconnect_curl(void *connection)
{
    if (connection)
        curl.cleanup(connection);
}

const hw_source_backend hw_source_http = {
    .connect = connect_curl, .disconnect = disconnect_curl, .read = read_url};
