// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Map viewers in a browser: during mapping, for finished maps, and as a self-contained page.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/viewer_address.hpp"

namespace cairn {

/// Streams a growing map to browsers, within the available time, and receives their commands. Without a browser it only
/// updates the surface, for browsers that connect later. Use from the mapper's thread.
class LiveViewer {
 public:
  /// Throws std::runtime_error if the port is in use or the address is not local.
  explicit LiveViewer(const ViewerAddress& at = {});
  ~LiveViewer();
  LiveViewer(const LiveViewer&) = delete;
  LiveViewer& operator=(const LiveViewer&) = delete;

  [[nodiscard]] const ViewerSite& site() const;
  /// True if a browser has loaded the page. Any thread.
  [[nodiscard]] bool is_opened() const;
  /// Starts a new map with its options; the mapper must live until the next call or the viewer's end. `frames_before`:
  /// frames of earlier runs, kept by a reset; browsers show this before a reset. `has_reset`: browsers offer a reset.
  void begin(Mapper& mapper, const Rig& rig, const Options& options, int frames_before = 0, bool has_reset = true);

  /// Commands from browsers since the last call.
  struct ViewerCommands {
    std::optional<bool> pause;
    bool reset = false, finish = false;
    bool skip = false;  ///< the stage shown by show_stage
  };
  [[nodiscard]] ViewerCommands commands();

  /// Call after each frame; `latency_ms`: milliseconds from arrival to pose.
  void fused(const Frame& frame, const FrameReport& report, double latency_ms);
  /// Call between frames. `dropped`: frames skipped to keep up.
  void update(bool paused, int dropped);
  /// Call after the last frame, and after the stages that follow.
  void finishing();
  /// Shows a stage after finishing(), with its completed fraction and a button to skip it. May be called while the
  /// mapper is busy.
  void show_stage(const std::string& words, double fraction);
  /// Switches browsers to the written map in `output`, for the lifetime of this object.
  void finished(const std::filesystem::path& output);
  /// Number of connected browsers.
  [[nodiscard]] int viewers() const;
  /// True if all connected browsers show the finished map.
  [[nodiscard]] bool is_shown();

  /// Statistics so far.
  struct ViewerStats {
    int parts = 0;                             ///< surface parts sent
    double updates_per_second = 0;             ///< surface updates
    double ms_per_update = 0;                  ///< mean time per surface update, milliseconds
    std::optional<double> first_mesh_seconds;  ///< from the first frame to the first surface part
  };
  [[nodiscard]] ViewerStats stats() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Serves a finished map to browsers during its lifetime.
class MapViewer {
 public:
  /// `map`: a folder made by `cairn reconstruct`, `live` or `merge`, a tiled project, or a single file: .glb, .gltf,
  /// .ply, .vdb or a tileset.json. Throws std::runtime_error with the error and the remedy, if the port is in
  /// use, or the address is not local.
  explicit MapViewer(const std::filesystem::path& map, const ViewerAddress& at = {});
  ~MapViewer();
  MapViewer(const MapViewer&) = delete;
  MapViewer& operator=(const MapViewer&) = delete;
  [[nodiscard]] const ViewerSite& site() const;
  /// True if a browser has loaded the page. Any thread.
  [[nodiscard]] bool is_opened() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Maximum size of report.html, bytes.
inline constexpr std::size_t kMaxReportPage = 12'000'000;

/// Size in bytes of a mesh.glb that always fits into report.html; for a larger one, preview.glb beside it is embedded
/// if mesh.glb does not fit.
inline constexpr std::uintmax_t kMaxInlineMesh = std::uintmax_t{4} << 20;

/// Writes report.html, of at most kMaxReportPage, in a folder with report.json, trajectory.txt and mesh.glb: a
/// self-contained page. It embeds mesh.glb or else preview.glb, with smaller textures or fewer triangles if necessary.
/// Atomic. Throws std::runtime_error if the folder has no map.
void write_report_page(const std::filesystem::path& folder);

}  // namespace cairn
