// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/run_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "base/file_name.hpp"
#include "cairn/mapping/live_surface.hpp"
#include "geometry/axes.hpp"
#include "io/ros/mcap_writer.hpp"
#include "log/messages.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Logging intervals in nanoseconds of the recording, slightly below the nominal values because timestamps jitter.
constexpr LogTime kImagesEvery = 195'000'000, kSurfaceEvery = 1'995'000'000, kPathEvery = 4'995'000'000;
constexpr int kMaxBricksPerUpdate = 2000;    // surface bricks per update
constexpr std::size_t kMaxPathPoses = 1000;  // maximum poses of the path during mapping
constexpr std::size_t kMaxQueued = 64;       // messages in the queue; a full queue blocks the run
                                             // until the disk catches up
constexpr std::uintmax_t kMinFreeSpace = std::uintmax_t{256} << 20;  // bytes left free on the disk for the map

// Coordinate frames, from outermost to innermost.
constexpr const char *kMap = "map", *kWorld = "world", *kTracked = "tracked", *kCamera = "camera",
                     *kColorCamera = "camera_color";

/// Encodes and writes messages in order, in its own thread.
class LogWriter {
 public:
  explicit LogWriter(const fs::path& file)
      : file_(file), writer_(file), thread_([this](const std::stop_token& stop) { run(stop); }) {}
  /// Blocks while the queue is full. Does nothing after an error.
  void add(LogTime time, const char* topic, std::function<ProtoMessage()> encode) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return queue_.size() < kMaxQueued || problem_; });
    if (problem_ || is_closed_) return;
    queue_.push_back({time, topic, std::move(encode)});
    changed_.notify_all();
  }
  /// Writes the queued messages and the end of the file.
  void end() {
    {
      const std::lock_guard lock(mutex_);
      if (std::exchange(is_closed_, true)) return;
      changed_.notify_all();
    }
    thread_.join();
  }
  [[nodiscard]] std::optional<std::string> problem() const {
    const std::lock_guard lock(mutex_);
    return problem_;
  }

 private:
  struct Message {
    LogTime time;
    const char* topic;
    std::function<ProtoMessage()> encode;
  };

  void run(const std::stop_token& stop) {
    try {
      while (const auto message = next(stop)) write(*message);
      writer_.finish();
    } catch (const std::exception& error) {
      const std::lock_guard lock(mutex_);
      problem_ = fmt::format("{}; logging stops, mapping continues", error.what());
      queue_.clear();
      changed_.notify_all();
    }
  }
  /// Returns nullopt after the last message.
  std::optional<Message> next(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [&] { return !queue_.empty() || is_closed_; });
    if (queue_.empty()) return std::nullopt;
    Message message = std::move(queue_.front());
    queue_.pop_front();
    changed_.notify_all();
    return message;
  }
  void write(const Message& message) {
    const ProtoMessage encoded = message.encode();
    if (!topics_.contains(message.topic)) {
      const ProtoSchema& schema = encoded.schema();
      topics_[message.topic] = writer_.add({.name = message.topic,
                                            .message_encoding = "protobuf",
                                            .schema = std::string(schema.name),
                                            .schema_encoding = "protobuf",
                                            .schema_data = descriptors_of(schema)});
    }
    if (encoded.bytes().size() > kCheckedSize) check_free_space();
    writer_.write(topics_[message.topic], message.time, encoded.bytes());
  }
  /// Throws if the disk is nearly full: the map may be written to the same disk.
  void check_free_space() const {
    std::error_code unknown;
    const fs::space_info space = fs::space(file_, unknown);
    if (!unknown && space.available < kMinFreeSpace)
      throw std::runtime_error(
          fmt::format("{}: less than {} MiB are left on the disk", file_.string(), kMinFreeSpace >> 20));
  }

  static constexpr std::size_t kCheckedSize = 10'000;  // bytes of a message that trigger a check of the free space
  fs::path file_;
  McapWriter writer_;
  std::map<std::string_view, std::uint16_t> topics_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Message> queue_;
  std::optional<std::string> problem_;
  bool is_closed_ = false;
  std::jthread thread_;  // last member: the thread uses the others
};

/// True once per interval; also true if the time goes backwards (the unsigned difference wraps).
class IntervalTimer {
 public:
  explicit IntervalTimer(LogTime every) : every_(every) {}
  bool operator()(LogTime now) {
    if (last_ && now - *last_ < every_) return false;
    last_ = now;
    return true;
  }

