// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/file_name.hpp"
#include "cairn/io/inspect.hpp"
#include "cairn/io/measure_noise.hpp"
#include "cairn/io/source.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/json_text.hpp"
#include "cli/map_info.hpp"
#include "cli/old_names.hpp"
#include "cli/plan_info.hpp"
#include "cli/quantity.hpp"
#include "cli/sources.hpp"

namespace cairn::apps {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string sequence;
  std::filesystem::path camera, picture;
  std::vector<std::string> topics;
  int frames = 100, frame = 0;
  bool json = false;
};

/// Source that copies depth images of its first seconds, for their noise.
class DepthSampler final : public Source {
 public:
  explicit DepthSampler(Source& source) : source_(source) {}
  [[nodiscard]] const Rig& rig() const override { return source_.rig(); }
  [[nodiscard]] std::string layout() const override { return source_.layout(); }
  [[nodiscard]] std::optional<int> size() const override { return source_.size(); }
  [[nodiscard]] std::optional<std::string> ended_early() const override { return source_.ended_early(); }
  [[nodiscard]] bool has_assumed_rate() const override { return source_.has_assumed_rate(); }
  [[nodiscard]] int dropped() const override { return source_.dropped(); }
  [[nodiscard]] std::optional<Frame> next() override {
    constexpr double kSeconds = 3;
    constexpr std::size_t kImages = 16;
    auto frame = source_.next();
    const auto pixels = static_cast<std::size_t>(rig().depth.width) * static_cast<std::size_t>(rig().depth.height);
    if (!frame || frame->problem || frame->depth.size() != pixels || images_.size() == kImages) return frame;
    if (images_.empty()) next_sample_ = frame->timestamp;
    if (frame->timestamp < next_sample_) return frame;
    next_sample_ += kSeconds / kImages;
    images_.push_back(frame->depth);
    for (std::size_t i = 0; i < std::min(pixels, frame->confidence.size()); ++i)
      if (frame->confidence[i] < rig().sensor.min_confidence) images_.back()[i] = 0;
    return frame;
  }
  [[nodiscard]] DepthNoise noise() const { return measure_depth_noise(images_, rig().depth); }

 private:
  Source& source_;
  std::vector<std::vector<float>> images_;
  double next_sample_ = 0;  // seconds
};

std::string lens_of(const Camera& c) {
  if (!c.distorted()) return "none";
  const auto last = std::find_if(c.distortion.rbegin(), c.distortion.rend(), [](double k) { return k != 0; }).base();
  return fmt::format("{} {}", c.lens == Lens::fisheye ? "fisheye" : "Brown-Conrady",
                     fmt::join(c.distortion.begin(), last, ", "));
}

Json json_of(const Camera& c) {
  return {{"width", c.width},
          {"height", c.height},
          {"fx", c.fx},
          {"fy", c.fy},
          {"cx", c.cx},
          {"cy", c.cy},
          {"lens", c.lens == Lens::fisheye ? "fisheye" : "brown_conrady"},
          {"distortion", c.distortion},
          {"readout", c.readout}};
}

Json json_of(const SourceSummary& s) {
  Json j{{"layout", s.layout},
         {"depth_camera", json_of(s.rig.depth)},
         {"sensor", to_string(s.rig.sensor)},
         {"color_registered", !s.rig.color}};
  if (s.rig.color) {
    const Eigen::Isometry3d& pose = s.rig.color->color_from_depth;
    const Eigen::Quaterniond q(pose.linear());
    j["color_camera"] = json_of(s.rig.color->camera);
    j["color_from_depth"] = {{"translation", {pose.translation().x(), pose.translation().y(), pose.translation().z()}},
                             {"rotation", {q.x(), q.y(), q.z(), q.w()}}};
  }
  if (s.frames) j["frames"] = *s.frames;
  if (const InertialSummary& i = s.inertial; i.gyroscope.samples > 0 || i.accelerometer.samples > 0) {
    const auto sensor = [](const InertialSummary::Sensor& n) {
      return Json{{"samples", n.samples}, {"hertz", n.rate}, {"longest_gap_s", n.longest_gap}};
    };
    j["inertial"] = {
        {"gyroscope", sensor(i.gyroscope)}, {"accelerometer", sensor(i.accelerometer)}, {"median_norm", i.norm}};
  }
  j.update(Json{{"looked_at", s.inspected},
                {"unreadable", s.unreadable},
                {"seconds", s.seconds},
                {"frames_per_second", s.rate},
                {"depth_m", {{"nearest", s.nearest}, {"median", s.median}, {"farthest", s.farthest}}},
                {"measured_share", s.measured_share},
                {"with_color", s.with_color},
                {"color_delay", s.color_delay},
                {"with_pose", s.with_pose},
                {"with_acceleration", s.with_acceleration},
                {"with_gyroscope", s.with_gyroscope},
                {"with_confidence", s.with_confidence},
                {"doubts", s.doubts}});
  add_old_fields(j);
  return j;
}

