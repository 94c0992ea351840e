// Render targets and programs: known colours come back where they were drawn.
#include "gpu.h"
#include "models.h"

// Clears to a colour, with the lower left quarter in another.
static void paint(uint32_t width, uint32_t height)
{
    glDisable(GL_SCISSOR_TEST);
    glClearColor(1, 0.5f, 0, 1);
    glClear(GL_COLOR_BUFFER_BIT);
    glEnable(GL_SCISSOR_TEST);
    glScissor(0, 0, (GLsizei)width / 2, (GLsizei)height / 2);
    glClearColor(0, 0, 1, 0);
    glClear(GL_COLOR_BUFFER_BIT);
    glDisable(GL_SCISSOR_TEST);
}

static void check_paint(const hw_image *image)
{
    for (uint32_t y = 0; y < image->height; y++) {
        for (uint32_t x = 0; x < image->width; x++) {
            bool lower_left = x < image->width / 2 && y >= image->height - image->height / 2;
            model_assert_color(image, x, y, !lower_left, lower_left ? 0 : 0.5f, lower_left, 1);
            assert_int_equal(model_pixel(image, x, y)[3], lower_left ? 0 : 255);
        }
    }
}

static void check_target(uint32_t width, uint32_t height, uint32_t samples)
{
    hw_target *target = NULL;
    hw_image image = {0};
    assert_ok(hw_target_create(&target, width, height, samples));
    hw_target_bind(target);
    GLint viewport[4];
    glGetIntegerv(GL_VIEWPORT, viewport);
    assert_int_equal(viewport[2], width);
    assert_int_equal(viewport[3], height);
    paint(width, height);
    assert_ok(hw_target_read(target, &image));
    assert_int_equal(image.width, width);
    assert_int_equal(image.height, height);
    assert_int_equal(image.channels, 4);
    check_paint(&image);
    // Reading again, into the same image; the target is still bound for drawing.
    uint8_t *data = image.data;
    glClearColor(0, 1, 0, 1);
    glClear(GL_COLOR_BUFFER_BIT);
    hw_target_resolve(target);
    assert_ok(hw_target_read(target, &image));
    assert_ptr_equal(image.data, data);
    model_assert_color(&image, 0, 0, 0, 1, 0, 0);
    model_assert_color(&image, width - 1, height - 1, 0, 1, 0, 0);
    hw_image_free(&image);
    hw_target_destroy(target);
}

static void test_orientation(void **state)
{
    (void)state;
    check_target(8, 8, 1);
    check_target(31, 7, 1);
    check_target(64, 48, 4);
}

static void test_limits(void **state)
{
    (void)state;
    hw_target *target = NULL;
    assert_int_equal(hw_target_create(&target, 0, 8, 1), HW_GRAPHICS);
    assert_int_equal(hw_target_create(&target, 1u << 20, 8, 1), HW_GRAPHICS);
    assert_null(target);
    hw_target_destroy(NULL);
    hw_alloc_fail_after(1);
    assert_int_equal(hw_target_create(&target, 8, 8, 1), HW_MEMORY);
    hw_alloc_fail_after(0);
    assert_null(target);
}

static void test_shader_errors(void **state)
{
    (void)state;
    GLuint program = 1;
    const char *good_vertex = "void main() { gl_Position = vec4(hw_light(vec3(0, 0, 1))); }\n";
    const char *good_fragment = "out vec4 o; void main() { o = vec4(1); }\n";
    assert_ok(hw_gpu_program("good", "#define X 1\n", good_vertex, good_fragment, &program));
    glDeleteProgram(program);
    assert_int_equal(
        hw_gpu_program("bad", NULL, "void main() { nonsense; }\n", good_fragment, &program),
        HW_GRAPHICS);
    assert_non_null(strstr(hw_error_text(), "bad.vert"));
    assert_non_null(strstr(hw_error_text(), "nonsense"));
    assert_int_equal(program, 0);
    assert_int_equal(
        hw_gpu_program("unlinked", NULL,
                       "out float v_a; void main() { v_a = 1.0; gl_Position = vec4(1); }\n",
                       "in vec3 v_a; out vec4 o; void main() { o = vec4(v_a, 1); }\n", &program),
        HW_GRAPHICS);
    assert_non_null(strstr(hw_error_text(), "unlinked"));
    assert_non_null(strstr(hw_error_text(), "v_a"));
    assert_int_equal(program, 0);
}

static void test_byte_counts(void **state)
{
    (void)state;
    hw_gpu_account account = {0};
    hw_gpu_buffer a, b;
    hw_gpu_texture texture;
    assert_ok(hw_gpu_buffer_create(&account, GL_ARRAY_BUFFER, NULL, 1000, GL_STATIC_DRAW, &a));
    assert_ok(hw_gpu_buffer_create(&account, GL_ARRAY_BUFFER, NULL, 24, GL_STATIC_DRAW, &b));
    assert_int_equal(account.bytes, 1024);
    hw_gpu_buffer_destroy(&account, &a);
    hw_gpu_buffer_destroy(&account, &a);
    assert_int_equal(account.bytes, 24);
    assert_int_equal(account.bytes_peak, 1024);
    assert_ok(hw_gpu_atlas_create(&account, 8, 8, false, &texture));
    assert_int_equal(account.bytes, 24 + texture.bytes);
    hw_gpu_texture_destroy(&account, &texture);
    hw_gpu_buffer_destroy(&account, &b);
    assert_int_equal(account.bytes, 0);
    assert_int_equal(hw_gpu_atlas_create(&account, 1u << 20, 4, false, &texture), HW_GRAPHICS);
    assert_int_equal(account.bytes, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_orientation),
        cmocka_unit_test(test_limits),
        cmocka_unit_test(test_shader_errors),
        cmocka_unit_test(test_byte_counts),
    };
    return cmocka_run_group_tests_name("target", tests, model_context_open, model_context_close);
}
