// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Buffers that a kernel only reads, at places that each thread computes: as texels. A CPU device gathers texels for all
// its lanes at once, where a storage buffer costs a loop with a branch for each; a GPU has a cache for them. The host
// knows by the sampler's kind what a texel is (src/gpu/kernel.cpp).
#ifndef CAIRN_FETCH_H
#define CAIRN_FETCH_H
#define PAIRS(place, name) layout(binding = place) uniform usamplerBuffer name
#define WORDS(place, name) layout(binding = place) uniform isamplerBuffer name
#define FLOATS(place, name) layout(binding = place) uniform samplerBuffer name

uvec2 fetch(usamplerBuffer pairs, int i) { return texelFetch(pairs, i).xy; }
uint fetch(isamplerBuffer words, int i) { return uint(texelFetch(words, i).x); }
float fetch(samplerBuffer floats, int i) { return texelFetch(floats, i).x; }
#endif
