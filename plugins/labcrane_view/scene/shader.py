"""The shaders: sun with a shadow map, sky light, a grain, haze with distance; and depth."""

VERTEX = """#version 330
in vec4 p3d_Vertex;
in vec3 p3d_Normal;
uniform mat4 p3d_ModelViewProjectionMatrix;
uniform mat4 p3d_ModelViewMatrix;
uniform mat4 p3d_ModelMatrix;
uniform struct p3d_LightSourceParameters {
  vec4 color; vec4 position; sampler2DShadow shadowMap; mat4 shadowViewMatrix;
} p3d_LightSource[1];
out vec3 world; out vec3 normal; out vec3 seen; out vec4 lit;
void main() {
  gl_Position = p3d_ModelViewProjectionMatrix * p3d_Vertex;
  vec4 view = p3d_ModelViewMatrix * p3d_Vertex;
  seen = view.xyz;
  world = (p3d_ModelMatrix * p3d_Vertex).xyz;
  normal = mat3(p3d_ModelMatrix) * p3d_Normal;
  lit = p3d_LightSource[0].shadowViewMatrix * view;
}
"""

FRAGMENT = """#version 330
in vec3 world; in vec3 normal; in vec3 seen; in vec4 lit;
uniform vec4 rgba; uniform float grain; uniform int shadows; uniform float glow;
uniform vec3 sun; uniform vec3 eye; uniform vec3 haze; uniform float thickness;
uniform sampler2D noise;
uniform struct p3d_LightSourceParameters {
  vec4 color; vec4 position; sampler2DShadow shadowMap; mat4 shadowViewMatrix;
} p3d_LightSource[1];
out vec4 colour;

float sunlit() {
  vec3 p = lit.xyz / lit.w;
  if (shadows == 0 || any(lessThan(p, vec3(0.0))) || any(greaterThan(p, vec3(1.0)))) return 1.0;
  p.z -= 0.0012;
  vec2 t = 0.7 / vec2(textureSize(p3d_LightSource[0].shadowMap, 0));
  float s = texture(p3d_LightSource[0].shadowMap, p + vec3(-t.x, -t.y, 0.0));
  s += texture(p3d_LightSource[0].shadowMap, p + vec3(t.x, -t.y, 0.0));
  s += texture(p3d_LightSource[0].shadowMap, p + vec3(-t.x, t.y, 0.0));
  s += texture(p3d_LightSource[0].shadowMap, p + vec3(t.x, t.y, 0.0));
  return 0.25 * s;
}

void main() {
  vec3 n = normalize(normal);
  vec3 towards = normalize(eye - world);
  if (rgba.a < 1.0) {
    float rim = pow(1.0 - abs(dot(n, towards)), 2.0);
    colour = vec4(rgba.rgb * (0.85 + 0.5 * rim), mix(rgba.a, 0.9, rim));
    return;
  }
  vec3 base = rgba.rgb;
  if (grain > 0.0) {
    float coarse = texture(noise, world.xy * 0.021).r;
    float fine = texture(noise, world.xy * 0.17 + world.z * 0.11).r;
    if (grain > 0.9) {
      float trodden = smoothstep(13.0, 5.0, length(world.xy - vec2(3.5, 0.0)));
      float earth = smoothstep(0.42, 0.75, coarse + 0.30 * trodden + 0.15 * (fine - 0.5));
      base = mix(base, vec3(0.37, 0.29, 0.20), earth);
    }
    base *= 0.72 + 0.56 * mix(coarse, fine, 0.6);
  }
  float facing = max(dot(n, sun), 0.0);
  float shade = facing > 0.0 ? sunlit() : 0.0;
  vec3 sky = mix(vec3(0.26, 0.24, 0.20), vec3(0.50, 0.56, 0.64), 0.5 + 0.5 * n.z);
  float gloss = pow(max(dot(n, normalize(sun + towards)), 0.0), 24.0) * 0.18 * shade;
  gloss *= 1.0 - grain;
  vec3 light = sky + vec3(1.05, 0.98, 0.86) * facing * shade;
  vec3 near = mix(base * light + gloss, base, glow);
  float away = length(seen);
  colour = vec4(mix(haze, near, exp(-thickness * thickness * away * away)), 1.0);
}
"""

# Without it the shadow pass runs the whole shader above: 15 instead of 25 pictures a second.
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
