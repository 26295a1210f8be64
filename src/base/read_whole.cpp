// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/read_whole.hpp"

#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <stdexcept>

namespace cairn {

std::vector<std::uint8_t> read_whole(const std::filesystem::path& file, std::size_t max_size) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored))
    throw std::runtime_error("cannot be read: there is no such file");
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot be read");
  const std::uintmax_t size = std::filesystem::file_size(file, ignored);
  if (!ignored && size > max_size)
    throw std::runtime_error(max_size >> 20 > 0
                                 ? fmt::format("has {} MiB, allowed: at most {} MiB", size >> 20, max_size >> 20)
                                 : fmt::format("has {} KiB, allowed: at most {} KiB", size >> 10, max_size >> 10));
  std::vector<std::uint8_t> bytes(ignored ? 0
                                          : size);  // exact size: growth by doubling takes up to three times the memory
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(in.gcount()));
  if (in && in.peek() != std::ifstream::traits_type::eof())  // files of the kernel (/proc) report no size
    bytes.insert(bytes.end(), std::istreambuf_iterator<char>(in), {});
  return bytes;
}

}  // namespace cairn
