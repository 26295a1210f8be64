// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "live_view.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <fstream>
#include <thread>

#include "view/messages.hpp"
#include "view/report_page.hpp"

namespace cairn::apps {
namespace {

using namespace std::chrono_literals;
constexpr auto kSurfaceEvery = 120ms, kImagesEvery = 200ms, kStateEvery = 100ms;
constexpr auto kRecent = 2s;        // of frames that rates are told of
constexpr int kBricksAtOnce = 120;  // of the surface: as many as cost less than a frame
constexpr double kFewInliers = 0.45;
constexpr auto kGoodbye = 500ms;  // for viewers to hear the last words

double memory_mb() {
  std::ifstream in("/proc/self/statm");
  double total = 0, resident = 0;
  in >> total >> resident;
  return resident * 4096 / (1 << 20);
}

nlohmann::json to_json(const Eigen::Isometry3d& pose) {  // column by column, as three.js takes it
  const Eigen::Matrix4d& m = pose.matrix();
  return std::vector<double>(m.data(), m.data() + 16);
}

std::pair<const char*, std::string> words_of(const FrameReport& report, bool any) {
  if (!any) return {"waiting", "Waiting for the first frame"};
  if (report.state == FrameState::lost)
    return {"lost", "Lost: turn back to what was seen before (" + report.reason + ")"};
  if (report.state == FrameState::skipped) return {"weak", "Frame skipped: " + report.reason};
  if (report.iterations > 0 && report.inlier_share < kFewInliers)
    return {"weak",
            fmt::format("Tracking is weak, move slowly: {:.0f} % of the image fits", 100 * report.inlier_share)};
  return {"good", report.iterations > 0 ? fmt::format("Tracking: {:.0f} % of the image fits", 100 * report.inlier_share)
                                        : "Tracking begins"};
}

}  // namespace

Served viewer_file() { return {"text/html; charset=utf-8", std::string(viewer_page())}; }

LiveView::LiveView(int port)
    : server_(port, {{"", viewer_file()}, {"data.json", Served{"application/json", std::string(R"({"mode":"live"})")}}},
              &feed_) {
  fmt::print(stderr, "view        {}\n", server_.url());
}

void LiveView::begin(Mapper& mapper, const Camera& camera, const Options& options) {
  mapper_ = &mapper;
  camera_ = camera;
  max_depth_ = options.surface.max_depth;
  ++epoch_;
  feed_.clear();
  counts_.clear();
  recent_.clear();
  any_ = false;
  send_state("waiting", "Waiting for the first frame");
}

LiveView::Asked LiveView::asked() {
  Asked asked;
  for (const std::string& request : feed_.take_requests()) {
    const auto j = nlohmann::json::parse(request, nullptr, false);
    if (!j.is_object() || !j.contains("do")) continue;  // rubbish
    if (j["do"] == "pause") asked.pause = true;
    if (j["do"] == "start") asked.pause = false;
    if (j["do"] == "reset") asked.reset = true;
    if (j["do"] == "finish") asked.finish = true;
  }
  return asked;
}

void LiveView::fused(const Frame& frame, const FrameReport& report, double latency_ms) {
  const auto now = Clock::now();
  any_ = true;
  if (!first_frame_) first_frame_ = now;
  last_ = report;
  ++counts_[report.state == FrameState::fused ? "fused" : report.state == FrameState::lost ? "lost" : "skipped"];
  recent_.emplace_back(now, latency_ms);
  if (feed_.viewers() > 0 && now - images_ > kImagesEvery && frame.problem.empty()) {
    images_ = now;
    if (!frame.colour.empty()) feed_.set("colour", colour_message(frame, camera_));
    feed_.set("depth", depth_message(frame, camera_, max_depth_));
  }
}

void LiveView::update(bool paused, int dropped) {
  const auto now = Clock::now();
  dropped_ = dropped;
  while (!recent_.empty() && now - recent_.front().first > kRecent) recent_.pop_front();
  if (now - surface_ > kSurfaceEvery) send_surface(paused);  // a viewer may come late and wants all of it
  if (feed_.viewers() == 0 || now - state_ < kStateEvery) return;
  const auto [status, words] = words_of(last_, any_);
  send_state(paused ? "paused" : status, paused ? "Paused: nothing is fused" : words);
}

void LiveView::send_surface(bool all) {
  if (!any_) return;
  const auto start = Clock::now();
  const SurfaceChanges changes = mapper_->surface_changes(kBricksAtOnce, all);
  for (const SurfacePart& part : changes.parts)
    feed_.set(fmt::format("part {} {} {} {}", part.submap, part.cell.x(), part.cell.y(), part.cell.z()),
              part_message(part, epoch_));
  nlohmann::json submaps = nlohmann::json::array();
  for (const Eigen::Isometry3d& pose : changes.world_from_submap) submaps.push_back(to_json(pose));
  feed_.set("submaps", nlohmann::json{{"epoch", epoch_}, {"submaps", submaps}}.dump(), true);
  feed_.set("path", path_message(mapper_->path(kMaxPath), epoch_));
  sent_parts_ += static_cast<int>(changes.parts.size());
  surface_ = Clock::now();
  if (!changes.parts.empty()) {
    surface_ms_.add(std::chrono::duration<double, std::milli>(surface_ - start).count());
    if (!first_mesh_seconds_) first_mesh_seconds_ = std::chrono::duration<double>(surface_ - *first_frame_).count();
  }
}

void LiveView::send_state(const char* status, const std::string& words) {
  state_ = Clock::now();
  const Feed::Size held = feed_.size();
  nlohmann::json state{{"epoch", epoch_},
                       {"status", status},
                       {"words", words},
                       {"frames", counts_},
                       {"skipped_to_keep_up", dropped_},
                       {"memory_mb", memory_mb()},
                       {"feed", {{"things", held.things}, {"bytes", held.bytes}, {"requests", held.requests}}},
                       {"loops", nlohmann::json::array()}};
  if (recent_.size() > 1) {
    const double seconds = std::chrono::duration<double>(recent_.back().first - recent_.front().first).count();
    state["frames_per_second"] = static_cast<double>(recent_.size() - 1) / seconds;
    double worst = 0;
    for (const auto& [when, latency] : recent_) worst = std::max(worst, latency);
    state["latency_ms"] = worst;
  }
  if (any_) {
    const Mapper::Statistics statistics = mapper_->statistics();
    state["keyframes"] = statistics.keyframes;
    state["submaps"] = statistics.submaps + 1;
    state["components"] = statistics.components;
    const Trajectory trajectory = mapper_->path(2);
    if (!trajectory.empty()) {
      state["camera"] = to_json(trajectory.back().world_from_camera);
      for (const FoundLoop& loop : mapper_->loops())
        state["loops"].push_back({loop.from - trajectory[0].timestamp, loop.to - trajectory[0].timestamp, loop.inlier});
    }
    state["view"] = {{"fx", camera_.fx / camera_.width},
                     {"aspect", static_cast<double>(camera_.width) / camera_.height}};
  }
  feed_.set("state", state.dump(), true);
}

void LiveView::finishing() {
  if (feed_.viewers() > 0 && any_) send_surface(true);
  send_state("finishing", "Finishing: the map is corrected and written");
}

void LiveView::finished(const std::filesystem::path& output) {
  send_state("finished", "Finished: open " + std::filesystem::absolute(output / "report.html").string());
  if (feed_.viewers() > 0) std::this_thread::sleep_for(kGoodbye);
}

nlohmann::json LiveView::told() const {
  const double seconds = first_frame_ ? std::chrono::duration<double>(Clock::now() - *first_frame_).count() : 0;
  nlohmann::json told{{"parts", sent_parts_},
                      {"updates_per_second", seconds > 0 ? static_cast<double>(surface_ms_.count()) / seconds : 0},
                      {"ms_per_update", surface_ms_.mean()}};
  if (first_mesh_seconds_) told["first_mesh_seconds"] = *first_mesh_seconds_;
  return told;
}

}  // namespace cairn::apps
