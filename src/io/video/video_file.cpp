// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/video/video_file.hpp"

#include <limits>
#include <new>
#include <stdexcept>

#include "io/video/ffmpeg.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr int kMaxSide = 4096;  // pixels, the limit of Camera
constexpr int kBlock = 64;      // pixels, largest block size of codecs
constexpr double kNoTime = -std::numeric_limits<double>::infinity();

VideoTags tags_of(const AVDictionary* dictionary) {
  VideoTags tags;
  const AVDictionaryEntry* entry = nullptr;
  while ((entry = ffmpeg().av_dict_get(dictionary, "", entry, AV_DICT_IGNORE_SUFFIX)) != nullptr)
    tags[entry->key] = entry->value;
  return tags;
}

template <class T>
T* require(T* pointer) {
  if (pointer == nullptr) throw std::bad_alloc();
  return pointer;
}

}  // namespace

VideoPacket::VideoPacket(AVPacket* owned, double time) : packet_(owned), time_(time) {}
void VideoPacket::Free::operator()(AVPacket* packet) const { ffmpeg().av_packet_free(&packet); }
int VideoPacket::track() const { return packet_->stream_index; }
std::int64_t VideoPacket::position() const { return packet_->pos; }
std::span<const std::uint8_t> VideoPacket::bytes() const {
  return {packet_->data, static_cast<std::size_t>(packet_->size)};
}

void VideoFile::Close::operator()(AVFormatContext* context) const { ffmpeg().avformat_close_input(&context); }

VideoFile::VideoFile(const fs::path& file, Format format) : name_(file.string()) {
  if (!fs::exists(file)) throw std::runtime_error(name_ + ": there is no such file");
  if (!fs::is_regular_file(file)) throw std::runtime_error(name_ + ": is not a file");
  if (fs::file_size(file) == 0) throw std::runtime_error(name_ + ": is empty");
  const bool matroska = format == Format::matroska;
  AVDictionary* options = nullptr;
  ffmpeg().av_dict_set(&options, "protocol_whitelist", "file", 0);
  AVFormatContext* context = nullptr;
  const int error = ffmpeg().avformat_open_input(
      &context, ("file:" + name_).c_str(), ffmpeg().av_find_input_format(matroska ? "matroska" : "mp4"), &options);
  ffmpeg().av_dict_free(&options);
  if (error < 0)
    throw std::runtime_error(name_ + ": is cut off or not " + (matroska ? "a Matroska" : "an MP4") + " file (" +
                             ffmpeg_error(error) + "); copy it again");
  context_.reset(context);
  tags_ = tags_of(context->metadata);
  for (unsigned i = 0; i < context->nb_streams; ++i) {
    const AVStream& stream = *context->streams[i];
    const AVCodecParameters& codec = *stream.codecpar;
    const AVRational rate = stream.avg_frame_rate;
    tracks_.push_back({.is_video = codec.codec_type == AVMEDIA_TYPE_VIDEO,
                       .codec = ffmpeg().avcodec_get_name(codec.codec_id),
                       .width = codec.width,
                       .height = codec.height,
                       .interval = rate.num > 0 && rate.den > 0 ? av_q2d(av_inv_q(rate)) : 0,
                       .tags = tags_of(stream.metadata)});
    if (codec.codec_type == AVMEDIA_TYPE_ATTACHMENT && codec.extradata != nullptr)
      attachments_.push_back(
          {.tags = tracks_.back().tags,
           .bytes = {reinterpret_cast<const char*>(codec.extradata), static_cast<std::size_t>(codec.extradata_size)}});
  }
}

std::optional<VideoPacket> VideoFile::next() {
  VideoPacket packet(require(ffmpeg().av_packet_alloc()), kNoTime);
  const int error = ffmpeg().av_read_frame(context_.get(), packet.packet_.get());
  if (error == AVERROR_EOF) return std::nullopt;
  if (error < 0) throw std::runtime_error(name_ + ": cannot be read further (" + ffmpeg_error(error) + ")");
  const AVPacket& read = *packet.packet_;
  if (read.pts != AV_NOPTS_VALUE)
    packet.time_ = static_cast<double>(read.pts) * av_q2d(context_->streams[read.stream_index]->time_base);
  return packet;
}

void VideoImage::Free::operator()(AVFrame* frame) const { ffmpeg().av_frame_free(&frame); }
int VideoImage::width() const { return frame_->width; }
int VideoImage::height() const { return frame_->height; }

