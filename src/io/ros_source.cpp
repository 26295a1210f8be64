// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <opencv2/core/utils/logger.hpp>
#include <stdexcept>

#include "io/ros_survey.hpp"
#include "io/time_order.hpp"

namespace cairn {
namespace {

constexpr double kAccelerationWindow = 0.25;  // seconds around a frame, as for TUM recordings
constexpr std::size_t kMostWaiting = 32;      // depth images waiting for data of the same time
constexpr std::size_t kMostSamples = 100000;  // of an inertial sensor

class RosSource final : public Source {
 public:
  RosSource(std::unique_ptr<RosRecording> recording, const SourceOptions& options)
      : recording_(std::move(recording)), plan_(plan_of(*recording_, options)) {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // errors go into Frame::problem
  }

  const Rig& rig() const override { return plan_.rig; }
  std::string layout() const override { return recording_->layout(); }
  std::optional<int> size() const override {
    const auto& all = recording_->topics()[plan_.depth.topic].messages;
    if (!all || *all > 1u << 30) return std::nullopt;
    return std::max(0, static_cast<int>(*all) - index_);
  }
  std::optional<std::string> ended_early() const override {
    return at_end_ && depth_.empty() ? recording_->ended_early() : std::nullopt;
  }

  std::optional<Frame> next() override {
    while (!at_end_ && !may_deliver()) read_on();
    if (depth_.empty()) return std::nullopt;
    Waiting image = taken_from(depth_);
    Frame frame{.index = index_++, .timestamp = image.time};
    try {
      if (image.problem) throw std::runtime_error(*image.problem);
      if (!(image.time > last_timestamp_))
        throw std::runtime_error(
            fmt::format("{}: its stamp does not come after that of the frame before but {:.3f} s "
                        "earlier, and images are sorted among {}: it is left out",
                        image.place, last_timestamp_ - image.time, kSortedImages));
      frame.depth = depth_in(image);
    } catch (const std::runtime_error& error) {
      frame.problem = error.what();
      return frame;
    }
    used_.push_back(std::move(image.bytes));
    attach_colour(frame);
    attach_motion(frame);
    last_timestamp_ = frame.timestamp;
    return frame;
  }

 private:
  /// Message kept until its frame is delivered.
  struct Waiting {
    double time;  // seconds
    std::vector<std::uint8_t> bytes;
    std::string place;  // file, topic and position of the message
    std::optional<std::string> problem;
  };
  struct Sample {
    double time;            // seconds
    Eigen::Vector3d value;  // gyroscope: in its own frame; accelerometer: in the depth camera's frame
  };

  static Waiting taken_from(std::deque<Waiting>& queue) {
    Waiting first = std::move(queue.front());
    queue.pop_front();
    return first;
  }
  /// Copies into the buffer of a delivered image: fresh memory costs more than the copy.
  std::vector<std::uint8_t> copy_of(std::span<const std::uint8_t> bytes) {
    std::vector<std::uint8_t> copy;
    if (!used_.empty()) {
      copy = std::move(used_.back());
      used_.pop_back();
    }
    copy.assign(bytes.begin(), bytes.end());
    return copy;
  }

  [[nodiscard]] double half_a_frame() const { return 0.5 * plan_.interval; }

  /// True if all data of the first depth image has been read.
  [[nodiscard]] bool may_deliver() const {
    if (depth_.size() > kMostWaiting) return true;
    if (depth_.size() < kSortedImages) return false;
    const double time = depth_.front().time;
    return (!plan_.colour || newest_colour_ >= time + half_a_frame()) && (!plan_.gyro || newest_rate_ >= time) &&
           (!plan_.accelerometer || newest_acceleration_ >= time + kAccelerationWindow);
  }

  void read_on() {
    try {
      const auto message = recording_->next();
      if (!message)
        at_end_ = true;
      else
        take(*message);
    } catch (const std::runtime_error& error) {
      depth_.push_back({depth_.empty() ? last_timestamp_ : depth_.back().time, {}, {}, error.what()});
      if (!std::isfinite(depth_.back().time)) depth_.back().time = 0;
    }
  }

  void take(const RosMessage& message) {
    const auto is = [&](const std::optional<RosStream>& s) { return s && s->topic == message.topic; };
    const RosTopic& topic = recording_->topics()[message.topic];
    const bool depth = message.topic == plan_.depth.topic, colour = is(plan_.colour);
    if (!depth && !colour && !is(plan_.gyro) && !is(plan_.accelerometer)) return;
    const std::string place = fmt::format("{}: {} in {} {}", *message.file, topic.name, message.unit, message.place);
    RosHeader header;
    try {
      header = read_ros_header(message.bytes, topic.encoding);
      if (is(plan_.gyro) || is(plan_.accelerometer)) take_motion(message, header);
    } catch (const std::runtime_error& error) {
      if (depth) throw std::runtime_error(place + ": " + error.what());
      return;
    }
    if (!depth && !colour) return;
    const double time = time_of(depth ? plan_.depth : *plan_.colour, message, header);
    auto& queue = depth ? depth_ : colour_;
    put_by_time(queue, {time, copy_of(message.bytes), place, {}}, &Waiting::time);
    if (!colour) return;
    newest_colour_ = std::max(newest_colour_, time);
    if (colour_.size() > 2 * kMostWaiting) drop_colour();
  }

