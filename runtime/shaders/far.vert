// Far objects: vertices in the image space of their capture (16-bit integers), carried to clip
// space by one projective matrix per record. That also makes texture coordinates linear in x and y.
layout(location = 0) in vec4 a_vertex; // x, y, z, record
struct FarRecord {
    mat4 clip;    // clip <- image space
    vec4 texture; // uv = xy + vertex.xy * zw
    vec4 kept;    // xy: of the pixels
};
layout(std140) uniform FarRecords
{
    FarRecord records[FAR_PAGE_RECORDS];
};
uniform int u_first_record; // of the page
out vec2 v_uv;
#ifdef DISSOLVE
flat out vec2 v_kept;
#endif
void main()
{
    int record = int(a_vertex.w) - u_first_record;
    gl_Position = records[record].clip * vec4(a_vertex.xyz, 1.0);
    vec4 place = records[record].texture;
    v_uv = place.xy + a_vertex.xy * place.zw;
#ifdef DISSOLVE
    v_kept = records[record].kept.xy;
#endif
}
