// SPDX-License-Identifier: GPL-3.0-or-later
// What the graphics card runs for every vertex and pixel. Eye space: x right, y up, the
// viewer looks along -z. Colours are mixed as light (linear) and shown as sRGB.
#pragma once

namespace cellwarp::core::shaders
{

#define CELLWARP_LIGHT                                                                   \
    "uniform int is_perspective;\n"                                                      \
    "uniform vec4 up;\n"                                                                 \
    "vec3 to_light(vec3 shown) { return shown * shown; }\n"                              \
    "vec3 to_shown(vec3 light) { return sqrt(clamp(light, 0.0, 1.0)); }\n"               \
    "vec3 viewer(vec3 place)\n"                                                          \
    "{ return is_perspective != 0 ? normalize(-place) : vec3(0.0, 0.0, 1.0); }\n"        \
    "float wrapped(vec3 n, vec3 l, float w)\n"                                           \
    "{ return max((dot(n, normalize(l)) + w) / (1.0 + w), 0.0); }\n"                     \
    "vec3 lit(vec3 colour, vec3 n, vec3 v)\n"                                            \
    "{\n"                                                                                \
    "    float sky = 0.5 + 0.5 * dot(n, up.xyz);\n"                                      \
    "    vec3 light = mix(vec3(0.13, 0.125, 0.14), vec3(0.30, 0.32, 0.36), sky);\n"      \
    "    light += vec3(0.66, 0.64, 0.60) * wrapped(n, vec3(-0.45, 0.75, 0.8), 0.15);\n"  \
    "    light += vec3(0.15, 0.17, 0.21) * wrapped(n, vec3(0.9, 0.1, 0.5), 0.3);\n"      \
    "    vec3 h = normalize(v + normalize(vec3(-0.45, 0.75, 0.8)));\n"                   \
    "    float s = max(dot(n, h), 0.0), r = 1.0 - max(dot(n, v), 0.0);\n"                \
    "    s *= s; s *= s; s *= s; s *= s; s *= s;\n"                                      \
    "    r *= r;\n"                                                                      \
    "    float shine = 0.10 * s, rim = 0.10 * r * r * sky;\n"                            \
    "    return colour * light + vec3(shine + rim);\n"                                   \
    "}\n"

/// A triangle that covers the view.
inline constexpr const char* kBackgroundVertex = R"(#version 330 core
out vec2 place;
void main()
{
    place = vec2((gl_VertexID & 1) * 4.0 - 1.0, (gl_VertexID >> 1) * 4.0 - 1.0);
    gl_Position = vec4(place, 0.0, 1.0);
}
)";
inline constexpr const char* kBackgroundFragment = R"(#version 330 core
in vec2 place;
out vec4 shown;
uniform vec4 upper, lower;
void main()
{
    float t = smoothstep(-1.1, 1.1, place.y);
    shown = vec4(mix(lower.rgb, upper.rgb, t), 1.0);
}
)";

inline constexpr const char* kShapeVertex = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 colour;
uniform mat4 to_eye, to_clip;
uniform float nearer;       // towards the viewer, of the depth: for lines on faces
uniform float point_size;   // [pixel] at distance 1; <= 0: no points
uniform int is_perspective_points;
centroid out vec3 eye_place, eye_normal;
centroid out vec4 sample_colour;
flat out float radius;      // of a point [eye]
uniform float point_radius;
void main()
{
    vec4 eye = to_eye * vec4(position, 1.0);
    eye_place = eye.xyz;
    eye_normal = mat3(to_eye) * normal;
    sample_colour = colour;
    radius = point_radius;
    gl_Position = to_clip * eye;
    gl_Position.z -= nearer * gl_Position.w;
    float far = is_perspective_points != 0 ? max(-eye.z, 1e-4) : 1.0;
    gl_PointSize = point_size > 0.0 ? clamp(point_size / far, 2.0, 48.0) : 1.0;
}
)";

/// Faces: where there is no normal the face's own is used.
inline constexpr const char* kFaceFragment = "#version 330 core\n" CELLWARP_LIGHT R"(
centroid in vec3 eye_place, eye_normal;
centroid in vec4 sample_colour;
out vec4 shown;
uniform vec4 selected;
uniform float opacity;      // of a ghost; 1: solid
void main()
{
    vec3 n = eye_normal;
    if (dot(n, n) < 1e-12)
        n = cross(dFdx(eye_place), dFdy(eye_place));
    n = normalize(n);
    vec3 v = viewer(eye_place);
    if (dot(n, v) < 0.0)
        n = -n;
    vec3 colour = mix(sample_colour.rgb, selected.rgb, 0.85 * sample_colour.a);
    vec3 light = lit(to_light(colour), n, v);
    float alpha = 1.0;
    if (opacity < 1.0) // what faces the viewer is clearer than the rim
        alpha = opacity * (0.35 + 0.65 * pow(1.0 - max(dot(n, v), 0.0), 1.5));
    shown = vec4(to_shown(light), alpha);
}
)";

