// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "cairn/io/known_cameras.hpp"
#include "io/intrinsics.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kMillimeters = 1000;  // units per meter of Open3D's recorders

struct CameraSource {
  Intrinsics intrinsics;
  std::string name;       // file or name
  bool is_known = false;  // a known camera's name; its depth_scale is not user input
};

std::optional<CameraSource> camera_from_option(const fs::path& option) {
  if (option.empty()) return std::nullopt;
  std::error_code ignored;
  if (fs::exists(option, ignored)) return CameraSource{.intrinsics = read_intrinsics(option), .name = option.string()};
  return CameraSource{.intrinsics = {.camera = camera_named(option)}, .name = option.string(), .is_known = true};
}

/// `is_needed`: rethrows errors in the file.
std::optional<CameraSource> camera_in_folder(const fs::path& folder, const fs::path& already_read, bool is_needed) {
  const auto file = intrinsics_file(folder);
  std::error_code ignored;
  if (!file || (!already_read.empty() && fs::equivalent(*file, already_read, ignored))) return std::nullopt;
  try {
    return CameraSource{.intrinsics = read_intrinsics(*file), .name = file->string()};
  } catch (const std::runtime_error&) {
    if (is_needed) throw;
    return std::nullopt;
  }
}

/// Applies the given rig. Fields missing from the file keep the recording's values: the sensor, the IMU, and a color
/// camera at its position.
void set_rig(const CameraSource& source, Recording& recording) {
  const Rig previous = recording.rig;
  const CameraFile& file = source.intrinsics.camera;
  Rig& rig = recording.rig = file.rig;
  if (rig.sensor == SensorModel{}) rig.sensor = previous.sensor;
  if (rig.depth_correction.empty()) rig.depth_correction = previous.depth_correction;
  if (!rig.camera_from_imu) rig.camera_from_imu = previous.camera_from_imu;
  // Among the supported file formats, only camera.yaml has a shutter readout.
  Camera resized = rig.depth;
  resized.width = previous.depth.width, resized.height = previous.depth.height,
  resized.readout = previous.depth.readout;
  if (rig.depth.readout == 0 && resized == previous.depth && fs::path(source.name).stem() != "camera")
    rig.depth.readout = previous.depth.readout;
  recording.has_color_camera |= rig.color.has_value();
  if (!rig.color && previous.color) {
    rig.color = previous.color;
    if (file.has_size || source.is_known)
      rig.color->camera = scaled_to(rig.depth, {previous.color->camera.width, previous.color->camera.height});
  }
  recording.has_image_size = file.has_size || source.is_known;
  recording.camera_is_missing = false;
  for (auto& entry : recording.entries) entry.camera.reset();
  std::erase_if(recording.interpretations, [](const Interpretation& u) { return u.what == "camera of"; });
  recording.interpretations.push_back({"camera of", source.name});
}

void set_rate(double rate, Recording& recording) {
  constexpr double kRounding = 1e-6;  // frames
  const auto rescaled = [&](double time) {
    const double frames = time * recording.frame_rate;
    return (std::abs(frames - std::round(frames)) < kRounding ? std::round(frames) : frames) / rate;
  };
  for (auto& entry : recording.entries) entry.timestamp = rescaled(entry.timestamp);
  for (auto& pose : recording.truth) pose.timestamp = rescaled(pose.timestamp);
  recording.frame_rate = rate;
}

std::optional<double> depth_scale_of(const CameraSource& source) {
  if (source.is_known) return std::nullopt;
  if (source.intrinsics.camera.depth_scale) return source.intrinsics.camera.depth_scale;
  return source.intrinsics.is_open3d ? std::optional(kMillimeters) : std::nullopt;
}

/// Returns the first available value, in the order option, file in the folder.
template <class Get>
std::optional<double> first_of(const std::optional<CameraSource>& option,
                               const std::optional<CameraSource>& from_folder, const Get& get) {
  for (const auto* source : {&option, &from_folder})
    if (*source)
      if (const auto value = get(**source)) return value;
  return std::nullopt;
}

}  // namespace

void resolve_camera(const fs::path& folder, const fs::path& option, Recording& recording) {
  const auto from_option = camera_from_option(option);
  const auto from_folder = camera_in_folder(folder, recording.camera_file, !from_option);
  if (from_option || from_folder) set_rig(from_option ? *from_option : *from_folder, recording);
  if (const auto units = first_of(from_option, from_folder, depth_scale_of)) {
    recording.depth_scale = *units;
    recording.has_depth_scale = true;
  } else if (from_option && from_option->intrinsics.camera.depth_scale && !recording.has_depth_scale) {
    recording.depth_scale = *from_option->intrinsics.camera.depth_scale;
    recording.has_depth_scale = true;
  }
  const auto rate = first_of(from_option, from_folder,
                             [](const CameraSource& source) { return source.intrinsics.camera.frame_rate; });
  recording.has_assumed_rate = recording.frame_rate > 0 && !rate;
  if (recording.frame_rate > 0 && rate) set_rate(*rate, recording);
  if (recording.is_plain && from_folder && from_folder->intrinsics.is_open3d) recording.layout = "Open3D folder";
  for (Interpretation& line : recording.interpretations)
    if (line.what == "times" && recording.frame_rate > 0)
      line.words +=
          fmt::format(", {:g} a second{}", recording.frame_rate,
                      recording.has_assumed_rate ? " assumed (set frame_rate in camera.yaml if it differs)" : "");
}

bool has_other_camera(const fs::path& folder, const Camera& known) {
  const auto file = intrinsics_file(folder);
  if (!file) return false;
  Camera found;
  try {
    found = read_intrinsics(*file).camera.rig.depth;
  } catch (const std::runtime_error&) {
    return true;  // resolve_camera() throws the error, unless an option has precedence
  }
  found.width = known.width, found.height = known.height, found.readout = known.readout;
  return found != known;
}

}  // namespace cairn
