// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "cairn/mapping/splats.hpp"

// One pair of functions per file format; for common behavior see write_splats and read_splats.
namespace cairn {

void write_splat_ply(const std::filesystem::path& file, const Splats& splats);
[[nodiscard]] Splats read_splat_ply(std::span<const std::uint8_t> bytes);
/// Bytes of a .spz file.
[[nodiscard]] std::string spz_of(const Splats& splats);
[[nodiscard]] Splats read_spz(std::span<const std::uint8_t> bytes);

}  // namespace cairn
