// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/stamped_list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/lines.hpp"
#include "base/words.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
// Steps between images, in clock units: 0.008 to 8 s, so that the units' ranges do not overlap. As in image_names.cpp.
constexpr double kMilliseconds = 8, kMicroseconds = 8e3, kNanoseconds = 8e6;

/// Splits a line's words at commas.
std::vector<std::string> fields_of(const std::vector<std::string>& words) {
  std::vector<std::string> fields;
  for (const std::string& word : words) {
    std::size_t begin = 0;
    for (std::size_t at = 0; at <= word.size(); ++at)
      if (at == word.size() || word[at] == ',') {
        if (at > begin) fields.push_back(word.substr(begin, at - begin));
        begin = at + 1;
      }
  }
  return fields;
}

/// Groups times and paths, at most `max_groups`: a path ends before the next number, or at the end of the line.
std::vector<std::pair<std::string, std::string>> groups_of(const std::vector<std::string>& fields,
                                                           std::size_t max_groups) {
  std::vector<std::pair<std::string, std::string>> groups;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const bool is_time = groups.size() < max_groups && number_in(fields[i]) && i + 1 < fields.size();
    if (groups.empty() || (is_time && !groups.back().second.empty())) {
      groups.emplace_back(fields[i], "");
    } else {
      std::string& path = groups.back().second;
      path += (path.empty() ? "" : " ") + fields[i];
    }
  }
  return groups;
}

bool is_header(const std::string& word) {
  return std::all_of(word.begin(), word.end(),
                     [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }) &&
         word.size() >= 4 && (word.starts_with("time") || word.starts_with("Time") || word.starts_with("stamp"));
}

}  // namespace

std::vector<std::vector<Stamped>> read_stamped_lists(const fs::path& file, std::size_t groups) {
  std::vector<std::vector<Stamped>> lists(groups);
  bool is_first = true;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    const auto fields = fields_of(words);
    const bool is_header_line = is_first && !fields.empty() && is_header(fields[0]);
    is_first = false;
    if (is_header_line) return;
    const auto found = groups_of(fields, groups);
    if (found.size() != groups ||
        std::any_of(found.begin(), found.end(), [](const auto& g) { return g.second.empty(); }))
      throw std::runtime_error(fmt::format("{}:{}: expected `{}`", file.string(), line,
                                           groups == 1 ? "timestamp path" : "timestamp path timestamp path"));
    for (std::size_t g = 0; g < groups; ++g) {
      std::string path = found[g].second;
      std::replace(path.begin(), path.end(), '\\', '/');
      lists[g].push_back({number_of(found[g].first, file, line), file.parent_path() / path});
    }
  });
  if (lists[0].empty()) throw std::runtime_error(file.string() + ": lists no image");
  return lists;
}

double units_per_second(const std::vector<Stamped>& list) {
  std::vector<double> times;
  for (const Stamped& stamped : list) {
    if (stamped.timestamp != std::floor(stamped.timestamp)) return 1;
    times.push_back(stamped.timestamp);
  }
  std::sort(times.begin(), times.end());
  std::vector<double> steps;
  for (std::size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
  if (steps.empty()) return 1;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle < kMilliseconds ? 1 : *middle < kMicroseconds ? 1e3 : *middle < kNanoseconds ? 1e6 : 1e9;
}

void divide_times(std::vector<Stamped>& list, double units) {
  for (Stamped& stamped : list) stamped.timestamp /= units;
}

}  // namespace cairn
