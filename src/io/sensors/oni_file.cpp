// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Records of OpenNI recordings, as defined in Source/Drivers/OniFile/DataRecords.h of OpenNI2.
#include "io/sensors/oni_file.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace cairn {
namespace {

constexpr std::size_t kFileHeader = 24, kRecordHeader = 28;  // bytes
constexpr std::uint32_t kRecordMagic = 0x0052494e;           // "NIR"
constexpr std::uint32_t kMaxNodes = 64, kMaxFields = 1 << 20, kMaxPayload = 1 << 28;
constexpr std::uint32_t kMinSide = 16, kMaxSide = 4096;  // pixels of an image
constexpr std::size_t kSeekEntry = 20;                   // time, number, place

enum Kind : std::uint32_t {
  kNodeAdded4 = 0x02,  // format 1.0.0.4; kNodeAdded5: 1.0.0.5
  kIntProperty,
  kRealProperty,
  kStringProperty,
  kGeneralProperty,
  kNodeRemoved,
  kDataBegin,
  kStateReady,
  kNewData,
  kEnd,
  kNodeAdded5,  // format 1.0.0.5
  kNodeAdded,
  kSeekTable
};

template <class T>
T number_at(std::string_view bytes, std::size_t at) {
  if (at > bytes.size() || sizeof(T) > bytes.size() - at) throw std::runtime_error("a record is too short");
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

/// Reads a length and a text of as many bytes, the last of them 0; advances past the text.
std::string_view text_in(std::string_view& fields) {
  const auto length = number_at<std::uint32_t>(fields, 0);
  if (length == 0 || length > fields.size() - 4 || fields[4 + length - 1] != '\0')
    throw std::runtime_error("a name is not terminated");
  const std::string_view text = fields.substr(4, length - 1);
  fields.remove_prefix(4 + length);
  return text;
}

void check_property(std::uint32_t kind, std::string_view fields) {
  const std::string_view name = text_in(fields);
  const auto size = number_at<std::uint32_t>(fields, 0);
  const std::string_view value = fields.substr(4);
  if (size != value.size()) throw std::runtime_error("a property has a wrong size");
  if ((kind == kIntProperty || kind == kRealProperty) && size != 8)
    throw std::runtime_error("a number does not have eight bytes");
  if (kind == kStringProperty && (value.empty() || value.back() != '\0'))
    throw std::runtime_error("a text is not terminated");
  if (kind == kGeneralProperty && name == "xnMapOutputMode")
    for (const std::size_t at : {0, 4})
      if (const auto side = number_at<std::uint32_t>(value, at); side < kMinSide || side > kMaxSide)
        throw std::runtime_error(
            fmt::format("an image has {} pixels per side, allowed: {} to {}", side, kMinSide, kMaxSide));
}

void check_fields(std::uint32_t kind, std::string_view fields) {
  switch (kind) {
    case kIntProperty:
    case kRealProperty:
    case kStringProperty:
    case kGeneralProperty:
      return check_property(kind, fields);
    case kNodeAdded4:
    case kNodeAdded5:
    case kNodeAdded:
      (void)text_in(fields);
      // Kind and codec; number of frames, first and last time; position of the seek table.
      if (fields.size() != (kind == kNodeAdded ? 36u : kind == kNodeAdded5 ? 28u : 8u))
        throw std::runtime_error("a node has a wrong size");
      return;
    case kDataBegin:
    case kNewData:
      if (fields.size() != 12) throw std::runtime_error("a record has a wrong size");
      return;
    case kNodeRemoved:
    case kStateReady:
    case kEnd:
    case kSeekTable:
      if (!fields.empty()) throw std::runtime_error("a record has a wrong size");
      return;
    default:
      throw std::runtime_error(fmt::format("a record has the unknown kind {}", kind));
  }
}

class OniFile {
 public:
  explicit OniFile(const std::filesystem::path& file) : in_(file, std::ios::binary) {
    size_ = std::filesystem::file_size(file);
  }

  void check() {
    if (size_ < kFileHeader) return;  // truncated: OpenNI2 reports the error
    const std::string_view header = read(kFileHeader);
    if (!header.starts_with("NI10")) throw std::runtime_error("it is not an OpenNI recording");
    if (number_at<std::uint32_t>(header, 20) > kMaxNodes) throw std::runtime_error("it has too many nodes");
    at_ = kFileHeader;
    while (size_ - at_ >= kRecordHeader && check_record()) {
    }
  }
  [[nodiscard]] std::uint64_t at() const { return at_; }

 private:
  /// Returns false at the last record.
  bool check_record() {
    const std::string_view header = read(kRecordHeader);
    const auto magic = number_at<std::uint32_t>(header, 0), kind = number_at<std::uint32_t>(header, 4),
               node = number_at<std::uint32_t>(header, 8), fields = number_at<std::uint32_t>(header, 12),
               payload = number_at<std::uint32_t>(header, 16);
    if (magic != kRecordMagic) throw std::runtime_error("no record starts here");
    if (fields < kRecordHeader || fields > kMaxFields || payload > kMaxPayload)
      throw std::runtime_error("a record has an impossible size");
    if (kind != kEnd && node > kMaxNodes) throw std::runtime_error("a record has an unknown node");
    if (size_ - at_ < std::uint64_t{fields} + payload) return false;  // truncated
    check_fields(kind, read(fields - kRecordHeader));
    if (kind == kSeekTable) check_seek_table(payload);
    at_ += std::uint64_t{fields} + payload;
    in_.seekg(static_cast<std::streamoff>(at_));
    return kind != kEnd;
  }

  void check_seek_table(std::uint32_t size) {
    if (size % kSeekEntry != 0) throw std::runtime_error("a seek table has a wrong size");
    const std::string_view table = read(size);
    for (std::size_t i = 0; i < size; i += kSeekEntry)
      if (number_at<std::uint64_t>(table, i + 12) >= size_)
        throw std::runtime_error("a seek table points outside the file");
  }

  std::string_view read(std::size_t count) {
    buffer_.resize(count);
    if (!in_.read(buffer_.data(), static_cast<std::streamsize>(count))) throw std::runtime_error("it cannot be read");
    return {buffer_.data(), count};
  }

  std::ifstream in_;
  std::uint64_t size_ = 0, at_ = 0;
  std::vector<char> buffer_;
};

}  // namespace

void check_oni(const std::filesystem::path& file) {
  OniFile oni(file);
  try {
    oni.check();
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: is cut off or not a readable OpenNI recording: at byte {}, {}",
                                         file.string(), oni.at(), error.what()));
  }
}

}  // namespace cairn
