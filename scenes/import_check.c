#include "import_check.h"
#include "alloc.h"
#include "bytes.h"
#include "file.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define FILE_BYTES_MAX (UINT64_C(8) << 30)

// ---- OFF ----------------------------------------------------------------------------------------

static hw_status fail_line(const char *path, const hw_words *w, const char *cause)
{
    return hw_fail(HW_FORMAT, "%s: line %llu: %s", path, (unsigned long long)w->line, cause);
}

// The rest of a COFF line, three or four components, as four in [0, 1]: whole numbers are of 255.
// No colour at all is white.
static bool off_color(hw_words *w, hw_bytes_writer *out)
{
    double c[4] = {1, 1, 1, 1};
    bool whole = true;
    const char *word;
    size_t length;
    int n = 0;
    for (hw_words look = *w; n < 4 && hw_words_get(&look, &word, &length); n++) {
        if (!hw_words_number(w))
            return false;
        c[n] = strtod(word, NULL);
        whole = whole && !memchr(word, '.', length);
    }
    if (n == 1 || n == 2)
        return false;
    for (int k = 0; k < 4; k++) {
        char text[32];
        double most = k < n && whole ? 255 : 1;
        int size = snprintf(text, sizeof text, " %.6f", fmin(fmax(c[k], 0), most) / most);
        hw_put_bytes(out, text, size > 0 && (size_t)size < sizeof text ? (size_t)size : 0);
    }
    return true;
}

static hw_status off_vertices(const char *path, hw_words *w, int64_t count, bool colors,
                              hw_bytes_writer *out)
{
    for (int64_t i = 0; i < count; i++) {
        if (!hw_words_line(w))
            return hw_fail(HW_FORMAT, "%s: truncated after %lld of %lld vertices", path,
                           (long long)i, (long long)count);
        const char *start = w->next;
        for (int k = 0; k < 3; k++)
            if (!hw_words_number(w))
                return fail_line(path, w, "three coordinates expected");
        hw_put_bytes(out, start, (size_t)(w->next - start));
        start = w->next;
        if (colors && !off_color(w, out))
            return fail_line(path, w, "three or four components of a colour expected");
        const char *comment = memchr(start, '#', (size_t)(w->end - start));
        if (!colors)
            hw_put_bytes(out, start, (size_t)((comment ? comment : w->end) - start));
        hw_put_u8(out, '\n');
    }
    return HW_OK;
}

static hw_status off_face(const char *path, hw_words *w, int64_t vertices, hw_model_facts *facts,
                          hw_bytes_writer *out)
{
    int64_t corners, index;
    if (!hw_words_integer(w, &corners) || corners < 0)
        return fail_line(path, w, "a number of corners expected");
    facts->faces += corners >= 3;
    for (int64_t k = -1; k < corners; k++) {
        if (k >= 0 && !hw_words_integer(w, &index))
            return fail_line(path, w, "fewer indices than corners");
        if (k >= 0 && (index < 0 || index >= vertices))
            return hw_fail(HW_FORMAT, "%s: line %llu: index %lld out of range (%lld vertices)",
                           path, (unsigned long long)w->line, (long long)index,
                           (long long)vertices);
        char text[32];
        int n = snprintf(text, sizeof text, "%lld ", (long long)(k < 0 ? corners : index));
        hw_put_bytes(out, text, n > 0 ? (size_t)n : 0);
    }
    hw_put_u8(out, '\n');
    return HW_OK;
}

