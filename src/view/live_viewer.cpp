// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <chrono>
#include <deque>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "base/json_text.hpp"
#include "base/read_json.hpp"
#include "cairn/mapping/live_surface.hpp"
#include "cairn/mapping/viewer.hpp"
#include "net/server.hpp"
#include "view/finished_map.hpp"
#include "view/guidance.hpp"
#include "view/messages.hpp"
#include "view/report_page.hpp"

namespace cairn {
namespace {

using namespace std::chrono_literals;
constexpr auto kSurfaceEvery = 120ms, kImagesEvery = 200ms, kStateEvery = 100ms;
constexpr auto kUprightEvery = 1s;        // interval of the gravity vote
constexpr auto kRateWindow = 2s;          // window for frame rates
constexpr int kMaxBricksPerUpdate = 120;  // of the surface: maximum per update, cheaper than a frame
constexpr int kMaxSkipped = 5;            // number of consecutive skipped frames before a notice
constexpr const char* kFinishedData = "finished.json";

double memory_mb() {
  std::ifstream in("/proc/self/statm");
  double total = 0, resident = 0;
  in >> total >> resident;
  return resident * 4096 / (1 << 20);
}

nlohmann::json to_json(const Eigen::Isometry3d& pose) {  // column-major, for three.js
  const Eigen::Matrix4d& m = pose.matrix();
  return std::vector<double>(m.data(), m.data() + 16);
}

/// Color class of a hint: good, weak or lost.
const char* status_of(Hint hint) {
  if (hint == Hint::back) return "lost";
  return hint == Hint::good || hint == Hint::covered ? "good" : "weak";
}

double seconds_of(std::chrono::steady_clock::time_point time) {
  return std::chrono::duration<double>(time.time_since_epoch()).count();
}

/// True if the images have the sizes of the rig. Mapper::add skips other frames.
bool has_sizes_of(const Frame& frame, const Rig& rig) {
  const auto fits = [](const auto& image, const Camera& camera) {
    return image.size() == static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  };
  return !frame.problem && fits(frame.depth, rig.depth) && (frame.color.empty() || fits(frame.color, rig.color_view()));
}

}  // namespace

struct LiveViewer::State {
  using Clock = std::chrono::steady_clock;
  void send_state(const char* status, const std::string& words, nlohmann::json more = nlohmann::json::object());
  void send_surface(bool all);
  [[nodiscard]] nlohmann::json last_frame() const;

  Feed feed;
  Server server;
  Mapper* mapper = nullptr;
  std::optional<LiveSurface> surface;
  Rig rig;
  Options options;
  std::optional<Guidance> guidance;
  ImageContent content;  // of the last frame
  std::optional<GravityAlignment> upright;
  int epoch = 0, dropped = 0, sent_parts = 0, frames_before = 0;
  bool has_reset = true, is_finishing = false;
  nlohmann::json sent;                // last state
  std::string stage_words;            // of the last stage shown
  std::map<std::string, int> counts;  // frames by state
  FrameReport last;
  int skipped = 0;                                          // consecutive frames
  std::deque<std::pair<Clock::time_point, double>> recent;  // frames of the last seconds, with their latency
  Clock::time_point surface_sent, images_sent, state_sent, upright_asked;
  std::optional<Clock::time_point> first_frame;
  std::optional<double> first_mesh_seconds;
  int shown = 0;    // viewers that show the finished map
  int updates = 0;  // of the surface
  double updates_ms = 0;
  bool is_fresh = false;  // a frame arrived since the last update
  bool any = false;       // frames

