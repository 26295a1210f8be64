// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "base/read_whole.hpp"
#include "base/words.hpp"
#include "cairn/mapping/esdf.hpp"

namespace cairn {
namespace {

std::string_view trimmed(std::string_view text) {
  constexpr const char* kSpace = " \t\r";
  const std::size_t first = text.find_first_not_of(kSpace);
  return first == text.npos ? "" : text.substr(first, text.find_last_not_of(kSpace) + 1 - first);
}

/// Parses a point. Throws std::runtime_error with the error in the line.
Eigen::Vector3f read_point(std::string_view line) {
  std::vector<float> values;
  while (true) {
    const std::size_t comma = std::min(line.find(','), line.size());
    const auto value = number_in<float>(trimmed(line.substr(0, comma)));
    if (!value) throw std::runtime_error(fmt::format("'{}' is not a number", shown(line.substr(0, comma))));
    values.push_back(*value);
    if (comma == line.size()) break;
    line.remove_prefix(comma + 1);
  }
  if (values.size() != 3) throw std::runtime_error(fmt::format("has {} columns; expected x,y,z", values.size()));
  return {values[0], values[1], values[2]};
}

}  // namespace

std::vector<Eigen::Vector3f> read_query_points(const std::filesystem::path& file) {
  std::vector<Eigen::Vector3f> points;
  int number = 1;
  try {
    const auto bytes = read_whole(file);
    std::istringstream in(std::string(bytes.begin(), bytes.end()));
    std::string line, header;
    if (!std::getline(in, line)) throw std::runtime_error("is empty; expected the header x,y,z");
    if (line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);
    std::copy_if(line.begin(), line.end(), std::back_inserter(header),
                 [](char c) { return c != ' ' && c != '\r' && c != '"'; });
    if (header != "x,y,z") throw std::runtime_error("expected the header x,y,z, found '" + shown(line) + "'");
    for (++number; std::getline(in, line); ++number)
      if (!trimmed(line).empty()) points.push_back(read_point(line));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}:{}: {}", file.string(), number, error.what()));
  }
  return points;
}

}  // namespace cairn