static hw_status off_body(const char *path, hw_words *w, bool colors, hw_model_facts *facts,
                          hw_bytes_writer *out)
{
    int64_t vertices, faces;
    char counts[64];
    if (!hw_words_integer(w, &vertices) || !hw_words_integer(w, &faces) || vertices < 0 ||
        faces < 0)
        return fail_line(path, w, "counts of vertices, faces and edges expected");
    int n = snprintf(counts, sizeof counts, "%lld %lld 0\n", (long long)vertices, (long long)faces);
    hw_put_bytes(out, counts, n > 0 ? (size_t)n : 0);
    HW_TRY(off_vertices(path, w, vertices, colors, out));
    for (int64_t i = 0; i < faces; i++) {
        if (!hw_words_line(w))
            return hw_fail(HW_FORMAT, "%s: truncated after %lld of %lld faces", path, (long long)i,
                           (long long)faces);
        HW_TRY(off_face(path, w, vertices, facts, out));
    }
    return facts->faces > 0 ? HW_OK : hw_fail(HW_FORMAT, "%s: no triangle", path);
}

// Writes the model anew in the one form that Assimp reads without losing anything: no comments, all
// three counts on their line, single blanks, nothing after a face's indices.
hw_status hw_check_off(const hw_model_bytes *file, hw_model_facts *facts)
{
    hw_words w = hw_words_make(file->data, file->size, '#');
    hw_bytes_writer out = {0};
    const char *kind = NULL, *word;
    size_t length = 0, more;
    if (!hw_words_line(&w) || !hw_words_get(&w, &kind, &length) || length < 3 || length > 9 ||
        memcmp(kind + length - 3, "OFF", 3) != 0)
        return hw_fail(HW_FORMAT, "%s: no OFF file (it does not start with OFF)", file->path);
    if (length > 3 && (kind[length - 4] == 'n' || kind[length - 4] == '4'))
        return hw_fail(HW_FORMAT, "%s: OFF of other than three dimensions", file->path);
    hw_words rest = w; // the counts may follow on the same line
    if (!hw_words_get(&rest, &word, &more) && !hw_words_line(&w))
        return hw_fail(HW_FORMAT, "%s: truncated after the first line", file->path);
    bool colors = length == 4 && kind[0] == 'C';
    hw_put_bytes(&out, kind, length);
    hw_put_u8(&out, '\n');
    hw_status status = off_body(file->path, &w, colors, facts, &out);
    if (status == HW_OK)
        status = hw_bytes_writer_check(&out);
    if (status == HW_OK && out.size > UINT32_MAX)
        status = hw_fail(HW_LIMIT, "%s: too long for an OFF file", file->path);
    if (status != HW_OK) {
        hw_bytes_writer_free(&out);
        return status;
    }
    facts->text = (char *)out.data;
    facts->text_bytes = out.size;
    return HW_OK;
}

// ---- OBJ ----------------------------------------------------------------------------------------

typedef struct obj_counts {
    int64_t v, vt, vn, faces;
} obj_counts;

static bool word_is(const char *word, size_t length, const char *text)
{
    return length == strlen(text) && memcmp(word, text, length) == 0;
}

// One index of a corner: from 1, or negative from the last element so far. Advances *at.
static bool obj_index(const char **at, const char *end, int64_t so_far, int64_t total)
{
    int64_t value = 0;
    bool negative = *at < end && **at == '-';
    const char *p = *at + negative, *start = p;
    while (p < end && *p >= '0' && *p <= '9' && p - start < 18)
        value = value * 10 + (*p++ - '0');
    if (p == start)
        return false;
    *at = p;
    return value >= 1 && value <= (negative ? so_far : total);
}

// "1", "1/2", "1//3", "1/2/3".
static bool obj_corner(const char *word, size_t length, const obj_counts *now,
                       const obj_counts *total)
{
    const char *p = word, *end = word + length;
    if (!obj_index(&p, end, now->v, total->v))
        return false;
    if (p < end && *p == '/') {
        p++;
        if (p < end && *p != '/' && !obj_index(&p, end, now->vt, total->vt))
            return false;
    }
    if (p < end && *p == '/') {
        p++;
        if (p < end && !obj_index(&p, end, now->vn, total->vn))
            return false;
    }
    return p == end;
}

