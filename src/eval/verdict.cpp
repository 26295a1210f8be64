// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/eval/verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <sstream>

#include "eval/verdict_items.hpp"
#include "eval/view_step.hpp"
#include "place/focal.hpp"

namespace cairn {
namespace {

constexpr double kGood = 0.95, kBad = 0.8;  // of the frames
constexpr double kMinAgreement = 0.8;       // of the points, for given poses; usual values are 0.9 and more
constexpr std::size_t kPixelStride = 37;    // depth pixel stride; coprime with usual image widths
constexpr int kMinFrames = 10;
constexpr double kMinMedianDepth = 0.1, kMaxMedianDepth = 20;      // meters, of a room
constexpr double kMaxOutOfRange = 0.5;                             // of the measurements outside the depth range
constexpr double kMinMeasured = 0.2;                               // minimum share of pixels with depth
constexpr double kMinBrightness = 25;                              // of 255
constexpr double kMajority = 0.5;                                  // share of the frames for a reason
constexpr double kMaxViewStep = 0.15;                              // of the image, between frames
constexpr double kMinFrameRate = 6;                                // Hz
constexpr double kMinGap = 3;                                      // times the usual frame interval
constexpr double kMinSharpness = 0.33, kMinSharpnessRatio = 0.85;  // sharpness; ratio to the sharpness of fused frames
constexpr double kMinCauseRatio = 0.05;                            // of the frames
constexpr double kMinProcessedRatio = 0.7;                         // of the incoming frames
constexpr float kLargeVoxel = 0.02f;                               // meters, suitable for a slow computer
// Views for the focal length check.
constexpr double kMinViewShift = 0.15;              // minimum shift between two views, share of the image
constexpr int kMaxPairs = 8, kMaxExtractions = 16;  // maximum numbers of pairs and of frames with extracted corners
constexpr int kMinPairs = 3;                        // minimum number of pairs
constexpr double kMinInlierRatio = 0.85;        // share of the maximum number of inliers that confirms the given length
constexpr double kMinContradictionRatio = 1.3;  // ratio to the inliers of the given length that rejects it
constexpr auto kCauses = static_cast<std::size_t>(FrameCause::partly_used) + 1;

/// Histogram over the logarithm, in decades.
struct LogHistogram {
  static constexpr double kMinValue = 1e-6;
  static constexpr int kBinsPerDecade = 20, kDecades = 13;
  std::array<double, kBinsPerDecade * kDecades> counts{};
  void add(double value) {
    if (!(value > 0)) return;
    const auto bin = static_cast<long>(kBinsPerDecade * std::log10(value / kMinValue));
    ++counts[static_cast<std::size_t>(std::clamp<long>(bin, 0, static_cast<long>(counts.size()) - 1))];
  }
  [[nodiscard]] double total() const {
    double sum = 0;
    for (const double c : counts) sum += c;
    return sum;
  }
  /// 0 if empty.
  [[nodiscard]] double median() const {
    const double half = total() / 2;
    double sum = 0;
    for (std::size_t i = 0; i < counts.size() && half > 0; ++i)
      if ((sum += counts[i]) >= half) return kMinValue * std::pow(10, (static_cast<double>(i) + 0.5) / kBinsPerDecade);
    return 0;
  }
};

struct Mean {
  double sum = 0, count = 0;
  void add(double value) { sum += value, ++count; }
  [[nodiscard]] double value() const { return count > 0 ? sum / count : 0; }
};

/// Statistics over all frames; only numbers, so that they are saved in one loop.
struct Sums {
  double frames = 0, with_color = 0, dark = 0;
  double pixels = 0, measured = 0, nearer = 0, farther = 0;  // sampled depth pixels
  LogHistogram depth, interval;                              // meters; seconds between frames
  Mean sharp_fused, sharp_lost;                              // image sharpness
  Mean lost_step, fast_step;  // share of the image, for lost frames; for the fast frames among them
  double losses = 0, fast_losses = 0, losses_after_gap = 0;  // frames lost directly after a fused frame
  double longest_gap = 0;                                    // seconds
  std::array<double, kCauses> causes{};                      // frames
  std::array<double, kWideFocalScales.size()> focal{};       // inliers per candidate
  double focal_pairs = 0, focal_extractions = 0, focal_done = 0;

