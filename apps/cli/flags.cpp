// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/flags.hpp"

#include <array>
#include <utility>

namespace cairn::apps {
namespace {

using Replacement = std::pair<const char*, const char*>;
constexpr std::array kFlags{
    Replacement{"SimplifyOptions::ratio", "--simplify"},
    Replacement{"SimplifyOptions::triangles", "--triangles"},
    Replacement{"SimplifyOptions::max_error", "--max-error"},
    Replacement{"CleanOptions::min_component", "--min-piece"},
    Replacement{"CleanOptions::min_weight", "--min-weight"},
    Replacement{"CleanOptions::fill_holes", "--fill-holes"},
    Replacement{"TextureOptions::enabled", "--texture"},
    Replacement{"TextureOptions::texel", "--texel"},
    Replacement{"TextureOptions::max_size", "--texture-size"},
    Replacement{"TextureOptions::jpeg_quality", "--jpeg-quality"},
    Replacement{"ExportOptions::cell_size", "--cell-size"},
    Replacement{"ExportOptions::point_spacing", "--points"},
    Replacement{"ViewsOptions::images", "--images"},
    Replacement{"ViewsOptions::point_spacing", "--points"},
    Replacement{"ExportOptions::levels", "--lods"},
    Replacement{"ExportOptions::compression", "--compress"},
    Replacement{"ExportOptions::cameras", "--cameras"},
    Replacement{"ExportOptions::axes", "--frame"},
    Replacement{"ExportOptions::geo", "--geo"},
    Replacement{"SplatOptions::images", "--images"},
    Replacement{"SplatOptions::max_splats", "--max-splats"},
    Replacement{"SplatOptions::resolution", "--resolution"},
    Replacement{"Options::up", "--up"},
    Replacement{"ExportOptions::lit", "--lit"},
    Replacement{"FuseOptions::device_memory", "--device-memory"},
    Replacement{"FuseOptions::voxel_size", "--voxel-size"},
    Replacement{"EsdfOptions::voxel_size", "--esdf-voxel-size"},
    Replacement{"SourceOptions::camera", "--camera"},
    Replacement{"SourceOptions::depth_topic", "--topic"},
    Replacement{"SourceOptions::color_topic", "--topic"},
    Replacement{"Project::frames_per_segment", "--frames-per-part"},
    Replacement{"Project::overlap", "--overlap"},
    Replacement{"allow it to stay separate", "keep separate components with --allow-disconnected"},
    Replacement{"begin a new session", "reconstruct again without --resume"},
};

}  // namespace

std::string with_flag_names(std::string message) {
  for (const auto& [field, flag] : kFlags)
    for (std::size_t at = message.find(field); at != std::string::npos; at = message.find(field, at))
      message.replace(at, std::string(field).size(), flag);
  return message;
}

}  // namespace cairn::apps
