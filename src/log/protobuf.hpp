// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Messages as Protocol Buffers pack them, by schemas that are known to readers as well: what is written and what is
// told of it come from one table. https://protobuf.dev/programming-guides/encoding
#pragma once
#include <concepts>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace cairn {

/// With the numbers of google.protobuf.FieldDescriptorProto.
enum class ProtoType : std::uint8_t {
  float64 = 1,
  int64 = 3,
  int32 = 5,
  fixed32 = 7,
  boolean = 8,
  text = 9,
  message = 11,
  bytes = 12,
  enumeration = 14
};

struct ProtoField {
  std::string_view name;
  int number;
  ProtoType type;
  std::string_view of = {};  // its message's full name, or its enumeration's name
  bool repeated = false;
};

/// The values have the numbers 0, 1, 2, ...
struct ProtoEnumeration {
  std::string_view name;
  std::vector<std::string_view> values;
};

struct ProtoSchema {
  std::string_view name;  // in full: foxglove.Log
  std::vector<ProtoField> fields;
  std::vector<ProtoEnumeration> enumerations = {};
};

/// Throws std::logic_error for a name that schemas.cpp does not list.
[[nodiscard]] const ProtoSchema& schema_of(std::string_view name);

/// A message, field by field. A field that its schema does not have, or not with this type, is a std::logic_error.
class ProtoMessage {
 public:
  explicit ProtoMessage(std::string_view schema) : schema_(&schema_of(schema)) {}

  ProtoMessage& put(std::string_view field, double value);
  template <class T>
  requires std::integral<T> || std::is_enum_v<T> ProtoMessage& put(std::string_view field, T value) {
    return put_integer(field, static_cast<std::int64_t>(value));
  }
  /// A text, or bytes.
  ProtoMessage& put(std::string_view field, std::string_view text);
  ProtoMessage& put(std::string_view field, const char* text) { return put(field, std::string_view(text)); }
  ProtoMessage& put(std::string_view field, const std::string& text) { return put(field, std::string_view(text)); }
  ProtoMessage& put(std::string_view field, const ProtoMessage& message);
  /// Of a repeated field, all at once.
  ProtoMessage& put(std::string_view field, std::span<const double> values);
  ProtoMessage& put(std::string_view field, std::span<const std::uint32_t> values);

  [[nodiscard]] const std::string& bytes() const { return bytes_; }
  [[nodiscard]] const ProtoSchema& schema() const { return *schema_; }

 private:
  ProtoMessage& put_integer(std::string_view field, std::int64_t value);
  [[nodiscard]] const ProtoField& field(std::string_view name) const;
  void begin(const ProtoField& field);
  void begin_sized(const ProtoField& field, std::size_t size);

  const ProtoSchema* schema_;
  std::string bytes_;
};

/// The google.protobuf.FileDescriptorSet of a message and all that it holds, as MCAP files tell schemas.
[[nodiscard]] std::string descriptors_of(const ProtoSchema& schema);

}  // namespace cairn
