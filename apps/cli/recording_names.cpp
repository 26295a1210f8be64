// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/recording_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <set>
#include <stdexcept>

#include "cairn/building/project.hpp"

namespace cairn::apps {
namespace {

/// Splits a name into folders of a path and options of a scene.
std::vector<std::string> split_name(const std::string& name) {
  std::vector<std::string> words(1);
  for (const char c : name) {
    if (c != '/' && c != '?' && c != '&')
      words.back() += c;
    else if (!words.back().empty())
      words.emplace_back();
  }
  if (words.size() > 1 && words.back().empty()) words.pop_back();
  return words;
}

/// Shortest unique suffixes, in words; complete names if two names are equal.
std::vector<std::string> shortest_suffixes(const std::vector<std::vector<std::string>>& all) {
  std::size_t max_words = 1;
  for (const auto& words : all) max_words = std::max(max_words, words.size());
  std::vector<std::string> suffixes;
  for (std::size_t count = 1; count <= max_words; ++count) {
    suffixes.clear();
    for (const auto& words : all)
      suffixes.push_back(fmt::format(
          "{}", fmt::join(words.end() - static_cast<std::ptrdiff_t>(std::min(count, words.size())), words.end(), " ")));
    if (std::set<std::string>(suffixes.begin(), suffixes.end()).size() == suffixes.size()) break;
  }
  return suffixes;
}

}  // namespace

std::vector<std::string> recordings_in(const std::filesystem::path& plan) {
  std::vector<std::string> names;
  for (const auto& recording : read_plan(plan).recordings) names.push_back(recording.name);
  return names;
}

std::vector<std::string> short_names(const std::vector<std::string>& names) {
  std::vector<std::vector<std::string>> all;
  all.reserve(names.size());
  for (const std::string& name : names) all.push_back(split_name(name));
  std::size_t min_words = all.empty() ? 0 : all[0].size();
  for (const auto& words : all) min_words = std::min(min_words, words.size());
  const auto is_shared = [&](const auto& word) {
    return std::all_of(all.begin(), all.end(), [&](const auto& words) { return word(words) == word(all[0]); });
  };
  std::size_t before = 0, after = 0;  // number of common words
  while (before + 1 < min_words && is_shared([&](const auto& words) { return words[before]; })) ++before;
  while (before + after + 1 < min_words &&
         is_shared([&](const auto& words) { return words[words.size() - 1 - after]; }))
    ++after;
  for (auto& words : all) {
    words.resize(words.size() - after);
    words.erase(words.begin(), words.begin() + static_cast<std::ptrdiff_t>(before));
  }
  return shortest_suffixes(all);
}

std::size_t find_recording(const std::string& word, const std::vector<std::string>& names) {
  const std::vector<std::string> shortened = short_names(names);
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < names.size(); ++i)
    if (names[i] == word || shortened[i] == word) found.push_back(i);
  if (found.size() == 1) return found[0];
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (found.empty() && error == std::errc() && end == word.data() + word.size() && number < names.size()) return number;
  std::vector<std::string> list;
  for (std::size_t i = 0; i < shortened.size(); ++i) list.push_back(fmt::format("{}: {}", i, shortened[i]));
  throw std::runtime_error(fmt::format("{} '{}'; recordings: {}",
                                       found.empty() ? "no recording matches" : "more than one recording matches", word,
                                       fmt::join(list, ", ")));
}

}  // namespace cairn::apps
