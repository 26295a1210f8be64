// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/lines.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "base/words.hpp"

namespace cairn {
namespace {

constexpr std::size_t kMaxLineLength = 1 << 16;  // characters

}  // namespace

void for_each_line(const std::filesystem::path& file,
                   const std::function<void(int, const std::vector<std::string>&)>& take) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error(file.string() + ": cannot be read");
  std::string buffer(kMaxLineLength + 2, '\0');  // with the line feed and the terminator
  int number = 1;
  for (; in.getline(buffer.data(), static_cast<std::streamsize>(buffer.size())); ++number) {
    std::string line = buffer.substr(0, static_cast<std::size_t>(in.gcount()) - (in.eof() ? 0 : 1));
    if (number == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);  // byte order mark of Windows editors
    std::istringstream stream(line);
    std::vector<std::string> words;
    for (std::string word; stream >> word;) words.push_back(word);
    if (!words.empty() && words[0][0] != '#') take(number, words);
  }
  if (!in.eof())
    throw std::runtime_error(
        fmt::format("{}:{}: is a line of more than {} characters", file.string(), number, kMaxLineLength));
}

double number_of(const std::string& word, const std::filesystem::path& file, int line) {
  const auto value = number_in(word);
  if (!value || !std::isfinite(*value))
    throw std::runtime_error(file.string() + ":" + std::to_string(line) + ": '" + shown(word) + "' is not a number");
  return *value;
}

}  // namespace cairn
