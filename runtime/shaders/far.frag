in vec2 v_uv;
uniform sampler2D u_atlas; // opaque: alpha is 1
out vec4 o_color;
void main()
{
    o_color = texture(u_atlas, v_uv);
}
