// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/command_line.hpp"

#include <algorithm>
#include <fstream>

#include "base/quoted.hpp"

namespace cairn::apps {

std::string resume_command(std::vector<std::string> arguments, const std::filesystem::path& requested,
                           const std::filesystem::path& written) {
  std::erase_if(arguments,
                [](const std::string& argument) { return argument == "--overwrite" || argument == "--auto-name"; });
  if (requested != written) {
    // The argument of -o, joined with it or separate; else the last word equal to the output.
    const auto is_output = [&](std::size_t i) {
      const std::string& argument = arguments[i];
      const bool follows = i > 0 && (arguments[i - 1] == "-o" || arguments[i - 1] == "--output");
      return (follows && argument == requested.string()) || argument == "-o" + requested.string() ||
             argument == "--output=" + requested.string();
    };
    std::size_t at = 0;
    while (at < arguments.size() && !is_output(at)) ++at;
    if (at == arguments.size()) {
      const auto it = std::find(arguments.rbegin(), arguments.rend(), requested.string());
      at = static_cast<std::size_t>(arguments.rend() - it) - 1;  // past the end if not found
    }
    if (at < arguments.size())
      arguments[at].replace(arguments[at].size() - requested.string().size(), requested.string().size(),
                            written.string());
  }
  if (std::find(arguments.begin(), arguments.end(), "--resume") == arguments.end()) arguments.emplace_back("--resume");
  std::string line;
  for (const std::string& argument : arguments) line += (line.empty() ? "" : " ") + quoted(argument);
  return line;
}

std::vector<std::string> own_arguments() {
  std::ifstream in("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> arguments;
  for (std::string word; std::getline(in, word, '\0');) arguments.push_back(word);
  return arguments;
}

}  // namespace cairn::apps