// Looks at one line; `total` NULL on the first pass, which only counts.
static hw_status obj_line(const char *path, hw_words *w, obj_counts *now, const obj_counts *total)
{
    const char *word;
    size_t length;
    if (!hw_words_get(w, &word, &length))
        return HW_OK;
    now->v += word_is(word, length, "v");
    now->vt += word_is(word, length, "vt");
    now->vn += word_is(word, length, "vn");
    now->faces += word_is(word, length, "f");
    if (!total)
        return HW_OK;
    int numbers = word_is(word, length, "v") || word_is(word, length, "vn") ? 3
                  : word_is(word, length, "vt")                             ? 1
                                                                            : 0;
    for (int k = 0; k < numbers; k++)
        if (!hw_words_number(w))
            return fail_line(path, w, "too few numbers");
    if (!word_is(word, length, "f"))
        return HW_OK;
    int corners = 0;
    bool more = false; // a line that ends in a backslash goes on
    for (; hw_words_get(w, &word, &length); corners += corners < 3) {
        more = word_is(word, length, "\\");
        if (!more && !obj_corner(word, length, now, total))
            return fail_line(path, w, "a face's index is malformed or out of range");
    }
    return corners == 3 || more ? HW_OK : fail_line(path, w, "a face without three corners");
}

hw_status hw_check_obj(const hw_model_bytes *file)
{
    if (memchr(file->data, 0, file->size))
        return hw_fail(HW_FORMAT, "%s: no text file, so no OBJ file", file->path);
    obj_counts total = {0}, now = {0};
    hw_words w = hw_words_make(file->data, file->size, '#');
    while (hw_words_line(&w))
        HW_TRY(obj_line(file->path, &w, &total, NULL));
    w = hw_words_make(file->data, file->size, '#');
    while (hw_words_line(&w))
        HW_TRY(obj_line(file->path, &w, &now, &total));
    if (total.v == 0 || total.faces == 0)
        return hw_fail(HW_FORMAT, "%s: no triangle", file->path);
    return HW_OK;
}

// ---- STL ----------------------------------------------------------------------------------------

#define STL_HEADER_BYTES   84
#define STL_TRIANGLE_BYTES 50

static hw_status stl_text(const hw_model_bytes *file, hw_model_facts *facts)
{
    hw_words w = hw_words_make(file->data, file->size, 0);
    uint64_t facets = 0, closed = 0, vertices = 0;
    bool open = false;
    while (hw_words_line(&w)) {
        const char *word;
        size_t length;
        if (!hw_words_get(&w, &word, &length))
            continue;
        open = !word_is(word, length, "endsolid");
        facets += word_is(word, length, "facet");
        closed += word_is(word, length, "endfacet");
        if (!word_is(word, length, "vertex"))
            continue;
        vertices++;
        for (int k = 0; k < 3; k++)
            if (!hw_words_number(&w))
                return fail_line(file->path, &w, "three coordinates expected");
    }
    if (open || closed != facets)
        return hw_fail(HW_FORMAT, "%s: truncated (no endsolid at the end)", file->path);
    if (facets == 0)
        return hw_fail(HW_FORMAT, "%s: no triangle", file->path);
    if (vertices != 3 * facets)
        return hw_fail(HW_FORMAT, "%s: %llu facets with %llu vertices", file->path,
                       (unsigned long long)facets, (unsigned long long)vertices);
    facts->faces = facets;
    return HW_OK;
}

hw_status hw_check_stl(const hw_model_bytes *file, hw_model_facts *facts)
{
    if (file->size >= STL_HEADER_BYTES) {
        hw_bytes_reader r = hw_bytes_reader_make(file->data + 80, 4);
        uint64_t count = facts->faces = hw_get_u32(&r);
        if (file->size == STL_HEADER_BYTES + STL_TRIANGLE_BYTES * count)
            return count ? HW_OK : hw_fail(HW_FORMAT, "%s: no triangle", file->path);
    }
    hw_words w = hw_words_make(file->data, file->size, 0);
    const char *word;
    size_t length;
    if (hw_words_line(&w) && hw_words_get(&w, &word, &length) && word_is(word, length, "solid"))
        return stl_text(file, facts);
    return hw_fail(HW_FORMAT,
                   "%s: no STL file: it neither starts with \"solid\" nor has the length that its "
                   "number of triangles asks for (truncated?)",
                   file->path);
}

