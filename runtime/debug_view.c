#include "debug_view.h"
#include <glad/gl.h>

static const struct {
    const char *name;
    float color[3];
} representations[HW_REPRESENTATION_COUNT] = {
    [HW_REPRESENTATION_FULL] = {"full geometry", {1.0f, 1.0f, 0.45f}},
    [HW_REPRESENTATION_LOD] = {"level of detail", {0.55f, 1.0f, 1.0f}},
    [HW_REPRESENTATION_NEAR] = {"near object", {1.0f, 0.35f, 0.3f}},
    [HW_REPRESENTATION_SVMESH] = {"SVMesh", {0.35f, 0.95f, 0.4f}},
    [HW_REPRESENTATION_MVMESH] = {"MVMesh", {0.4f, 0.55f, 1.0f}},
};

const char *hw_representation_name(hw_representation representation)
{
    return representations[representation].name;
}

const float *hw_representation_color(hw_representation representation)
{
    return representations[representation].color;
}

const hw_camera *hw_debug_culling_camera(const hw_debug_view *view, const hw_camera *camera)
{
    return view->frozen ? &view->camera : camera;
}

// By blending, so that no shader knows of it: source times constant, alpha as it is.
void hw_debug_tint(const hw_debug_view *view, hw_representation representation)
{
    if (!view->tint)
        return;
    const float *c = representations[representation].color;
    glEnable(GL_BLEND);
    glBlendColor(c[0], c[1], c[2], 1);
    glBlendFuncSeparate(GL_CONSTANT_COLOR, GL_ZERO, GL_ONE, GL_ZERO);
}

void hw_debug_begin(const hw_debug_view *view)
{
    if (view->wireframe)
        glPolygonMode(GL_FRONT_AND_BACK, GL_LINE);
}

void hw_debug_end(const hw_debug_view *view)
{
    if (view->wireframe)
        glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    if (view->tint)
        glDisable(GL_BLEND);
}
