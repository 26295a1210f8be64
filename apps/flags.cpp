// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "flags.hpp"

#include <array>
#include <utility>

namespace cairn::apps {
namespace {

using Words = std::pair<const char*, const char*>;
constexpr std::array kFlags{
    Words{"SimplifyOptions::ratio", "--simplify"},
    Words{"SimplifyOptions::triangles", "--triangles"},
    Words{"SimplifyOptions::max_error", "--max-error"},
    Words{"CleanOptions::min_piece", "--min-piece"},
    Words{"CleanOptions::min_weight", "--min-weight"},
    Words{"CleanOptions::fill_holes", "--fill-holes"},
    Words{"TextureOptions::enabled", "--texture"},
    Words{"TextureOptions::texel", "--texel"},
    Words{"TextureOptions::max_size", "--texture-size"},
    Words{"TextureOptions::jpeg_quality", "--jpeg-quality"},
    Words{"ExportOptions::cell_size", "--cell-size"},
    Words{"ExportOptions::point_spacing", "--points"},
    Words{"ViewsOptions::images", "--images"},
    Words{"ViewsOptions::point_spacing", "--points"},
    Words{"ExportOptions::levels", "--lods"},
    Words{"ExportOptions::compression", "--compress"},
    Words{"ExportOptions::cameras", "--cameras"},
    Words{"ExportOptions::axes", "--frame"},
    Words{"ExportOptions::geo", "--geo"},
    Words{"Options::up", "--up"},
    Words{"ExportOptions::lit", "--lit"},
    Words{"FuseOptions::device_memory", "--device-memory"},
    Words{"FuseOptions::voxel_size", "--voxel-size"},
    Words{"EsdfOptions::voxel_size", "--esdf-voxel-size"},
    Words{"SourceOptions::camera", "--camera"},
    Words{"SourceOptions::depth_topic", "--topic"},
    Words{"SourceOptions::colour_topic", "--topic"},
    Words{"PartsPlan::frames_per_part", "--frames-per-part"},
    Words{"PartsPlan::overlap", "--overlap"},
    Words{"allow it to stay apart", "keep separate pieces with --allow-disconnected"},
    Words{"begin a new session", "reconstruct again without --resume"},
};

}  // namespace

std::string in_flags(std::string message) {
  for (const auto& [field, flag] : kFlags)
    for (std::size_t at = message.find(field); at != std::string::npos; at = message.find(field, at))
      message.replace(at, std::string(field).size(), flag);
  return message;
}

}  // namespace cairn::apps
