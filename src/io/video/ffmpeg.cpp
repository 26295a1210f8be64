// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/video/ffmpeg.hpp"

#include <fmt/format.h>

#include <span>

#include "base/runtime_library.hpp"

namespace cairn {
namespace {

RuntimeLibrary open_library(const char* name, int version) {
  const std::string file = fmt::format("lib{}.so.{}", name, version);
  return {std::span(&file, 1),
          {.need = "videos need FFmpeg",
           .install = fmt::format("install it (Debian: lib{}{})", name, version),
           .update = {}}};
}

Ffmpeg load() {
  Ffmpeg f;
  // In dependency order.
  RuntimeLibrary library = open_library("avutil", LIBAVUTIL_VERSION_MAJOR);
#define CAIRN_FIND(name) library.find(#name, f.name);
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
