// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Encoder for Protocol Buffers messages. Messages and their schema descriptors come from the same table.
// https://protobuf.dev/programming-guides/encoding
#pragma once
#include <concepts>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace cairn {

/// Numbers of google.protobuf.FieldDescriptorProto.
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
  std::string_view of = {};  // full name of the message type, or name of the enumeration
  bool repeated = false;
};

/// Values are numbered 0, 1, 2, ...
struct ProtoEnumeration {
  std::string_view name;
  std::vector<std::string_view> values;
};

struct ProtoSchema {
  std::string_view name;  // full name: foxglove.Log
  std::vector<ProtoField> fields;
  std::vector<ProtoEnumeration> enumerations = {};
};

/// Throws std::logic_error for a name absent from schemas.cpp.
[[nodiscard]] const ProtoSchema& schema_of(std::string_view name);

/// Message builder, field by field. Throws std::logic_error for a field absent from the schema or of another type.
class ProtoMessage {
 public:
  explicit ProtoMessage(std::string_view schema) : schema_(&schema_of(schema)) {}

  ProtoMessage& put(std::string_view field, double value);
  template <class T>
  requires std::integral<T> || std::is_enum_v<T> ProtoMessage& put(std::string_view field, T value) {
    return put_integer(field, static_cast<std::int64_t>(value));
  }
  /// Adds a string or bytes field.
  ProtoMessage& put(std::string_view field, std::string_view text);
  ProtoMessage& put(std::string_view field, const char* text) { return put(field, std::string_view(text)); }
  ProtoMessage& put(std::string_view field, const std::string& text) { return put(field, std::string_view(text)); }
  ProtoMessage& put(std::string_view field, const ProtoMessage& message);
  /// Adds all values of a repeated field at once.
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

/// google.protobuf.FileDescriptorSet of a message and its field types, the schema format of MCAP files.
[[nodiscard]] std::string descriptors_of(const ProtoSchema& schema);

}  // namespace cairn
