#include "bytes.h"
#include "import_check.h"
#include <string.h>

#define ELEMENTS_MAX   32
#define PROPERTIES_MAX 256

enum { TYPE_I8, TYPE_U8, TYPE_I16, TYPE_U16, TYPE_I32, TYPE_U32, TYPE_F32, TYPE_F64, TYPE_COUNT };
static const uint8_t type_bytes[TYPE_COUNT] = {1, 1, 2, 2, 4, 4, 4, 8};

typedef enum ply_encoding { PLY_ASCII, PLY_LITTLE, PLY_BIG } ply_encoding;

typedef struct ply_property {
    bool is_list, is_corners; // is_corners: indices of vertices
    int count_type, type;
} ply_property;

typedef struct ply_element {
    bool is_vertex;
    uint64_t count;
    uint32_t first, property_count; // into properties
} ply_element;

typedef struct ply_file {
    const char *path;
    ply_encoding encoding;
    uint32_t element_count, property_count;
    ply_element elements[ELEMENTS_MAX];
    ply_property properties[PROPERTIES_MAX];
    uint64_t vertex_count, face_count, strip_count;
} ply_file;

// ---- Header -------------------------------------------------------------------------------------

static bool next_is(hw_words *w, const char *text)
{
    const char *word;
    size_t length;
    return hw_words_get(w, &word, &length) && length == strlen(text) &&
           memcmp(word, text, length) == 0;
}

