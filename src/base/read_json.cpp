// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/read_json.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "base/json_scan.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;
constexpr int kMaxCborDepth = 16;

class BoundedParser : public nlohmann::detail::json_sax_dom_parser<Json> {
 public:
  explicit BoundedParser(Json& to) : json_sax_dom_parser(to) {}
  bool start_object(std::size_t size) { return enter() && json_sax_dom_parser::start_object(size); }
  bool start_array(std::size_t size) { return enter() && json_sax_dom_parser::start_array(size); }
  bool end_object() { return --depth_, json_sax_dom_parser::end_object(); }
  bool end_array() { return --depth_, json_sax_dom_parser::end_array(); }

 private:
  bool enter() {
    if (++depth_ >= kMaxCborDepth) throw std::runtime_error("it is nested too deeply");
    return true;
  }
  int depth_ = 0;
};

}  // namespace

void check_json_values(std::string_view text, std::size_t max_values) {
  std::size_t values = 0;
  for_each_outside_strings(text, [&](std::size_t i) {
    const char c = text[i];
    if ((c == '[' || c == '{' || c == ',') && ++values > max_values)
      throw std::runtime_error(fmt::format("has more than {} values", max_values));
  });
}

Json parsed_json(std::string_view text) {
  check_json_depth(text);
  return Json::parse(text);
}

Json parsed_json(std::span<const std::uint8_t> bytes) {
  return parsed_json(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

Json parsed_json_or_none(std::string_view text) {
  try {
    check_json_depth(text);
  } catch (const TooDeepJson&) {
    return Json(Json::value_t::discarded);
  }
  return Json::parse(text, nullptr, false);
}

Json parsed_cbor(const std::string& bytes) {
  Json json;
  BoundedParser sax(json);
  Json::sax_parse(bytes, &sax, Json::input_format_t::cbor);
  return json;
}

}  // namespace cairn
