// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "session/checked_file.hpp"

#include <fmt/format.h>

#include <boost/crc.hpp>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string_view>

namespace cairn {
namespace {

using Json = nlohmann::json;

std::uint32_t checksum(std::string_view bytes) {
  boost::crc_32_type crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return crc.checksum();
}

}  // namespace

CheckedBytes read_checked(const std::filesystem::path& file, const std::string& kind) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error(file.string() + ": cannot be opened");
  std::string begin(kind.size(), ' ');
  CheckedBytes read;
  in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  in >> read.format >> std::hex >> read.checksum;
  in.get();
  if (!in || begin != kind) throw std::runtime_error(fmt::format("{}: does not begin with '{}'", file.string(), kind));
  if (read.format < Session::kOldestFormat || read.format > Session::kFormat)
    throw std::runtime_error(
        fmt::format("{}: was written by another version of cairn (format {}, this one reads {} to {})", file.string(),
                    read.format, Session::kOldestFormat, Session::kFormat));
  read.bytes.assign(std::istreambuf_iterator<char>(in), {});
  if (checksum(read.bytes) != read.checksum) throw std::runtime_error(file.string() + ": is damaged");
  return read;
}

CheckedBytes checked_file(const Json& json, const char* kind) {
  const auto first_line = [&](std::uint32_t sum) { return fmt::format("{} {} {:08x}\n", kind, Session::kFormat, sum); };
  CheckedBytes file{.bytes = first_line(0)};
  const std::size_t begin = file.bytes.size();
  Json::to_cbor(json, file.bytes);
  file.checksum = checksum(std::string_view(file.bytes).substr(begin));
  file.bytes.replace(0, begin, first_line(file.checksum));
  return file;
}

}  // namespace cairn
