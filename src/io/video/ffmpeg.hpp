// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// FFmpeg functions, loaded with dlopen when the first video is opened. Linking would load FFmpeg and its hundred
// dependencies at every start, and the program would not run without them.
#pragma once
extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

#include <string>

namespace cairn {

// clang-format off
#define CAIRN_AVFORMAT(X) \
  X(avformat_alloc_output_context2) X(avformat_close_input) X(avformat_free_context) X(avformat_new_stream) \
  X(avformat_open_input) X(avformat_write_header) X(av_find_input_format) X(av_interleaved_write_frame) \
  X(av_read_frame) X(av_write_trailer) X(avio_closep) X(avio_open)
#define CAIRN_AVCODEC(X) \
  X(av_packet_alloc) X(av_packet_free) X(av_packet_rescale_ts) X(avcodec_alloc_context3) \
  X(avcodec_find_decoder) X(avcodec_find_encoder_by_name) X(avcodec_free_context) X(avcodec_get_name) \
  X(avcodec_open2) X(avcodec_parameters_from_context) X(avcodec_parameters_to_context) X(avcodec_receive_frame) \
  X(avcodec_receive_packet) X(avcodec_send_frame) X(avcodec_send_packet)
#define CAIRN_AVUTIL(X) \
  X(av_dict_free) X(av_dict_get) X(av_dict_set) X(av_frame_alloc) X(av_frame_free) X(av_frame_get_buffer) \
  X(av_log_set_level) X(av_opt_set) X(av_strerror)
#define CAIRN_SWSCALE(X) \
  X(sws_freeContext) X(sws_getCoefficients) X(sws_getContext) X(sws_scale) X(sws_setColorspaceDetails)
// clang-format on

struct Ffmpeg {
#define CAIRN_DECLARE(name) decltype(&::name) name = nullptr;  // NOLINT(bugprone-macro-parentheses): a member's name
  CAIRN_AVFORMAT(CAIRN_DECLARE)
  CAIRN_AVCODEC(CAIRN_DECLARE)
  CAIRN_AVUTIL(CAIRN_DECLARE)
  CAIRN_SWSCALE(CAIRN_DECLARE)
#undef CAIRN_DECLARE
};

/// Returns the loaded functions. Throws std::runtime_error with the packages to install if FFmpeg is missing.
[[nodiscard]] const Ffmpeg& ffmpeg();

/// Returns the description of an FFmpeg error code.
[[nodiscard]] std::string ffmpeg_error(int error);

}  // namespace cairn
