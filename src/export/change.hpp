// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

#include "cairn/building/change.hpp"
#include "export/map_chunks.hpp"

namespace cairn {

/// One of two maps in the same frame.
struct ChangeSide {
  std::string name;  // for messages
  const MapChunks& map;
};

void check(const ChangeOptions& options, const std::filesystem::path& file);

/// Compares part by part; keeps the simplified surface in memory until the end. Throws as export_change(before, after,
/// ...) does.
ExportedChange write_change(const ChangeSide& before, const ChangeSide& after, const std::filesystem::path& file,
                            const ChangeOptions& options, const ExportProgress& progress);

}  // namespace cairn
