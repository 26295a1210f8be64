// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/ros_survey.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <deque>
#include <map>
#include <stdexcept>
#include <tuple>

#include "base/words.hpp"
#include "io/datasets/zip_recording.hpp"
#include "io/recording_segment.hpp"

namespace cairn {
namespace {

using Holds = RecordedTopic::Holds;
constexpr std::uint64_t kImages = 8;      // images examined per topic, for pixel format and rate
constexpr double kMaxSurveyTime = 10;     // seconds; all topics with camera data should have appeared by then
constexpr double kMaxClockOffset = 2;     // seconds, more than any message delay
constexpr double kYear = 365.25 * 86400;  // seconds

/// Topic properties found in the first messages of a recording.
struct TopicSummary {
  std::uint64_t messages = 0;
  RosHeader header;     // of the first message
  double received = 0;  // seconds, of the first message
  std::vector<double> stamps;
  RosImage::Kind kind = RosImage::Kind::other;
  std::string encoding;  // or the reason why no image is readable
  Eigen::Vector2i size = Eigen::Vector2i::Zero();
  std::optional<RosCameraInfo> info;
  bool rate = false, acceleration = false;
  std::optional<float> value;
};

bool is_image(const RosTopic& topic) {
  return topic.type == "sensor_msgs/Image" || topic.type == "sensor_msgs/CompressedImage";
}
bool is_tf(const RosTopic& topic) { return topic.type == "tf2_msgs/TFMessage" || topic.type == "tf/tfMessage"; }

std::string lower(std::string text) {
  for (char& c : text) c = c == ' ' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}
/// True for infrared and depth confidence images, which also have 8 or 16 bits.
bool is_auxiliary(const std::string& name) {
  const std::string n = lower(name);
  for (const char* word : {"infra", "/ir/", "confidence", "amplitude"})
    if (n.find(word) != n.npos) return true;
  return false;
}
/// Stream prefix of a topic in librealsense's own recordings: the first three names of /device_0/sensor_0/Depth_0/...
std::optional<std::string> realsense_stream(const std::string& topic) {
  if (!topic.starts_with("/device_")) return std::nullopt;
  std::size_t end = 0;
  for (int i = 0; i < 3 && end != topic.npos; ++i) end = topic.find('/', end + 1);
  return topic.substr(0, end);
}

/// Topics and transforms in the first messages of a recording.
class Survey {
 public:
  explicit Survey(RosRecording& recording) : recording_(recording) {
    recording.rewind();
    while (!is_complete()) {
      try {
        const auto message = recording.next();
        if (!message) break;
        add(*message);
      } catch (const std::runtime_error&) {
        // The affected frames report the error.
      }
    }
    summaries_.resize(recording.topics().size());
    recording.rewind();
  }

  [[nodiscard]] const std::vector<RosTopic>& topics() const { return recording_.topics(); }
  [[nodiscard]] const std::string& name() const { return recording_.name(); }
  [[nodiscard]] const TopicSummary& summary(std::size_t topic) const { return summaries_[topic]; }
  [[nodiscard]] const std::string& device() const { return device_; }
  [[nodiscard]] std::uint64_t messages(std::size_t topic) const {
    return topics()[topic].messages.value_or(summaries_[topic].messages);
  }
  [[nodiscard]] Holds holds(std::size_t topic) const {
    const RosImage::Kind kind = summaries_[topic].kind;
    if (!is_image(topics()[topic]) || kind == RosImage::Kind::other) return Holds::other;
    return kind == RosImage::Kind::depth ? Holds::depth : Holds::color;
  }
  /// Frame id of a topic's messages; empty: unknown.
  [[nodiscard]] std::string frame_of(std::size_t topic) const {
    if (const auto stream = realsense_stream(topics()[topic].name)) return *stream;
    return summaries_[topic].info ? summaries_[topic].info->header.frame_id : summaries_[topic].header.frame_id;
  }
  /// Chains the known transforms; empty if they do not connect the frames.
  [[nodiscard]] std::optional<Eigen::Isometry3d> transform(const std::string& to, const std::string& from) const;
  /// Offset of the first header stamp from its arrival time, seconds.
  [[nodiscard]] double clock(std::size_t topic) const {
    return summaries_[topic].header.stamp > 0 ? summaries_[topic].header.stamp - summaries_[topic].received : 0;
  }

