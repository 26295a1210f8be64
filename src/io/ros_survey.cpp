// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros_survey.hpp"

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
#include "io/part.hpp"
#include "io/zip_recording.hpp"

namespace cairn {
namespace {

using Holds = RecordedTopic::Holds;
constexpr std::uint64_t kImages = 8;      // images examined per topic, for pixel format and rate
constexpr double kLongEnough = 10;        // seconds; all topics with camera data should have appeared by then
constexpr double kOtherClock = 2;         // seconds, more than any message delay
constexpr double kYear = 365.25 * 86400;  // seconds

/// Topic properties found in the first messages of a recording.
struct Seen {
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
bool is_beside_depth(const std::string& name) {
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
    while (!is_enough()) {
      try {
        const auto message = recording.next();
        if (!message) break;
        take(*message);
      } catch (const std::runtime_error&) {
        // The affected frames report the error.
      }
    }
    seen_.resize(recording.topics().size());
    recording.rewind();
  }

  [[nodiscard]] const std::vector<RosTopic>& topics() const { return recording_.topics(); }
  [[nodiscard]] const std::string& name() const { return recording_.name(); }
  [[nodiscard]] const Seen& seen(std::size_t topic) const { return seen_[topic]; }
  [[nodiscard]] const std::string& device() const { return device_; }
  [[nodiscard]] std::uint64_t messages(std::size_t topic) const {
    return topics()[topic].messages.value_or(seen_[topic].messages);
  }
  [[nodiscard]] Holds holds(std::size_t topic) const {
    const RosImage::Kind kind = seen_[topic].kind;
    if (!is_image(topics()[topic]) || kind == RosImage::Kind::other) return Holds::other;
    return kind == RosImage::Kind::depth ? Holds::depth : Holds::colour;
  }
  /// Frame id of a topic's messages; empty: unknown.
  [[nodiscard]] std::string frame_of(std::size_t topic) const {
    if (const auto stream = realsense_stream(topics()[topic].name)) return *stream;
    return seen_[topic].info ? seen_[topic].info->header.frame_id : seen_[topic].header.frame_id;
  }
  /// Chains the known transforms; empty if they do not connect the frames.
  [[nodiscard]] std::optional<Eigen::Isometry3d> transform(const std::string& to, const std::string& from) const;
  /// Offset of the first header stamp from its arrival time, seconds.
  [[nodiscard]] double clock(std::size_t topic) const {
    return seen_[topic].header.stamp > 0 ? seen_[topic].header.stamp - seen_[topic].received : 0;
  }

 private:
  [[nodiscard]] bool is_enough() const;
  void take(const RosMessage& message);
  void take_image(const RosMessage& message, Seen& seen);

