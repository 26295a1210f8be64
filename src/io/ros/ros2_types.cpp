// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/ros2_types.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

namespace cairn {
namespace {

// Serializer instructions of Cyclone DDS 0.10 (dds_opcodes.h).
constexpr std::uint32_t kField = 1u << 24, kString = 5, kSequence = 7, kArray = 8, kStruct = 10;
constexpr std::uint32_t kPointer = sizeof(void*), kSequenceSize = 3 * kPointer;

/// Fields of a message type: b, w, d are numbers of 1, 4 and 8 bytes, s is a string; a capital letter is a list, a
/// count after a letter an array, and parentheses enclose the fields of a list's entries. Nested messages are
/// flattened, as in CDR.
struct Type {
  std::string_view name, fields;
};
constexpr std::array kTypes{
    Type{"sensor_msgs/Image", "wwswwsbwB"},
    Type{"sensor_msgs/CompressedImage", "wwssB"},
    Type{"sensor_msgs/CameraInfo", "wwswwsDd9d9d12wwwwwwb"},
    Type{"sensor_msgs/Imu", "wwsd4d9d3d9d3d9"},
    Type{"tf2_msgs/TFMessage", "(wwssd7)"},
    Type{"geometry_msgs/PoseStamped", "wwsd7"},
    Type{"sensor_msgs/PointCloud2", "wwsww(swbw)bwwBb"},
};

std::uint32_t aligned(std::uint32_t offset, std::uint32_t to) { return (offset + to - 1) / to * to; }

/// Translates fields to instructions.
class Compiler {
 public:
  /// Appends the instructions of `fields` up to the end or a closing parenthesis, and then of the entries of its lists.
  /// Returns the size in memory, bytes.
  std::uint32_t compile(std::string_view fields) {
    struct List {
      std::size_t at;  // its instruction
      std::string_view fields;
    };
    std::vector<List> lists;
    offset_ = 0;
    while (!fields.empty() && fields[0] != ')') {
      const char letter = fields[0];
      fields.remove_prefix(1);
      if (letter == '(') {
        lists.push_back({layout_.instructions.size(), fields});
        put(kSequence << 16 | kStruct << 8, kSequenceSize, kPointer);
        layout_.instructions.insert(layout_.instructions.end(), {0, 0});  // set below
        fields.remove_prefix(fields.find(')') + 1);
      } else {
        put_field(letter, take_count(fields));
      }
    }
    layout_.instructions.push_back(0);  // end
    ++layout_.count;
    const std::uint32_t size = aligned(offset_, kPointer);
    for (const List& list : lists) {
      const auto entry = static_cast<std::uint32_t>(layout_.instructions.size() - list.at);
      layout_.instructions[list.at + 2] = compile(list.fields);
      layout_.instructions[list.at + 3] = 4u << 16 | entry;
    }
    return size;
  }
  Ros2Layout compiled(std::string_view fields) {
    layout_.size = compile(fields);
    return std::move(layout_);
  }

 private:
  static std::uint32_t take_count(std::string_view& fields) {
    std::uint32_t count = 0;
    const char* const end = std::from_chars(fields.data(), fields.data() + fields.size(), count).ptr;
    fields.remove_prefix(static_cast<std::size_t>(end - fields.data()));
    return count;
  }
  void put(std::uint32_t type, std::uint32_t bytes, std::uint32_t alignment) {
    offset_ = aligned(offset_, alignment);
    layout_.instructions.insert(layout_.instructions.end(), {kField | type, offset_});
    ++layout_.count;
    offset_ += bytes;
  }
  void put_field(char letter, std::uint32_t count) {
    if (letter == 's') return put(kString << 16, kPointer, kPointer);
    const bool is_list = letter == 'B' || letter == 'D';
    const std::uint32_t number = letter == 'w' ? 3 : letter == 'b' || letter == 'B' ? 1 : 4;
    if (is_list) return put(kSequence << 16 | number << 8, kSequenceSize, kPointer);
    const std::uint32_t bytes = 1u << (number - 1);
    if (count == 0) return put(number << 16, bytes, bytes);
    put(kArray << 16 | number << 8, count * bytes, bytes);
    layout_.instructions.push_back(count);
  }

  Ros2Layout layout_;
  std::uint32_t offset_ = 0;  // bytes
};

constexpr std::string_view kMiddle = "::msg::dds_::";

}  // namespace

std::optional<Ros2Layout> ros2_layout(std::string_view type) {
  const auto* const it = std::find_if(kTypes.begin(), kTypes.end(), [&](const Type& t) { return t.name == type; });
  if (it == kTypes.end()) return std::nullopt;
  return Compiler().compiled(it->fields);
}

std::string to_dds_type(std::string_view type) {
  const std::size_t slash = type.find('/');
  if (slash == type.npos) return {};
  return std::string(type.substr(0, slash)).append(kMiddle).append(type.substr(slash + 1)) + "_";
}

std::string from_dds_type(std::string_view dds_type) {
  const std::size_t middle = dds_type.find(kMiddle);
  if (middle == dds_type.npos || !dds_type.ends_with('_')) return {};
  dds_type.remove_suffix(1);
  return std::string(dds_type.substr(0, middle)).append("/").append(dds_type.substr(middle + kMiddle.size()));
}

}  // namespace cairn