/// Lines, in one colour or (alpha 0) in that of the samples.
inline constexpr const char* kLineFragment = R"(#version 330 core
centroid in vec4 sample_colour;
out vec4 shown;
uniform vec4 ink, selected;
void main()
{
    vec3 colour = mix(sample_colour.rgb, selected.rgb, 0.85 * sample_colour.a);
    shown = ink.a > 0.0 ? ink : vec4(colour, 0.9);
}
)";

/// Points as little balls.
inline constexpr const char* kPointFragment = "#version 330 core\n" CELLWARP_LIGHT R"(
centroid in vec3 eye_place;
centroid in vec4 sample_colour;
flat in float radius;
out vec4 shown;
uniform vec4 selected;
uniform float opacity;
void main()
{
    vec2 at = gl_PointCoord * 2.0 - 1.0;
    float far = dot(at, at);
    if (far > 1.0)
        discard;
    vec3 n = vec3(at.x, -at.y, sqrt(1.0 - far));
    vec3 colour = mix(sample_colour.rgb, selected.rgb, 0.85 * sample_colour.a);
    // Flatter than a ball: neighbours make one surface.
    vec3 light = lit(to_light(colour), normalize(vec3(0.55 * n.xy, n.z)), vec3(0.0, 0.0, 1.0));
    shown = vec4(to_shown(light * (1.0 - 0.35 * far * far)), opacity);
}
)";

/// Boxes of cells: an origin and three edges each.
inline constexpr const char* kCellVertex = R"(#version 330 core
layout(location = 0) in vec3 corner;
layout(location = 1) in vec3 origin;
layout(location = 2) in vec3 edge_x;
layout(location = 3) in vec3 edge_y;
layout(location = 4) in vec3 edge_z;
layout(location = 5) in vec4 colour;
uniform mat4 to_eye, to_clip;
uniform float nearer;
out vec3 eye_place;
out vec4 cell_colour;
void main()
{
    // A little smaller, so that neighbours can be told apart.
    vec3 k = mix(vec3(0.5), corner, 0.97);
    vec4 eye = to_eye * vec4(origin + k.x * edge_x + k.y * edge_y + k.z * edge_z, 1.0);
    eye_place = eye.xyz;
    cell_colour = colour;
    gl_Position = to_clip * eye;
    gl_Position.z -= nearer * gl_Position.w;
}
)";
inline constexpr const char* kCellFragment = "#version 330 core\n" CELLWARP_LIGHT R"(
in vec3 eye_place;
in vec4 cell_colour;
out vec4 shown;
uniform float opacity, is_line;
void main()
{
    vec3 n = normalize(cross(dFdx(eye_place), dFdy(eye_place)));
    vec3 v = viewer(eye_place);
    if (dot(n, v) < 0.0)
        n = -n;
    vec3 light = is_line > 0.0 ? to_light(cell_colour.rgb)
                               : lit(to_light(cell_colour.rgb), n, v);
    shown = vec4(to_shown(light), opacity);
}
)";

inline constexpr const char* kFloorVertex = R"(#version 330 core
uniform mat4 to_clip;
uniform vec4 centre, side_u, side_v;
out vec2 place;             // on the floor [view]
void main()
{
    vec2 k = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    vec4 x = vec4(centre.xyz + k.x * side_u.xyz + k.y * side_v.xyz, 1.0);
    place = k * side_u.w;
    gl_Position = to_clip * x;
}
)";
inline constexpr const char* kFloorFragment = R"(#version 330 core
in vec2 place;
out vec4 shown;
uniform vec4 ink, footprint;
float lines(float spacing)
{
    vec2 at = place / spacing;
    vec2 width = max(fwidth(at), vec2(1e-6));
    vec2 far = abs(fract(at - 0.5) - 0.5) / width;
    vec2 line = (1.0 - clamp(far - 0.1, 0.0, 1.0)) * (1.0 - smoothstep(0.25, 0.6, width));
    return max(line.x, line.y);
}
void main()
{
    float fade = exp(-dot(place, place) / 1.1);
    float line = max(0.45 * lines(0.1), lines(0.5)) * ink.a * fade;
    vec2 at = place / max(footprint.xy, vec2(0.02));
    float shade = footprint.z * exp(-0.9 * dot(at, at));
    shown = vec4(ink.rgb * line, line + shade * (1.0 - line));
    // (colours are premultiplied by alpha; the shade is black)
}
)";

#undef CELLWARP_LIGHT

} // namespace cellwarp::core::shaders
