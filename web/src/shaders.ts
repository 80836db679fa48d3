// The passes of the WebGL2 renderer. Row 0 is the top of the picture in every plane; the last pass flips the rows.

import { LOWEST } from "./protocol";

const head = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
`;

/** One triangle over the whole plane. */
const whole = `${head}
void main() {
  gl_Position = vec4(vec2(gl_VertexID == 1 ? 3. : -1., gl_VertexID == 2 ? 3. : -1.), 0., 1.);
}`;

export const shaders = {
  /** Strokes of one plane (docs/law/depth.md): each adds peak 2^p, p = down dy^2 + along (dx - slope dy)^2, to p = end. */
  strokes: {
    vertex: `${head}
uniform sampler2D strokes;
uniform ivec2 range;
uniform vec2 size;
flat out vec2 middle;
flat out vec4 shape;
flat out float slope;
void main() {
  int number = gl_InstanceID * 128 + gl_VertexID / 6;
  gl_Position = vec4(2., 2., 0., 1.);
  if (number >= range.y) return;
  int at = range.x + number;
  ivec2 texel = ivec2(2 * (at % 1024), at / 1024);
  vec4 a = texelFetch(strokes, texel, 0);
  vec4 b = texelFetch(strokes, texel + ivec2(1, 0), 0);
  // a: x, y, slope, along; b: down, end, peak, half.
  middle = a.xy;
  slope = a.z;
  shape = vec4(a.w, b.xyz);
  float across = sqrt(b.y / a.w + a.z * a.z * b.y / b.x);
  vec2 reach = vec2(across, b.w);
  int corner = gl_VertexID % 6;
  bool right = corner == 1 || corner == 2 || corner == 4;
  bool low = corner >= 2 && corner != 3;
  // Whole pixels, so that every pixel centre within is covered.
  vec2 from = floor(a.xy - reach), to = ceil(a.xy + reach) + 1.;
  vec2 p = vec2(right ? to.x : from.x, low ? to.y : from.y);
  gl_Position = vec4(2. * p / size - 1., 0., 1.);
}`,
    fragment: `${head}
flat in vec2 middle;
flat in vec4 shape;
flat in float slope;
out vec4 depth;
void main() {
  vec2 d = gl_FragCoord.xy - 0.5 - middle;
  float aside = d.x - slope * d.y;
  float power = shape.y * d.y * d.y + shape.x * aside * aside;
  if (power < shape.z) discard;
  depth = vec4(shape.w * exp2(power));
}`,
  },

  /** Upsamples a plane by two, vertically or horizontally, by the least-squares filter of the CPU's pyramid. */
  upsample: {
    vertex: whole,
    fragment: `${head}
uniform sampler2D coarse;
uniform int down;
uniform int pad;
out vec4 depth;
const float TAPS[8] = float[8](-0.0078614, 0.0397912, -0.1338106, 0.8789731, 0.2922763, -0.0948323, 0.0321284, -0.0066647);
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  int place = down == 1 ? at.y : at.x;
  bool even = place % 2 == 0;
  int first = place / 2 + pad - pad / 2 - (even ? 4 : 3);
  int last = (down == 1 ? textureSize(coarse, 0).y : textureSize(coarse, 0).x) - 1;
  float sum = 0.;
  for (int k = 0; k < 8; k++) {
    int from = min(first + k, last);
    float weight = even ? TAPS[7 - k] : TAPS[k];
    sum += weight * texelFetch(coarse, down == 1 ? ivec2(at.x, from) : ivec2(from, at.y), 0).r;
  }
  depth = vec4(sum);
}`,
  },

  /** Turns depths into grey levels from 0 to 255; densities stay as they are. */
  level: {
    vertex: whole,
    fragment: `${head}
uniform sampler2D depths;
uniform sampler2D table;
uniform int pad;
uniform int mode;
uniform int perspective;
uniform vec3 lens;
uniform float depths_of[6];
uniform float ratios[6];
out vec4 level;

// docs/law/response.md: 64 steps an octave from 2^-14 to 2^4.
float response(float tau) {
  const uint first = 113u << 23;
  if (!(tau > uintBitsToFloat(first))) {
    return tau > 0. ? tau / uintBitsToFloat(first) * texelFetch(table, ivec2(0), 0).r : 0.;
  }
  uint offset = floatBitsToUint(tau) - first;
  int index = int(offset >> 17);
  if (index >= 1152) return texelFetch(table, ivec2(1152, 0), 0).r;
  float t = float(offset & 131071u) / 131072.;
  return mix(texelFetch(table, ivec2(index, 0), 0).r, texelFetch(table, ivec2(index + 1, 0), 0).r, t);
}

// docs/law/fxaa.md: the mean after FXAA, relative to the mean before.
float ratio(float tau) {
  float x = log2(tau);
  if (!(x > depths_of[0])) return ratios[0];
  for (int i = 1; i < 6; i++) {
    if (x < depths_of[i]) {
      float t = (x - depths_of[i - 1]) / (depths_of[i] - depths_of[i - 1]);
      return ratios[i - 1] + t * (ratios[i] - ratios[i - 1]);
    }
  }
  return ratios[5];
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float tau = max(texelFetch(depths, at + pad, 0).r, 0.);
  if (perspective == 1) {
    vec2 t = (vec2(at) - lens.xy) / lens.z;
    tau *= sqrt(1. + t.x * t.x) * sqrt(1. + t.y * t.y);
  }
  if (mode == 0) level = vec4(255. * (tau < 0.01 ? tau * (1. - tau * (0.5 - tau / 6.)) : 1. - exp(-tau)));
  else if (mode == 1) level = vec4(response(tau));
  else if (mode == 2) level = vec4(response(tau) * ratio(tau));
  else level = vec4(tau);
}`,
  },

  /** Turns levels or densities into colours; levels are first blurred as FXAA does. */
  color: {
    vertex: whole,
    fragment: `${head}
uniform sampler2D levels;
uniform sampler2D colors;
uniform float blur;
uniform int density;
uniform int white;
uniform float gain;
uniform vec2 range;
uniform ivec2 size;
out vec4 color;

float down(int x, int y) {
  float here = texelFetch(levels, ivec2(x, y), 0).r;
  float above = texelFetch(levels, ivec2(x, max(y - 1, 0)), 0).r;
  float below = texelFetch(levels, ivec2(x, min(y + 1, size.y - 1)), 0).r;
  return (1. - 2. * blur) * here + blur * (above + below);
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  at.y = size.y - 1 - at.y;
  float v = texelFetch(levels, at, 0).r;
  if (density == 1) {
    float share = (log(v) - range.x) / range.y;
    int place = v > 0. ? int(clamp(floor(mix(${LOWEST}., 255., share) + 0.5), 0., 255.)) : 0;
    vec3 c = texelFetch(colors, ivec2(place, 0), 0).rgb;
    color = vec4(c, 1.);
    return;
  }
  if (blur > 0.) {
    v = (1. - 2. * blur) * down(at.x, at.y) + blur * (down(max(at.x - 1, 0), at.y) + down(min(at.x + 1, size.x - 1), at.y));
  }
  float grey = roundEven(clamp(v, 0., 255.)) / 255.;
  if (gain != 1.) grey = min(roundEven(grey * 255. * gain) / 255., 1.);
  color = vec4(vec3(white == 1 ? 1. - grey : grey), 1.);
}`,
  },
};
