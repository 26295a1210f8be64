// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "cairn/known_cameras.hpp"
#include "io/intrinsics.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kMillimeters = 1000;  // units per meter of Open3D's recorders

struct Told {
  Intrinsics what;
  std::string by;         // file or name
  bool is_known = false;  // a known camera's name; its depth_scale is not user input
};

std::optional<Told> told_by_option(const fs::path& option) {
  if (option.empty()) return std::nullopt;
  std::error_code ignored;
  if (fs::exists(option, ignored)) return Told{.what = read_intrinsics(option), .by = option.string()};
  return Told{.what = {.camera = camera_named(option)}, .by = option.string(), .is_known = true};
}

/// `is_needed`: rethrows errors in the file.
std::optional<Told> told_beside(const fs::path& folder, const fs::path& own, bool is_needed) {
  const auto file = intrinsics_file(folder);
  std::error_code ignored;
  if (!file || (!own.empty() && fs::equivalent(*file, own, ignored))) return std::nullopt;
  try {
    return Told{.what = read_intrinsics(*file), .by = file->string()};
  } catch (const std::runtime_error&) {
    if (is_needed) throw;
    return std::nullopt;
  }
}

/// Applies the given rig. Fields missing from the file keep the recording's values: the sensor, the IMU, and a color
/// camera at its position.
void take_rig(const Told& told, Recording& recording) {
  const Rig before = recording.rig;
  const CameraFile& file = told.what.camera;
  Rig& rig = recording.rig = file.rig;
  if (rig.sensor == SensorModel{}) rig.sensor = before.sensor;
  if (rig.depth_correction.empty()) rig.depth_correction = before.depth_correction;
  if (!rig.camera_from_imu) rig.camera_from_imu = before.camera_from_imu;
  // Among the supported file formats, only camera.yaml has a shutter readout.
  Camera seen = rig.depth;
  seen.width = before.depth.width, seen.height = before.depth.height, seen.readout = before.depth.readout;
  if (seen == before.depth && fs::path(told.by).stem() != "camera") rig.depth.readout = before.depth.readout;
  recording.colour_is_told |= rig.colour.has_value();
  if (!rig.colour && before.colour) {
    rig.colour = before.colour;
    if (file.has_size || told.is_known)
      rig.colour->camera = scaled_to(rig.depth, {before.colour->camera.width, before.colour->camera.height});
  }
  recording.size_is_told = file.has_size || told.is_known;
  recording.camera_is_missing = false;
  for (auto& entry : recording.entries) entry.camera.reset();
  std::erase_if(recording.understood, [](const Understood& u) { return u.what == "camera of"; });
  recording.understood.push_back({"camera of", told.by});
}

void take_rate(double rate, Recording& recording) {
  constexpr double kRounding = 1e-6;  // frames
  const auto again = [&](double time) {
    const double frames = time * recording.frame_rate;
    return (std::abs(frames - std::round(frames)) < kRounding ? std::round(frames) : frames) / rate;
  };
  for (auto& entry : recording.entries) entry.timestamp = again(entry.timestamp);
  for (auto& pose : recording.truth) pose.timestamp = again(pose.timestamp);
  recording.frame_rate = rate;
}

std::optional<double> depth_scale_of(const Told& told) {
  if (told.is_known) return std::nullopt;
  if (told.what.camera.depth_scale) return told.what.camera.depth_scale;
  return told.what.is_open3d ? std::optional(kMillimeters) : std::nullopt;
}

/// Returns the first available value, in the order option, file in the folder.
template <class Get>
std::optional<double> first_of(const std::optional<Told>& option, const std::optional<Told>& beside, const Get& get) {
  for (const auto* told : {&option, &beside})
    if (*told)
      if (const auto value = get(**told)) return value;
  return std::nullopt;
}

}  // namespace

void settle_camera(const fs::path& folder, const fs::path& option, Recording& recording) {
  const auto named = told_by_option(option);
  const auto beside = told_beside(folder, recording.camera_file, !named);
  if (named || beside) take_rig(named ? *named : *beside, recording);
  if (const auto units = first_of(named, beside, depth_scale_of)) {
    recording.depth_scale = *units;
    recording.unit_is_told = true;
  } else if (named && named->what.camera.depth_scale && !recording.unit_is_told) {
    recording.depth_scale = *named->what.camera.depth_scale;
    recording.unit_is_told = true;
  }
  const auto rate = first_of(named, beside, [](const Told& told) { return told.what.camera.frame_rate; });
  const bool is_assumed = recording.frame_rate > 0 && !rate;
  if (recording.frame_rate > 0 && rate) take_rate(*rate, recording);
  if (recording.is_plain && beside && beside->what.is_open3d) recording.layout = "Open3D folder";
  for (Understood& line : recording.understood)
    if (line.what == "times" && recording.frame_rate > 0)
      line.words += fmt::format(", {:g} a second{}", recording.frame_rate,
                                is_assumed ? " assumed (frame_rate in camera.yaml tells another)" : "");
}

bool is_told_another(const fs::path& folder, const Camera& known) {
  const auto file = intrinsics_file(folder);
  if (!file) return false;
  Camera told;
  try {
    told = read_intrinsics(*file).camera.rig.depth;
  } catch (const std::runtime_error&) {
    return true;  // settle_camera() throws the error, unless an option has precedence
  }
  told.width = known.width, told.height = known.height, told.readout = known.readout;
  return told != known;
}

}  // namespace cairn
