// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/video_writer.hpp"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

#include <stdexcept>
#include <string>
#include <utility>

namespace cairn {
namespace {

struct Free {
  void operator()(AVPacket* p) const { av_packet_free(&p); }
  void operator()(AVFrame* p) const { av_frame_free(&p); }
  void operator()(AVCodecContext* p) const { avcodec_free_context(&p); }
  void operator()(SwsContext* p) const { sws_freeContext(p); }
  void operator()(AVFormatContext* p) const {
    if (p->pb != nullptr) avio_closep(&p->pb);
    avformat_free_context(p);
  }
};
template <class T>
using Owned = std::unique_ptr<T, Free>;

}  // namespace

struct VideoWriter::State {
  std::string name;
  Owned<AVFormatContext> container;
  Owned<AVCodecContext> encoder;
  Owned<SwsContext> converter;
  Owned<AVPacket> packet{av_packet_alloc()};
  std::int64_t images = 0;

  void must(int result) const {
    if (result >= 0) return;
    char text[AV_ERROR_MAX_STRING_SIZE];
    throw std::runtime_error("cannot write " + name + ": " + av_make_error_string(text, sizeof text, result));
  }

  void open_encoder(int width, int height, int rate) {
    const AVCodec* codec = avcodec_find_encoder_by_name("libx264");
    if (codec == nullptr)
      throw std::runtime_error("cannot write " + name + ": FFmpeg has no encoder libx264 here; take another layout");
    if (width % 2 != 0 || height % 2 != 0)
      throw std::runtime_error("cannot write " + name + ": H.264 takes images with an even number of pixels a side");
    encoder.reset(avcodec_alloc_context3(codec));
    encoder->width = width, encoder->height = height;
    encoder->time_base = {1, rate};
    encoder->framerate = {rate, 1};
    encoder->pix_fmt = AV_PIX_FMT_YUV420P;
    encoder->colorspace = AVCOL_SPC_BT709;
    encoder->color_range = AVCOL_RANGE_MPEG;
    encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    av_opt_set(encoder->priv_data, "crf", "8", 0);  // hardly any loss beside that of colour at half the resolution
    must(avcodec_open2(encoder.get(), codec, nullptr));
    converter.reset(sws_getContext(width, height, AV_PIX_FMT_RGBA, width, height, AV_PIX_FMT_YUV420P,
                                   SWS_BILINEAR | SWS_ACCURATE_RND, nullptr, nullptr, nullptr));
    if (!converter) throw std::bad_alloc();
    sws_setColorspaceDetails(converter.get(), sws_getCoefficients(SWS_CS_DEFAULT), 1,
                             sws_getCoefficients(SWS_CS_ITU709), 0, 0, 1 << 16, 1 << 16);
  }

  void open_container(int rate) {
    AVFormatContext* made = nullptr;
    must(avformat_alloc_output_context2(&made, nullptr, "mp4", name.c_str()));
    container.reset(made);
    must(avio_open(&container->pb, name.c_str(), AVIO_FLAG_WRITE));
    AVStream* stream = avformat_new_stream(made, nullptr);
    if (stream == nullptr) throw std::bad_alloc();
    must(avcodec_parameters_from_context(stream->codecpar, encoder.get()));
    stream->time_base = encoder->time_base;
    stream->avg_frame_rate = {rate, 1};
    must(avformat_write_header(made, nullptr));
  }

  /// `frame` null: none follows.
  void encode(const AVFrame* frame) {
    must(avcodec_send_frame(encoder.get(), frame));
    while (avcodec_receive_packet(encoder.get(), packet.get()) >= 0) {
      av_packet_rescale_ts(packet.get(), encoder->time_base, container->streams[0]->time_base);
      packet->stream_index = 0;
      must(av_interleaved_write_frame(container.get(), packet.get()));
    }
  }
};

VideoWriter::VideoWriter(const std::filesystem::path& file, int width, int height, int rate)
    : state_(std::make_unique<State>()) {
  av_log_set_level(AV_LOG_QUIET);  // what is wrong is thrown
  state_->name = file.string();
  state_->open_encoder(width, height, rate);
  state_->open_container(rate);
}

VideoWriter::~VideoWriter() = default;

void VideoWriter::add(const std::vector<std::uint32_t>& colour) {
  State& s = *state_;
  const Owned<AVFrame> frame(av_frame_alloc());
  frame->width = s.encoder->width;
  frame->height = s.encoder->height;
  frame->format = AV_PIX_FMT_YUV420P;
  s.must(av_frame_get_buffer(frame.get(), 0));
  const std::uint8_t* from[1] = {reinterpret_cast<const std::uint8_t*>(colour.data())};
  const int stride[1] = {4 * frame->width};
  s.must(sws_scale(s.converter.get(), from, stride, 0, frame->height, frame->data, frame->linesize));
  frame->pts = s.images++;
  s.encode(frame.get());
}

void VideoWriter::finish() {
  state_->encode(nullptr);
  state_->must(av_write_trailer(state_->container.get()));
}

}  // namespace cairn
