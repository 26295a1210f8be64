// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Maps in a browser: while they grow, when they are finished, and as a page of their own.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapper.hpp"

namespace cairn {

inline constexpr int kDefaultViewerPort = 4242;

/// Where a viewer listens.
struct ViewerAddress {
  int port = kDefaultViewerPort;  ///< 0: any free one
  /// Empty: this machine alone sees the page, at http://127.0.0.1:PORT/TOKEN/. An IP address of this machine: other
  /// devices of that network see it, too, those that know the token, at https://HOST:PORT/TOKEN/; 0.0.0.0: of all its
  /// networks. The certificate is made by the viewer itself, so that a browser asks once whether it is trusted.
  std::string host;
  std::filesystem::path certificates;  ///< folder in which that one is kept; empty: the user's state folder
};

/// Where a viewer is found.
struct ViewerSite {
  struct Url {
    std::string url, interface;  ///< interface: of the network, by its name
  };
  std::vector<Url> urls;    ///< at least one, the likeliest first
  std::string fingerprint;  ///< SHA-256 of the certificate, as browsers show it; empty: HTTP
};

/// Shows a map that grows to browsers, as much as the time allows, and hears what they ask for. Without
/// a browser it makes the surface alone, since one may come late. The mapper's thread.
class LiveViewer {
 public:
  /// Throws std::runtime_error when the port is in use or the address is not this machine's.
  explicit LiveViewer(const ViewerAddress& at = {});
  ~LiveViewer();
  LiveViewer(const LiveViewer&) = delete;
  LiveViewer& operator=(const LiveViewer&) = delete;

  [[nodiscard]] const ViewerSite& site() const;
  /// Whether a browser has loaded the page. Any thread.
  [[nodiscard]] bool is_opened() const;
  /// A new map, which must live until the next one or the end, with its options. `frames_before`: of earlier runs,
  /// which a reset keeps; viewers are told so before they ask for one.
  void begin(Mapper& mapper, const Rig& rig, const Options& options, int frames_before = 0);

  /// What viewers asked for since the last call.
  struct Asked {
    std::optional<bool> pause;
    bool reset = false, finish = false;
  };
  [[nodiscard]] Asked asked();

  /// After each frame; `latency_ms`: milliseconds from its arrival to its pose.
  void fused(const Frame& frame, const FrameReport& report, double latency_ms);
  /// Between frames. `dropped`: frames that were skipped to keep up.
  void update(bool paused, int dropped);
  /// The last frame has come.
  void finishing();
  /// Shows viewers the map that was written instead, as long as this lives.
  void finished(const std::filesystem::path& output);
  /// Browsers that look at it now.
  [[nodiscard]] int viewers() const;
  /// Whether all of them have the finished map in front of them.
  [[nodiscard]] bool is_shown();

  /// What it did so far.
  struct Told {
    int parts = 0;                             ///< of the surface, that were sent
    double updates_per_second = 0;             ///< of the surface
    double ms_per_update = 0;                  ///< milliseconds, on the mean
    std::optional<double> first_mesh_seconds;  ///< from the first frame to the first part
  };
  [[nodiscard]] Told told() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Shows a finished map to browsers, as long as it lives.
class MapViewer {
 public:
  /// `map`: a folder that `cairn reconstruct`, `live` or `merge` has made, a plan's that has been tiled, or a single
  /// file: .glb, .gltf, .ply, .obj, .vdb or a tileset.json. Throws std::runtime_error with what is wrong with it and
  /// what to do, when the port is in use, or the address is not this machine's.
  explicit MapViewer(const std::filesystem::path& map, const ViewerAddress& at = {});
  ~MapViewer();
  MapViewer(const MapViewer&) = delete;
  MapViewer& operator=(const MapViewer&) = delete;
  [[nodiscard]] const ViewerSite& site() const;
  /// Whether a browser has loaded the page. Any thread.
  [[nodiscard]] bool is_opened() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A mesh.glb of more bytes does not fit into the report's page; preview.glb beside it takes its place there.
inline constexpr std::uintmax_t kMaxInlineMesh = std::uintmax_t{64} << 20;

/// Writes report.html in a folder with report.json, trajectory.txt and mesh.glb: a page that needs nothing else. For a
/// mesh that is too large preview.glb is shown, if there is one; else the page tells that it is left out. Whole or not
/// at all. Throws std::runtime_error when the folder holds no map.
void write_report_page(const std::filesystem::path& folder);

}  // namespace cairn
