// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/export.hpp"

#include <optional>
#include <utility>

#include "export/export_run.hpp"
#include "export/texturer.hpp"
#include "export/write.hpp"

namespace cairn {

namespace fs = std::filesystem;

Exported export_surface(const ExportInput& input, const fs::path& file, const ExportOptions& options,
                        const ExportProgress& progress) {
  check(options, file);
  if (input.bricks.empty()) throw not_written(file, "the map is empty: no frame was fused into it");
  const bool has_texture = options.texture.enabled;
  ExportRun run{.input = input,
                .file = file,
                .options = options,
                .progress = progress,
                .cells = Cells(input.bricks, input.volume.brick_size(), is_tileset(file), options)};
  run.count = static_cast<int>(run.cells.all().size()) * (3 + has_texture) + 1 +
              (has_texture ? static_cast<int>(input.keyframes.size()) : 0);
  std::optional<Texturer> made;
  Texturer* const texturer = has_texture ? &made.emplace(run) : nullptr;
  if (is_tileset(file))
    write_tiles(run, texturer);
  else if (options.point_spacing > 0)
    write_points(run);
  else
    write_parts(run, texturer);
  return std::move(run.exported);
}

}  // namespace cairn