  RosRecording& recording_;
  std::vector<Seen> seen_;
  std::map<std::pair<std::string, std::string>, Eigen::Isometry3d> parent_from_child_;
  std::string device_;
  std::optional<double> first_;
  double latest_ = 0;  // arrival time, seconds
};

bool Survey::is_enough() const {
  const bool long_enough = first_ && latest_ - *first_ > kLongEnough;
  bool depth = false, info = false, all = !topics().empty();
  for (std::size_t i = 0; i < topics().size(); ++i) {
    const RosTopic& topic = topics()[i];
    const Seen none, &seen = i < seen_.size() ? seen_[i] : none;
    depth |= seen.kind == RosImage::Kind::depth;
    info |= seen.info.has_value();
    const bool several = is_tf(topic) || topic.type == "diagnostic_msgs/KeyValue";
    const std::uint64_t wanted = is_image(topic) ? kImages : 1;
    const bool is_seen = topic.messages
                             ? seen.messages >= (several ? *topic.messages : std::min(wanted, *topic.messages))
                             : !several && seen.messages >= wanted;
    all &= is_seen || (several && long_enough);
  }
  // Without an index, a topic may still appear.
  const bool indexed = !topics().empty() && topics()[0].messages;
  return (all && (indexed || long_enough)) || (long_enough && depth && info);
}

void Survey::take(const RosMessage& message) {
  if (seen_.size() <= message.topic) seen_.resize(topics().size());
  const RosTopic& topic = topics()[message.topic];
  Seen& seen = seen_[message.topic];
  // librealsense stamps static data with zero.
  if (message.received > 1e-6 && !first_) first_ = message.received;
  latest_ = std::max(latest_, message.received);
  const bool first = ++seen.messages == 1;
  const auto bytes = message.bytes;
  if (is_image(topic) || topic.type == "sensor_msgs/Imu" || topic.type == "sensor_msgs/CameraInfo") {
    const RosHeader header = read_ros_header(bytes, topic.encoding);
    if (first) seen.header = header, seen.received = message.received;
    if (seen.stamps.size() < kImages) seen.stamps.push_back(header.stamp > 0 ? header.stamp : message.received);
  }
  if (is_image(topic)) {
    if (seen.messages <= kImages && seen.kind == RosImage::Kind::other) take_image(message, seen);
  } else if (topic.type == "sensor_msgs/CameraInfo") {
    if (!seen.info) seen.info = read_camera_info(bytes, topic.encoding);
  } else if (topic.type == "sensor_msgs/Imu") {
    const RosImu imu = read_imu(bytes, topic.encoding);
    seen.rate |= imu.rate.has_value();
    seen.acceleration |= imu.acceleration.has_value();
  } else if (is_tf(topic)) {
    for (const RosTransform& t : read_tf(bytes, topic.encoding))
      parent_from_child_.try_emplace({t.parent, t.child}, t.parent_from_child);
  } else if (const std::size_t at = topic.name.find("/tf/");
             at != std::string::npos && topic.type == "geometry_msgs/Transform") {
    // librealsense stores stream_from_reference, with the reference of the sensor group.
    const std::string reference = topic.name.substr(0, topic.name.find('/', 1)) + topic.name.substr(at);
    parent_from_child_.try_emplace({topic.name.substr(0, at), reference}, read_transform(bytes, topic.encoding));
  } else if (topic.type == "std_msgs/Float32") {
    seen.value = read_float(bytes, topic.encoding);
  } else if (topic.type == "diagnostic_msgs/KeyValue" && topic.name.ends_with("/info")) {
    const auto [key, value] = read_key_value(bytes, topic.encoding);
    if (key == "Name" && topic.name.find("/sensor_") == std::string::npos) device_ = value;
  }
}

void Survey::take_image(const RosMessage& message, Seen& seen) {
  const RosTopic& topic = topics()[message.topic];
  try {
    const RosImage image = read_ros_image(message.bytes, topic.encoding, topic.type);
    seen.kind = image.kind;
    seen.encoding = image.encoding;
    seen.size = {image.width, image.pixels.rows};
  } catch (const std::exception& error) {
    seen.encoding = error.what();
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

const char* word_of(Holds holds) { return holds == Holds::depth ? "depth" : "colour"; }

/// Lists the image topics for an error or a warning.
std::string images_in(const Survey& survey) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < survey.topics().size(); ++i)
    if (is_image(survey.topics()[i]))
      all.push_back(fmt::format("{} ({})", shown(survey.topics()[i].name),
                                survey.seen(i).messages == 0 ? "no message" : shown(survey.seen(i).encoding)));
  return all.empty() ? "there are none" : fmt::format("{}", fmt::join(all, ", "));
}

std::size_t topic_named(const Survey& survey, const std::string& name, Holds wanted) {
  const bool is_depth = wanted == Holds::depth;
  for (std::size_t i = 0; i < survey.topics().size(); ++i) {
    if (survey.topics()[i].name != name) continue;
    if (survey.holds(i) == wanted) return i;
    throw std::runtime_error(fmt::format(
        "{}: the topic {} is no {} topic, it holds {}; images are in: {}", survey.name(), name, word_of(wanted),
        is_image(survey.topics()[i]) ? shown(survey.seen(i).encoding) : shown(survey.topics()[i].type),
        images_in(survey)));
  }
  throw std::runtime_error(fmt::format("{}: has no topic {} (SourceOptions::{}); images are in: {}", survey.name(),
                                       shown(name), is_depth ? "depth_topic" : "colour_topic", images_in(survey)));
}

/// Number of leading names shared by two topics: one for /a/depth/image and /a/color/image.
std::ptrdiff_t kinship(const std::string& a, const std::string& b) {
  const auto end = std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first;
  return std::count(a.begin(), end, '/') - 1;
}

/// Returns the named topic, else the best topic with the wanted content: color before gray, closest to `beside` by
/// name, most messages.
std::optional<std::size_t> choose(const Survey& survey, Holds wanted, const std::string& name,
                                  const std::string& beside = {}) {
  if (!name.empty()) return topic_named(survey, name, wanted);
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < survey.topics().size(); ++i)
    if (survey.holds(i) == wanted && !is_beside_depth(survey.topics()[i].name)) all.push_back(i);
  if (all.empty()) return std::nullopt;
  const auto rank = [&](std::size_t i) {
    return std::tuple(survey.seen(i).kind == RosImage::Kind::grey, -kinship(survey.topics()[i].name, beside),
                      ~survey.messages(i), survey.topics()[i].type != "sensor_msgs/Image", survey.topics()[i].name);
  };
  std::sort(all.begin(), all.end(), [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
  std::vector<std::string> others;
  for (const std::size_t i : all)
    if (i != all[0] && survey.seen(i).kind == survey.seen(all[0]).kind)
      others.push_back(shown(survey.topics()[i].name));
  if (!others.empty())
    spdlog::warn("{}: {} is taken from the topic {} with {} messages; there are also {} (SourceOptions::{}_topic)",
                 survey.name(), word_of(wanted), survey.topics()[all[0]].name, survey.messages(all[0]),
                 fmt::join(others, ", "), word_of(wanted));
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
    const auto& info = survey.seen(i).info;
    if (!info) continue;
    std::string base = survey.topics()[i].name;
    base.erase(std::min(base.rfind('/'), base.size()));
    if (base.ends_with("/info")) base.erase(base.size() - 5);
    const bool same_frame = info->header.frame_id == survey.seen(image).header.frame_id;
    const bool same_size = Eigen::Vector2i(info->width, info->height) == survey.seen(image).size;
    const bool below = name.starts_with(base + "/");
    if (!below && !(same_frame && same_size)) continue;
    const std::tuple rank{below ? base.size() + 1 : 0, same_size, same_frame};
    if (!best || rank > best_rank) best = i, best_rank = rank;
  }
  return best;
}

/// Camera of an image topic. If a user file defines the cameras, only the size is needed.
Camera camera_of_topic(const Survey& survey, std::size_t image, std::optional<std::size_t> info, bool told) {
  const std::string& name = survey.topics()[image].name;
  const Eigen::Vector2i size = survey.seen(image).size;
  if (told)
    return {.width = size.x(),
            .height = size.y(),
            .fx = 1.0 * size.x(),
            .fy = 1.0 * size.x(),
            .cx = 0.5 * size.x(),
            .cy = 0.5 * size.y()};
  if (!info)
    throw std::runtime_error(
        fmt::format("{}: no topic of sensor_msgs/CameraInfo belongs to {}; record its camera_info, "
                    "or tell the cameras in a camera.yaml (SourceOptions::camera)",
                    survey.name(), name));
  const std::string& info_name = survey.topics()[*info].name;
  Camera camera;
  try {
    camera = camera_of(*survey.seen(*info).info, name.find("rect") != name.npos);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(
        fmt::format("{}: the topic {}: {}; a camera.yaml can tell the cameras instead "
                    "(SourceOptions::camera)",
                    survey.name(), info_name, error.what()));
  }
  if (Eigen::Vector2i(camera.width, camera.height) != size)
    throw std::runtime_error(
        fmt::format("{}: images of {} have {}x{} pixels, {} tells of {}x{}; a camera.yaml can tell the cameras instead "
                    "(SourceOptions::camera)",
                    survey.name(), name, size.x(), size.y(), info_name, camera.width, camera.height));
  return camera;
}

/// Clock difference for messages.
std::string span_of(double seconds) {
  seconds = std::abs(seconds);
  return seconds > kYear ? fmt::format("{:.1f} years", seconds / kYear) : fmt::format("{:.1f} s", seconds);
}

RosStream stream_of(const Survey& survey, std::size_t topic, std::size_t depth) {
  const double apart = survey.clock(topic) - survey.clock(depth);
  if (topic == depth || std::abs(apart) <= kOtherClock) return {.topic = topic, .after_arrival = {}};
  spdlog::warn(
      "{}: the clocks of {} and {} are {} apart: times of arrival are taken in place of the stamps of the "
      "first",
      survey.name(), survey.topics()[topic].name, survey.topics()[depth].name, span_of(apart));
  return {.topic = topic, .after_arrival = survey.clock(depth)};
}

/// Finds an inertial topic with the wanted measurement, preferably on the camera's own device.
std::optional<std::size_t> inertial(const Survey& survey, std::size_t depth, const std::string& depth_frame,
                                    bool Seen::*measures) {
  std::optional<std::size_t> best;
  std::tuple<bool, bool, std::uint64_t> best_rank;
  const auto device = [&](std::size_t i) {
    const std::string& name = survey.topics()[i].name;
    return name.substr(0, name.find('/', 1));
  };
  for (std::size_t i = 0; i < survey.topics().size(); ++i) {
    if (!(survey.seen(i).*measures)) continue;
    const std::tuple rank{device(i) == device(depth), survey.transform(depth_frame, survey.frame_of(i)).has_value(),
                          survey.messages(i)};
    if (!best || rank > best_rank) best = i, best_rank = rank;
  }
  return best;
}

void set_inertial(const Survey& survey, const std::string& depth_frame, RosPlan& plan) {
  const std::size_t depth = plan.depth.topic;
  if (const auto topic = inertial(survey, depth, depth_frame, &Seen::rate)) {
    plan.gyro = stream_of(survey, *topic, depth);
    if (const auto pose = survey.transform(depth_frame, survey.frame_of(*topic)))
      plan.rig.camera_from_imu = Eigen::Quaterniond(pose->linear());
  }
  const auto topic = inertial(survey, depth, depth_frame, &Seen::acceleration);
  if (!topic) return;
  if (const auto pose = survey.transform(depth_frame, survey.frame_of(*topic))) {
    plan.accelerometer = stream_of(survey, *topic, depth);
    plan.depth_from_accelerometer = pose->linear();
  } else {
    spdlog::warn("{}: no tf leads from '{}' to '{}': the accelerometer in {} is not used", survey.name(),
                 shown(survey.frame_of(*topic)), shown(depth_frame), survey.topics()[*topic].name);
  }
}

/// Sets the color camera; stays empty if color is registered to depth.
void set_colour(const Survey& survey, std::size_t colour, const std::string& depth_frame, bool told, RosPlan& plan) {
  const auto info = camera_info_of(survey, colour);
  const std::string frame = survey.frame_of(info.value_or(colour));
  plan.colour = stream_of(survey, colour, plan.depth.topic);
  ColourCamera camera{.camera = camera_of_topic(survey, colour, info, told)};
  const bool same_frame = !frame.empty() && frame == depth_frame;
  if (same_frame && camera.camera == plan.rig.depth) return;
  if (const auto pose = survey.transform(frame, depth_frame)) {
    camera.colour_from_depth = *pose;
  } else if (!told) {
    spdlog::warn(
        "{}: no tf leads from '{}' to '{}': the colour camera is taken to be where the depth camera is; a "
        "camera.yaml can tell its place (SourceOptions::camera)",
        survey.name(), shown(depth_frame), shown(frame));
  }
  plan.rig.colour = camera;
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
    const auto& value = survey.seen(i).value;
    if (value && lower(survey.topics()[i].name) == lower(sensor) + "/option/depth_units/value" && *value > 1e-6f &&
        *value <= 1)
      plan.unit = static_cast<double>(std::round(*value * 1e7)) * 1e-7;
  }
}

void set_interval(const Survey& survey, RosPlan& plan) {
  std::vector<double> steps;
  auto stamps = survey.seen(plan.depth.topic).stamps;
  std::sort(stamps.begin(), stamps.end());
  for (std::size_t i = 1; i < stamps.size(); ++i) steps.push_back(stamps[i] - stamps[i - 1]);
  if (steps.empty()) return;
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  if (const double step = steps[steps.size() / 2]; step > 1e-3 && step < 1) plan.interval = step;
}

/// True for a log written by RunLog.
bool holds_a_log(const Survey& survey) {
  const auto& topics = survey.topics();
  return std::any_of(topics.begin(), topics.end(), [](const RosTopic& t) { return t.type == "cairn.Frame"; });
}

}  // namespace

