// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Fields of JSON files next to images.
#pragma once
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "base/read_json.hpp"
#include "base/read_whole.hpp"

namespace cairn {

/// Maximum number of values of a JSON file beside images: 30,000 frames with poses and intrinsics.
constexpr std::size_t kMaxJsonValues = 1'000'000;

/// Calls `take` with the file's JSON object. Errors name the file and end with `expected`.
template <class Take>
void read_json(const std::filesystem::path& file, const std::string& expected, Take&& take) {
  try {
    const auto bytes = read_whole(file);
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    check_json_values(text, kMaxJsonValues);
    const auto json = parsed_json(text);
    if (!json.is_object()) throw std::runtime_error("is not a JSON object");
    take(json);
  } catch (const nlohmann::json::exception&) {
    throw std::runtime_error(file.string() + ": is not JSON; expected " + expected);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what() + "; expected " + expected);
  }
}

/// Returns a number of an object, or `fallback` if the key is missing. Throws if neither exists.
inline double number_at(const nlohmann::json& object, const char* key, std::optional<double> fallback = {}) {
  const auto it = object.find(key);
  if (it == object.end() && fallback) return *fallback;
  if (it == object.end()) throw std::runtime_error(std::string("`") + key + "` is missing");
  if (!it->is_number()) throw std::runtime_error(std::string("`") + key + "` is not a number");
  return it->get<double>();
}

inline int pixels_at(const nlohmann::json& object, const char* key) {
  const double value = number_at(object, key);
  if (!(value >= 0 && value <= 1e6 && value == std::floor(value)))
    throw std::runtime_error(std::string("`") + key + "` is not a number of pixels");
  return static_cast<int>(value);
}

}  // namespace cairn