static bool word_type(hw_words *w, int *type)
{
    static const char *const names[2][TYPE_COUNT] = {
        {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"},
        {"int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"}};
    const char *word;
    size_t length;
    if (!hw_words_get(w, &word, &length))
        return false;
    for (int i = 0; i < 2 * TYPE_COUNT; i++) {
        const char *name = names[i / TYPE_COUNT][i % TYPE_COUNT];
        if (length == strlen(name) && memcmp(word, name, length) == 0) {
            *type = i % TYPE_COUNT;
            return true;
        }
    }
    return false;
}

static bool parse_format(hw_words *w, ply_file *ply)
{
    const char *word;
    size_t length;
    if (!hw_words_get(w, &word, &length))
        return false;
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    for (int i = 0; i < 3; i++)
        if (length == strlen(names[i]) && memcmp(word, names[i], length) == 0) {
            ply->encoding = (ply_encoding)i;
            return true;
        }
    return false;
}

static bool parse_element(hw_words *w, ply_file *ply)
{
    const char *word;
    size_t length;
    int64_t count;
    if (ply->element_count == ELEMENTS_MAX || !hw_words_get(w, &word, &length) ||
        !hw_words_integer(w, &count) || count < 0)
        return false;
    ply_element *e = &ply->elements[ply->element_count++];
    *e = (ply_element){.count = (uint64_t)count, .first = ply->property_count};
    e->is_vertex = length == 6 && memcmp(word, "vertex", 6) == 0;
    if (e->is_vertex)
        ply->vertex_count = e->count;
    if (length == 4 && memcmp(word, "face", 4) == 0)
        ply->face_count = e->count;
    if (length == 9 && memcmp(word, "tristrips", 9) == 0)
        ply->strip_count = e->count;
    return true;
}

static bool parse_property(hw_words *w, ply_file *ply)
{
    if (ply->element_count == 0 || ply->property_count == PROPERTIES_MAX)
        return false;
    ply_property *p = &ply->properties[ply->property_count++];
    ply->elements[ply->element_count - 1].property_count++;
    *p = (ply_property){0};
    hw_words list = *w;
    if (next_is(&list, "list")) {
        *w = list;
        p->is_list = true;
        if (!word_type(w, &p->count_type) || p->count_type >= TYPE_F32)
            return false;
    }
    if (!word_type(w, &p->type))
        return false;
    hw_words name = *w;
    p->is_corners = p->is_list && (next_is(&name, "vertex_indices") || next_is(w, "vertex_index"));
    return !p->is_corners || p->type < TYPE_F32;
}

static hw_status fail_header(const ply_file *ply, const hw_words *w)
{
    return hw_fail(HW_FORMAT, "%s: line %llu: malformed PLY header", ply->path,
                   (unsigned long long)w->line);
}

// Leaves the cursor on the line "end_header".
static hw_status parse_header(const hw_model_bytes *file, hw_words *w, ply_file *ply)
{
    const char *word;
    size_t length;
    bool format = false;
    if (!hw_words_line(w) || !next_is(w, "ply"))
        return hw_fail(HW_FORMAT, "%s: no PLY file (it does not start with ply)", file->path);
    while (hw_words_line(w)) {
        bool good = hw_words_get(w, &word, &length);
        if (length == 10 && memcmp(word, "end_header", 10) == 0)
            return format ? HW_OK : fail_header(ply, w);
        if (length == 6 && memcmp(word, "format", 6) == 0)
            good = format = parse_format(w, ply);
        else if (length == 7 && memcmp(word, "element", 7) == 0)
            good = parse_element(w, ply);
        else if (length == 8 && memcmp(word, "property", 8) == 0)
            good = parse_property(w, ply);
        else if (!(length == 7 && memcmp(word, "comment", 7) == 0) &&
                 !(length == 8 && memcmp(word, "obj_info", 8) == 0))
            good = false;
        if (!good)
            return fail_header(ply, w);
    }
    return hw_fail(HW_FORMAT, "%s: truncated in the header", file->path);
}

// ---- Body ---------------------------------------------------------------------------------------

static hw_status fail_truncated(const ply_file *ply)
{
    return hw_fail(HW_FORMAT, "%s: truncated (fewer elements than the header says)", ply->path);
}

static hw_status check_corner(const ply_file *ply, int64_t index)
{
    if (index >= 0 && (uint64_t)index < ply->vertex_count)
        return HW_OK;
    return hw_fail(HW_FORMAT, "%s: index %lld out of range (%llu vertices)", ply->path,
                   (long long)index, (unsigned long long)ply->vertex_count);
}

static int64_t get_integer(hw_bytes_reader *r, const ply_file *ply, int type)
{
    uint8_t bytes[8] = {0};
    uint32_t size = type_bytes[type], value = 0;
    hw_get_bytes(r, bytes, size);
    for (uint32_t i = 0; i < size; i++)
        value |= (uint32_t)bytes[ply->encoding == PLY_BIG ? size - 1 - i : i] << (8 * i);
    switch (type) {
    case TYPE_I8:
        return (int8_t)value;
    case TYPE_I16:
        return (int16_t)value;
    case TYPE_I32:
        return (int32_t)value;
    default:
        return value;
    }
}

static hw_status binary_instance(const ply_file *ply, const ply_element *e, hw_bytes_reader *r)
{
    for (uint32_t i = 0; i < e->property_count; i++) {
        const ply_property *p = &ply->properties[e->first + i];
        int64_t count = p->is_list ? get_integer(r, ply, p->count_type) : 1;
        if (r->failed || count < 0 || (uint64_t)count > hw_bytes_left(r) / type_bytes[p->type])
            return fail_truncated(ply);
        if (!p->is_corners)
            (void)hw_get_span(r, (size_t)count * type_bytes[p->type]);
        for (int64_t k = 0; p->is_corners && k < count; k++)
            HW_TRY(check_corner(ply, get_integer(r, ply, p->type)));
    }
    return HW_OK;
}

static hw_status check_binary(const ply_file *ply, hw_bytes_reader r)
{
    for (uint32_t i = 0; i < ply->element_count; i++) {
        const ply_element *e = &ply->elements[i];
        size_t least = 0; // bytes of an instance, lists being empty
        for (uint32_t k = 0; k < e->property_count; k++) {
            const ply_property *p = &ply->properties[e->first + k];
            least += type_bytes[p->is_list ? p->count_type : p->type];
        }
        if (least == 0 ? e->count > 0 : e->count > hw_bytes_left(&r) / least)
            return fail_truncated(ply);
        for (uint64_t k = 0; k < e->count; k++)
            HW_TRY(binary_instance(ply, e, &r));
    }
    return HW_OK;
}

// Each instance has a line of its own.
static hw_status ascii_instance(const ply_file *ply, const ply_element *e, hw_words *w)
{
    for (uint32_t i = 0; i < e->property_count; i++) {
        const ply_property *p = &ply->properties[e->first + i];
        int64_t count = 1, index;
        bool good = !p->is_list || (hw_words_integer(w, &count) && count >= 0);
        for (int64_t k = 0; good && k < count; k++) {
            if (!p->is_corners) {
                good = hw_words_number(w);
                continue;
            }
            good = hw_words_integer(w, &index);
            if (good)
                HW_TRY(check_corner(ply, index));
        }
        if (!good)
            return hw_fail(HW_FORMAT, "%s: line %llu: a number is missing or malformed", ply->path,
                           (unsigned long long)w->line);
    }
    const char *word;
    size_t length;
    if (hw_words_get(w, &word, &length))
        return hw_fail(HW_FORMAT, "%s: line %llu: more numbers than the header says", ply->path,
                       (unsigned long long)w->line);
    return HW_OK;
}

static hw_status check_ascii(const ply_file *ply, hw_words *w)
{
    for (uint32_t i = 0; i < ply->element_count; i++)
        for (uint64_t k = 0; k < ply->elements[i].count; k++) {
            if (!hw_words_line(w))
                return fail_truncated(ply);
            HW_TRY(ascii_instance(ply, &ply->elements[i], w));
        }
    return HW_OK;
}

hw_status hw_check_ply(const hw_model_bytes *file, hw_model_facts *facts)
{
    ply_file ply = {.path = file->path};
    hw_words w = hw_words_make(file->data, file->size, 0);
    HW_TRY(parse_header(file, &w, &ply));
    if (ply.vertex_count == 0 || (ply.face_count == 0 && ply.strip_count == 0))
        return hw_fail(HW_FORMAT, "%s: no triangle", file->path);
    if (ply.vertex_count > UINT32_MAX || ply.face_count > UINT32_MAX)
        return hw_fail(HW_LIMIT, "%s: too many vertices or faces", file->path);
    facts->faces = ply.face_count;
    if (ply.encoding == PLY_ASCII)
        return check_ascii(&ply, &w);
    size_t start = (size_t)(w.end - (const char *)file->data) + 1; // past the newline
    if (start >= file->size)
        return fail_truncated(&ply);
    return check_binary(&ply, hw_bytes_reader_make(file->data + start, file->size - start));
}
