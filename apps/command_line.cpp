// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "command_line.hpp"

#include <algorithm>
#include <fstream>
#include <string_view>

namespace cairn::apps {

std::string quoted(const std::string& word) {
  constexpr std::string_view kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_@%+=:,./-";
  if (!word.empty() && word.find_first_not_of(kPlain) == word.npos) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::string resuming(std::vector<std::string> words, const std::filesystem::path& asked,
                     const std::filesystem::path& written) {
  std::erase_if(words, [](const std::string& w) { return w == "--overwrite" || w == "--auto-name"; });
  if (asked != written) {
    // As its last word, or after -o, in one word with it or not.
    const auto names_it = [&](const std::string& w) {
      return w == asked.string() || (w.starts_with("-o") && w.substr(2) == asked.string()) ||
             w == "--output=" + asked.string();
    };
    if (const auto it = std::find_if(words.rbegin(), words.rend(), names_it); it != words.rend())
      it->replace(it->size() - asked.string().size(), asked.string().size(), written.string());
  }
  if (std::find(words.begin(), words.end(), "--resume") == words.end()) words.emplace_back("--resume");
  std::string line;
  for (const std::string& w : words) line += (line.empty() ? "" : " ") + quoted(w);
  return line;
}

std::vector<std::string> own_words() {
  std::ifstream in("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> words;
  for (std::string word; std::getline(in, word, '\0');) words.push_back(word);
  return words;
}

}  // namespace cairn::apps
