// Pixels, y down from the top left corner.
layout(location = 0) in vec2 a_position;
layout(location = 1) in vec4 a_color;
uniform vec2 u_size;
out vec4 v_color;
void main()
{
    vec2 unit = a_position / u_size;
    gl_Position = vec4(2.0 * unit.x - 1.0, 1.0 - 2.0 * unit.y, 0.0, 1.0);
    v_color = a_color;
}