RosPlan plan_of(RosRecording& recording, const SourceOptions& options) {
  const Survey survey(recording);
  std::uint64_t messages = 0;
  for (std::size_t i = 0; i < survey.topics().size(); ++i) messages += survey.messages(i);
  if (messages == 0)
    throw std::runtime_error(fmt::format("{}: holds no message; record it again, or copy it again", survey.name()));
  const auto depth = choose(survey, Holds::depth, options.depth_topic);
  if (!depth && holds_a_log(survey))
    throw std::runtime_error(
        fmt::format("{}: is a log of a run (--log), not a recording; Foxglove and Rerun play it", survey.name()));
  if (!depth)
    throw std::runtime_error(
        fmt::format("{}: has no topic of depth images (16UC1, mono16, 32FC1 or compressedDepth); "
                    "images are in: {}",
                    survey.name(), images_in(survey)));
  const bool told = !options.camera.empty();
  RosPlan plan;
  plan.depth.topic = *depth;
  const auto info = camera_info_of(survey, *depth);
  const std::string depth_frame = survey.frame_of(info.value_or(*depth));
  plan.rig = camera_of_topic(survey, *depth, info, told);
  if (const auto colour = choose(survey, Holds::colour, options.colour_topic, survey.topics()[*depth].name))
    set_colour(survey, *colour, depth_frame, told, plan);
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
  if (const auto part = part_in(ros_recording)) return recorded_topics(part->recording);
  if (is_zip(ros_recording))
    return unpacked(ros_recording)->told_in_its_name([](const std::string& inside) { return recorded_topics(inside); });
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
