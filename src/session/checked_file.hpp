// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Session file: a first line with kind, format number and checksum, followed by CBOR.
#pragma once
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "cairn/mapping/session.hpp"

namespace cairn {

/// CBOR after the first line, with the line's checksum and format number.
struct CheckedBytes {
  std::string bytes;
  std::uint32_t checksum = 0;
  int format = Session::kFormat;
};

/// Reads the CBOR of a file of the given kind. Throws std::runtime_error with the file's name for another kind, an
/// unsupported format or a wrong checksum.
[[nodiscard]] CheckedBytes read_checked(const std::filesystem::path& file, const std::string& kind);
/// Complete file for read_checked(), with the checksum of its CBOR.
[[nodiscard]] CheckedBytes checked_file(const nlohmann::json& json, const char* kind);

}  // namespace cairn
