// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/exr_image.hpp"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/words.hpp"

namespace cairn {
namespace {

constexpr std::size_t kPreambleSize = 8;          // bytes of the magic number, version and flags
constexpr std::uint8_t kUnsupportedFlags = 0x18;  // flags of deep data and multi-part files, in the second byte
constexpr std::uint64_t kMaxRatio = 1500;         // maximum compression ratio, as for TIFF
constexpr std::uint64_t kFreeSize = 1 << 16;      // bytes allowed for any file
constexpr std::uint64_t kMinChannelSize = 18;     // minimum bytes of a channel in the header
constexpr const char* kRemedy = "save one channel of 32-bit floats, in scan lines compressed with ZIP";

/// Type of a header attribute, with the bytes that OpenEXR reads for its value (0: as many as the header says).
struct AttributeType {
  std::string_view name;
  std::size_t bytes;
};

/// Types of header attributes with memory bounded by their size in the file.
constexpr std::array<AttributeType, 26> kAttributeTypes{
    {{"box2i", 16},      {"box2f", 16}, {"chlist", 0},   {"chromaticities", 32},
     {"compression", 1}, {"double", 8}, {"envmap", 1},   {"float", 4},
     {"floatvector", 0}, {"int", 4},    {"keycode", 28}, {"lineOrder", 1},
     {"m33d", 72},       {"m33f", 36},  {"m44d", 128},   {"m44f", 64},
     {"rational", 8},    {"string", 0}, {"tiledesc", 9}, {"timecode", 8},
     {"v2d", 16},        {"v2f", 8},    {"v2i", 8},      {"v3d", 24},
     {"v3f", 12},        {"v3i", 12}}};

std::runtime_error damaged() { return std::runtime_error("is not a readable EXR file: damaged or cut off"); }

template <class T>
T value_of(std::string_view bytes) {
  T value;
  if (bytes.size() < sizeof value) throw damaged();
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

cv::Rect rect_of(const std::array<std::int32_t, 4>& box, std::uint32_t max_side) {
  constexpr std::int32_t kMaxOffset = 1 << 20;  // pixels, maximum offset of a corner
  const std::int64_t width = std::int64_t{box[2]} - box[0] + 1, height = std::int64_t{box[3]} - box[1] + 1;
  if (width < 1 || height < 1 || width > max_side || height > max_side)
    throw std::runtime_error(fmt::format("has {} x {} pixels, allowed: 1 to {} per side", width, height, max_side));
  if (box[0] < -kMaxOffset || box[0] > kMaxOffset || box[1] < -kMaxOffset || box[1] > kMaxOffset) throw damaged();
  return {box[0], box[1], static_cast<int>(width), static_cast<int>(height)};
}

/// Windows of the stored pixels and of the image.
struct Windows {
  cv::Rect data, display;
};

/// Bytes of a channel list with its end: per channel a name, its null byte and 16 bytes.
std::size_t size_of_channel_list(std::string_view value) {
  constexpr std::size_t kChannelValues = 16;
  std::size_t at = 0;
  while (at < value.size() && value[at] != '\0') {
    const std::size_t end = value.find('\0', at);
    if (end == value.npos) throw damaged();
    at = end + 1 + kChannelValues;
  }
  return at + 1;
}

/// Checks a value's size. OpenEXR reads most values without their size: with a wrong size it takes other bytes for the
/// next attribute than `check_header`.
void check_size(const AttributeType& type, std::string_view value) {
  const std::size_t size = type.name == "chlist"        ? size_of_channel_list(value)
                           : type.name == "floatvector" ? value.size() / sizeof(float) * sizeof(float)
                           : type.bytes == 0            ? value.size()
                                                        : type.bytes;
  if (size != value.size()) throw damaged();
}

/// Checks the header's attributes (name, type, size, value) before OpenEXR allocates memory for them.
Windows check_header(std::string_view all, std::uint32_t max_side) {
  if (all.size() < kPreambleSize) throw damaged();
  if ((static_cast<std::uint8_t>(all[5]) & kUnsupportedFlags) != 0)
    throw std::runtime_error(fmt::format("is a multi-part or deep EXR file; {}", kRemedy));
  std::string_view left = all.substr(kPreambleSize);
  const auto take = [&](std::size_t size) {
    if (size > left.size()) throw damaged();
    const std::string_view taken = left.substr(0, size);
    left.remove_prefix(size);
    return taken;
  };
  const auto text = [&] {
    const std::string_view found = take(left.find('\0') == left.npos ? left.size() : left.find('\0'));
    take(1);
    return found;
  };
  std::optional<cv::Rect> data, display;
  std::uint64_t channels = 0;
  for (auto name = text(); !name.empty(); name = text()) {
    const std::string_view type = text(), value = take(value_of<std::uint32_t>(take(4)));
    const auto* known =
        std::find_if(kAttributeTypes.begin(), kAttributeTypes.end(), [&](const auto& t) { return t.name == type; });
    if (known == kAttributeTypes.end())
      throw std::runtime_error(fmt::format("is an EXR file with an attribute of type '{}', which is not supported; {}",
                                           shown(type), kRemedy));
    check_size(*known, value);
    if (type == "box2i" && name == "dataWindow") data = rect_of(value_of<std::array<std::int32_t, 4>>(value), max_side);
    if (type == "box2i" && name == "displayWindow")
      display = rect_of(value_of<std::array<std::int32_t, 4>>(value), max_side);
    if (type == "chlist") channels += value.size() / kMinChannelSize + 1;
  }
  if (!data || !display) throw damaged();
  if (4 * channels * static_cast<std::uint64_t>(data->area()) > all.size() * kMaxRatio + kFreeSize)
    throw std::runtime_error("the file is cut off");
  return {*data, *display};
}

class Bytes final : public Imf::IStream {
 public:
  explicit Bytes(std::span<const std::uint8_t> all) : IStream("depth"), all_(all) {}
  bool read(char to[], int count) override {
    if (count < 0 || static_cast<std::uint64_t>(count) > all_.size() - at_) throw damaged();
    std::memcpy(to, all_.data() + at_, static_cast<std::size_t>(count));
    at_ += static_cast<std::uint64_t>(count);
    return at_ < all_.size();
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t position) override {
    if (position > all_.size()) throw damaged();
    at_ = position;
  }

 private:
  std::span<const std::uint8_t> all_;
  std::uint64_t at_ = 0;
};

/// Names of the channels to read: depth, or R, G and B if equal.
std::vector<std::string> channels_of(const Imf::ChannelList& list) {
  std::vector<std::string> names;
  for (auto it = list.begin(); it != list.end(); ++it) {
    names.emplace_back(it.name());
    if (it.channel().xSampling != 1 || it.channel().ySampling != 1)
      throw std::runtime_error(fmt::format("is an EXR file with subsampled channels; {}", kRemedy));
  }
  const auto has = [&](std::string_view name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  if (has("Z")) return {"Z"};
  if (has("R") && has("G") && has("B")) return {"R", "G", "B"};
  for (const char* name : {"Y", "R", "V"})
    if (has(name)) return {name};
  for (const std::string& name : names)
    if (name.ends_with(".Z") || name.ends_with(".V")) return {name};
  if (names.size() == 1) return names;
  throw std::runtime_error(
      fmt::format("is an EXR file of {} channels, none of them Z, Y or R; {}", names.size(), kRemedy));
}

/// Pixels of the data window, one image per channel.
std::vector<cv::Mat1f> read_channels(Imf::InputFile& file, const std::vector<std::string>& names,
                                     const cv::Rect& window) {
  std::vector<cv::Mat1f> images;
  Imf::FrameBuffer buffer;
  for (const std::string& name : names) {
    images.emplace_back(window.size(), 0.0f);
    const std::ptrdiff_t origin = std::ptrdiff_t{window.y} * window.width + window.x;
    buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(images.back().ptr<float>() - origin),
                                   sizeof(float), sizeof(float) * static_cast<std::size_t>(window.width), 1, 1, 0.0));
  }
  file.setFrameBuffer(buffer);
  file.readPixels(window.y, window.y + window.height - 1);
  return images;
}

bool are_equal(const cv::Mat1f& a, const cv::Mat1f& b) {
  return std::equal(a.begin(), a.end(), b.begin(),
                    [](float x, float y) { return x == y || (std::isnan(x) && std::isnan(y)); });
}

}  // namespace

cv::Mat decode_exr(std::span<const std::uint8_t> all, std::uint32_t max_side) {
  const auto [data, display] = check_header({reinterpret_cast<const char*>(all.data()), all.size()}, max_side);
  try {
    const int max_size = static_cast<int>(max_side);
    Imf::Header::setMaxImageSize(max_size, max_size);
    Imf::Header::setMaxTileSize(max_size, max_size);
    Bytes bytes(all);
    Imf::InputFile file(bytes, 0);
    const auto images = read_channels(file, channels_of(file.header().channels()), data);
    for (const cv::Mat1f& image : images)
      if (!are_equal(image, images[0]))
        throw std::runtime_error(fmt::format("is an EXR color image, not depth: its R, G and B differ; {}", kRemedy));
    if ((data & display) != data || data == display) return images[0];
    cv::Mat1f full(display.size(), 0.0f);
    images[0].copyTo(full(data - display.tl()));
    return full;
  } catch (const std::runtime_error&) {
    throw;
  } catch (const std::exception&) {  // from OpenEXR
    throw damaged();
  }
}

}  // namespace cairn
