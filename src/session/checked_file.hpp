// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A file of a session: a first line with what it is, the format's number and a checksum, and CBOR behind it.
#pragma once
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "cairn/session.hpp"

namespace cairn {

/// What was behind a first line, or is to come there.
struct CheckedBytes {
  std::string bytes;
  std::uint32_t checksum = 0;
  int format = Session::kFormat;
};

/// The CBOR of a file of this kind. Throws std::runtime_error, with the file's name, for another kind, a format that is
/// not read, or a checksum that is not the bytes'.
[[nodiscard]] CheckedBytes read_checked(const std::filesystem::path& file, const std::string& kind);
/// A whole file for read_checked(), and the checksum of its CBOR.
[[nodiscard]] CheckedBytes checked_file(const nlohmann::json& json, const char* kind);

}  // namespace cairn
