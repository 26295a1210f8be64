// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/suggest.hpp"

#include <algorithm>
#include <cctype>

namespace cairn::apps {
namespace {

constexpr std::size_t kMaxPrefixMatches = 4;  // maximum number of words with a common prefix in a suggestion

char lower(char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); }

/// Removes the dashes of an option.
std::string_view without_dashes(std::string_view word) {
  return word.substr(std::min(word.find_first_not_of('-'), word.size()));
}

bool has_prefix(std::string_view word, std::string_view prefix) {
  return word.size() >= prefix.size() &&
         std::equal(prefix.begin(), prefix.end(), word.begin(), [](char a, char b) { return lower(a) == lower(b); });
}

}  // namespace

int edit_distance(std::string_view a, std::string_view b) {
  std::vector<int> before(b.size() + 1), last(b.size() + 1), now(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = static_cast<int>(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    now[0] = static_cast<int>(i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const bool is_same = lower(a[i - 1]) == lower(b[j - 1]);
      now[j] = std::min({last[j] + 1, now[j - 1] + 1, last[j - 1] + !is_same});
      if (i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) && lower(a[i - 2]) == lower(b[j - 1]))
        now[j] = std::min(now[j], before[j - 2] + 1);
    }
    before.swap(last);
    last.swap(now);
  }
  return last[b.size()];
}

std::vector<std::string> near_words(std::string_view typed, const std::vector<std::string>& known) {
  const std::string_view name = without_dashes(typed);
  if (name.empty()) return {};
  std::vector<std::string> nearest, prefix_matches;
  int min_distance = 1 + static_cast<int>(name.size()) / 3;  // a wrong letter in three, plus an extra letter
  for (const std::string& word : known) {
    if (name.size() > 1 && has_prefix(without_dashes(word), name)) prefix_matches.push_back(word);
    const int distance = edit_distance(name, without_dashes(word));
    if (distance > min_distance || distance >= static_cast<int>(name.size())) continue;
    if (distance < min_distance) nearest.clear();
    min_distance = distance;
    nearest.push_back(word);
  }
  return prefix_matches.empty() || prefix_matches.size() > kMaxPrefixMatches ? nearest : prefix_matches;
}

std::string join_choices(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " or " : ", ") + words[i];
  return text;
}

std::string did_you_mean(std::string_view typed, const std::vector<std::string>& known) {
  const auto meant = near_words(typed, known);
  return meant.empty() ? "" : "; did you mean " + join_choices(meant) + "?";
}

}  // namespace cairn::apps
