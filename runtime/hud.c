#include "hud.h"
#include "alloc.h"
#include "gpu.h"
#include "keys.h"
#include "minimap.h"
#include "shaders.h"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

// The font is made of quads, so it needs no texture and no file. (This is the only file that
// includes it.)
#include <stb/stb_easy_font.h>

#define QUADS_MAX   16384u // 4 vertices each: indices stay within 16 bits
#define TEXT_MAX    1024u
#define LINE_HEIGHT 12 // of the font, in its own pixels; glyphs are at most 9 high
#define PADDING     4
#define COLUMN_GAP  8
#define ROWS_MAX    6u // of a text that is wrapped

// As stb_easy_font writes them.
typedef struct hud_vertex {
    float x, y, z;
    uint8_t color[4];
} hud_vertex;
_Static_assert(sizeof(hud_vertex) == 16, "stb_easy_font writes 16 bytes a vertex");

struct hw_hud {
    hw_gpu_account account;
    hw_gpu_buffer vertices, indices;
    GLuint program, array;
    GLint size_location;
    uint32_t quad_count;
    hud_vertex quads[QUADS_MAX * 4];
    char text[TEXT_MAX];
};

// ---- The line

// 1234567 -> "1,234,567".
static void group_thousands(uint64_t value, char out[32])
{
    char digits[24];
    int length = snprintf(digits, sizeof digits, "%llu", (unsigned long long)value);
    int n = 0;
    for (int i = 0; i < length; i++) {
        if (i > 0 && (length - i) % 3 == 0)
            out[n++] = ',';
        out[n++] = digits[i];
    }
    out[n] = '\0';
}

// A text that is added to piece by piece.
typedef struct writer {
    char *out;
    size_t length, capacity; // length is what was written, or would have been
} writer;

static void put(writer *w, const char *format, ...) HW_PRINTF(2, 3);
static void put(writer *w, const char *format, ...)
{
    size_t at = w->length < w->capacity ? w->length : w->capacity - 1;
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(w->out + at, w->capacity - at, format, arguments);
    va_end(arguments);
    w->length += length > 0 ? (size_t)length : 0;
}

static void put_bytes(writer *w, const char *what, uint64_t bytes, uint64_t budget)
{
    put(w, "   %s %.1f", what, (double)bytes / 1e6);
    if (budget > 0)
        put(w, " of %.0f", (double)budget / 1e6);
    put(w, " MB");
}

size_t hw_hud_format(const hw_hud_info *info, char *out, size_t capacity)
{
    writer w = {out, 0, capacity};
    char triangles[32];
    group_thousands(info->triangles, triangles);
    put(&w, "%s", info->config);
    if (info->fps > 0)
        put(&w, "   %.0f fps   %.1f ms (p99 %.1f)", info->fps, info->frame_ms, info->p99_ms);
    put(&w, "   cell %d,%d   %s triangles, %u draws", info->cell_q, info->cell_r, triangles,
        info->draws);
    if (info->hidden > 0)
        put(&w, ", %u hidden", info->hidden);
    put_bytes(&w, "RAM", info->ram_bytes, 0);
    if (info->waiting_budget_bytes > 0)
        put_bytes(&w, "waiting", info->waiting_bytes, info->waiting_budget_bytes);
    put_bytes(&w, "GPU", info->gpu_bytes, info->gpu_budget_bytes);
    if (info->queue >= 0)
        put(&w, "   queue %lld", (long long)info->queue);
    put(&w, "   %.1f MB/s   %llu stalls, %llu late", info->loaded_bytes_s / 1e6,
        (unsigned long long)info->stalls, (unsigned long long)info->late);
    if (info->recorded_s >= 0)
        put(&w, "   REC %.1f s", info->recorded_s);
    if (info->views)
        put(&w, "   [%s]", info->views);
    return w.length < capacity ? w.length : capacity - 1;
}

// ---- Layout, in pixels of the window

static const uint8_t white[4] = {255, 255, 255, 255};
static const uint8_t amber[4] = {255, 214, 130, 255};
static const uint8_t dark[4] = {16, 20, 28, 150};
static const uint8_t darker[4] = {16, 20, 28, 200};

