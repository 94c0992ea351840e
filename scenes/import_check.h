// Strict checks of model files before Assimp sees them: it believes counts in headers (and
// allocates them), overlooks truncation, and drops what it cannot read without a word. Internal to
// scenes.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

typedef enum hw_model_kind {
    HW_MODEL_GLTF, // .gltf and .glb
    HW_MODEL_PLY,
    HW_MODEL_OBJ,
    HW_MODEL_OFF,
    HW_MODEL_STL,
    HW_MODEL_3DS,
    HW_MODEL_COLLADA, // left to Assimp
    HW_MODEL_OTHER    // left to Assimp
} hw_model_kind;

// By the file name's extension.
hw_model_kind hw_model_kind_of(const char *path);
// What a check finds out.
typedef struct hw_model_facts {
    uint64_t faces;    // polygons that a reader must find; 0 where that is not known
    char *text;        // the model as Assimp does not stumble over it (OFF, glTF); else NULL
    size_t text_bytes; //
} hw_model_facts;

// Structure, lengths, counts and indices; errors name the file first, then the cause. Missing,
// empty, overlong (8 GiB) and irregular files are refused for every kind. Free facts->text with
// hw_free (NULL on failure).
HW_MUST_USE hw_status hw_import_check(const char *path, hw_model_facts *facts);

// Turns backslashes, and with `percent` %20 and its like (glTF names files by URI), in place.
void hw_model_decode_path(char *path, bool percent);

// A file's content. Parsers below may rely on a 0 byte after `size` bytes.
typedef struct hw_model_bytes {
    const char *path;
    const uint8_t *data;
    size_t size;
} hw_model_bytes;
HW_MUST_USE hw_status hw_check_gltf(const hw_model_bytes *file, hw_model_facts *facts);
HW_MUST_USE hw_status hw_check_ply(const hw_model_bytes *file, hw_model_facts *facts);
HW_MUST_USE hw_status hw_check_off(const hw_model_bytes *file, hw_model_facts *facts);
HW_MUST_USE hw_status hw_check_obj(const hw_model_bytes *file);
HW_MUST_USE hw_status hw_check_stl(const hw_model_bytes *file, hw_model_facts *facts);
HW_MUST_USE hw_status hw_check_3ds(const hw_model_bytes *file);

// A cursor over the words of a text file, line by line.
typedef struct hw_words {
    const char *next, *end; // of the current line's rest
    const char *file_end;
    uint64_t line; // from 1
    char comment;  // starts a comment that runs to the end of the line; 0 = none
} hw_words;
hw_words hw_words_make(const void *data, size_t size, char comment);
// Goes to the next line that has a word; false at the end of the file.
bool hw_words_line(hw_words *w);
// The next word of the line (not 0-terminated); false at the end of the line.
bool hw_words_get(hw_words *w, const char **word, size_t *length);
// The next word as a decimal integer; false if there is none or it is no integer.
bool hw_words_integer(hw_words *w, int64_t *out);
// The next word as a number, only looked at, not converted: "1", "-.5e3", "nan", "inf".
bool hw_words_number(hw_words *w);