 private:
  LogTime every_;
  std::optional<LogTime> last_;
};

Eigen::Isometry3d turn(const Eigen::Matrix3d& rotation) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = rotation;
  return pose;
}

fs::path checked(const fs::path& file, bool replace) {
  if (extension_of(file) != ".mcap")
    throw std::runtime_error(file.string() + ": a log is an MCAP file; give it a name that ends in .mcap");
  if (!fs::exists(fs::symlink_status(file))) return file;
  if (!replace) throw std::runtime_error(file.string() + ": exists; choose another name");
  if (!is_written_by_mcap_writer(file))
    throw std::runtime_error(file.string() + ": exists and is not a log of an earlier run; choose another name");
  fs::remove(file);
  return file;
}

}  // namespace

struct RunLog::State {
  explicit State(const fs::path& file) : log_writer(file) {}
  /// Logs a message; does nothing before the first frame, because its time is unknown.
  template <class Encode>
  void log(const char* topic, const Encode& encode) {
    if (time) log_writer.add(*time, topic, [at = *time, encode] { return encode(at); });
  }
  void log_text(LogLevel level, std::string text);
  void update_time(const FrameReport& report);
  void log_state_change(const FrameReport& report);
  void add_images(const Frame& frame);
  void add_transforms();
  void add_surface(int max_bricks, bool all);
  void add_path();

  Mapper* mapper = nullptr;
  std::optional<LiveSurface> surface;
  Rig rig;
  std::optional<LogTime> time;                                // of the last frame; empty before the first frame
  std::vector<std::pair<LogLevel, std::string>> early_texts;  // texts from before the first frame
  IntervalTimer images{kImagesEvery}, surfaces{kSurfaceEvery}, paths{kPathEvery};
  GravityAlignment upright;
  std::vector<Eigen::Isometry3d> tracked_from_submap{Eigen::Isometry3d::Identity()};  // last logged poses
  std::optional<Eigen::Isometry3d> submap_from_camera;                                // pose of the last tracked frame
  FrameState state = FrameState::fused;
  std::size_t loops = 0;  // number of logged loop closures
  LogWriter log_writer;
};

void RunLog::State::log_text(LogLevel level, std::string text) {
  if (!time) return early_texts.emplace_back(level, std::move(text)), void();
  log("/diagnostics", [=](LogTime at) { return text_message(at, level, text); });
}

/// Updates the log time. A skipped frame may have an invalid timestamp, so the previous time is kept.
void RunLog::State::update_time(const FrameReport& report) {
  constexpr double kMaxTimestamp = 9e9;  // seconds: year 2255
  if (!(report.timestamp >= 0 && report.timestamp < kMaxTimestamp)) return;
  if (time && report.state == FrameState::skipped) return;
  time = std::max(time.value_or(0), static_cast<LogTime>(std::llround(1e9 * report.timestamp)));
  for (auto& [level, text] : std::exchange(early_texts, {})) log_text(level, std::move(text));
}

/// Logs transitions of the frame state, not every frame.
void RunLog::State::log_state_change(const FrameReport& report) {
  if (report.state == FrameState::held_out) return;
  const FrameState before = std::exchange(state, report.state);
  if (report.state == FrameState::fused && report.cause == FrameCause::new_component)
    log_text(LogLevel::warning,
             fmt::format("frame {} starts a new component of the map: {}", report.index, report.reason));
  else if (report.state == FrameState::fused && before == FrameState::lost)
    log_text(LogLevel::info, fmt::format("tracking recovered at frame {}", report.index));
  if (report.state == before || report.state == FrameState::fused) return;
  log_text(LogLevel::warning, fmt::format("frame {} is {}: {}", report.index, to_string(report.state), report.reason));
}

void RunLog::State::add_transforms() {
  std::vector<NamedTransform> all{{kMap, kWorld, turn(matrix_from_world(Axes::z_up))},
                                  {kWorld, kTracked, turn(upright.world_from_tracked.toRotationMatrix())},
                                  {kCamera, kColorCamera, rig.depth_from_color()}};
  if (submap_from_camera) all.push_back({kTracked, kCamera, tracked_from_submap.back() * *submap_from_camera});
  log("/tf", [=](LogTime at) { return transforms_message(at, all); });
}