 private:
  [[nodiscard]] bool is_complete() const;
  void add(const RosMessage& message);
  void add_image(const RosMessage& message, TopicSummary& summary);

  RosRecording& recording_;
  std::vector<TopicSummary> summaries_;
  std::map<std::pair<std::string, std::string>, Eigen::Isometry3d> parent_from_child_;
  std::string device_;
  std::optional<double> first_;
  double latest_ = 0;  // arrival time, seconds
};

bool Survey::is_complete() const {
  const bool timed_out = first_ && latest_ - *first_ > kMaxSurveyTime;
  bool depth = false, info = false, all = !topics().empty();
  for (std::size_t i = 0; i < topics().size(); ++i) {
    const RosTopic& topic = topics()[i];
    const TopicSummary none, &summary = i < summaries_.size() ? summaries_[i] : none;
    depth |= summary.kind == RosImage::Kind::depth;
    info |= summary.info.has_value();
    const bool has_many = is_tf(topic) || topic.type == "diagnostic_msgs/KeyValue";
    const std::uint64_t expected = is_image(topic) ? kImages : 1;
    const bool has_enough = topic.messages
                                ? summary.messages >= (has_many ? *topic.messages : std::min(expected, *topic.messages))
                                : !has_many && summary.messages >= expected;
    all &= has_enough || (has_many && timed_out);
  }
  // Without an index, a topic may still appear.
  const bool indexed = !topics().empty() && topics()[0].messages;
  return (all && (indexed || timed_out)) || (timed_out && depth && info);
}

void Survey::add(const RosMessage& message) {
  if (summaries_.size() <= message.topic) summaries_.resize(topics().size());
  const RosTopic& topic = topics()[message.topic];
  TopicSummary& summary = summaries_[message.topic];
  // librealsense stamps static data with zero.
  if (message.received > 1e-6 && !first_) first_ = message.received;
  latest_ = std::max(latest_, message.received);
  const bool first = ++summary.messages == 1;
  const auto bytes = message.bytes;
  if (is_image(topic) || topic.type == "sensor_msgs/Imu" || topic.type == "sensor_msgs/CameraInfo") {
    const RosHeader header = read_ros_header(bytes, topic.encoding);
    if (first) summary.header = header, summary.received = message.received;
    if (summary.stamps.size() < kImages) summary.stamps.push_back(header.stamp > 0 ? header.stamp : message.received);
  }
  if (is_image(topic)) {
    if (summary.messages <= kImages && summary.kind == RosImage::Kind::other) add_image(message, summary);
  } else if (topic.type == "sensor_msgs/CameraInfo") {
    if (!summary.info) summary.info = read_camera_info(bytes, topic.encoding);
  } else if (topic.type == "sensor_msgs/Imu") {
    const RosImu imu = read_imu(bytes, topic.encoding);
    summary.rate |= imu.rate.has_value();
    summary.acceleration |= imu.acceleration.has_value();
  } else if (is_tf(topic)) {
    for (const RosTransform& t : read_tf(bytes, topic.encoding))
      parent_from_child_.try_emplace({t.parent, t.child}, t.parent_from_child);
  } else if (const std::size_t at = topic.name.find("/tf/");
             at != std::string::npos && topic.type == "geometry_msgs/Transform") {
    // librealsense stores stream_from_reference, with the reference of the sensor group.
    const std::string reference = topic.name.substr(0, topic.name.find('/', 1)) + topic.name.substr(at);
    parent_from_child_.try_emplace({topic.name.substr(0, at), reference}, read_transform(bytes, topic.encoding));
  } else if (topic.type == "std_msgs/Float32") {
    summary.value = read_float(bytes, topic.encoding);
  } else if (topic.type == "diagnostic_msgs/KeyValue" && topic.name.ends_with("/info")) {
    const auto [key, value] = read_key_value(bytes, topic.encoding);
    if (key == "Name" && topic.name.find("/sensor_") == std::string::npos) device_ = value;
  }
}

void Survey::add_image(const RosMessage& message, TopicSummary& summary) {
  const RosTopic& topic = topics()[message.topic];
  try {
    const RosImage image = read_ros_image(message.bytes, topic.encoding, topic.type);
    summary.kind = image.kind;
    summary.encoding = image.encoding;
    summary.size = {image.width, image.pixels.rows};
  } catch (const std::exception& error) {
    summary.encoding = error.what();
  }
}

std::optional<Eigen::Isometry3d> Survey::transform(const std::string& to, const std::string& from) const {
  std::map<std::string, Eigen::Isometry3d> to_from{{to, Eigen::Isometry3d::Identity()}};
  for (std::deque<std::string> open{to}; !open.empty(); open.pop_front()) {
    const std::string at = open.front();
    if (at == from) return to_from[at];
    for (const auto& [frames, parent_from_child] : parent_from_child_) {
      const auto& [parent, child] = frames;
      if (parent != at && child != at) continue;
      const std::string& other = parent == at ? child : parent;
      const Eigen::Isometry3d step = parent == at ? parent_from_child : parent_from_child.inverse();
      if (to_from.try_emplace(other, to_from[at] * step).second) open.push_back(other);
    }
  }
  return std::nullopt;
}

const char* to_string(Holds holds) { return holds == Holds::depth ? "depth" : "color"; }

/// Lists the image topics for an error or a warning.
std::string images_in(const Survey& survey) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < survey.topics().size(); ++i)
    if (is_image(survey.topics()[i]))
      all.push_back(fmt::format("{} ({})", shown(survey.topics()[i].name),
                                survey.summary(i).messages == 0 ? "no message" : shown(survey.summary(i).encoding)));
  return all.empty() ? "none" : fmt::format("{}", fmt::join(all, ", "));
}

