// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/ros_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <opencv2/core/utils/logger.hpp>
#include <stdexcept>

#include "io/inertial_samples.hpp"
#include "io/ros/ros_survey.hpp"
#include "io/ros/time_order.hpp"

namespace cairn {
namespace {

constexpr std::size_t kMaxQueued = 32;     // depth images waiting for data of the same time
constexpr std::size_t kMaxLiveQueued = 8;  // the same, of running topics

class RosSource final : public Source {
 public:
  RosSource(std::unique_ptr<RosRecording> recording, const SourceOptions& options)
      : recording_(std::move(recording)), plan_(plan_of(*recording_, options)) {
    if (recording_->is_live()) recording_->follow(topics_of(plan_));
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
    while (!at_end_ && !is_ready()) read_message();
    if (depth_.empty()) return std::nullopt;
    QueuedMessage image = pop_front(depth_);
    Frame frame{.index = index_++, .timestamp = image.time};
    try {
      if (image.problem) throw std::runtime_error(*image.problem);
      if (!(image.time > last_timestamp_))
        throw std::runtime_error(fmt::format(
            "{}: its timestamp is {:.3f} s before the previous frame, and only {} images are sorted: it is skipped",
            image.place, last_timestamp_ - image.time, kSortWindow));
      frame.depth = depth_in(image);
    } catch (const std::runtime_error& error) {
      frame.problem = error.what();
      return frame;
    }
    buffers_.push_back(std::move(image.bytes));
    attach_color(frame);
    samples_.attach_to(frame, std::isfinite(last_timestamp_) ? last_timestamp_ : frame.timestamp - plan_.interval);
    last_timestamp_ = frame.timestamp;
    return frame;
  }

 private:
  /// Message kept until its frame is delivered.
  struct QueuedMessage {
    double time;  // seconds
    std::vector<std::uint8_t> bytes;
    std::string place;  // file, topic and position of the message
    std::optional<std::string> problem;
  };

  static QueuedMessage pop_front(std::deque<QueuedMessage>& queue) {
    QueuedMessage first = std::move(queue.front());
    queue.pop_front();
    return first;
  }
  /// Copies into the buffer of a delivered image: fresh memory costs more than the copy.
  std::vector<std::uint8_t> copy_of(std::span<const std::uint8_t> bytes) {
    std::vector<std::uint8_t> copy;
    if (!buffers_.empty()) {
      copy = std::move(buffers_.back());
      buffers_.pop_back();
    }
    copy.assign(bytes.begin(), bytes.end());
    return copy;
  }

  [[nodiscard]] double half_interval() const { return 0.5 * plan_.interval; }

  static std::vector<std::size_t> topics_of(const RosPlan& plan) {
    std::vector<std::size_t> topics{plan.depth.topic};
    for (const auto* stream : {&plan.color, &plan.gyro, &plan.accelerometer})
      if (*stream) topics.push_back((*stream)->topic);
    return topics;
  }

  /// True if all data of the first depth image has been read.
  [[nodiscard]] bool is_ready() const {
    if (recording_->is_live()) return is_live_ready();
    if (depth_.size() > kMaxQueued) return true;
    if (depth_.size() < kSortWindow) return false;
    const double time = depth_.front().time;
    return (!plan_.color || newest_color_ >= time + half_interval()) && (!plan_.gyro || newest_rate_ >= time) &&
           (!plan_.accelerometer || newest_acceleration_ >= time + kAccelerationWindow);
  }

  /// The same for running topics, with less delay: their messages arrive in order.
  [[nodiscard]] bool is_live_ready() const {
    if (depth_.empty()) return false;
    if (depth_.size() > kMaxLiveQueued || depth_.back().problem) return true;
    const double time = depth_.front().time;
    return (!plan_.color || newest_color_ >= time) && (!plan_.gyro || newest_rate_ >= time);
  }

  void read_message() {
    try {
      const auto message = recording_->next();
      if (!message)
        at_end_ = true;
      else
        add(*message);
    } catch (const std::runtime_error& error) {
      depth_.push_back({depth_.empty() ? last_timestamp_ : depth_.back().time, {}, {}, error.what()});
      if (!std::isfinite(depth_.back().time)) depth_.back().time = 0;
    }
  }