// ---- 3DS ----------------------------------------------------------------------------------------

enum { CHUNK_MAIN = 0x4d4d, CHUNK_EDIT = 0x3d3d, CHUNK_OBJECT = 0x4000, CHUNK_MESH = 0x4100 };
enum { CHUNK_VERTICES = 0x4110, CHUNK_FACES = 0x4120, CHUNK_UVS = 0x4140 };
#define CHUNK_HEADER_BYTES 6

typedef struct mesh_3ds {
    uint32_t vertices, faces, highest; // highest index of a face
} mesh_3ds;

static hw_status fail_3ds(const hw_model_bytes *file, size_t at, const char *cause)
{
    return hw_fail(HW_FORMAT, "%s: chunk at byte %zu: %s", file->path, at, cause);
}

static hw_status chunks_3ds(const hw_model_bytes *file, size_t begin, size_t end, int depth,
                            mesh_3ds *mesh);

// Arrays of `bytes` each after a 16-bit count.
static hw_status array_3ds(const hw_model_bytes *file, hw_bytes_reader *r, size_t bytes,
                           uint32_t *count)
{
    *count = hw_get_u16(r);
    if (r->failed || *count * bytes > hw_bytes_left(r))
        return fail_3ds(file, (size_t)(r->data - file->data), "shorter than its count says");
    return HW_OK;
}

static hw_status content_3ds(const hw_model_bytes *file, uint32_t tag, size_t begin, size_t end,
                             int depth, mesh_3ds *mesh)
{
    hw_bytes_reader r = hw_bytes_reader_make(file->data + begin, end - begin);
    uint32_t count;
    switch (tag) {
    case CHUNK_EDIT:
        return chunks_3ds(file, begin, end, depth, mesh);
    case CHUNK_OBJECT: {
        const uint8_t *name_end = memchr(file->data + begin, 0, end - begin);
        if (!name_end)
            return fail_3ds(file, begin, "a name without an end");
        return chunks_3ds(file, (size_t)(name_end + 1 - file->data), end, depth, mesh);
    }
    case CHUNK_MESH: {
        mesh_3ds inner = {0};
        HW_TRY(chunks_3ds(file, begin, end, depth, &inner));
        if (inner.faces > 0 && inner.highest >= inner.vertices)
            return hw_fail(HW_FORMAT, "%s: index %u out of range (%u vertices)", file->path,
                           inner.highest, inner.vertices);
        mesh->faces += inner.faces;
        return HW_OK;
    }
    case CHUNK_VERTICES:
        return array_3ds(file, &r, 12, &mesh->vertices);
    case CHUNK_UVS:
        return array_3ds(file, &r, 8, &count);
    case CHUNK_FACES:
        HW_TRY(array_3ds(file, &r, 8, &mesh->faces));
        for (uint32_t i = 0; i < 4 * mesh->faces; i++) {
            uint32_t index = hw_get_u16(&r);
            if (i % 4 != 3 && index > mesh->highest) // the fourth are flags
                mesh->highest = index;
        }
        return chunks_3ds(file, begin + r.position, end, depth, mesh);
    default:
        return HW_OK;
    }
}

static hw_status chunks_3ds(const hw_model_bytes *file, size_t begin, size_t end, int depth,
                            mesh_3ds *mesh)
{
    if (depth > 8)
        return fail_3ds(file, begin, "nested too deeply");
    while (end - begin >= CHUNK_HEADER_BYTES) {
        hw_bytes_reader r = hw_bytes_reader_make(file->data + begin, CHUNK_HEADER_BYTES);
        uint32_t tag = hw_get_u16(&r), length = hw_get_u32(&r);
        if (length < CHUNK_HEADER_BYTES || length > end - begin)
            return fail_3ds(file, begin, "a length that leaves its parent (truncated?)");
        HW_TRY(content_3ds(file, tag, begin + CHUNK_HEADER_BYTES, begin + length, depth + 1, mesh));
        begin += length;
    }
    return HW_OK;
}

