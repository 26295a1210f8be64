// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/read_whole.hpp"

#include <fstream>
#include <iterator>
#include <stdexcept>

namespace cairn {

std::vector<std::uint8_t> read_whole(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored))
    throw std::runtime_error("cannot be read: there is no such file");
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot be read");
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace cairn