  void add(const RosMessage& message) {
    const auto is = [&](const std::optional<RosStream>& s) { return s && s->topic == message.topic; };
    const RosTopic& topic = recording_->topics()[message.topic];
    const bool depth = message.topic == plan_.depth.topic, color = is(plan_.color);
    if (!depth && !color && !is(plan_.gyro) && !is(plan_.accelerometer)) return;
    const std::string place = fmt::format("{}: {} in {} {}", *message.file, topic.name, message.unit, message.place);
    RosHeader header;
    try {
      header = read_ros_header(message.bytes, topic.encoding);
      if (is(plan_.gyro) || is(plan_.accelerometer)) add_motion(message, header);
    } catch (const std::runtime_error& error) {
      if (depth) throw std::runtime_error(place + ": " + error.what());
      return;
    }
    if (!depth && !color) return;
    const double time = time_of(depth ? plan_.depth : *plan_.color, message, header);
    auto& queue = depth ? depth_ : color_;
    insert_by_time(queue, {time, copy_of(message.bytes), place, {}}, &QueuedMessage::time);
    if (!color) return;
    newest_color_ = std::max(newest_color_, time);
    if (color_.size() > 2 * kMaxQueued) drop_color();
  }

  void drop_color() { buffers_.push_back(pop_front(color_).bytes); }

  void add_motion(const RosMessage& message, const RosHeader& header) {
    const RosImu imu = read_imu(message.bytes, recording_->topics()[message.topic].encoding);
    const auto time_in = [&](const std::optional<RosStream>& stream) {
      return stream && stream->topic == message.topic ? std::optional(time_of(*stream, message, header)) : std::nullopt;
    };
    if (const auto time = time_in(plan_.gyro); time && imu.rate) {
      newest_rate_ = std::max(newest_rate_, *time);
      samples_.add_rate({*time, *imu.rate});
    }
    if (const auto time = time_in(plan_.accelerometer); time && imu.acceleration) {
      newest_acceleration_ = std::max(newest_acceleration_, *time);
      samples_.add_acceleration({*time, plan_.depth_from_accelerometer * *imu.acceleration});
    }
  }

  [[nodiscard]] RosImage image_in(const QueuedMessage& queued, const RosStream& stream, const Camera& camera) const {
    const RosTopic& topic = recording_->topics()[stream.topic];
    return read_ros_image(queued.bytes, topic.encoding, topic.type, {.size = {camera.width, camera.height}});
  }

  std::vector<float> depth_in(const QueuedMessage& queued) const {
    try {
      const RosImage image = image_in(queued, plan_.depth, plan_.rig.depth);
      if (image.kind != RosImage::Kind::depth)
        throw std::runtime_error(fmt::format("has {}, which is not depth", image.encoding));
      return depth_of(image, plan_.unit);
    } catch (const std::exception& error) {
      throw std::runtime_error(queued.place + ": " + error.what());
    }
  }

  /// Attaches the color image closest in time, within half a frame interval.
  void attach_color(Frame& frame) {
    const auto offset = [&](const QueuedMessage& w) { return w.time - frame.timestamp; };
    while (!color_.empty() && offset(color_.front()) < -half_interval()) drop_color();
    const QueuedMessage* nearest = nullptr;
    for (const QueuedMessage& queued : color_)
      if (nearest == nullptr || std::abs(offset(queued)) < std::abs(offset(*nearest))) nearest = &queued;
    if (nearest == nullptr || !(std::abs(offset(*nearest)) <= half_interval())) return;
    try {
      const RosImage image = image_in(*nearest, *plan_.color, plan_.rig.color_view());
      if (image.kind != RosImage::Kind::color && image.kind != RosImage::Kind::gray) return;
      frame.color = color_of(image);
      frame.color_delay = offset(*nearest);
    } catch (const std::exception&) {
      // Frames without color are still valid.
    }
  }

  std::unique_ptr<RosRecording> recording_;
  RosPlan plan_;
  std::deque<QueuedMessage> depth_, color_;
  std::vector<std::vector<std::uint8_t>> buffers_;  // buffers of delivered images
  InertialSamples samples_;
  double newest_color_ = -INFINITY, newest_rate_ = -INFINITY, newest_acceleration_ = -INFINITY;  // seconds
  double last_timestamp_ = -INFINITY;
  int index_ = 0;
  bool at_end_ = false;
};

}  // namespace

std::unique_ptr<Source> open_ros(const std::filesystem::path& recording, const SourceOptions& options) {
  auto opened = recording.native().starts_with(kRos2)
                    ? open_ros2(recording.native(), std::vector{options.depth_topic, options.color_topic})
                    : open_ros_recording(recording);
  return std::make_unique<RosSource>(std::move(opened), options);
}

}  // namespace cairn