std::size_t topic_named(const Survey& survey, const std::string& name, Holds expected) {
  const bool is_depth = expected == Holds::depth;
  for (std::size_t i = 0; i < survey.topics().size(); ++i) {
    if (survey.topics()[i].name != name) continue;
    if (survey.holds(i) == expected) return i;
    throw std::runtime_error(fmt::format(
        "{}: the topic {} is not a {} topic, it has {}; image topics: {}", survey.name(), name, to_string(expected),
        is_image(survey.topics()[i]) ? shown(survey.summary(i).encoding) : shown(survey.topics()[i].type),
        images_in(survey)));
  }
  throw std::runtime_error(fmt::format("{}: has no topic {} (SourceOptions::{}); image topics: {}", survey.name(),
                                       shown(name), is_depth ? "depth_topic" : "color_topic", images_in(survey)));
}

/// Number of leading names shared by two topics: one for /a/depth/image and /a/color/image.
std::ptrdiff_t common_names(const std::string& a, const std::string& b) {
  const auto end = std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first;
  return std::count(a.begin(), end, '/') - 1;
}

/// Returns the named topic, else the best topic with the wanted content: color before gray, closest to `beside` by
/// name, most messages.
std::optional<std::size_t> choose(const Survey& survey, Holds expected, const std::string& name,
                                  const std::string& beside = {}) {
  if (!name.empty()) return topic_named(survey, name, expected);
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < survey.topics().size(); ++i)
    if (survey.holds(i) == expected && !is_auxiliary(survey.topics()[i].name)) all.push_back(i);
  if (all.empty()) return std::nullopt;
  const auto rank = [&](std::size_t i) {
    return std::tuple(survey.summary(i).kind == RosImage::Kind::gray, -common_names(survey.topics()[i].name, beside),
                      ~survey.messages(i), survey.topics()[i].type != "sensor_msgs/Image", survey.topics()[i].name);
  };
  std::sort(all.begin(), all.end(), [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
  std::vector<std::string> others;
  for (const std::size_t i : all)
    if (i != all[0] && survey.summary(i).kind == survey.summary(all[0]).kind)
      others.push_back(shown(survey.topics()[i].name));
  if (!others.empty())
    spdlog::warn("{}: {} is read from the topic {} with {} messages; other topics: {} (SourceOptions::{}_topic)",
                 survey.name(), to_string(expected), survey.topics()[all[0]].name, survey.messages(all[0]),
                 fmt::join(others, ", "), to_string(expected));
  return all[0];
}

/// Finds the camera_info topic of an image topic: /camera/depth/camera_info of /camera/depth/image_raw,
/// /device_0/sensor_0/Depth_0/info/camera_info of /device_0/sensor_0/Depth_0/image/data; else a topic of the same
/// frame.
std::optional<std::size_t> camera_info_of(const Survey& survey, std::size_t image) {
  std::optional<std::size_t> best;
  std::tuple<std::size_t, bool, bool> best_rank;
  const std::string& name = survey.topics()[image].name;
  for (std::size_t i = 0; i < survey.topics().size(); ++i) {
    const auto& info = survey.summary(i).info;
    if (!info) continue;
    std::string base = survey.topics()[i].name;
    base.erase(std::min(base.rfind('/'), base.size()));
    if (base.ends_with("/info")) base.erase(base.size() - 5);
    const bool same_frame = info->header.frame_id == survey.summary(image).header.frame_id;
    const bool same_size = Eigen::Vector2i(info->width, info->height) == survey.summary(image).size;
    const bool below = name.starts_with(base + "/");
    if (!below && !(same_frame && same_size)) continue;
    const std::tuple rank{below ? base.size() + 1 : 0, same_size, same_frame};
    if (!best || rank > best_rank) best = i, best_rank = rank;
  }
  return best;
}

/// Camera of an image topic. If a user file defines the cameras, only the size is needed.
Camera camera_of_topic(const Survey& survey, std::size_t image, std::optional<std::size_t> info, bool has_cameras) {
  const std::string& name = survey.topics()[image].name;
  const Eigen::Vector2i size = survey.summary(image).size;
  if (has_cameras)
    return {.width = size.x(),
            .height = size.y(),
            .fx = 1.0 * size.x(),
            .fy = 1.0 * size.x(),
            .cx = 0.5 * size.x(),
            .cy = 0.5 * size.y()};
  if (!info)
    throw std::runtime_error(
        fmt::format("{}: has no topic of sensor_msgs/CameraInfo for {}; record its camera_info, or give the cameras in "
                    "a camera.yaml (SourceOptions::camera)",
                    survey.name(), name));
  const std::string& info_name = survey.topics()[*info].name;
  Camera camera;
  try {
    camera = camera_of(*survey.summary(*info).info, name.find("rect") != name.npos);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(
        fmt::format("{}: the topic {}: {}; or give the cameras in a camera.yaml (SourceOptions::camera)", survey.name(),
                    info_name, error.what()));
  }
  if (Eigen::Vector2i(camera.width, camera.height) != size)
    throw std::runtime_error(
        fmt::format("{}: images of {} have {}x{} pixels, but {} has {}x{}; give the cameras in a camera.yaml "
                    "(SourceOptions::camera)",
                    survey.name(), name, size.x(), size.y(), info_name, camera.width, camera.height));
  return camera;
}

/// Clock difference for messages.
std::string format_duration(double seconds) {
  seconds = std::abs(seconds);
  return seconds > kYear ? fmt::format("{:.1f} years", seconds / kYear) : fmt::format("{:.1f} s", seconds);
}

RosStream stream_of(const Survey& survey, std::size_t topic, std::size_t depth) {
  const double offset = survey.clock(topic) - survey.clock(depth);
  if (topic == depth || std::abs(offset) <= kMaxClockOffset) return {.topic = topic, .after_arrival = {}};
  spdlog::warn("{}: the clocks of {} and {} differ by {}: arrival times replace the timestamps of the first",
               survey.name(), survey.topics()[topic].name, survey.topics()[depth].name, format_duration(offset));
  return {.topic = topic, .after_arrival = survey.clock(depth)};
}

/// Finds an inertial topic with the wanted measurement, preferably on the camera's own device.
std::optional<std::size_t> inertial(const Survey& survey, std::size_t depth, const std::string& depth_frame,
                                    bool TopicSummary::*measures) {
  std::optional<std::size_t> best;
  std::tuple<bool, bool, std::uint64_t> best_rank;
  const auto device = [&](std::size_t i) {
    const std::string& name = survey.topics()[i].name;
    return name.substr(0, name.find('/', 1));
  };
  for (std::size_t i = 0; i < survey.topics().size(); ++i) {
    if (!(survey.summary(i).*measures)) continue;
    const std::tuple rank{device(i) == device(depth), survey.transform(depth_frame, survey.frame_of(i)).has_value(),
                          survey.messages(i)};
    if (!best || rank > best_rank) best = i, best_rank = rank;
  }
  return best;
}

void set_inertial(const Survey& survey, const std::string& depth_frame, RosPlan& plan) {
  const std::size_t depth = plan.depth.topic;
  if (const auto topic = inertial(survey, depth, depth_frame, &TopicSummary::rate)) {
    plan.gyro = stream_of(survey, *topic, depth);
    if (const auto pose = survey.transform(depth_frame, survey.frame_of(*topic)))
      plan.rig.camera_from_imu = Eigen::Quaterniond(pose->linear());
  }
  const auto topic = inertial(survey, depth, depth_frame, &TopicSummary::acceleration);
  if (!topic) return;
  if (const auto pose = survey.transform(depth_frame, survey.frame_of(*topic))) {
    plan.accelerometer = stream_of(survey, *topic, depth);
    plan.depth_from_accelerometer = pose->linear();
  } else {
    spdlog::warn("{}: has no tf from '{}' to '{}': the accelerometer in {} is not used", survey.name(),
                 shown(survey.frame_of(*topic)), shown(depth_frame), survey.topics()[*topic].name);
  }
}

/// Sets the color camera; stays empty if color is registered to depth.
void set_color(const Survey& survey, std::size_t color, const std::string& depth_frame, bool has_cameras,
               RosPlan& plan) {
  const auto info = camera_info_of(survey, color);
  const std::string frame = survey.frame_of(info.value_or(color));
  plan.color = stream_of(survey, color, plan.depth.topic);
  ColorCamera camera{.camera = camera_of_topic(survey, color, info, has_cameras)};
  const bool same_frame = !frame.empty() && frame == depth_frame;
  if (same_frame && camera.camera == plan.rig.depth) return;
  if (const auto pose = survey.transform(frame, depth_frame)) {
    camera.color_from_depth = *pose;
  } else if (!has_cameras) {
    spdlog::warn(
        "{}: has no tf from '{}' to '{}': the color camera is assumed at the position of the depth camera; give its "
        "pose in a camera.yaml (SourceOptions::camera)",
        survey.name(), shown(depth_frame), shown(frame));
  }
  plan.rig.color = camera;
}

/// Sets sensor model and depth unit from librealsense's device topics.
void set_realsense(const Survey& survey, RosPlan& plan) {
  const std::string& depth = survey.topics()[plan.depth.topic].name;
  if (!depth.starts_with("/device_")) return;
  const std::string& device = survey.device();
  plan.rig.sensor = sensor_model(device.find("L5") != device.npos    ? "time_of_flight"
                                 : device.find("SR3") != device.npos ? "structured_light"
                                                                     : "stereo");
  const std::string sensor = depth.substr(0, depth.find('/', depth.find('/', 1) + 1));
  for (std::size_t i = 0; i < survey.topics().size(); ++i) {
    const auto& value = survey.summary(i).value;
    if (value && lower(survey.topics()[i].name) == lower(sensor) + "/option/depth_units/value" && *value > 1e-6f &&
        *value <= 1)
      plan.unit = static_cast<double>(std::round(*value * 1e7)) * 1e-7;
  }
}

void set_interval(const Survey& survey, RosPlan& plan) {
  std::vector<double> steps;
  auto stamps = survey.summary(plan.depth.topic).stamps;
  std::sort(stamps.begin(), stamps.end());
  for (std::size_t i = 1; i < stamps.size(); ++i) steps.push_back(stamps[i] - stamps[i - 1]);
  if (steps.empty()) return;
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  if (const double step = steps[steps.size() / 2]; step > 1e-3 && step < 1) plan.interval = step;
}

/// True for a log written by RunLog.
bool is_run_log(const Survey& survey) {
  const auto& topics = survey.topics();
  return std::any_of(topics.begin(), topics.end(), [](const RosTopic& t) { return t.type == "cairn.Frame"; });
}

}  // namespace

