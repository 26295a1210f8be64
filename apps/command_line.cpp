// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "command_line.hpp"

#include <algorithm>
#include <fstream>

#include "cairn/quoted.hpp"

namespace cairn::apps {

std::string resuming(std::vector<std::string> words, const std::filesystem::path& asked,
                     const std::filesystem::path& written) {
  std::erase_if(words, [](const std::string& w) { return w == "--overwrite" || w == "--auto-name"; });
  if (asked != written) {
    // The argument of -o, joined with it or separate; else the last word equal to the output.
    const auto is_output = [&](std::size_t i) {
      const std::string& w = words[i];
      const bool follows = i > 0 && (words[i - 1] == "-o" || words[i - 1] == "--output");
      return (follows && w == asked.string()) || w == "-o" + asked.string() || w == "--output=" + asked.string();
    };
    std::size_t at = 0;
    while (at < words.size() && !is_output(at)) ++at;
    if (at == words.size()) {
      const auto it = std::find(words.rbegin(), words.rend(), asked.string());
      at = static_cast<std::size_t>(words.rend() - it) - 1;  // past the end if not found
    }
    if (at < words.size())
      words[at].replace(words[at].size() - asked.string().size(), asked.string().size(), written.string());
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
