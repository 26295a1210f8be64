// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Read-only buffers with per-thread addresses, as texels. A CPU device gathers texels for all lanes at once, whereas a
// storage buffer costs a loop with a branch per lane; a GPU has a cache for texels. The host derives the texel format
// from the image type (src/gpu/kernel.cpp).
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