hw_status hw_check_3ds(const hw_model_bytes *file)
{
    hw_bytes_reader r = hw_bytes_reader_make(file->data, file->size);
    uint32_t tag = hw_get_u16(&r), length = hw_get_u32(&r);
    mesh_3ds total = {0};
    if (r.failed || tag != CHUNK_MAIN)
        return hw_fail(HW_FORMAT, "%s: no 3DS file", file->path);
    if (length > file->size || length < CHUNK_HEADER_BYTES)
        return hw_fail(HW_FORMAT, "%s: truncated (%u bytes announced, %zu there)", file->path,
                       length, file->size);
    HW_TRY(chunks_3ds(file, CHUNK_HEADER_BYTES, length, 0, &total));
    return total.faces > 0 ? HW_OK : hw_fail(HW_FORMAT, "%s: no triangle", file->path);
}

// ---- All ----------------------------------------------------------------------------------------

static int hex_digit(char c)
{
    return c >= '0' && c <= '9'                 ? c - '0'
           : (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10
                                                : -1;
}

void hw_model_decode_path(char *path, bool percent)
{
    char *to = path;
    for (const char *from = path; *from; from++) {
        bool escape = percent && *from == '%' && hex_digit(from[1]) >= 0 && hex_digit(from[2]) >= 0;
        char c = escape ? (char)(hex_digit(from[1]) * 16 + hex_digit(from[2])) : *from;
        from += escape ? 2 : 0;
        *to++ = c == '\\' ? '/' : c;
    }
    *to = 0;
}

hw_model_kind hw_model_kind_of(const char *path)
{
    static const struct {
        const char *extension;
        hw_model_kind kind;
    } table[] = {{"gltf", HW_MODEL_GLTF}, {"glb", HW_MODEL_GLTF},    {"ply", HW_MODEL_PLY},
                 {"obj", HW_MODEL_OBJ},   {"off", HW_MODEL_OFF},     {"stl", HW_MODEL_STL},
                 {"3ds", HW_MODEL_3DS},   {"dae", HW_MODEL_COLLADA}, {"zae", HW_MODEL_COLLADA}};
    const char *slash = strrchr(path, '/');
    const char *dot = strrchr(slash ? slash : path, '.');
    for (size_t i = 0; dot && i < sizeof table / sizeof *table; i++)
        if (strcasecmp(dot + 1, table[i].extension) == 0)
            return table[i].kind;
    return HW_MODEL_OTHER;
}

static hw_status check_kind(const hw_model_bytes *file, hw_model_facts *facts)
{
    switch (hw_model_kind_of(file->path)) {
    case HW_MODEL_GLTF:
        return hw_check_gltf(file, facts);
    case HW_MODEL_PLY:
        return hw_check_ply(file, facts);
    case HW_MODEL_OBJ:
        return hw_check_obj(file);
    case HW_MODEL_OFF:
        return hw_check_off(file, facts);
    case HW_MODEL_STL:
        return hw_check_stl(file, facts);
    case HW_MODEL_3DS:
        return hw_check_3ds(file);
    case HW_MODEL_COLLADA:
    case HW_MODEL_OTHER:
        break;
    }
    return HW_OK;
}

hw_status hw_import_check(const char *path, hw_model_facts *facts)
{
    uint8_t *data = NULL;
    hw_model_bytes file = {.path = path};
    *facts = (hw_model_facts){0};
    HW_TRY(hw_file_read(path, FILE_BYTES_MAX, &data, &file.size));
    file.data = data;
    hw_status status = file.size == 0 ? hw_fail(HW_FORMAT, "%s: the file is empty", path)
                                      : check_kind(&file, facts);
    hw_free(data);
    return status;
}
