// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "log/protobuf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <set>
#include <stdexcept>

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written in memory order");

enum class Wire : std::uint8_t { varint = 0, eight_bytes = 1, sized = 2, four_bytes = 5 };

Wire wire_of(ProtoType type) {
  switch (type) {
    case ProtoType::float64:
      return Wire::eight_bytes;
    case ProtoType::fixed32:
      return Wire::four_bytes;
    case ProtoType::text:
    case ProtoType::message:
    case ProtoType::bytes:
      return Wire::sized;
    default:
      return Wire::varint;
  }
}

void put_varint(std::string& to, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) to += static_cast<char>(value | 0x80);
  to += static_cast<char>(value);
}

template <class T>
void put_raw(std::string& to, T value) {
  to.append(reinterpret_cast<const char*>(&value), sizeof value);
}

void expect(bool is_so, const ProtoField& field) {
  if (!is_so) throw std::logic_error(fmt::format("the field {} has another type", field.name));
}

std::string_view package_of(std::string_view name) { return name.substr(0, name.rfind('.')); }
std::string_view short_name(std::string_view name) { return name.substr(name.rfind('.') + 1); }
/// File name of a schema as in the published schemas: one message per file; google.* names in lower case.
std::string file_of(std::string_view name) {
  std::string file(name);
  std::replace(file.begin(), file.end(), '.', '/');
  if (name.starts_with("google."))
    for (char& c : file) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return file + ".proto";
}

ProtoMessage descriptor_of(const ProtoSchema& schema) {
  enum Label { kOptional = 1, kRepeated = 3 };
  ProtoMessage message("google.protobuf.DescriptorProto");
  message.put("name", short_name(schema.name));
  for (const ProtoField& f : schema.fields) {
    ProtoMessage field("google.protobuf.FieldDescriptorProto");
    field.put("name", f.name).put("number", f.number).put("label", f.repeated ? kRepeated : kOptional);
    field.put("type", f.type);
    if (f.type == ProtoType::message) field.put("type_name", fmt::format(".{}", f.of));
    if (f.type == ProtoType::enumeration) field.put("type_name", fmt::format(".{}.{}", schema.name, f.of));
    message.put("field", field);
  }
  for (const ProtoEnumeration& e : schema.enumerations) {
    ProtoMessage enumeration("google.protobuf.EnumDescriptorProto");
    enumeration.put("name", e.name);
    for (std::size_t i = 0; i < e.values.size(); ++i)
      enumeration.put(
          "value", ProtoMessage("google.protobuf.EnumValueDescriptorProto").put("name", e.values[i]).put("number", i));
    message.put("enum_type", enumeration);
  }
  return message;
}

/// Adds a file after its dependencies.
void add_file(const ProtoSchema& schema, std::set<std::string_view>& added, ProtoMessage& set) {
  if (!added.insert(schema.name).second) return;
  ProtoMessage file("google.protobuf.FileDescriptorProto");
  file.put("name", file_of(schema.name)).put("package", package_of(schema.name));
  std::set<std::string_view> needed;
  for (const ProtoField& f : schema.fields)
    if (f.type == ProtoType::message && needed.insert(f.of).second) {
      add_file(schema_of(f.of), added, set);
      file.put("dependency", file_of(f.of));
    }
  set.put("file", file.put("message_type", descriptor_of(schema)).put("syntax", "proto3"));
}

}  // namespace

const ProtoField& ProtoMessage::field(std::string_view name) const {
  const auto it =
      std::find_if(schema_->fields.begin(), schema_->fields.end(), [&](const auto& f) { return f.name == name; });
  if (it == schema_->fields.end()) throw std::logic_error(fmt::format("{} has no field {}", schema_->name, name));
  return *it;
}

void ProtoMessage::begin(const ProtoField& f) {
  put_varint(bytes_, static_cast<std::uint64_t>(f.number) << 3 | static_cast<std::uint64_t>(wire_of(f.type)));
}

void ProtoMessage::begin_sized(const ProtoField& f, std::size_t size) {
  put_varint(bytes_, static_cast<std::uint64_t>(f.number) << 3 | static_cast<std::uint64_t>(Wire::sized));
  put_varint(bytes_, size);
}

ProtoMessage& ProtoMessage::put(std::string_view name, double value) {
  const ProtoField& f = field(name);
  expect(f.type == ProtoType::float64, f);
  begin(f);
  put_raw(bytes_, value);
  return *this;
}

ProtoMessage& ProtoMessage::put_integer(std::string_view name, std::int64_t value) {
  const ProtoField& f = field(name);
  const Wire wire = wire_of(f.type);
  expect(wire == Wire::varint || wire == Wire::four_bytes, f);
  begin(f);
  if (wire == Wire::varint)
    put_varint(bytes_, static_cast<std::uint64_t>(value));
  else
    put_raw(bytes_, static_cast<std::uint32_t>(value));
  return *this;
}

ProtoMessage& ProtoMessage::put(std::string_view name, std::string_view text) {
  const ProtoField& f = field(name);
  expect(f.type == ProtoType::text || f.type == ProtoType::bytes, f);
  begin_sized(f, text.size());
  bytes_ += text;
  return *this;
}

ProtoMessage& ProtoMessage::put(std::string_view name, const ProtoMessage& message) {
  const ProtoField& f = field(name);
  expect(f.type == ProtoType::message && f.of == message.schema().name, f);
  begin_sized(f, message.bytes().size());
  bytes_ += message.bytes();
  return *this;
}

ProtoMessage& ProtoMessage::put(std::string_view name, std::span<const double> values) {
  const ProtoField& f = field(name);
  expect(f.type == ProtoType::float64 && f.repeated, f);
  begin_sized(f, values.size_bytes());
  bytes_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
  return *this;
}

ProtoMessage& ProtoMessage::put(std::string_view name, std::span<const std::uint32_t> values) {
  const ProtoField& f = field(name);
  expect(f.type == ProtoType::fixed32 && f.repeated, f);
  begin_sized(f, values.size_bytes());
  bytes_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
  return *this;
}

std::string descriptors_of(const ProtoSchema& schema) {
  ProtoMessage set("google.protobuf.FileDescriptorSet");
  std::set<std::string_view> added;
  add_file(schema, added, set);
  return set.bytes();
}

}  // namespace cairn