  void drop_colour() { used_.push_back(taken_from(colour_).bytes); }

  void take_motion(const RosMessage& message, const RosHeader& header) {
    const RosImu imu = read_imu(message.bytes, recording_->topics()[message.topic].encoding);
    const auto put = [&](const std::optional<RosStream>& stream, const std::optional<Eigen::Vector3d>& value,
                         const Eigen::Matrix3d& turn, std::deque<Sample>& samples, double& newest) {
      if (!stream || stream->topic != message.topic || !value) return;
      const double time = time_of(*stream, message, header);
      newest = std::max(newest, time);
      put_by_time(samples, {time, turn * *value}, &Sample::time);
      if (samples.size() > kMostSamples) samples.pop_front();
    };
    put(plan_.gyro, imu.rate, Eigen::Matrix3d::Identity(), rates_, newest_rate_);
    put(plan_.accelerometer, imu.acceleration, plan_.depth_from_accelerometer, accelerations_, newest_acceleration_);
  }

  [[nodiscard]] RosImage image_in(const Waiting& waiting, const RosStream& stream, const Camera& camera) const {
    const RosTopic& topic = recording_->topics()[stream.topic];
    return read_ros_image(waiting.bytes, topic.encoding, topic.type, {.size = {camera.width, camera.height}});
  }

  std::vector<float> depth_in(const Waiting& waiting) const {
    try {
      const RosImage image = image_in(waiting, plan_.depth, plan_.rig.depth);
      if (image.kind != RosImage::Kind::depth)
        throw std::runtime_error(fmt::format("holds {}, which is no depth", image.encoding));
      return depth_of(image, plan_.unit);
    } catch (const std::exception& error) {
      throw std::runtime_error(waiting.place + ": " + error.what());
    }
  }

  /// Attaches the color image closest in time, within half a frame interval.
  void attach_colour(Frame& frame) {
    const auto off = [&](const Waiting& w) { return w.time - frame.timestamp; };
    while (!colour_.empty() && off(colour_.front()) < -half_a_frame()) drop_colour();
    const Waiting* nearest = nullptr;
    for (const Waiting& waiting : colour_)
      if (nearest == nullptr || std::abs(off(waiting)) < std::abs(off(*nearest))) nearest = &waiting;
    if (nearest == nullptr || !(std::abs(off(*nearest)) <= half_a_frame())) return;
    try {
      const RosImage image = image_in(*nearest, *plan_.colour, plan_.rig.colour_view());
      if (image.kind != RosImage::Kind::colour && image.kind != RosImage::Kind::grey) return;
      frame.colour = colour_of(image);
      frame.colour_delay = off(*nearest);
    } catch (const std::exception&) {
      // Frames without color are still valid.
    }
  }

  void attach_motion(Frame& frame) {
    const double since = std::isfinite(last_timestamp_) ? last_timestamp_ : frame.timestamp - plan_.interval;
    for (; !rates_.empty() && rates_.front().time <= frame.timestamp; rates_.pop_front())
      if (rates_.front().time > since) frame.gyro.push_back({rates_.front().time, rates_.front().value});
    while (!accelerations_.empty() && accelerations_.front().time < frame.timestamp - kAccelerationWindow)
      accelerations_.pop_front();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int count = 0;
    for (const Sample& sample : accelerations_) {
      if (sample.time > frame.timestamp + kAccelerationWindow) break;
      sum += sample.value;
      ++count;
    }
    if (count > 0) frame.acceleration = sum / count;
  }

  std::unique_ptr<RosRecording> recording_;
  RosPlan plan_;
  std::deque<Waiting> depth_, colour_;
  std::vector<std::vector<std::uint8_t>> used_;  // buffers of delivered images
  std::deque<Sample> rates_, accelerations_;
  double newest_colour_ = -INFINITY, newest_rate_ = -INFINITY, newest_acceleration_ = -INFINITY;  // seconds
  double last_timestamp_ = -INFINITY;
  int index_ = 0;
  bool at_end_ = false;
};

}  // namespace

std::unique_ptr<Source> open_ros(const std::filesystem::path& recording, const SourceOptions& options) {
  return std::make_unique<RosSource>(open_ros_recording(recording), options);
}

}  // namespace cairn