RosPlan plan_of(RosRecording& recording, const SourceOptions& options) {
  const Survey survey(recording);
  std::uint64_t messages = 0;
  for (std::size_t i = 0; i < survey.topics().size(); ++i) messages += survey.messages(i);
  if (messages == 0)
    throw std::runtime_error(fmt::format("{}: has no messages; record it again, or copy it again", survey.name()));
  const auto depth = choose(survey, Holds::depth, options.depth_topic);
  if (!depth && is_run_log(survey))
    throw std::runtime_error(
        fmt::format("{}: is a log of a run (--log), not a recording; Foxglove and Rerun play it", survey.name()));
  if (!depth)
    throw std::runtime_error(
        fmt::format("{}: has no topic of depth images (16UC1, mono16, 32FC1 or compressedDepth); image topics: {}",
                    survey.name(), images_in(survey)));
  const bool has_cameras = !options.camera.empty();
  RosPlan plan;
  plan.depth.topic = *depth;
  const auto info = camera_info_of(survey, *depth);
  const std::string depth_frame = survey.frame_of(info.value_or(*depth));
  plan.rig = camera_of_topic(survey, *depth, info, has_cameras);
  if (const auto color = choose(survey, Holds::color, options.color_topic, survey.topics()[*depth].name))
    set_color(survey, *color, depth_frame, has_cameras, plan);
  set_inertial(survey, depth_frame, plan);
  set_realsense(survey, plan);
  set_interval(survey, plan);
  try {
    check(plan.rig);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", survey.name(), error.what()));
  }
  return plan;
}

double time_of(const RosStream& stream, const RosMessage& message, const RosHeader& header) {
  if (stream.after_arrival) return message.received + *stream.after_arrival;
  return header.stamp > 0 ? header.stamp : message.received;
}

std::vector<RecordedTopic> recorded_topics(const std::string& ros_recording) {
  if (const auto segment = read_segment(ros_recording)) return recorded_topics(segment->recording);
  if (is_zip(ros_recording))
    return unpacked(ros_recording)->with_archive_name([](const std::string& content) {
      return recorded_topics(content);
    });
  const auto recording = open_ros_recording(ros_recording);
  const Survey survey(*recording);
  std::vector<RecordedTopic> all;
  for (std::size_t i = 0; i < survey.topics().size(); ++i) {
    const RosTopic& topic = survey.topics()[i];
    all.push_back({topic.name, topic.type, topic.messages, survey.holds(i)});
  }
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return all;
}

}  // namespace cairn
