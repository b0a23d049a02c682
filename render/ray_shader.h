#pragma once

#include <array>

namespace palpate::render {

/// What the ray caster's fragment shader has of ours, in GLSL 1.50. Positions are texture coordinates of the volume at
/// rest.
///
/// A ray goes from where it enters the volume to where it leaves it or meets something solid. At each place it looks up
/// where the tissue there lies at rest (palpateShift), and how far there is no border around that (palpateLeaps, see
/// LeapGrid); so far it leaps, and composes what it has crossed at once. Where borders are near it goes in steps of VTK's
/// sample distance. A tissue's opacity is that of a layer of one unit of that distance, a millimetre.
///
/// Source: K. J. Zuiderveld, A. H. J. Koning, M. A. Viergever, "Acceleration of Ray-Casting Using 3D Distance
/// Transforms", Visualization in Biomedical Computing, SPIE 1808, 1992.
namespace ray_shader {

/// Goes after VTK's own declarations.
inline constexpr const char* declarations = R"(
uniform sampler3D palpateShift;
uniform vec3 palpateScale;       // to texture coordinates of the shifts
uniform vec3 palpateOffset;
uniform vec3 palpateReach;       // shift per unit of a texel
uniform sampler3D palpateLeaps;
uniform vec3 palpateBlocks;      // that the volume is wide, per axis
uniform vec3 palpateWhole;       // size of the volume, in the unit of VTK's sample distance
uniform vec3 palpateEye;
uniform mat4 palpateFromScreen;  // from normalised device coordinates
uniform vec4 palpateCut;         // seen is where dot(palpateCut, vec4(p, 1)) > 0
uniform float palpateEnough;     // opacity behind which nothing is seen

float palpateLeast(vec3 v) { return min(v.x, min(v.y, v.z)); }

void palpateMarch()
{
    vec2 place = (gl_FragCoord.xy - in_windowLowerLeftCorner) * in_inverseWindowSize;
    float depth = texture(in_depthSampler, place).x;
    vec3 begin = ip_textureCoords, way = begin - palpateEye;
    way *= in_sampleDistance / length(way * palpateWhole);
    vec4 solid = palpateFromScreen * vec4(2.0 * place - 1.0, 2.0 * depth - 1.0, 1.0);
    float cutBegin = dot(palpateCut, vec4(begin, 1.0)), cutStep = dot(palpateCut.xyz, way);
    if (gl_FragCoord.z >= depth || (cutBegin < 0.0 && cutStep <= 0.0))
        discard;
    vec3 perStep = way * palpateBlocks, slow = vec3(1e-6);
    vec3 stepsPerBlock = 1.0 / mix(perStep, slow, lessThan(abs(perStep), slow));
    vec3 leaves = palpateBlocks * stepsPerBlock;
    leaves = max((in_texMin[0] - begin) * leaves, (in_texMax[0] - begin) * leaves);
    float last = min(length((solid.xyz / solid.w - begin) * palpateWhole) / in_sampleDistance, palpateLeast(leaves));
    float at = cutBegin < 0.0 ? -cutBegin / cutStep : 0.0;
    if (cutBegin > 0.0 && cutStep < 0.0)
        last = min(last, -cutBegin / cutStep);

    vec4 colour = vec4(0.0);
    while (at < last && colour.a < palpateEnough) {
        vec3 seen = begin + at * way, rest = seen, q = seen * palpateScale + palpateOffset;
        float safe = 1.0;
        if (all(greaterThanEqual(q, vec3(0.0))) && all(lessThanEqual(q, vec3(1.0)))) {
            rest += (texture(palpateShift, q).xyz - 128.0 / 255.0) * palpateReach;
            safe = 0.7;  // what is stretched at rest is passed faster
        }
        vec3 inBlocks = rest * palpateBlocks, block = clamp(floor(inBlocks), vec3(0.0), ceil(palpateBlocks) - 1.0);
        float free = texelFetch(palpateLeaps, ivec3(block), 0).r * 255.0;
        bool air = free > 127.5;
        free -= air ? 128.0 : 0.0;
        vec3 border = max((block + 1.0 - free - inBlocks) * stepsPerBlock, (block + free - inBlocks) * stepsPerBlock);
        float leap = min(max(1.0, safe * palpateLeast(border)), last - at);
        vec4 tissue = texture(in_volume[0], rest + 0.5 * leap * way);
        float opacity = 1.0 - pow(max(1.0 - tissue.a, 1e-3), leap * in_sampleDistance);
        colour += air ? vec4(0.0) : (1.0 - colour.a) * opacity * vec4(tissue.rgb, 1.0);
        at += max(leap, 1e-3);
    }
    g_fragColor = colour;
}
)";

/// Goes into the place of VTK's own way to find where a ray begins and ends, and of its loop, which then does nothing.
inline constexpr const char* march = "palpateMarch();\n  g_exit = true;\n";

/// What of VTK's shader is not wanted: the marks that it would fill in.
inline constexpr std::array unwanted{"//VTK::Base::Init",     "//VTK::Terminate::Init", "//VTK::Shading::Init",
                                     "//VTK::Clipping::Init", "//VTK::Shading::Impl",   "//VTK::Terminate::Impl",
                                     "//VTK::Clipping::Impl"};

}  // namespace ray_shader

}  // namespace palpate::render