  template <class Visit>
  void visit_each(const Visit& visit) {
    for (double* v : {&frames,          &with_color,       &dark,
                      &pixels,          &measured,         &nearer,
                      &farther,         &sharp_fused.sum,  &sharp_fused.count,
                      &sharp_lost.sum,  &sharp_lost.count, &lost_step.sum,
                      &lost_step.count, &fast_step.sum,    &fast_step.count,
                      &losses,          &fast_losses,      &losses_after_gap,
                      &longest_gap,     &focal_pairs,      &focal_extractions,
                      &focal_done})
      visit(*v);
    for (auto* list : {&depth.counts, &interval.counts})
      for (double& v : *list) visit(v);
    for (double& v : causes) visit(v);
    for (double& v : focal) visit(v);
  }
};

double share(double of, double all) { return all > 0 ? of / all : 0; }

/// Most plausible depth scale error for a median depth outside the range of rooms.
double likely_scale_error(double median) {
  double best = 1, error = 1e9;
  for (const double factor : {1e-4, 2e-4, 1e-3, 5e-3, 0.01, 0.1, 0.2, 5.0, 10.0, 100.0, 200.0, 1e3, 5e3, 1e4})
    if (const double e = std::abs(std::log(median / factor / 1.5)); e < error) error = e, best = factor;
  return best;
}

}  // namespace

std::string to_string(Verdict::Level level) {
  return level == Verdict::Level::good ? "good" : level == Verdict::Level::weak ? "weak" : "bad";
}

struct RunMonitor::State {
  Rig rig;
  float min_depth, max_depth, voxel_size;
  Sums sums;
  FrameSamples samples;
  Speeds speeds;
  int recording = 0;
  Measured measured;  // of the finished map
  // State of the previous frames.
  ViewProfile before;
  std::optional<double> last_timestamp;
  bool was_tracked = false;
  Features reference;  // reference view of the focal length check
  ViewStep shift_since_reference;

  void add_depth(const Frame& frame);
  void compare_views(const Frame& frame, const ViewStep& step);
  [[nodiscard]] bool can_compare_views(const Frame& frame) const;

