// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/sources.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <boost/crc.hpp>
#include <charconv>
#include <optional>
#include <span>
#include <stdexcept>
#include <string_view>

#include "cairn/io/known_cameras.hpp"
#include "cairn/io/mask.hpp"
#include "cli/command_tree.hpp"
#include "cli/quiet.hpp"

namespace cairn::apps {
std::filesystem::path tidy(const std::filesystem::path& path) {
  const auto absolute = std::filesystem::weakly_canonical(std::filesystem::absolute(path));
  return absolute.has_filename() ? absolute : absolute.parent_path();
}

FrameRange parse_frames(const std::string& text) {
  const auto invalid = [&](const char* why) {
    return CLI::ValidationError(
        "--frames", fmt::format("'{}' {}: use N (the first N), A:B (A to B - 1, counted from 0), A: (from A), :B, or "
                                "A:B:STEP (every STEP-th), for example 100, 0:300, 300:, ::3",
                                text, why));
  };
  std::array<std::optional<int>, 3> parts;
  std::size_t begin = 0, part = 0;
  for (; begin <= text.size(); ++part) {
    if (part == parts.size()) throw invalid("has too many parts");
    const std::size_t end = std::min(text.find(':', begin), text.size());
    if (end > begin) {
      int value = 0;
      const auto [stop, error] = std::from_chars(text.data() + begin, text.data() + end, value);
      if (error != std::errc() || stop != text.data() + end || value < 0) throw invalid("is not a range of frames");
      parts[part] = value;
    }
    begin = end + 1;
  }
  if (part == 1) std::swap(parts[0], parts[1]);  // N
  if (parts[2] == 0) throw invalid("has a step of 0");
  if (parts[1] && *parts[1] <= parts[0].value_or(0)) throw invalid("contains no frame");
  return {.begin = parts[0].value_or(0), .end = parts[1], .step = parts[2].value_or(1)};
}

nlohmann::json to_json(const HoldOut& hold_out) {
  return {{"every", hold_out.every}, {"begin", hold_out.range.begin}, {"step", hold_out.range.step}};
}

HoldOut hold_out_from(const nlohmann::json& j) {
  return {.every = j.at("every"),
          .range = {.begin = j.at("begin"), .end = {}, .step = std::max(1, j.at("step").get<int>())}};
}

std::string identity(const std::string& sequence, SourceOptions options) {
  options.find_color_camera = false;
  if (is_sensor(sequence) || is_synthetic(sequence)) return sequence;
  constexpr int kFrames = 3, kTries = 30;  // frames to hash; read attempts from the start
  const Quiet quiet;
  const auto source = open_source(sequence, options);
  boost::crc_optimal<64, 0x42f0e1eba9ea3693u, ~0ull, ~0ull, true, true> sum;  // ECMA-182
  const auto take = [&](const auto& values) {
    sum.process_bytes(std::data(values), std::size(values) * sizeof(*std::data(values)));
  };
  const auto take_camera = [&](const Camera& c) {
    take(std::array{c.width, c.height, static_cast<int>(c.lens)});
    take(std::array{c.fx, c.fy, c.cx, c.cy});
    take(c.distortion);
  };
  take_camera(source->rig().depth);
  if (const auto& color = source->rig().color) {
    take_camera(color->camera);
    const Eigen::Matrix4d pose = color->color_from_depth.matrix();
    take(std::span(pose.data(), 16));
  }
  for (int tried = 0, taken = 0; tried < kTries && taken < kFrames; ++tried) {
    const auto frame = source->next();
    if (!frame) break;
    if (frame->problem) continue;
    take(std::array{frame->timestamp});
    take(frame->depth);
    ++taken;
  }
  return fmt::format("recording {:016x}", sum.checksum());
}

std::string is_recording(const std::string& name) {
  if (is_synthetic(name)) return {};
  std::string path = name;
  return CLI::ExistingPath(path);
}

void add_camera(CLI::App& command, std::filesystem::path& camera, const std::string& in_place) {
  std::vector<std::string_view> names;
  for (const KnownCamera& known : known_cameras()) names.push_back(known.name);
  const std::string all = fmt::format("{}", fmt::join(names, ", "));
  command.add_option("--camera", camera, fmt::format("camera.yaml, or a known camera ({}), {}", all, in_place))
      ->type_name(kFile)
      ->check([all](const std::string& given) {
        std::error_code ignored;
        if (std::filesystem::is_regular_file(given, ignored) || known_camera(given) != nullptr) return std::string();
        // A word that looks like a file name gets the error of a missing file, which names similar files.
        if (std::string file = given; given.find_first_of("./") != given.npos) return CLI::ExistingFile(file);
        return fmt::format("'{}' is neither a file nor a known camera; known cameras: {}", given, all);
      });
}

void add_topics(CLI::App& command, std::vector<std::string>& topics) {
  command.add_option("--topic", topics, "ROS: topic of the depth or of the color images, each at most once")
      ->allow_extra_args(false);
}

void add_mask(CLI::App& command, std::filesystem::path& mask) {
  command
      .add_option("--mask", mask,
                  "Folder of masks: PNG images named by the depth image's number or time, as 000012.png or "
                  "12.345678.png; pixels other than 0 are ignored")
      ->check(CLI::ExistingDirectory);
}

std::unique_ptr<Source> masked(std::unique_ptr<Source> source, const std::filesystem::path& mask,
                               const std::string& sequence) {
  return mask.empty() ? std::move(source) : with_masks(std::move(source), mask, sequence);
}

SourceOptions source_options(const std::string& sequence, const std::filesystem::path& camera,
                             const std::vector<std::string>& topics) {
  SourceOptions options;
  options.camera = camera;
  if (topics.empty()) return options;
  if (!is_ros_recording(sequence))
    throw std::runtime_error(sequence + ": has no topics; --topic is for ROS recordings");
  const auto recorded = recorded_topics(sequence);
  for (const std::string& topic : topics) {
    const auto it = std::find_if(recorded.begin(), recorded.end(), [&](const auto& t) { return t.name == topic; });
    // A topic that is missing or of another type is rejected later, with a list of all topics.
    const bool color = it != recorded.end() && it->holds == RecordedTopic::Holds::color;
    std::string& named = color ? options.color_topic : options.depth_topic;
    if (!named.empty())
      throw std::runtime_error(fmt::format("{}: --topic {} and --topic {} are both for {}", sequence, named, topic,
                                           color ? "color" : "depth"));
    named = topic;
  }
  return options;
}

}  // namespace cairn::apps