std::vector<std::uint32_t> VideoImage::color() const {
  struct FreeConverter {
    void operator()(SwsContext* context) const { ffmpeg().sws_freeContext(context); }
  };
  const auto format = static_cast<AVPixelFormat>(frame_->format);
  const std::unique_ptr<SwsContext, FreeConverter> converter(
      ffmpeg().sws_getContext(width(), height(), format, width(), height(), AV_PIX_FMT_RGBA,
                              SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT, nullptr, nullptr, nullptr));
  if (converter == nullptr) throw std::runtime_error("its pixel format is not a color format");
  const int full = frame_->color_range == AVCOL_RANGE_JPEG || format == AV_PIX_FMT_YUVJ420P ||
                   format == AV_PIX_FMT_YUVJ422P || format == AV_PIX_FMT_YUVJ444P;
  // Fails for RGB pixels, which need no conversion.
  (void)ffmpeg().sws_setColorspaceDetails(converter.get(), ffmpeg().sws_getCoefficients(frame_->colorspace), full,
                                          ffmpeg().sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, 1 << 16, 1 << 16);
  std::vector<std::uint32_t> pixels(static_cast<std::size_t>(width()) * static_cast<std::size_t>(height()));
  std::uint8_t* const to[4] = {reinterpret_cast<std::uint8_t*>(pixels.data())};
  const int stride[4] = {4 * width()};
  if (ffmpeg().sws_scale(converter.get(), frame_->data, frame_->linesize, 0, height(), to, stride) != height())
    throw std::runtime_error("its color cannot be converted");
  for (auto& pixel : pixels) pixel |= 0xff000000u;
  return pixels;
}

std::vector<std::uint16_t> VideoImage::gray() const {
  if (frame_->format != AV_PIX_FMT_GRAY16BE && frame_->format != AV_PIX_FMT_GRAY16LE)
    throw std::runtime_error("is not a 16-bit gray image");
  const bool big_endian = frame_->format == AV_PIX_FMT_GRAY16BE;
  std::vector<std::uint16_t> pixels;
  pixels.reserve(static_cast<std::size_t>(width()) * static_cast<std::size_t>(height()));
  for (int y = 0; y < height(); ++y) {
    const std::uint8_t* row = frame_->data[0] + static_cast<std::ptrdiff_t>(y) * frame_->linesize[0];
    for (int x = 0; x < width(); ++x, row += 2)
      pixels.push_back(static_cast<std::uint16_t>(big_endian ? row[0] << 8 | row[1] : row[1] << 8 | row[0]));
  }
  return pixels;
}

void VideoDecoder::Free::operator()(AVCodecContext* context) const { ffmpeg().avcodec_free_context(&context); }

VideoDecoder::VideoDecoder(const VideoFile& file, int track) : tick_(av_q2d(file.context_->streams[track]->time_base)) {
  const AVCodecParameters* parameters = file.context_->streams[track]->codecpar;
  const AVCodec* codec = ffmpeg().avcodec_find_decoder(parameters->codec_id);
  if (codec == nullptr)
    throw std::runtime_error(std::string("FFmpeg cannot decode ") + ffmpeg().avcodec_get_name(parameters->codec_id));
  context_.reset(require(ffmpeg().avcodec_alloc_context3(codec)));
  int error = ffmpeg().avcodec_parameters_to_context(context_.get(), parameters);
  // A packet may declare a larger size than its track, and FFmpeg allocates memory for it; codecs round sizes up.
  const bool has_size = parameters->width > 0 && parameters->width <= kMaxSide && parameters->height > 0 &&
                        parameters->height <= kMaxSide;
  context_->max_pixels = has_size ? std::int64_t{parameters->width + kBlock} * (parameters->height + kBlock)
                                  : std::int64_t{kMaxSide} * kMaxSide;
  context_->thread_type = FF_THREAD_SLICE;  // frame threads would delay images
  // By default, the rest of a damaged JPEG is decoded as gray.
  if (codec->id == AV_CODEC_ID_MJPEG) context_->err_recognition = AV_EF_EXPLODE;
  if (error >= 0) error = ffmpeg().avcodec_open2(context_.get(), codec, nullptr);
  if (error < 0)
    throw std::runtime_error("its " + std::string(codec->name) + " cannot be decoded (" + ffmpeg_error(error) + ")");
}

void VideoDecoder::put(const VideoPacket& packet) {
  const int error = ffmpeg().avcodec_send_packet(context_.get(), packet.packet_.get());
  if (error < 0) throw std::runtime_error("cannot be decoded (" + ffmpeg_error(error) + ")");
}

void VideoDecoder::end() { (void)ffmpeg().avcodec_send_packet(context_.get(), nullptr); }

std::optional<VideoImage> VideoDecoder::next() {
  VideoImage image(require(ffmpeg().av_frame_alloc()), kNoTime);
  const int error = ffmpeg().avcodec_receive_frame(context_.get(), image.frame_.get());
  if (error == AVERROR(EAGAIN) || error == AVERROR_EOF) return std::nullopt;
  if (error < 0) throw std::runtime_error("cannot be decoded (" + ffmpeg_error(error) + ")");
  if (image.frame_->pts != AV_NOPTS_VALUE) image.time_ = static_cast<double>(image.frame_->pts) * tick_;
  return image;
}

}  // namespace cairn
