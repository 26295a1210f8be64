// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Buffers that a kernel only reads, at places that each thread computes: as texels. A CPU device gathers texels for all
// its lanes at once, where a storage buffer costs a loop with a branch for each; a GPU has a cache for them. The host
// knows by the image's kind what a texel is (src/gpu/kernel.cpp).
#ifndef CAIRN_FETCH_H
#define CAIRN_FETCH_H
#extension GL_EXT_samplerless_texture_functions : require
#define PAIRS(place, name) layout(binding = place) uniform utextureBuffer name
#define WORDS(place, name) layout(binding = place) uniform itextureBuffer name
#define FLOATS(place, name) layout(binding = place) uniform textureBuffer name

uvec2 fetch(utextureBuffer pairs, int i) { return texelFetch(pairs, i).xy; }
uint fetch(itextureBuffer words, int i) { return uint(texelFetch(words, i).x); }
float fetch(textureBuffer floats, int i) { return texelFetch(floats, i).x; }
#endif
