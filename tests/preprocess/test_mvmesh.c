// MVMeshes of a made-up object: a red pillar before a green wall, and a blue box behind the wall.
#include "shapes.h"

#include "mvmesh.h"

#define PILLAR_X 100.0f
#define WALL_X   130.0f
#define BOX_X    135.0f

typedef struct stage {
    hw_scene scene;
    hw_rays *rays;
    hw_capturer *capturer;
    hw_hexgrid grid;
    hw_cell_view view;
    hw_chain chain;
    hw_mesh_level_info info;
    hw_far_options options;
} stage;

// Everything relative to the cell's centre, along +x.
static hw_mesh make_object(hw_vec3 c)
{
    hw_mesh mesh = shape_plane(hw_v3(c.x + WALL_X, c.y - 15, c.z - 15), hw_v3(0, 0, 30),
                               hw_v3(0, 30, 0), 24, 24);
    uint32_t wall = mesh.vertex_count;
    hw_mesh pillar = shape_box(
        (hw_box){{c.x + PILLAR_X, c.y - 3, c.z - 15}, {c.x + PILLAR_X + 4, c.y + 3, c.z + 15}},
        false);
    hw_mesh box = shape_box(
        (hw_box){{c.x + BOX_X, c.y - 4, c.z - 6}, {c.x + BOX_X + 10, c.y + 4, c.z + 6}}, false);
    shape_append(&mesh, &pillar);
    shape_append(&mesh, &box);
    assert_int_equal(HW_NEW(&mesh.colors, mesh.vertex_count), HW_OK);
    for (uint32_t i = 0; i < mesh.vertex_count; i++)
        mesh.colors[i] = i < wall       ? (hw_color8){0, 255, 0, 255}
                         : i < wall + 8 ? (hw_color8){255, 0, 0, 255}
                                        : (hw_color8){0, 0, 255, 255};
    return mesh;
}

static void set_stage(stage *s)
{
    hw_mat4 identity = hw_mat4_translation(0, 0, 0);
    *s = (stage){.grid = hw_hexgrid_cover(-60, -60, 60, 60, 50, 8, 16)};
    s->view = hw_cell_view_make(&s->grid, hw_hexgrid_locate(&s->grid, 0, 0));
    hw_mesh mesh = make_object(s->view.centre);
    s->scene = shape_scene(&mesh, &identity, 1);
    s->chain = (hw_chain){1, s->scene.meshes, &s->info};
    s->info.vertex_count = s->scene.meshes[0].vertex_count;
    s->info.index_count = s->scene.meshes[0].index_count;
    s->options = (hw_far_options){.policy = &hw_policy_screen,
                                  .self_occlusion_px = 5,
                                  .multi_view_px = 1000,
                                  .multi_view_count = 3,
                                  .multi_blend = true,
                                  .edge_length_px = 4.5,
                                  .multi_outline_px = 0.05,
                                  .capture_side_max = 1024,
                                  .capture_samples = 2};
    assert_int_equal(hw_rays_create_scene(&s->rays, &s->scene), HW_OK);
    assert_int_equal(hw_capturer_create(&s->scene, s->rays, NULL, &s->capturer), HW_OK);
}

static void clear_stage(stage *s)
{
    hw_capturer_destroy(s->capturer);
    hw_rays_destroy(s->rays);
    hw_scene_free(&s->scene);
}

static bool derive(const stage *s, hw_svmesh *out)
{
    bool is_near;
    hw_svmesh_job job = {.view = &s->view,
                         .options = &s->options,
                         .scene = &s->scene,
                         .capturer = s->capturer,
                         .chain = &s->chain,
                         .scale = 1,
                         .face = hw_face_towards(1, 0.01)};
    job.distance = hw_region_distance_to(&s->grid, s->view.id, s->scene.objects[0].bounds);
    assert_int_equal(hw_svmesh_derive(&job, &is_near, out), HW_OK);
    return is_near;
}

// Of a triangle that begins at `index`: its middle in the image space of the record and, relative
// to the cell's centre, in the world.
static void middle_of(const stage *s, const hw_svmesh *m, uint32_t index, double image[3],
                      hw_vec3 *world)
{
    hw_mat4 matrix = hw_far_record_matrix(&m->record, s->view.centre);
    double h[4];
    image[0] = image[1] = image[2] = 0;
    for (int k = 0; k < 3; k++) {
        const hw_far_vertex *v = &m->vertices[m->indices[index + k]];
        image[0] += v->x / 3.0;
        image[1] += v->y / 3.0;
        image[2] += v->z / 3.0;
    }
    for (int r = 0; r < 4; r++)
        h[r] = matrix.m[r] * image[0] + matrix.m[4 + r] * image[1] + matrix.m[8 + r] * image[2] +
               matrix.m[12 + r];
    *world = hw_v3_sub(hw_v3((float)(h[0] / h[3]), (float)(h[1] / h[3]), (float)(h[2] / h[3])),
                       s->view.centre);
}

// The colour that capture k shows at a point of image space.
static hw_color8 texel_at(const stage *s, const hw_svmesh *m, uint32_t k, const double p[3])
{
    hw_mat4 matrix =
        hw_far_view_matrix(&m->record, s->view.centre, k > 0 ? &m->views[k - 1] : NULL);
    const hw_capture *capture = k > 0 ? &m->view_captures[k - 1] : &m->capture;
    double h[4];
    for (int r = 0; r < 4; r++)
        h[r] =
            matrix.m[r] * p[0] + matrix.m[4 + r] * p[1] + matrix.m[8 + r] * p[2] + matrix.m[12 + r];
    double x = h[0] / h[3] + HW_CAPTURE_PADDING, y = h[1] / h[3] + HW_CAPTURE_PADDING;
    assert_true(x >= 0 && x < capture->width && y >= 0 && y < capture->height);
    return capture->colors[(size_t)y * capture->width + (size_t)x];
}

