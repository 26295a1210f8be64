// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/videos.hpp"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>

namespace cairn {
namespace {

void must(int result, const char* what) {
  if (result < 0) throw std::logic_error(std::string("cannot write a video for a test: ") + what);
}

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

Owned<AVFormatContext> container(const std::filesystem::path& file, const char* format) {
  av_log_set_level(AV_LOG_QUIET);
  AVFormatContext* context = nullptr;
  must(avformat_alloc_output_context2(&context, nullptr, format, file.c_str()), "container");
  Owned<AVFormatContext> owned(context);
  must(avio_open(&context->pb, file.c_str(), AVIO_FLAG_WRITE), file.c_str());
  return owned;
}

void set_tags(AVDictionary*& dictionary, const std::map<std::string, std::string>& tags) {
  for (const auto& [key, value] : tags) av_dict_set(&dictionary, key.c_str(), value.c_str(), 0);
}

void set_extradata(AVCodecParameters& codec, const std::string& bytes) {
  codec.extradata = static_cast<std::uint8_t*>(av_mallocz(bytes.size() + AV_INPUT_BUFFER_PADDING_SIZE));
  codec.extradata_size = static_cast<int>(bytes.size());
  std::memcpy(codec.extradata, bytes.data(), bytes.size());
}

void add_track(AVFormatContext* context, const MatroskaFile::Track& track) {
  AVStream& stream = *avformat_new_stream(context, nullptr);
  AVCodecParameters& codec = *stream.codecpar;
  const bool samples = track.codec == MatroskaFile::Codec::samples;
  codec.codec_type = samples ? AVMEDIA_TYPE_SUBTITLE : AVMEDIA_TYPE_VIDEO;
  codec.codec_id = samples                                     ? AV_CODEC_ID_SUBRIP
                   : track.codec == MatroskaFile::Codec::mjpeg ? AV_CODEC_ID_MJPEG
                   : track.codec == MatroskaFile::Codec::mpeg4 ? AV_CODEC_ID_MPEG4
                                                               : AV_CODEC_ID_RAWVIDEO;
  codec.width = track.width;
  codec.height = track.height;
  if (track.rate > 0) stream.avg_frame_rate = {track.rate, 1};
  set_tags(stream.metadata, track.tags);
}

/// Writes the pixel format of raw images into their bitmap headers, which the muxer leaves empty.
void put_fourcc(const std::filesystem::path& file, const std::vector<MatroskaFile::Track>& tracks) {
  std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
  const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
  std::size_t at = 0;
  for (const auto& track : tracks) {
    if (track.codec != MatroskaFile::Codec::raw) continue;
    at = bytes.find(std::string("\1\0\x18\0\0\0\0\0", 8), bytes.find("V_MS/VFW/FOURCC", at)) + 4;
    stream.seekp(static_cast<std::streamoff>(at));
    stream << track.fourcc;
  }
}

}  // namespace

void MatroskaFile::write(const std::filesystem::path& file) const {
  const auto context = container(file, "matroska");
  set_tags(context->metadata, tags);
  for (const Track& track : tracks) add_track(context.get(), track);
  if (!attachment_name.empty()) {
    AVStream& stream = *avformat_new_stream(context.get(), nullptr);
    stream.codecpar->codec_type = AVMEDIA_TYPE_ATTACHMENT;
    set_extradata(*stream.codecpar, attachment);
    set_tags(stream.metadata, {{"filename", attachment_name}, {"mimetype", "application/octet-stream"}});
  }
  AVDictionary* options = nullptr;
  av_dict_set(&options, "allow_raw_vfw", "1", 0);
  const int begun = avformat_write_header(context.get(), &options);
  av_dict_free(&options);
  must(begun, "header");
  const Owned<AVPacket> out(av_packet_alloc());
  for (const Packet& packet : packets) {
    must(av_new_packet(out.get(), static_cast<int>(packet.bytes.size())), "packet");
    std::memcpy(out->data, packet.bytes.data(), packet.bytes.size());
    out->stream_index = packet.track;
    out->pts = out->dts = std::llround(packet.time * 1000);
    out->duration = 1;
    out->flags = AV_PKT_FLAG_KEY;
    must(av_write_frame(context.get(), out.get()), "packet");
    av_packet_unref(out.get());
  }
  must(av_write_trailer(context.get()), "end");
  avio_closep(&context->pb);
  put_fourcc(file, tracks);
}

void write_mp4(const std::filesystem::path& file, const std::vector<std::vector<std::uint32_t>>& images, int width,
               int height, int rate, const char* codec_name) {
  const auto context = container(file, "mp4");
  const AVCodec* codec = avcodec_find_encoder_by_name(codec_name);
  if (codec == nullptr) throw std::logic_error(std::string("there is no encoder ") + codec_name);
  const Owned<AVCodecContext> encoder(avcodec_alloc_context3(codec));
  encoder->width = width;
  encoder->height = height;
  encoder->time_base = {1, rate};
  encoder->framerate = {rate, 1};
  encoder->pix_fmt = AV_PIX_FMT_YUV420P;
  encoder->colorspace = AVCOL_SPC_BT709;
  encoder->color_range = AVCOL_RANGE_MPEG;
  encoder->max_b_frames = 2;
  encoder->bit_rate = 8'000'000;
  encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  av_opt_set(encoder->priv_data, "crf", "8", 0);
  av_opt_set(encoder->priv_data, "x265-params", "log-level=none", 0);
  must(avcodec_open2(encoder.get(), codec, nullptr), "encoder");
  AVStream& stream = *avformat_new_stream(context.get(), nullptr);
  must(avcodec_parameters_from_context(stream.codecpar, encoder.get()), "stream");
  stream.time_base = encoder->time_base;
  stream.avg_frame_rate = encoder->framerate;
  auto* turn = reinterpret_cast<std::int32_t*>(
      av_stream_new_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, 9 * sizeof(std::int32_t)));
  av_display_rotation_set(turn, 90);
  must(avformat_write_header(context.get(), nullptr), "header");
  const Owned<SwsContext> converter(sws_getContext(width, height, AV_PIX_FMT_RGBA, width, height, AV_PIX_FMT_YUV420P,
                                                   SWS_BILINEAR | SWS_ACCURATE_RND, nullptr, nullptr, nullptr));
  sws_setColorspaceDetails(converter.get(), sws_getCoefficients(SWS_CS_DEFAULT), 1, sws_getCoefficients(SWS_CS_ITU709),
                           0, 0, 1 << 16, 1 << 16);
  const Owned<AVPacket> out(av_packet_alloc());
  const auto write_packets = [&] {
    while (avcodec_receive_packet(encoder.get(), out.get()) >= 0) {
      av_packet_rescale_ts(out.get(), encoder->time_base, stream.time_base);
      out->stream_index = 0;
      must(av_interleaved_write_frame(context.get(), out.get()), "packet");
    }
  };
  for (std::size_t i = 0; i < images.size(); ++i) {
    const Owned<AVFrame> frame(av_frame_alloc());
    frame->width = width;
    frame->height = height;
    frame->format = AV_PIX_FMT_YUV420P;
    must(av_frame_get_buffer(frame.get(), 0), "image");
    const std::uint8_t* from[1] = {reinterpret_cast<const std::uint8_t*>(images[i].data())};
    const int stride[1] = {4 * width};
    sws_scale(converter.get(), from, stride, 0, height, frame->data, frame->linesize);
    frame->pts = static_cast<std::int64_t>(i);
    must(avcodec_send_frame(encoder.get(), frame.get()), "image");
    write_packets();
  }
  must(avcodec_send_frame(encoder.get(), nullptr), "end");
  write_packets();
  must(av_write_trailer(context.get()), "end");
}

}  // namespace cairn