void RunLog::State::add_images(const Frame& frame) {
  const auto f = std::make_shared<const Frame>(frame);
  const auto r = std::make_shared<const Rig>(rig);
  log("/camera/depth/calibration", [=](LogTime at) { return calibration_message(at, kCamera, r->depth); });
  log("/camera/depth/image", [=](LogTime at) { return depth_image_message(at, kCamera, *f, r->depth); });
  log("/points", [=](LogTime at) { return points_message(at, kCamera, *f, *r); });
  if (frame.color.empty()) return;
  const Camera& view = r->color_view();
  log("/camera/color/calibration", [=](LogTime at) { return calibration_message(at, kColorCamera, view); });
  log("/camera/color/image", [=](LogTime at) { return color_image_message(at, kColorCamera, *f, view); });
}

void RunLog::State::add_surface(int max_bricks, bool all) {
  SurfaceChanges changes = surface->changes(max_bricks, all);
  upright = mapper->upright();
  if (!changes.world_from_submap.empty()) tracked_from_submap = std::move(changes.world_from_submap);
  std::vector<NamedTransform> submaps;
  for (std::size_t i = 0; i < tracked_from_submap.size(); ++i)
    submaps.push_back({kTracked, submap_frame(static_cast<int>(i)), tracked_from_submap[i]});
  log("/tf/submaps", [=](LogTime at) { return transforms_message(at, submaps); });
  const auto parts = std::make_shared<const std::vector<SurfaceBlock>>(std::move(changes.parts));
  if (!parts->empty()) log("/mesh", [=](LogTime at) { return surface_message(at, *parts); });
  const std::vector<FoundLoop> found = mapper->loops();
  if (loops < found.size()) add_path();
  for (; loops < found.size(); ++loops)
    log_text(LogLevel::info, fmt::format("loop closure of {:.3f} s with {:.3f} s{}", found[loops].to, found[loops].from,
                                         found[loops].inlier ? "" : ", rejected by the pose graph"));
}

void RunLog::State::add_path() {
  const Trajectory path = mapper->path(kMaxPathPoses);
  if (!path.empty()) log("/trajectory", [=](LogTime at) { return poses_message(at, kTracked, path); });
}

RunLog::RunLog(const fs::path& file, bool replace) : state_(std::make_unique<State>(checked(file, replace))) {}

RunLog::~RunLog() { state_->log_writer.end(); }

void RunLog::begin(Mapper& mapper, const Rig& rig) {
  State& s = *state_;
  if (s.mapper != nullptr) s.log("/mesh", no_surface_message);
  s.mapper = &mapper;
  s.surface.emplace(mapper);
  s.rig = rig;
  s.upright = {};
  s.tracked_from_submap = {Eigen::Isometry3d::Identity()};
  s.submap_from_camera.reset();
  s.loops = mapper.loops().size();
}

void RunLog::add(const Frame& frame, const FrameReport& report) {
  State& s = *state_;
  s.update_time(report);
  if (!s.time) return;
  s.log("/cairn/frame", [=](LogTime at) { return report_message(at, report); });
  s.log_state_change(report);
  if (report.state == FrameState::fused || report.state == FrameState::held_out) {
    s.submap_from_camera = report.tracked_from_camera;
    if (s.surfaces(*s.time)) s.add_surface(kMaxBricksPerUpdate, false);
    s.add_transforms();
    if (s.paths(*s.time)) s.add_path();
  }
  if (!frame.problem && s.images(*s.time)) s.add_images(frame);
}

void RunLog::warn(std::string_view text) { state_->log_text(LogLevel::warning, std::string(text)); }

void RunLog::finishing() {
  State& s = *state_;
  if (!s.submap_from_camera) return;
  s.mapper->finish_optimization();
  s.add_surface(std::numeric_limits<int>::max(), true);
}

void RunLog::finish(const Verdict& verdict) {
  State& s = *state_;
  s.upright = s.mapper->upright();
  s.add_transforms();
  if (const Trajectory all = s.mapper->trajectory(); !all.empty())
    s.log("/trajectory", [=](LogTime at) { return poses_message(at, kWorld, all); });
  using Level = Verdict::Level;
  const LogLevel level = verdict.level == Level::good   ? LogLevel::info
                         : verdict.level == Level::weak ? LogLevel::warning
                                                        : LogLevel::error;
  s.log_text(level, fmt::format("{}: {}", to_string(verdict.level), verdict.words));
  for (const std::string& reason : verdict.reasons) s.log_text(level, reason);
  s.log_writer.end();
}

std::optional<std::string> RunLog::problem() const { return state_->log_writer.problem(); }

}  // namespace cairn