void hw_hud_add_quad(hw_hud *hud, const float corners[4][2], const uint8_t color[4])
{
    if (hud->quad_count == QUADS_MAX)
        return;
    hud_vertex *v = &hud->quads[4 * hud->quad_count++];
    for (int i = 0; i < 4; i++) {
        v[i] = (hud_vertex){corners[i][0], corners[i][1], 0, {0}};
        memcpy(v[i].color, color, 4);
    }
}

static void add_rectangle(hw_hud *hud, float x0, float y0, float x1, float y1,
                          const uint8_t color[4])
{
    const float corners[4][2] = {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
    hw_hud_add_quad(hud, corners, color);
}

// Copies to hud->text what one row of `width` of the font's pixels holds of the text, broken
// between groups (set off by three spaces) or else at a space where there is one. Returns the
// characters used; *measured gets the row's own width.
static size_t fit_row(hw_hud *hud, const char *text, int width, int *measured)
{
    size_t n = 0, space = 0, group = 0;
    int x = 0;
    for (; text[n] && n < TEXT_MAX - 1; n++) {
        char shown[2] = {text[n] >= 32 && text[n] < 127 ? text[n] : '?', '\0'};
        x += stb_easy_font_width(shown);
        if (x > width)
            break;
        hud->text[n] = shown[0];
        if (shown[0] == ' ')
            space = n;
        if (strncmp(text + n, "   ", 3) == 0)
            group = n;
    }
    if (text[n] && space > 0)
        n = group > 0 ? group : space;
    hud->text[n] = '\0';
    *measured = stb_easy_font_width(hud->text);
    while (text[n] == ' ')
        n++;
    return n;
}

// The text in hud->text, with its upper left corner at (x, y).
static void add_text(hw_hud *hud, float x, float y, float scale, const uint8_t color[4])
{
    hud_vertex *first = &hud->quads[4 * hud->quad_count];
    int room = (int)(QUADS_MAX - hud->quad_count) * 4 * (int)sizeof(hud_vertex);
    uint8_t rgba[4];
    memcpy(rgba, color, 4);
    int count = stb_easy_font_print(0, 0, hud->text, rgba, first, room);
    for (int i = 0; i < 4 * count; i++) {
        first[i].x = x + scale * first[i].x;
        first[i].y = y + scale * first[i].y;
    }
    hud->quad_count += (uint32_t)count;
}

// Rows of text on a dark panel, from the top of the window or up to its bottom. Returns the panel's
// height.
static float add_block(hw_hud *hud, const char *text, bool at_bottom, float scale, uint32_t width,
                       uint32_t height, const uint8_t color[4])
{
    int room = (int)((float)width / scale) - 2 * PADDING;
    int widest = 0, measured;
    uint32_t rows = 0;
    const char *rest = text;
    while (*rest && rows < ROWS_MAX) {
        size_t used = fit_row(hud, rest, room, &measured);
        if (used == 0)
            break;
        widest = measured > widest ? measured : widest;
        rest += used;
        rows++;
    }
    float panel = scale * (float)(LINE_HEIGHT * rows + PADDING);
    float y = at_bottom ? (float)height - panel : 0;
    add_rectangle(hud, 0, y, scale * (float)(widest + 2 * PADDING), y + panel, dark);
    rest = text;
    for (uint32_t row = 0; row < rows; row++) {
        rest += fit_row(hud, rest, room, &measured);
        add_text(hud, PADDING * scale, y + scale * (float)(PADDING + LINE_HEIGHT * row), scale,
                 color);
    }
    return panel;
}

// Colours and what they mean, up to the lower right corner.
static void add_legend(hw_hud *hud, const hw_hud_content *content, uint32_t width, uint32_t height,
                       float scale)
{
    int widest = 0;
    for (uint32_t i = 0; i < content->legend_count; i++) {
        snprintf(hud->text, sizeof hud->text, "%s", content->legend[i].text);
        int w = stb_easy_font_width(hud->text);
        widest = w > widest ? w : widest;
    }
    float w = scale * (float)(LINE_HEIGHT + widest + 2 * PADDING);
    float h = scale * (float)(LINE_HEIGHT * content->legend_count + PADDING);
    float x = (float)width - w, y = (float)height - h;
    add_rectangle(hud, x, y, x + w, y + h, dark);
    for (uint32_t i = 0; i < content->legend_count; i++) {
        const hw_hud_legend_row *row = &content->legend[i];
        float top = y + scale * (float)(PADDING + LINE_HEIGHT * i);
        uint8_t color[4] = {0, 0, 0, 255};
        for (int k = 0; k < 3; k++)
            color[k] = (uint8_t)(row->color[k] * 255 + 0.5f);
        add_rectangle(hud, x + scale * PADDING, top, x + scale * (PADDING + 8), top + scale * 8,
                      color);
        snprintf(hud->text, sizeof hud->text, "%s", row->text);
        add_text(hud, x + scale * (PADDING + LINE_HEIGHT), top, scale, white);
    }
}

// The widest key and meaning of the table, in the font's pixels.
static void measure_help(float *keys_width, float *meaning_width)
{
    int keys = 0, meaning = 0;
    for (size_t i = 0; i < hw_key_row_count; i++) {
        char text[64];
        hw_key_format(&hw_key_rows[i], text, sizeof text);
        int w = stb_easy_font_width(text);
        keys = w > keys ? w : keys;
        snprintf(text, sizeof text, "%s", hw_key_rows[i].meaning);
        w = stb_easy_font_width(text);
        meaning = w > meaning ? w : meaning;
    }
    *keys_width = (float)keys;
    *meaning_width = (float)meaning;
}

static void add_help_row(hw_hud *hud, const hw_key_row *row, float x, float y, float keys_width,
                         float scale)
{
    snprintf(hud->text, sizeof hud->text, "%s", row->meaning);
    add_text(hud, x + scale * (keys_width + COLUMN_GAP), y, scale, white);
    hw_key_format(row, hud->text, sizeof hud->text);
    add_text(hud, x, y, scale, amber);
}

// All keys in two columns, as large as there is room for; one column where the window is narrow.
static void add_help(hw_hud *hud, uint32_t width, uint32_t height, float scale)
{
    float keys, meaning, w, h;
    measure_help(&keys, &meaning);
    float column = keys + meaning + 3 * COLUMN_GAP;
    size_t columns = 2, rows;
    for (;; scale > 1 ? scale-- : columns--) {
        rows = (hw_key_row_count + columns - 1) / columns;
        w = scale * ((float)columns * column - 2 * COLUMN_GAP + 2 * PADDING);
        h = scale * (float)(LINE_HEIGHT * rows + 2 * PADDING);
        if ((w <= (float)width && h <= (float)height) || (scale <= 1 && columns == 1))
            break;
    }
    float x = fmaxf(floorf(((float)width - w) / 2), 0);
    float y = fmaxf(floorf(((float)height - h) / 2), 0);
    add_rectangle(hud, x, y, x + w, y + h, darker);
    for (size_t i = 0; i < hw_key_row_count; i++)
        add_help_row(hud, &hw_key_rows[i], x + scale * (PADDING + column * (float)(i / rows)),
                     y + scale * (float)(PADDING + 1 + LINE_HEIGHT * (i % rows)), keys, scale);
}

// ---- Drawing

static hw_status make_buffers(hw_hud *hud)
{
    uint16_t *indices = NULL;
    HW_TRY(HW_NEW(&indices, QUADS_MAX * 6));
    static const uint16_t corners[6] = {0, 1, 2, 0, 2, 3};
    for (uint32_t i = 0; i < QUADS_MAX * 6; i++)
        indices[i] = (uint16_t)(i / 6 * 4 + corners[i % 6]);
    glGenVertexArrays(1, &hud->array);
    glBindVertexArray(hud->array);
    hw_status status =
        hw_gpu_buffer_create(&hud->account, GL_ELEMENT_ARRAY_BUFFER, indices,
                             QUADS_MAX * 6 * sizeof *indices, GL_STATIC_DRAW, &hud->indices);
    hw_free(indices);
    HW_TRY(status);
    HW_TRY(hw_gpu_buffer_create(&hud->account, GL_ARRAY_BUFFER, NULL, sizeof hud->quads,
                                GL_STREAM_DRAW, &hud->vertices));
    glEnableVertexAttribArray(0);
    glVertexAttribPointer(0, 2, GL_FLOAT, GL_FALSE, sizeof(hud_vertex),
                          hw_gpu_offset(offsetof(hud_vertex, x)));
    glEnableVertexAttribArray(1);
    glVertexAttribPointer(1, 4, GL_UNSIGNED_BYTE, GL_TRUE, sizeof(hud_vertex),
                          hw_gpu_offset(offsetof(hud_vertex, color)));
    glBindVertexArray(0);
    glBindBuffer(GL_ARRAY_BUFFER, 0);
    return hw_gpu_check("HUD");
}

hw_status hw_hud_create(hw_hud **out)
{
    hw_status status = HW_OK;
    hw_hud *hud = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&hud, 1));
    HW_GO(hw_gpu_program("hud", NULL, hw_shader_hud_vert, hw_shader_hud_frag, &hud->program));
    hud->size_location = glGetUniformLocation(hud->program, "u_size");
    HW_GO(make_buffers(hud));
    *out = hud;
    hud = NULL;
