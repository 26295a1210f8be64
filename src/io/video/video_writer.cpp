// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/video/video_writer.hpp"

#include <stdexcept>
#include <string>
#include <utility>

#include "io/video/ffmpeg.hpp"

namespace cairn {
namespace {

struct Free {
  void operator()(AVPacket* p) const { ffmpeg().av_packet_free(&p); }
  void operator()(AVFrame* p) const { ffmpeg().av_frame_free(&p); }
  void operator()(AVCodecContext* p) const { ffmpeg().avcodec_free_context(&p); }
  void operator()(SwsContext* p) const { ffmpeg().sws_freeContext(p); }
  void operator()(AVFormatContext* p) const {
    if (p->pb != nullptr) ffmpeg().avio_closep(&p->pb);
    ffmpeg().avformat_free_context(p);
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
  Owned<AVPacket> packet{ffmpeg().av_packet_alloc()};
  std::int64_t images = 0;

  void check(int result) const {
    if (result < 0) throw std::runtime_error("cannot write " + name + ": " + ffmpeg_error(result));
  }

  void open_encoder(int width, int height, int rate) {
    const AVCodec* codec = ffmpeg().avcodec_find_encoder_by_name("libx264");
    if (codec == nullptr)
      throw std::runtime_error("cannot write " + name + ": FFmpeg has no encoder libx264; use another layout");
    if (width % 2 != 0 || height % 2 != 0)
      throw std::runtime_error("cannot write " + name + ": H.264 needs images of even width and height");
    encoder.reset(ffmpeg().avcodec_alloc_context3(codec));
    encoder->width = width, encoder->height = height;
    encoder->time_base = {1, rate};
    encoder->framerate = {rate, 1};
    encoder->pix_fmt = AV_PIX_FMT_YUV420P;
    encoder->colorspace = AVCOL_SPC_BT709;
    encoder->color_range = AVCOL_RANGE_MPEG;
    encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    ffmpeg().av_opt_set(encoder->priv_data, "crf", "8",
                        0);  // little loss besides color at half resolution
    check(ffmpeg().avcodec_open2(encoder.get(), codec, nullptr));
    converter.reset(ffmpeg().sws_getContext(width, height, AV_PIX_FMT_RGBA, width, height, AV_PIX_FMT_YUV420P,
                                            SWS_BILINEAR | SWS_ACCURATE_RND, nullptr, nullptr, nullptr));
    if (!converter) throw std::bad_alloc();
    ffmpeg().sws_setColorspaceDetails(converter.get(), ffmpeg().sws_getCoefficients(SWS_CS_DEFAULT), 1,
                                      ffmpeg().sws_getCoefficients(SWS_CS_ITU709), 0, 0, 1 << 16, 1 << 16);
  }

  void open_container(int rate) {
    AVFormatContext* context = nullptr;
    check(ffmpeg().avformat_alloc_output_context2(&context, nullptr, "mp4", name.c_str()));
    container.reset(context);
    check(ffmpeg().avio_open(&container->pb, name.c_str(), AVIO_FLAG_WRITE));
    AVStream* stream = ffmpeg().avformat_new_stream(context, nullptr);
    if (stream == nullptr) throw std::bad_alloc();
    check(ffmpeg().avcodec_parameters_from_context(stream->codecpar, encoder.get()));
    stream->time_base = encoder->time_base;
    stream->avg_frame_rate = {rate, 1};
    check(ffmpeg().avformat_write_header(context, nullptr));
  }

  /// Encodes a frame; null flushes the encoder.
  void encode(const AVFrame* frame) {
    check(ffmpeg().avcodec_send_frame(encoder.get(), frame));
    while (ffmpeg().avcodec_receive_packet(encoder.get(), packet.get()) >= 0) {
      ffmpeg().av_packet_rescale_ts(packet.get(), encoder->time_base, container->streams[0]->time_base);
      packet->stream_index = 0;
      check(ffmpeg().av_interleaved_write_frame(container.get(), packet.get()));
    }
  }
};

VideoWriter::VideoWriter(const std::filesystem::path& file, int width, int height, int rate)
    : state_(std::make_unique<State>()) {
  state_->name = file.string();
  state_->open_encoder(width, height, rate);
  state_->open_container(rate);
}

VideoWriter::~VideoWriter() = default;

void VideoWriter::add(const std::vector<std::uint32_t>& color) {
  State& s = *state_;
  const Owned<AVFrame> frame(ffmpeg().av_frame_alloc());
  frame->width = s.encoder->width;
  frame->height = s.encoder->height;
  frame->format = AV_PIX_FMT_YUV420P;
  s.check(ffmpeg().av_frame_get_buffer(frame.get(), 0));
  const std::uint8_t* from[1] = {reinterpret_cast<const std::uint8_t*>(color.data())};
  const int stride[1] = {4 * frame->width};
  s.check(ffmpeg().sws_scale(s.converter.get(), from, stride, 0, frame->height, frame->data, frame->linesize));
  frame->pts = s.images++;
  s.encode(frame.get());
}

void VideoWriter::finish() {
  state_->encode(nullptr);
  state_->check(ffmpeg().av_write_trailer(state_->container.get()));
}

}  // namespace cairn
