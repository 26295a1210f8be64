// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/ros2_publisher.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "cairn/mapping/live_surface.hpp"
#include "geometry/axes.hpp"
#include "io/ros/dds.hpp"
#include "io/ros/ros_recording.hpp"

namespace cairn {
namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kPointsEvery = std::chrono::seconds(2);
constexpr int kMaxBricksPerUpdate = 2000;
constexpr std::size_t kMaxPoints = 1'000'000;  // 16 MB
constexpr const char *kMap = "map", *kCamera = "cairn_camera";

// Messages in memory, as in C for Cyclone DDS: see ros2_types.cpp.
struct Header {
  std::int32_t sec;
  std::uint32_t nanosec;
  const char* frame_id;
};
struct PoseStamped {
  Header header;
  std::array<double, 7> pose;  // position, qx, qy, qz, qw
};
struct TransformStamped {
  Header header;
  const char* child_frame_id;
  std::array<double, 7> transform;
};
struct TfMessage {
  DdsList transforms;
};
struct PointField {
  const char* name;
  std::uint32_t offset;
  std::uint8_t datatype;
  std::uint32_t count;
};
struct PointCloud2 {
  Header header;
  std::uint32_t height, width;
  DdsList fields;
  std::uint8_t is_bigendian;
  std::uint32_t point_step, row_step;
  DdsList data;
  std::uint8_t is_dense;
};
constexpr std::uint8_t kFloat32 = 7;  // sensor_msgs/PointField

struct Point {
  Eigen::Vector3f position;
  std::uint32_t rgb;  // 0xRRGGBB
};
static_assert(sizeof(Point) == 16);

std::array<double, 7> values_of(const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Quaterniond q(pose.linear());
  return {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
}

}  // namespace

struct Ros2Publisher::State {
  State(std::uint32_t domain, Stamps how)
      : participant(domain),
        stamps(how),
        pose(participant.add_writer("/cairn/pose", "geometry_msgs/PoseStamped", {.depth = 10})),
        tf(participant.add_writer("/tf", "tf2_msgs/TFMessage", {.depth = 100})),
        points(participant.add_writer("/cairn/points", "sensor_msgs/PointCloud2", {.depth = 1})) {}

  [[nodiscard]] Header header_at(double timestamp) const {
    const std::chrono::duration<double> now = std::chrono::system_clock::now().time_since_epoch();
    const double time = stamps == Stamps::now ? now.count() : timestamp, seconds = std::floor(time);
    return {static_cast<std::int32_t>(seconds), static_cast<std::uint32_t>(1e9 * (time - seconds)), kMap};
  }
  /// Rotation and translation from a submap's frame to `map`.
  [[nodiscard]] Eigen::Isometry3d map_from(const Eigen::Isometry3d& tracked_from_other) const {
    Eigen::Isometry3d map_from_tracked = Eigen::Isometry3d::Identity();
    map_from_tracked.linear() = matrix_from_world(Axes::z_up) * mapper->upright().world_from_tracked.toRotationMatrix();
    return map_from_tracked * tracked_from_other;
  }
  void update_surface();
  void publish_pose(const Header& header, const Eigen::Isometry3d& tracked_from_camera) const;
  void publish_points(const Header& header) const;

  DdsParticipant participant;
  Stamps stamps;
  DdsParticipant::Entity pose, tf, points;
  Mapper* mapper = nullptr;
  std::optional<LiveSurface> surface;
  std::map<std::tuple<int, int, int, int>, std::vector<Point>> blocks;  // by submap and cell, in the submap's frame
  std::vector<Eigen::Isometry3d> tracked_from_submap{Eigen::Isometry3d::Identity()};
  std::optional<Clock::time_point> published;  // points
  bool has_failed = false;
};

void Ros2Publisher::State::update_surface() {
  SurfaceChanges changes = surface->changes(kMaxBricksPerUpdate);
  if (!changes.world_from_submap.empty()) tracked_from_submap = std::move(changes.world_from_submap);
  for (const SurfaceBlock& block : changes.parts) {
    auto& all = blocks[{block.submap, block.cell.x(), block.cell.y(), block.cell.z()}];
    all.clear();
    for (std::size_t i = 0; i < block.mesh.positions.size(); ++i) {
      std::uint32_t rgb = 0xffffff;
      if (!block.mesh.colors.empty()) {
        const auto& c = block.mesh.colors[i];
        rgb = static_cast<std::uint32_t>(c[0]) << 16 | static_cast<std::uint32_t>(c[1]) << 8 | c[2];
      }
      all.push_back({block.mesh.positions[i], rgb});
    }
  }
}

void Ros2Publisher::State::publish_pose(const Header& header, const Eigen::Isometry3d& tracked_from_camera) const {
  const auto values = values_of(map_from(tracked_from_submap.back() * tracked_from_camera));
  const PoseStamped stamped{header, values};
  participant.write(pose, &stamped);
  const TransformStamped transform{header, kCamera, values};
  const TfMessage message{{1, 1, &transform}};
  participant.write(tf, &message);
}

void Ros2Publisher::State::publish_points(const Header& header) const {
  std::size_t count = 0;
  for (const auto& [where, block] : blocks) count += block.size();
  const std::size_t step = count / kMaxPoints + 1;
  std::vector<Point> all;
  all.reserve(count / step + 1);
  for (const auto& [where, block] : blocks) {
    const auto submap = static_cast<std::size_t>(std::get<0>(where));
    if (submap >= tracked_from_submap.size()) continue;
    const Eigen::Isometry3f map_from_submap = map_from(tracked_from_submap[submap]).cast<float>();
    for (std::size_t i = 0; i < block.size(); i += step)
      all.push_back({map_from_submap * block[i].position, block[i].rgb});
  }
  const std::array<PointField, 4> fields{
      {{"x", 0, kFloat32, 1}, {"y", 4, kFloat32, 1}, {"z", 8, kFloat32, 1}, {"rgb", 12, kFloat32, 1}}};
  const auto bytes = static_cast<std::uint32_t>(all.size() * sizeof(Point));
  const PointCloud2 cloud{.header = header,
                          .height = 1,
                          .width = static_cast<std::uint32_t>(all.size()),
                          .fields = {fields.size(), fields.size(), fields.data()},
                          .is_bigendian = 0,
                          .point_step = sizeof(Point),
                          .row_step = bytes,
                          .data = {bytes, bytes, all.data()},
                          .is_dense = 1};
  participant.write(points, &cloud);
}

Ros2Publisher::Ros2Publisher(const std::string& domain, Stamps stamps)
    : state_(std::make_unique<State>(ros2_domain(domain), stamps)) {}
Ros2Publisher::~Ros2Publisher() = default;

void Ros2Publisher::begin(Mapper& mapper) {
  state_->mapper = &mapper;
  state_->surface.emplace(mapper);
  state_->blocks.clear();
  state_->tracked_from_submap = {Eigen::Isometry3d::Identity()};
}

void Ros2Publisher::add(const FrameReport& report) {
  State& s = *state_;
  if (!report.tracked_from_camera || s.has_failed) return;
  try {
    const Header header = s.header_at(report.timestamp);
    const auto now = Clock::now();
    const bool is_due = !s.published || now >= *s.published + kPointsEvery;
    if (is_due) s.update_surface();
    s.publish_pose(header, *report.tracked_from_camera);
    if (!is_due) return;
    s.publish_points(header);
    s.published = now;
  } catch (const std::runtime_error& error) {
    s.has_failed = true;
    spdlog::warn("ros2: {}; publishing stops, mapping continues", error.what());
  }
}

}  // namespace cairn