// What the checks count.
typedef struct tally {
    uint32_t triangles, bits, unseen, only_others; // other captures, not the own
    uint32_t walls, pillars, sides;                // of the pillar
} tally;

// Every capture that a triangle names shows its surface there, and nothing of the box is left.
static tally check(const stage *s, const hw_svmesh *m)
{
    tally t = {0};
    uint32_t index = 0;
    for (uint32_t r = 0; r < m->record.range_count; r++) {
        const hw_far_range *range = &m->ranges[r];
        for (uint32_t i = 0; i < range->index_count; i += 3, index += 3) {
            double image[3];
            hw_vec3 at;
            middle_of(s, m, index, image, &at);
            bool wall = at.x > WALL_X - 5;
            assert_true(at.x < BOX_X - 1);
            for (uint32_t k = 0; range->views >> k; k++) {
                if (!(range->views >> k & 1))
                    continue;
                hw_color8 color = texel_at(s, m, k, image);
                assert_true(wall ? color.g > 20 && color.r == 0 : color.r > 20 && color.g == 0);
                t.bits++;
            }
            for (int k = 0; range->views == 0 && k < 3; k++) {
                hw_color8 color = m->colors[m->indices[index + k]];
                assert_true(wall ? color.g > 20 && color.r == 0 : color.r > 20 && color.g == 0);
            }
            t.triangles++;
            t.unseen += range->views == 0;
            t.only_others += range->views && !(range->views & 1);
            t.walls += wall;
            t.pillars += !wall;
            t.sides += !wall && fabsf(at.y) > 2.5f && at.x > PILLAR_X + 0.5f;
        }
    }
    assert_int_equal(index, m->record.index_count);
    return t;
}

static void captures_show_what_they_are_said_to(void **state)
{
    (void)state;
    stage s;
    hw_svmesh m;
    set_stage(&s);
    assert_false(derive(&s, &m));
    assert_int_equal(m.record.view_count, 2);
    tally t = check(&s, &m);
    assert_true(t.bits > 2 * t.walls); // most of the wall is seen from everywhere
    assert_true(t.only_others > 10);   // but not what the pillar hides from the centre
    assert_true(t.pillars >= 6);       // two triangles in front, two on either side
    assert_int_equal(t.sides, 4);
    hw_svmesh_free(&m);
    s.options.multi_view_count = 7;
    assert_false(derive(&s, &m));
    assert_int_equal(m.record.view_count, 6);
    tally more = check(&s, &m);
    assert_true(more.bits > 2 * t.bits);
    hw_svmesh_free(&m);
    clear_stage(&s);
}

static void without_blending_one_capture_is_left(void **state)
{
    (void)state;
    stage s;
    hw_svmesh m;
    set_stage(&s);
    s.options.multi_blend = false;
    assert_false(derive(&s, &m));
    tally t = check(&s, &m);
    assert_int_equal(t.bits + t.unseen, t.triangles);
    assert_true(t.only_others > 10);
    // Captures that show little are cropped to it.
    assert_true(m.view_captures[0].width < m.capture.width * 3 / 4);
    hw_svmesh_free(&m);
    clear_stage(&s);
}

static void colors_stand_in_for_captures(void **state)
{
    (void)state;
    stage s;
    hw_svmesh m;
    set_stage(&s);
    s.options.multi_view_count = 1;
    assert_false(derive(&s, &m));
    assert_int_equal(m.record.view_count, 0);
    tally t = check(&s, &m);
    assert_true(t.unseen > 10);
    assert_int_equal(t.only_others, 0);
    assert_non_null(m.colors);
    hw_svmesh_free(&m);
    clear_stage(&s);
}

static void the_thesis_policy_makes_them_too(void **state)
{
    (void)state;
    stage s;
    hw_svmesh m;
    set_stage(&s);
    s.options.policy = &hw_policy_thesis;
    assert_false(derive(&s, &m));
    assert_int_equal(m.record.view_count, 2);
    uint32_t unsimplified = s.scene.meshes[0].index_count / 3;
    assert_in_range(m.record.index_count / 3, 8, unsimplified - 1);
    hw_svmesh_free(&m);
    clear_stage(&s);
}

static void the_limit_divides_near_from_multi_view(void **state)
{
    (void)state;
    stage s;
    hw_svmesh m;
    set_stage(&s);
    s.options.multi_view_px = 0;
    assert_true(derive(&s, &m));
    s.options.multi_view_px = 40; // below its self-occluding error
    assert_true(derive(&s, &m));
    hw_mesh *mesh = &s.scene.meshes[0];
    s.options.multi_textured_px = 1000; // another limit, for what has texture coordinates
    assert_true(derive(&s, &m));
    assert_int_equal(HW_NEW(&mesh->uvs, mesh->vertex_count), HW_OK);
    assert_false(derive(&s, &m));
    assert_int_equal(m.record.view_count, 2);
    hw_svmesh_free(&m);
    s.options.self_occlusion_px = 1000; // an SVMesh
    s.options.outline_px = 0.1;
    assert_false(derive(&s, &m));
    assert_int_equal(m.record.range_count, 0);
    assert_null(m.ranges);
    hw_svmesh_free(&m);
    clear_stage(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(captures_show_what_they_are_said_to),
        cmocka_unit_test(without_blending_one_capture_is_left),
        cmocka_unit_test(colors_stand_in_for_captures),
        cmocka_unit_test(the_thesis_policy_makes_them_too),
        cmocka_unit_test(the_limit_divides_near_from_multi_view),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