Json json_of(const DepthNoise& n) {
  Json samples = Json::array();
  for (const auto& s : n.samples) samples.push_back({{"depth", s.depth}, {"sigma", s.sigma}, {"patches", s.patches}});
  Json j{{"images", n.frames},         {"patches", n.patches},
         {"samples", samples},         {"correlation_px", n.correlation_px},
         {"depth_step", n.depth_step}, {"inverse_depth_step", n.inverse_depth_step},
         {"holes", n.holes},           {"flying", n.flying},
         {"nearest", n.nearest},       {"farthest", n.farthest}};
  if (!n.samples.empty())
    j["model"] = {{"floor", n.model.floor}, {"growth", n.model.growth}, {"sharpest", n.model.sharpest}};
  return j;
}

void print(const Camera& c, const char* name) {
  fmt::print("{:<16}{}x{}, fx {:.2f} fy {:.2f} cx {:.2f} cy {:.2f} pixels\n", name, c.width, c.height, c.fx, c.fy, c.cx,
             c.cy);
  fmt::print("  {:<14}{}\n", "distortion", lens_of(c));
  if (c.readout > 0) fmt::print("  {:<14}{:.1f} ms\n", "readout", 1000 * c.readout);
}

void print(const DepthNoise& n, const SensorModel& assumed) {
  if (n.samples.empty()) {
    fmt::print("{:<16}not measured: {} planar patches in {} images are too few\n", "depth noise", n.patches, n.frames);
    return;
  }
  std::vector<float> depths;
  for (const float z : {0.5f, 1.0f, 2.0f, 3.0f, 4.0f})
    if (n.sigma(z)) depths.push_back(z);
  if (depths.empty()) depths.push_back(n.samples[n.samples.size() / 2].depth);
  std::vector<std::string> measured, model, steps;
  bool quantized = false;
  for (const float z : depths) {
    measured.push_back(fmt::format("{:.1f} mm at {:.3g} m", 1000 * n.sigma(z).value_or(0), z));
    model.push_back(fmt::format("{:.1f}", 1000 * assumed.sigma(z)));
    steps.push_back(fmt::format("{:.1f} mm at {:.3g} m", 1000 * n.step(z), z));
    quantized |= n.step(z) > n.sigma(z);
  }
  fmt::print("{:<16}{} (measured); {} assumes {} mm\n", "depth noise", fmt::join(measured, ", "), to_string(assumed),
             fmt::join(model, ", "));
  constexpr float kCorrelated = 4, kFlying = 0.1f;  // pixels; share of the edges
  if (n.correlation_px > kCorrelated)
    fmt::print("  {:<14}noise is correlated over {:.0f} pixels\n", "smoothed", n.correlation_px);
  if (quantized) fmt::print("  {:<14}in steps of {}\n", "quantized", fmt::join(steps, ", "));
  if (n.flying > kFlying) fmt::print("  {:<14}at {:.0f} % of the depth edges\n", "flying pixels", 100 * n.flying);
}

