// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/video/ffmpeg.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <stdexcept>

namespace cairn {
namespace {

/// Loads a shared library, until the end of the program.
void* open_library(const char* name, int version) {
  const std::string file = fmt::format("lib{}.so.{}", name, version);
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr)
    throw std::runtime_error(fmt::format("videos need FFmpeg, whose {} is not installed: install it (Debian: lib{}{})",
                                         file, name, version));
  return library;
}

template <class Function>
void find(void* library, const char* name, Function& function) {
  function = reinterpret_cast<Function>(dlsym(library, name));
  if (function == nullptr)
    throw std::runtime_error(fmt::format("videos need FFmpeg, and the installed version lacks {}", name));
}

Ffmpeg load() {
  Ffmpeg f;
  // In dependency order.
  void* library = open_library("avutil", LIBAVUTIL_VERSION_MAJOR);
#define CAIRN_FIND(name) find(library, #name, f.name);
  CAIRN_AVUTIL(CAIRN_FIND)
  library = open_library("swscale", LIBSWSCALE_VERSION_MAJOR);
  CAIRN_SWSCALE(CAIRN_FIND)
  library = open_library("avcodec", LIBAVCODEC_VERSION_MAJOR);
  CAIRN_AVCODEC(CAIRN_FIND)
  library = open_library("avformat", LIBAVFORMAT_VERSION_MAJOR);
  CAIRN_AVFORMAT(CAIRN_FIND)
#undef CAIRN_FIND
  f.av_log_set_level(AV_LOG_QUIET);  // errors are thrown instead
  return f;
}

}  // namespace

const Ffmpeg& ffmpeg() {
  static const Ffmpeg loaded = load();
  return loaded;
}

std::string ffmpeg_error(int error) {
  char text[AV_ERROR_MAX_STRING_SIZE] = "";
  ffmpeg().av_strerror(error, text, sizeof text);
  return text;
}

}  // namespace cairn