out:
    hw_hud_destroy(hud);
    return status;
}

void hw_hud_destroy(hw_hud *hud)
{
    if (!hud)
        return;
    hw_gpu_buffer_destroy(&hud->account, &hud->vertices);
    hw_gpu_buffer_destroy(&hud->account, &hud->indices);
    glDeleteVertexArrays(1, &hud->array);
    glDeleteProgram(hud->program);
    hw_free(hud);
}

static void set_enabled(GLenum capability, bool on)
{
    (on ? glEnable : glDisable)(capability);
}

static void draw_quads(hw_hud *hud, uint32_t width, uint32_t height)
{
    static const GLenum capabilities[3] = {GL_DEPTH_TEST, GL_CULL_FACE, GL_BLEND};
    bool were_on[3];
    for (int i = 0; i < 3; i++) {
        were_on[i] = glIsEnabled(capabilities[i]);
        set_enabled(capabilities[i], capabilities[i] == GL_BLEND);
    }
    // The picture's alpha tells objects from sky; it stays as it is.
    glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ZERO, GL_ONE);
    glBindBuffer(GL_ARRAY_BUFFER, hud->vertices.name);
    // A new store each time: the driver need not wait for the frame before.
    glBufferData(GL_ARRAY_BUFFER, sizeof hud->quads, NULL, GL_STREAM_DRAW);
    glBufferSubData(GL_ARRAY_BUFFER, 0, (GLsizeiptr)(hud->quad_count * 4 * sizeof(hud_vertex)),
                    hud->quads);
    glUseProgram(hud->program);
    glUniform2f(hud->size_location, (float)width, (float)height);
    glBindVertexArray(hud->array);
    glDrawElements(GL_TRIANGLES, (GLsizei)hud->quad_count * 6, GL_UNSIGNED_SHORT, NULL);
    glBindVertexArray(0);
    glUseProgram(0);
    glBindBuffer(GL_ARRAY_BUFFER, 0);
    for (int i = 0; i < 3; i++)
        set_enabled(capabilities[i], were_on[i]);
}

void hw_hud_draw(hw_hud *hud, uint32_t width, uint32_t height, const hw_hud_content *content)
{
    // Whole multiples keep the font's pixels even.
    float scale = height >= 1600 ? 3.0f : height >= 600 && width >= 760 ? 2.0f : 1.0f;
    float below = 0;
    hud->quad_count = 0;
    if (content->line)
        below = add_block(hud, content->line, false, scale, width, height, white);
    if (content->message)
        add_block(hud, content->message, true, scale, width, height, amber);
    if (content->legend_count > 0)
        add_legend(hud, content, width, height, scale);
    if (content->map) {
        float side = floorf(0.4f * (float)(width < height ? width : height));
        hw_minimap_draw(hud, content->map, (float)width - side, below, side);
    }
    if (content->help)
        add_help(hud, width, height, scale);
    if (hud->quad_count > 0)
        draw_quads(hud, width, height);
}

void hw_hud_blank(hw_hud *hud)
{
    (void)hud;
    glClearColor(0.16f, 0.19f, 0.23f, 0);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
}