void print(const SourceSummary& s, const DepthNoise& noise, const std::vector<Interpretation>& interpretations) {
  fmt::print("{:<16}{}\n", "layout", s.layout);
  for (const auto& [what, words] : interpretations) fmt::print("{:<16}{}\n", what, words);
  print(s.rig.depth, "depth camera");
  fmt::print("  {:<14}{}, {:.1f} mm at 1 m, {:.1f} mm at 3 m\n", "sensor", to_string(s.rig.sensor),
             1000 * s.rig.sensor.sigma(1), 1000 * s.rig.sensor.sigma(3));
  if (s.rig.color) {
    print(s.rig.color->camera, "color camera");
    const Eigen::Isometry3d& pose = s.rig.color->color_from_depth;
    const Eigen::Vector3d t = 100 * pose.translation();
    fmt::print("  {:<14}{:.2f} {:.2f} {:.2f} cm, rotated by {:.2f} degrees (color_from_depth)\n", "pose", t.x(), t.y(),
               t.z(), Eigen::AngleAxisd(pose.linear()).angle() * 57.29578);
  } else {
    fmt::print("{:<16}registered to depth\n", "color");
  }
  fmt::print("{:<16}{}, {:.1f} per second\n", "frames", s.frames ? std::to_string(*s.frames) : "unknown", s.rate);
  fmt::print("{:<16}{} frames, {:.2f} s\n", "inspected", s.inspected, s.seconds);
  fmt::print("{:<16}{:.2f} to {:.2f} m, median {:.2f} m; {:.0f} % of the pixels\n", "depth", s.nearest, s.farthest,
             s.median, 100 * s.measured_share);
  print(noise, s.rig.sensor);
  fmt::print("{:<16}with {} of these, {:+.1f} ms from depth\n", "color images", s.with_color, 1000 * s.color_delay);
  fmt::print("{:<16}with {} of these\n", "poses", s.with_pose);
  const auto samples = [](const InertialSummary::Sensor& sensor) {
    return sensor.rate > 0 ? fmt::format(", {:.0f} Hz", sensor.rate) : "";
  };
  const InertialSummary& i = s.inertial;
  fmt::print("{:<16}with {} of these{}{}\n", "accelerometer", s.with_acceleration, samples(i.accelerometer),
             i.norm > 0 ? fmt::format(", {:.2f} m/s^2", i.norm) : "");
  fmt::print("{:<16}with {} of these{}\n", "gyroscope", s.with_gyroscope, samples(i.gyroscope));
  fmt::print("{:<16}with {} of these\n", "confidence", s.with_confidence);
  for (const std::string& doubt : s.doubts) fmt::print("{:<16}{}\n", "doubt", doubt);
  if (s.doubts.empty()) fmt::print("{:<16}none\n", "doubts");
}

void draw(const Arguments& a) {
  SourceOptions options = source_options(a.sequence, a.camera, a.topics);
  options.range = {.begin = a.frame, .end = a.frame + 1};
  const auto source = open_source(a.sequence, options);
  const auto frame = source->next();
  if (!frame) throw std::runtime_error(fmt::format("{}: has no frame {}", a.sequence, a.frame));
  if (frame->problem) throw std::runtime_error(*frame->problem);
  write_edges_picture(a.picture, source->rig(), *frame);
}

void info(const Arguments& a) {
  if (is_project_folder(a.sequence)) return print_project_info(a.sequence, a.json);
  refuse_internal_files(a.sequence);
  Inputs().add_recording(a.sequence).add(a.camera).check_output_file(a.picture);
  if (is_map_folder(a.sequence)) return print_map_info(a.sequence, a.json);
  const auto source = open_source(a.sequence, source_options(a.sequence, a.camera, a.topics));
  DepthSampler sampler(*source);
  SourceSummary summary = inspect(sampler, a.frames);
  const DepthNoise noise = sampler.noise();
  // Poses in separate files are not part of the frames until requested.
  if (!is_sensor(a.sequence) && !is_synthetic(a.sequence) &&
      (std::filesystem::is_directory(a.sequence) || extension_of(a.sequence) == ".zip"))
    summary.with_pose =
        std::max(summary.with_pose, std::min(summary.inspected, static_cast<int>(recorded_truth(a.sequence).size())));
  const auto interpretations = interpretation_of(a.sequence, source_options(a.sequence, a.camera, a.topics));
  if (a.json) {
    Json json = json_of(summary);
    json["depth_noise"] = json_of(noise);
    for (const auto& [what, words] : interpretations) json["understood"][what] = words;
    fmt::print("{}\n", format_json(json, 2));
  } else {
    print(summary, noise, interpretations);
  }
  if (!a.picture.empty()) draw(a);
}

}  // namespace

void add_info(CLI::App& program) {
  auto* command = program.add_subcommand(
      "info", "Describe a recording or a sensor, the quality of a map, or the progress of a project");
  const auto a = std::make_shared<Arguments>();
  command->add_option("SEQUENCE", a->sequence, kSequenceHelp)->required()->type_name(kPath);
  add_camera(*command, a->camera, "in place of the cameras of the recording or sensor");
  add_topics(*command, a->topics);
  add_number(*command, "--frames", a->frames, {1, 1e9}, "Number of frames to inspect, from the first")
      ->capture_default_str();
  command->add_option("--picture", a->picture, "PNG of a frame's color with the depth edges drawn over it")
      ->type_name(kFile);
  add_number(*command, "--frame", a->frame, {0, 1e9}, "Frame of --picture")->capture_default_str();
  command->add_flag("--json", a->json, "Print JSON");
  command->callback([a] { info(*a); });
}

}  // namespace cairn::apps