  explicit State(const ViewerAddress& at)
      : server(at, {{"", viewer_file()}, {"data.json", {"application/json", std::string(R"({"mode":"live"})")}}},
               &feed) {}
};

LiveViewer::LiveViewer(const ViewerAddress& at) : state_(std::make_unique<State>(at)) {}
LiveViewer::~LiveViewer() = default;

const ViewerSite& LiveViewer::site() const { return state_->server.site(); }
bool LiveViewer::is_opened() const { return state_->server.is_opened(); }

void LiveViewer::begin(Mapper& mapper, const Rig& rig, const Options& options, int frames_before, bool has_reset) {
  State& s = *state_;
  s.frames_before = frames_before;
  s.has_reset = has_reset;
  s.is_finishing = false;
  s.mapper = &mapper;
  s.surface.emplace(mapper);
  s.rig = rig;
  s.options = options;
  s.guidance.emplace(rig.depth, options.surface);
  s.upright.reset();
  ++s.epoch;
  s.feed.clear();
  s.counts.clear();
  s.recent.clear();
  s.any = false;
  s.send_state("waiting", "Waiting for the first frame");
}

LiveViewer::ViewerCommands LiveViewer::commands() {
  State& s = *state_;
  ViewerCommands commands;
  for (const std::string& request : s.feed.take_requests()) {
    const auto j = parsed_json_or_none(request);
    if (!j.is_object() || !j.contains("do")) continue;  // invalid request
    if (j["do"] == "pause") commands.pause = true;
    if (j["do"] == "start") commands.pause = false;
    if (j["do"] == "reset") commands.reset = true;
    if (j["do"] == "finish") commands.finish = true;
    if (j["do"] == "skip") commands.skip = true;
    if (j["do"] == "shown") ++s.shown;
  }
  return commands;
}

void LiveViewer::fused(const Frame& frame, const FrameReport& report, double latency_ms) {
  State& s = *state_;
  const auto now = State::Clock::now();
  s.any = true;
  if (!s.first_frame) s.first_frame = now;
  s.last = report;
  s.skipped = report.state == FrameState::skipped ? s.skipped + 1 : 0;
  const bool is_shown = has_sizes_of(frame, s.rig);
  if (is_shown) s.content = content_of(frame, s.rig, s.options.surface);
  std::optional<Eigen::Isometry3d> pose;
  if (report.state == FrameState::fused || report.state == FrameState::held_out)
    if (const Trajectory path = s.mapper->path(2); !path.empty()) pose = path.back().world_from_camera;
  s.guidance->add_frame(report, s.content, pose, seconds_of(now));
  s.is_fresh = true;
  ++s.counts[std::string(to_string(report.state))];
  s.recent.emplace_back(now, latency_ms);
  if (s.feed.viewers() > 0 && now - s.images_sent > kImagesEvery && is_shown) {
    s.images_sent = now;
    if (!frame.color.empty()) s.feed.set("color", color_message(frame, s.rig.color_view()));
    s.feed.set("depth", depth_message(frame, s.rig.depth, s.options.surface.max_depth));
  }
}

void LiveViewer::update(bool paused, int dropped) {
  State& s = *state_;
  const auto now = State::Clock::now();
  if (std::exchange(s.is_fresh, false)) s.guidance->add_dropped(dropped - std::exchange(s.dropped, dropped));
  while (!s.recent.empty() && now - s.recent.front().first > kRateWindow) s.recent.pop_front();
  if (now - s.surface_sent > kSurfaceEvery) s.send_surface(paused);  // also for late viewers
  if (s.feed.viewers() == 0 || now - s.state_sent < kStateEvery) return;
  if (!s.any) return s.send_state("waiting", "Waiting for the first frame");
  if (s.skipped > kMaxSkipped && !paused) return s.send_state("weak", "No usable frames: " + s.last.reason);
  const Advice advice = s.guidance->advice();
  nlohmann::json guidance{{"level", to_string(advice.hint)}, {"words", advice.words}};
  if (advice.turn) guidance["turn"] = {advice.turn->x(), advice.turn->y()};
  s.send_state(paused ? "paused" : status_of(advice.hint), paused ? "Paused" : advice.words, {{"guidance", guidance}});
}

void LiveViewer::State::send_surface(bool all) {
  if (!any) return;
  const auto start = Clock::now();
  const SurfaceChanges changes = surface->changes(kMaxBricksPerUpdate, all);
  if (changes.coverage) guidance->set_coverage(*changes.coverage);
  for (const SurfaceBlock& part : changes.parts)
    feed.set(fmt::format("part {} {} {} {}", part.submap, part.cell.x(), part.cell.y(), part.cell.z()),
             part_message(part, epoch));
  nlohmann::json submaps = nlohmann::json::array();
  for (const Eigen::Isometry3d& pose : changes.world_from_submap) submaps.push_back(to_json(pose));
  feed.set("submaps", nlohmann::json{{"epoch", epoch}, {"submaps", submaps}}.dump(), true);
  feed.set("path", path_message(mapper->path(kMaxPath), epoch));
  sent_parts += static_cast<int>(changes.parts.size());
  surface_sent = Clock::now();
  if (!changes.parts.empty()) {
    updates_ms += std::chrono::duration<double, std::milli>(surface_sent - start).count();
    ++updates;
    if (!first_mesh_seconds) first_mesh_seconds = std::chrono::duration<double>(surface_sent - *first_frame).count();
  }
}

void LiveViewer::State::send_state(const char* status, const std::string& words, nlohmann::json more) {
  state_sent = Clock::now();
  const Feed::Size feed_size = feed.size();
  nlohmann::json state = std::move(more);
  state.update({{"epoch", epoch},
                {"status", status},
                {"words", words},
                {"frames", counts},
                {"frames_before", frames_before},
                {"has_reset", has_reset},
                {"skipped_to_keep_up", dropped},
                {"memory_mb", memory_mb()},
                {"feed", {{"things", feed_size.items}, {"bytes", feed_size.bytes}, {"requests", feed_size.requests}}},
                {"loops", nlohmann::json::array()}});
  if (recent.size() > 1) {
    const double seconds = std::chrono::duration<double>(recent.back().first - recent.front().first).count();
    state["frames_per_second"] = static_cast<double>(recent.size() - 1) / seconds;
    double worst = 0;
    for (const auto& [when, latency] : recent) worst = std::max(worst, latency);
    state["latency_ms"] = worst;
  }
  if (any) {
    const Statistics statistics = mapper->statistics();
    state["keyframes"] = statistics.keyframes;
    state["submaps"] = statistics.submaps + 1;
    state["components"] = statistics.components;
    const Trajectory trajectory = mapper->path(2);
    if (!trajectory.empty()) {
      state["camera"] = to_json(trajectory.back().world_from_camera);
      for (const FoundLoop& loop : mapper->loops())
        state["loops"].push_back({loop.from - trajectory[0].timestamp, loop.to - trajectory[0].timestamp, loop.inlier});
    }
    if (!upright || state_sent - upright_asked > kUprightEvery) {
      upright_asked = state_sent;
      upright = mapper->upright();
    }
    if (upright->known) {
      const Eigen::Quaterniond& q = upright->world_from_tracked;
      state["upright"] = {q.x(), q.y(), q.z(), q.w()};
    }
    state["last_frame"] = last_frame();
    const Camera& camera = rig.depth;
    state["view"] = {{"fx", camera.fx / camera.width}, {"aspect", static_cast<double>(camera.width) / camera.height}};
    if (content.median > 0) state["view"]["depth"] = content.median;
  }
  feed.set("state", text_of(state), true);
  sent = std::move(state);
}

/// Numeric details of the last frame.
nlohmann::json LiveViewer::State::last_frame() const {
  nlohmann::json stats{{"near", content.near}, {"far", content.far}, {"empty", content.empty}};
  if (content.brightness) stats["brightness"] = *content.brightness;
  if (!last.reason.empty()) stats["reason"] = last.reason;
  if (last.fit.iterations > 0) stats.update({{"inlier_share", last.fit.inlier_share}, {"rmse", last.fit.rmse}});
  return stats;
}

void LiveViewer::finishing() {
  State& s = *state_;
  if (!std::exchange(s.is_finishing, true) && s.feed.viewers() > 0 && s.any) s.send_surface(true);
  s.send_state("finishing", "Finishing: the map is corrected and written");
}

void LiveViewer::show_stage(const std::string& words, double fraction) {
  State& s = *state_;
  const auto now = State::Clock::now();
  if (words == s.stage_words && now - s.state_sent < kStateEvery) return;
  s.state_sent = now;
  s.stage_words = words;
  nlohmann::json state = s.sent;  // the mapper's numbers as before the stage
  state.update({{"status", "finishing"}, {"words", words}, {"stage", {{"fraction", fraction}}}});
  s.feed.set("state", text_of(state), true);
}

void LiveViewer::finished(const std::filesystem::path& output) {
  State& s = *state_;
  auto files = FinishedMap(output).served();
  files[kFinishedData] = std::move(files["data.json"]);
  files.erase("data.json");  // a late viewer gets the finished map from the state message
  s.server.add(std::move(files));
  s.send_state("finished", "Finished: " + std::filesystem::absolute(output).lexically_normal().string(),
               {{"data", kFinishedData}});
}

int LiveViewer::viewers() const { return state_->feed.viewers(); }

bool LiveViewer::is_shown() {
  (void)commands();
  return state_->shown >= viewers();
}

LiveViewer::ViewerStats LiveViewer::stats() const {
  const State& s = *state_;
  const double seconds =
      s.first_frame ? std::chrono::duration<double>(State::Clock::now() - *s.first_frame).count() : 0;
  return {.parts = s.sent_parts,
          .updates_per_second = seconds > 0 ? s.updates / seconds : 0,
          .ms_per_update = s.updates > 0 ? s.updates_ms / s.updates : 0,
          .first_mesh_seconds = s.first_mesh_seconds};
}

}  // namespace cairn
