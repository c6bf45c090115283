"""The shaders: sun with a shadow map, sky light, a grain, haze with distance; and depth."""

LIGHTS = """
uniform struct p3d_LightSourceParameters {
  vec4 color; vec4 position; sampler2DShadow shadowMap; mat4 shadowViewMatrix;
} p3d_LightSource[2];
"""
"""The sun twice: with the shadows of static objects, drawn once, and of moving objects."""

VERTEX = (
    """#version 330
in vec4 p3d_Vertex;
in vec3 p3d_Normal;
uniform mat4 p3d_ModelViewProjectionMatrix;
uniform mat4 p3d_ModelViewMatrix;
uniform mat4 p3d_ModelMatrix;
"""
    + LIGHTS
    + """
out vec3 world; out vec3 normal; out vec3 seen; out vec3 still; out vec3 moving;
void main() {
  gl_Position = p3d_ModelViewProjectionMatrix * p3d_Vertex;
  vec4 view = p3d_ModelViewMatrix * p3d_Vertex;
  seen = view.xyz;
  world = (p3d_ModelMatrix * p3d_Vertex).xyz;
  normal = mat3(p3d_ModelMatrix) * p3d_Normal;
  still = (p3d_LightSource[0].shadowViewMatrix * view).xyz;  // the sun's rays are parallel: w is 1
  moving = (p3d_LightSource[1].shadowViewMatrix * view).xyz;
}
"""
)

TAPPED = """
float tapped(sampler2DShadow map, vec3 p) {
  if (any(lessThan(p, vec3(0.0))) || any(greaterThan(p, vec3(1.0)))) return 1.0;
  p.z -= 0.0012;
#if TAPS == 1
  return texture(map, p);
#else
  vec2 t = 0.7 / vec2(textureSize(map, 0));
  float s = texture(map, p + vec3(-t.x, -t.y, 0.0));
  s += texture(map, p + vec3(t.x, -t.y, 0.0));
  s += texture(map, p + vec3(-t.x, t.y, 0.0));
  s += texture(map, p + vec3(t.x, t.y, 0.0));
  return 0.25 * s;
#endif
}
"""

FRAGMENT = (
    """
in vec3 world; in vec3 normal; in vec3 seen; in vec3 still; in vec3 moving;
uniform vec4 rgba; uniform float glow;
uniform vec3 sun; uniform vec3 sunlight; uniform vec3 above; uniform vec3 below;
uniform vec3 eye; uniform vec3 haze; uniform float thickness;
uniform sampler2D noise;
uniform vec2 sunshine;  // how bright the sun is, and what moving shadows leave of it at least
"""
    + LIGHTS
    + """
out vec4 colour;
"""
    + TAPPED
    + """
float sunlit() {
#if TAPS == 0
  return sunshine.x;
#else
  return sunshine.x * min(max(sunshine.y, tapped(p3d_LightSource[1].shadowMap, moving)),
                          tapped(p3d_LightSource[0].shadowMap, still));
#endif
}

void main() {
  vec3 n = normalize(normal);
#ifdef GLASS
  float rim = pow(1.0 - abs(dot(n, normalize(eye - world))), 2.0);
  colour = vec4(rgba.rgb * (0.85 + 0.5 * rim), mix(rgba.a, 0.9, rim));
#else
  vec3 base = rgba.rgb;
#ifndef SMOOTH
  float coarse = texture(noise, world.xy * 0.021).r;
  float fine = texture(noise, world.xy * 0.17 + world.z * 0.11).r;
  float earth_share = 0.0;
#ifdef GROUND
  float trodden = smoothstep(13.0, 5.0, length(world.xy - vec2(3.5, 0.0)));
  float earth = smoothstep(0.42, 0.75, coarse + 0.30 * trodden + 0.15 * (fine - 0.5));
  base = mix(base, vec3(0.37, 0.29, 0.20), earth);
  earth_share = earth;
#endif
#if TAPS == 4
  float grit = texture(noise, world.xy * 1.7).r;
  base *= 1.0 + 0.9 * (grit - 0.5) * earth_share;
#endif
  base *= 0.72 + 0.56 * mix(coarse, fine, 0.6);
#endif
  float facing = max(dot(n, sun), 0.0);
  float shade = sunlit();
  vec3 sky = mix(below, above, 0.5 + 0.5 * n.z);
  vec3 light = sky + sunlight * facing * shade;
  vec3 near = base * light;
#ifndef GROUND
  vec3 half_way = normalize(sun + normalize(eye - world));
  near += pow(max(dot(n, half_way), 0.0), 24.0) * GLOSS * sunlight * shade * sign(facing);
#endif
  near = mix(near, base, glow);
  colour = vec4(mix(haze, near, exp(-thickness * thickness * dot(seen, seen))), 1.0);
#endif
}
"""
)

