// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <chrono>
#include <deque>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "cairn/mapper.hpp"
#include "durations.hpp"
#include "view/server.hpp"

namespace cairn::apps {

inline constexpr int kDefaultPort = 4242;

/// The page, for a Server.
[[nodiscard]] Served viewer_file();

/// What `cairn live --view` shows: fills the feed of the viewers from the map, as much as the time allows, and hears
/// what they ask for. Without viewers it makes the surface alone, since one may come late.
class LiveView {
 public:
  /// Throws std::runtime_error when the port is in use. Prints the address.
  explicit LiveView(int port);

  /// A new map.
  void begin(Mapper& mapper, const Camera& camera, const Options& options);

  /// What viewers asked for since the last call.
  struct Asked {
    std::optional<bool> pause;
    bool reset = false, finish = false;
  };
  Asked asked();

  /// After each frame; `latency_ms`: from its arrival to its pose.
  void fused(const Frame& frame, const FrameReport& report, double latency_ms);
  /// Between frames. `dropped`: frames that were skipped to keep up.
  void update(bool paused, int dropped);
  void finishing();
  /// Tells viewers where the result is and gives them a moment to hear it.
  void finished(const std::filesystem::path& output);

  /// For the report: what the view did.
  [[nodiscard]] nlohmann::json told() const;

 private:
  using Clock = std::chrono::steady_clock;
  void send_state(const char* status, const std::string& words);
  void send_surface(bool all);

  Feed feed_;
  Server server_;
  Mapper* mapper_ = nullptr;
  Camera camera_;
  float max_depth_ = 5;
  int epoch_ = 0, dropped_ = 0, sent_parts_ = 0;
  std::map<std::string, int> counts_;  // frames by state
  FrameReport last_;
  bool any_ = false;                                         // frames
  std::deque<std::pair<Clock::time_point, double>> recent_;  // frames of the last seconds, and their latency
  Clock::time_point surface_, images_, state_;               // when each was sent last
  std::optional<Clock::time_point> first_frame_;
  std::optional<double> first_mesh_seconds_;
  Durations surface_ms_;
};

}  // namespace cairn::apps