  // Reasons, in output order.
  void add_impossible(std::vector<std::string>& reasons, const RunSummary& o) const;
  void add_unseen(std::vector<std::string>& reasons) const;
  void add_motion(std::vector<std::string>& reasons, const FrameRates& frame_rates) const;
  void add_items(Verdict& v, const RunSummary& o) const;
  void add_causes(std::vector<std::string>& reasons, const RunSummary& o) const;
  /// Reason for a wrong focal length, if the corners contradict it strongly.
  [[nodiscard]] std::optional<std::string> wrong_focal() const;
};

void RunMonitor::State::add_depth(const Frame& frame) {
  for (std::size_t i = 0; i < frame.depth.size(); i += kPixelStride) {
    const float z = frame.depth[i];
    ++sums.pixels;
    if (!(z > 0)) continue;
    ++sums.measured;
    sums.nearer += z < min_depth;
    sums.farther += z > max_depth;
    sums.depth.add(static_cast<double>(z));
  }
}

bool RunMonitor::State::can_compare_views(const Frame& frame) const {
  return sums.focal_done == 0 && sums.focal_extractions < kMaxExtractions && !rig.color && !frame.color.empty() &&
         frame.color.size() == frame.depth.size();
}

/// Collects inliers per focal length between views with sufficient rotation, of unknown size.
void RunMonitor::State::compare_views(const Frame& frame, const ViewStep& step) {
  shift_since_reference.right += step.right, shift_since_reference.down += step.down;
  if (!can_compare_views(frame)) return;
  if (!reference.rays.empty() && shift_since_reference.length() < kMinViewShift) return;
  Features seen = extract_features(frame.color, frame.depth, rig.depth);
  ++sums.focal_extractions;
  if (!reference.rays.empty())
    if (const auto inliers = focal_inliers(reference, seen, rig.depth)) {
      for (std::size_t i = 0; i < inliers->size(); ++i) sums.focal[i] += (*inliers)[i];
      ++sums.focal_pairs;
    }
  reference = std::move(seen);
  shift_since_reference = {};
  const double max_inliers = *std::max_element(sums.focal.begin(), sums.focal.end());
  sums.focal_done = sums.focal_pairs >= kMaxPairs ||
                    (sums.focal_pairs >= kMinPairs && sums.focal[kGivenFocal] >= kMinInlierRatio * max_inliers);
}

std::optional<std::string> RunMonitor::State::wrong_focal() const {
  const auto* const best = std::max_element(sums.focal.begin(), sums.focal.end());
  const double given = sums.focal[kGivenFocal];
  if (sums.focal_pairs < kMinPairs || *best < kMinContradictionRatio * given) return std::nullopt;
  // Interpolates between candidates, weighted by their inliers.
  const auto i = static_cast<std::size_t>(std::distance(sums.focal.begin(), best));
  double weight = 0, logarithm = 0;
  for (std::size_t k = i > 0 ? i - 1 : i; k <= std::min(i + 1, sums.focal.size() - 1); ++k) {
    const double w = sums.focal[k] * sums.focal[k];
    weight += w, logarithm += w * std::log(kWideFocalScales[k]);
  }
  const double found = 10 * std::round(rig.depth.fx * std::exp(logarithm / weight) / 10);
  return fmt::format(
      "{:.0f} % more corners fit a focal length of about {:.0f} pixels than the given {:.0f} ({:.0f} pairs of views): "
      "check the camera's intrinsics (fx, fy)",
      std::min(100 * (*best / std::max(given, 1.0) - 1), 999.0), found, rig.depth.fx, sums.focal_pairs);
}

void RunMonitor::State::add_impossible(std::vector<std::string>& reasons, const RunSummary& o) const {
  if (const double median = sums.depth.median(); median > kMaxMedianDepth || (median > 0 && median < kMinMedianDepth)) {
    const double factor = likely_scale_error(median);
    reasons.push_back(
        fmt::format("median depth is {:.2g} m: is depth_scale right? A value {:g} times as {} would give {:.1f} m",
                    median, factor > 1 ? factor : 1 / factor, factor > 1 ? "large" : "small", median / factor));
  }
  // Tracked views give a finer estimate; they are not available for a very wrong focal length.
  if (const FocalEvidence& f = o.focal; f.contradicts())
    reasons.push_back(fmt::format(
        "corners fit a focal length of {:.0f} pixels ({:.2f} pixels off) better than the given {:.0f} ({:.2f} pixels "
        "off, {} pairs of views): check the camera's intrinsics, and that color is registered to depth",
        f.scale * rig.depth.fx, f.error_best, rig.depth.fx, f.error_given, f.pairs));
  else if (const auto far = wrong_focal())
    reasons.push_back(*far);
  if (o.total < kMinFrames)
    reasons.push_back(fmt::format("only {} frame{}: a surface needs to be seen often and from several sides", o.total,
                                  o.total == 1 ? "" : "s"));
}

/// Reasons due to holes in the depth, an unsuitable distance, or darkness.
void RunMonitor::State::add_unseen(std::vector<std::string>& reasons) const {
  const auto add_reason = [&](std::string text) { reasons.push_back(std::move(text)); };
  if (const double seen = share(sums.measured, sums.pixels); sums.pixels > 0 && seen < kMinMeasured)
    add_reason(
        fmt::format("depth has holes: only {:.0f} % of its pixels are measured; glass, mirrors, sunlight, black or "
                    "shiny objects and objects too close give no depth",
                    100 * seen));
  if (const double out = share(sums.farther, sums.measured); out > kMaxOutOfRange)
    add_reason(
        fmt::format("too far: {:.0f} % of the depth is farther than {:g} m and not used: move closer, or raise "
                    "surface.max_depth (--config)",
                    100 * out, max_depth));
  if (const double out = share(sums.nearer, sums.measured); out > kMaxOutOfRange)
    add_reason(fmt::format("too near: {:.0f} % of the depth is nearer than {:g} m and not used: move away", 100 * out,
                           min_depth));
  if (share(sums.dark, sums.with_color) > kMajority)
    add_reason("too dark: most color images are nearly black: add light, or increase the exposure");
}

/// Items that do not depend on the number of frames in the map; reasons from those that are not good.
void RunMonitor::State::add_items(Verdict& v, const RunSummary& o) const {
  Measured all = measured;
  all.speeds = speeds;
  if (sums.frames > 0) all.with_color = share(sums.with_color, sums.frames);
  all.upright_unknown = o.upright_unknown;
  for (Verdict::Item& item : items_of(all)) {
    if (item.level != Verdict::Level::good) v.reasons.push_back(item.text);
    v.evidence.push_back(std::move(item));
  }
}

/// Frames dropped to keep up are missing between the compared frames. Drops are reported first, and motion only if it
/// would also be fast without drops.
void RunMonitor::State::add_motion(std::vector<std::string>& reasons, const FrameRates& frame_rates) const {
  const auto add_reason = [&](std::string text) { reasons.push_back(std::move(text)); };
  const double interval = sums.interval.median(), rate = interval > 0 ? 1 / interval : 0;
  const double turned_back = sums.causes[static_cast<std::size_t>(FrameCause::timestamp_goes_back)];
  if (turned_back > kMinCauseRatio * sums.frames)
    add_reason(fmt::format(
        "the timestamps of {:.0f} frames go back; these frames are skipped: are the images in order?", turned_back));
  const double kept = frame_rates.received > 0 ? frame_rates.processed / frame_rates.received : 1;
  if (kept < kMinProcessedRatio) {
    add_reason(fmt::format(
        "this computer keeps up with {:.0f} of {:.0f} frames a second: {}record first (cairn record), and "
        "reconstruct the recording",
        frame_rates.processed, frame_rates.received, voxel_size < kLargeVoxel ? "use --voxel-size 0.02, or " : ""));
    if (kept * sums.fast_step.value() < kMaxViewStep) return;
  }
  const bool is_fast = sums.losses > 0 && (sums.fast_losses >= kMajority * sums.losses ||
                                           sums.fast_step.count >= kMajority * sums.lost_step.count);
  if (is_fast && rate > 0 && rate < kMinFrameRate)
    add_reason(fmt::format(
        "too few frames: about {:.1f} per second, and the view moves by {:.0f} % of the image between frames: "
        "use more frames (--frames without a step), or move more slowly",
        rate, 100 * sums.fast_step.value()));
  else if (is_fast)
    add_reason(
        fmt::format("too fast: where the camera was lost the view moves by {:.0f} % of the image from frame to frame: "
                    "move and turn more slowly",
                    100 * sums.fast_step.value()));
  else if (sums.losses > 0 && sums.losses_after_gap >= kMajority * sums.losses)
    add_reason(
        fmt::format("gaps: the camera was lost where frames are missing, for {:.1f} s at most: record to a faster "
                    "disk, or with smaller images",
                    sums.longest_gap));
  const double lost = sums.sharp_lost.value(), fused = sums.sharp_fused.value();
  if (lost > 0 && (lost < kMinSharpness || (fused > 0 && lost < kMinSharpnessRatio * fused)))
    add_reason("blurred: the lost frames are less sharp than the others: move more slowly, or add light");
}

/// Most frequent cause of frames missing in the map.
void RunMonitor::State::add_causes(std::vector<std::string>& reasons, const RunSummary& o) const {
  const auto* const most_frequent = std::max_element(sums.causes.begin(), sums.causes.end());
  const auto cause = static_cast<FrameCause>(std::distance(sums.causes.begin(), most_frequent));
  if (*most_frequent == 0 || *most_frequent <= kMinCauseRatio * o.total) return;
  if (cause < FrameCause::little_depth)
    reasons.push_back(fmt::format("{:.0f} frames could not be used: {}", *most_frequent, to_string(cause)));
  else if (reasons.empty())
    reasons.push_back(
        fmt::format("{:.0f} frames were lost: {}; when that happens, turn back slowly to a place seen before",
                    *most_frequent, to_string(cause)));
}

RunMonitor::RunMonitor(const Rig& rig, const Options& options)
    : state_(new State{.rig = rig,
                       .min_depth = options.surface.min_depth,
                       .max_depth = options.surface.max_depth,
                       .voxel_size = options.fuse.voxel_size,
                       .sums = {},
                       .samples = FrameSamples(rig),
                       .speeds = Speeds(options.motion),
                       .measured = {},
                       .before = {},
                       .last_timestamp = {},
                       .reference = {},
                       .shift_since_reference = {}}) {}
RunMonitor::~RunMonitor() = default;
RunMonitor::RunMonitor(RunMonitor&&) noexcept = default;
RunMonitor& RunMonitor::operator=(RunMonitor&&) noexcept = default;

void RunMonitor::begin_recording(int number) {
  state_->recording = number;
  state_->speeds.begin();
}

void RunMonitor::compare_with_map(const std::vector<Mesh>& parts, const std::vector<Trajectory>& trajectories,
                                  double clock_offset, const DepthCorrection& correction) {
  State& s = *state_;
  const Camera& grid = s.samples.camera();
  std::vector<PlacedSample> fused, held_out;
  for (const PlacedSample& p : placed_samples(s.samples, s.rig.depth.readout, trajectories, clock_offset))
    (p.sample->held_out ? held_out : fused).push_back(p);
  const DepthTolerance tolerance{s.rig.sensor, s.voxel_size};
  s.measured.fused = compare_depth(parts, grid, correction, tolerance, fused);
  s.measured.held_out = compare_depth(parts, grid, correction, tolerance, held_out);
  s.measured.still = compare_still(grid, s.rig.sensor, fused);
}

void RunMonitor::compare_with_device(const Trajectory& tracked, const Trajectory& device, double drift) {
  state_->measured.device = compare_poses(tracked, device, drift);
}

void RunMonitor::add(const Frame& frame, const FrameReport& report) {
  State& s = *state_;
  Sums& sums = s.sums;
  const bool is_lost = report.state == FrameState::lost;
  ++sums.frames;
  const bool has_pose = report.state == FrameState::fused || report.state == FrameState::held_out;
  if (!has_pose) ++sums.causes[static_cast<std::size_t>(report.cause)];
  if (frame.problem) return;
  s.add_depth(frame);
  ViewProfile now = profile_of(frame, s.rig);
  if (!frame.color.empty()) {
    ++sums.with_color;
    sums.dark += now.brightness < kMinBrightness;
    if (now.sharpness > 0) (is_lost ? sums.sharp_lost : sums.sharp_fused).add(now.sharpness);
  }
  if (has_pose) s.samples.add(frame, s.recording, static_cast<double>(s.min_depth), static_cast<double>(s.max_depth));
  s.speeds.add(report, has_pose, sums.interval.median());
  double interval = 0;
  if (s.last_timestamp && frame.timestamp > *s.last_timestamp) interval = frame.timestamp - *s.last_timestamp;
  const double median_interval = sums.interval.median();
  sums.interval.add(interval);
  if (const auto step = s.before.columns.empty() ? std::nullopt : step_between(s.before, now)) {
    const bool is_fast = step->length() >= kMaxViewStep;
    if (is_lost) sums.lost_step.add(step->length());
    if (is_lost && is_fast) sums.fast_step.add(std::min(1.0, step->length()));
    sums.fast_losses += is_lost && is_fast && s.was_tracked;
    s.compare_views(frame, *step);
  } else {
    s.compare_views(frame, {});
  }
  if (is_lost && s.was_tracked) {
    ++sums.losses;
    if (median_interval > 0 && interval > kMinGap * median_interval) {
      ++sums.losses_after_gap;
      sums.longest_gap = std::max(sums.longest_gap, interval);
    }
  }
  if (frame.depth.empty()) return;
  s.before = std::move(now);
  s.last_timestamp = frame.timestamp;
  s.was_tracked = has_pose;
}

Verdict RunMonitor::verdict(const RunSummary& o) const {
  const double in_map = share(o.fused, o.total);
  Verdict v;
  std::vector<std::string>& reasons = v.reasons;
  const bool is_contradicted = o.poses && o.poses->contradicts;
  if (is_contradicted) reasons.push_back(to_string(*o.poses, "--poses"));
  v.evidence.push_back(frames_item(in_map, o));
  if (o.components > 1)
    reasons.push_back(fmt::format(
        "{} components of the map are not connected by a loop; only the largest is written, the session keeps "
        "all: record slowly from one to the other (--resume)",
        o.components));
  state_->add_impossible(reasons, o);
  if (in_map < kGood) {
    state_->add_unseen(reasons);
  }
  state_->add_items(v, o);
  if (in_map < kGood) {
    state_->add_motion(reasons, o.frame_rates);
    state_->add_causes(reasons, o);
  }
  reasons.insert(reasons.end(), o.warnings.begin(), o.warnings.end());
  const bool is_bad = in_map < kBad || o.components > 1 || (is_contradicted && o.poses->as_given < kMinAgreement);
  v.level = is_bad                                 ? Verdict::Level::bad
            : in_map < kGood || !v.reasons.empty() ? Verdict::Level::weak
                                                   : Verdict::Level::good;
  const std::string frame_count = fmt::format("{} of {} frames are in the map", o.fused, o.total) +
                                  (o.held_out > 0 ? fmt::format(", {} were held out", o.held_out) : "");
  if (in_map < kBad)
    v.words = (in_map < kMajority ? "mostly lost: only " : "much is missing: only ") + frame_count;
  else if (is_contradicted)
    v.words = "depth contradicts the poses: " + frame_count;
  else if (o.components > 1)
    v.words = fmt::format("in {} disconnected components: {}", o.components, frame_count);
  else if (in_map < kGood)
    v.words = frame_count + ": check what is missing";
  else
    v.words = frame_count + (v.level == Verdict::Level::weak ? ", with warnings" : "");
  return v;
}

std::string RunMonitor::save() const {
  std::ostringstream out;
  out.precision(17);
  Sums sums = state_->sums;
  sums.visit_each([&](double& v) { out << v << ' '; });
  state_->speeds.save(out);
  state_->samples.save(out);
  return std::move(out).str();
}

void RunMonitor::restore(const std::string& saved) {
  std::istringstream in(saved);
  Sums sums;
  sums.visit_each([&](double& v) { in >> v; });
  if (!in) return;
  state_->sums = sums;
  // Older sessions have no samples.
  if (state_->speeds.restore(in)) state_->samples.restore(in);
}

}  // namespace cairn