GROUND, ROUGH, SMOOTH, GLASS = "GROUND", "ROUGH", "SMOOTH", "GLASS"
"""What surfaces look like. A renderer without a graphics card runs both sides of a branch, so that
each has a program of its own."""

GLOSS = {ROUGH: 0.09, SMOOTH: 0.18}


def fragment(surface: str, taps: int) -> str:
    """Return the program of a surface, with 0, 1 or 4 looks at each map of shadows."""
    defined = f"#define {surface}\n#define TAPS {taps}\n#define GLOSS {GLOSS.get(surface, 0.0)}\n"
    return f"#version 330\n{defined}{FRAGMENT}"


# Without it the shadow pass runs the whole shader above.
DEPTH_VERTEX = """#version 330
in vec4 p3d_Vertex;
uniform mat4 p3d_ModelViewProjectionMatrix;
void main() { gl_Position = p3d_ModelViewProjectionMatrix * p3d_Vertex; }
"""

DEPTH_FRAGMENT = """#version 330
void main() {}
"""

FAR_VERTEX = """#version 330
in vec4 p3d_Vertex;
uniform mat4 p3d_ModelViewProjectionMatrix;
out float away;
void main() {
  gl_Position = p3d_ModelViewProjectionMatrix * p3d_Vertex;
  away = gl_Position.w;  // metres along the line of sight
}
"""

FAR_FRAGMENT = """#version 330
in float away;
uniform vec2 range;
out vec4 colour;
void main() {
  colour = vec4(vec3(clamp((range.y - away) / (range.y - range.x), 0.0, 1.0)), 1.0);
}
"""

SKY_VERTEX = """#version 330
in vec4 p3d_Vertex;
uniform mat4 p3d_ModelViewProjectionMatrix;
out vec3 way;
void main() {
  gl_Position = p3d_ModelViewProjectionMatrix * p3d_Vertex;
  way = p3d_Vertex.xyz;
}
"""

SKY_FRAGMENT = """#version 330
in vec3 way;
uniform vec3 haze; uniform vec3 zenith;
out vec4 colour;
void main() {
  float up = clamp(way.z / length(way), 0.0, 1.0);
  colour = vec4(mix(haze, zenith, smoothstep(0.0, 0.45, up)), 1.0);
}
"""
"""Haze at the horizon, the zenith's colour above."""

BACKDROP_VERTEX = """#version 330
in vec4 p3d_Vertex;
out vec2 place;
void main() {
  gl_Position = vec4(p3d_Vertex.xz, 0.0, 1.0);
  place = p3d_Vertex.xz;
}
"""

BACKDROP_FRAGMENT = (
    """
in vec2 place;
uniform sampler2D sunlit; uniform sampler2D shaded; uniform sampler2D depth;
uniform mat4 p3d_ProjectionMatrixInverse;
"""
    + LIGHTS
    + TAPPED
    + """
out vec4 colour;
void main() {
  vec2 at = 0.5 * place + 0.5;
  float far = texture(depth, at).r;
  gl_FragDepth = far;
#if TAPS == 0
  colour = texture(sunlit, at);
#else
  vec4 seen = p3d_ProjectionMatrixInverse * vec4(place, 2.0 * far - 1.0, 1.0);
  vec3 moving = (p3d_LightSource[1].shadowViewMatrix * vec4(seen.xyz / seen.w, 1.0)).xyz;
  float sun = tapped(p3d_LightSource[1].shadowMap, moving);
  colour = mix(texture(shaded, at), texture(sunlit, at), sun);
#endif
}
"""
)
"""The sheet that shows the drawn scenery with the shadows of moving objects."""


def backdrop(taps: int) -> str:
    """Return the program of the sheet, with 0, 1 or 4 looks at the map of moving shadows."""
    return f"#version 330\n#define TAPS {taps}\n{BACKDROP_FRAGMENT}"
