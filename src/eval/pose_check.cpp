// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Consistency check of given poses and depth: points of a depth image are compared with another depth image, using the
// given relative pose. The check is repeated for all conventions the poses could use.
#include "cairn/eval/pose_check.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <utility>

namespace cairn {
namespace {

// Selection of frames.
constexpr int kBursts = 4, kFramesPerBurst = 24;
constexpr double kMinFrameInterval = 0.09;                      // minimum seconds between frames of a burst
constexpr int kMaxSingleBurst = 3 * kBursts * kFramesPerBurst;  // frames; a shorter recording is a single burst
constexpr int kMaxUnseekableFrames = 64;  // number of leading frames read from a source without seeking
constexpr double kMinBurstGap = 3;        // times the usual spacing: starts another burst
// Comparison of two views.
constexpr int kMaxWidth = 160;  // maximum width in pixels
constexpr int kPointColumns = 14, kPointRows = 10;
constexpr float kSigmas = 3;            // of the difference of two depths
constexpr float kPoseError = 0.015f;    // meters, of ordinary poses between two frames
constexpr float kTurnError = 0.01f;     // radians, of ordinary poses between two frames
constexpr float kMinDepth = 0.05f;      // meters
constexpr float kMaxDepthStep = 0.05f;  // relative depth difference of neighbors on one surface
constexpr float kMinVisible = 0.25f;    // of the points
// Pairs: agreement below these shares without motion indicates a moving camera; poses indicate motion by angle and
// length.
constexpr std::array kMovedAgreement{0.75f, 0.45f};
constexpr double kMovedAngle = 0.1, kMovedDistance = 0.15;  // radians, meters
constexpr double kMaxOverlapAngle = 0.5,
                 kMaxOverlapDistance = 0.5;  // radians, meters: maximum motion between overlapping views
constexpr int kViewsPerStretch = 4;          // number of views whose pairs are correlated
constexpr int kMinPairs = 8, kMinStretches = 4;
// Conventions.
constexpr std::array kScales{1.0, 0.001, 0.01, 0.3048, 100.0, 1000.0};
constexpr std::size_t kRefinedCandidates = 8;  // number of best candidates for the clock and scale search
constexpr double kMaxClockOffset = 1, kMaxClockOffsetAlone = 5, kClockStep = 0.1, kClockFine = 0.02;  // seconds
constexpr double kMinClockOffset = 0.05;  // smallest reported offset in seconds
constexpr double kMaxScale = 32;          // factor
constexpr double kMinScale = 1.1;         // smallest reported factor
constexpr double kMaxEqualScale = 1.5;    // factor below which two scales are the same result
// Differences of shares: a clear difference, and equality of two conventions, in which case the simpler is preferred.
constexpr double kMinClearDifference = 0.06, kMinClearSigmas = 4;
constexpr double kMaxEqualDifference = 0.02, kMaxEqualSigmas = 2;
constexpr double kMinExplained = 0.6;  // below this share, the poses must explain more than the motionless camera

struct View {
  double time = 0;
  std::vector<float> depth;  // meters, of a pinhole camera
  std::vector<Eigen::Vector3f> points;
};

/// Undistorted depth images at low resolution.
class Views {
 public:
  explicit Views(const Rig& rig) : rig_(rig), camera_(rig.depth.rectified()) {
    const int step = std::max(1, (rig.depth.width + kMaxWidth - 1) / kMaxWidth);
    camera_.width = rig.depth.width / step, camera_.height = rig.depth.height / step;
    const double s = 1.0 / step;
    camera_.fx *= s, camera_.fy *= s;
    camera_.cx = (camera_.cx + 0.5) * s - 0.5, camera_.cy = (camera_.cy + 0.5) * s - 0.5;
    for (int y = 0; y < camera_.height; ++y)
      for (int x = 0; x < camera_.width; ++x) {
        const Eigen::Vector2d distorted = rig.depth.distort(camera_.ray(x, y).head<2>());
        const double u = std::round(rig.depth.fx * distorted.x() + rig.depth.cx),
                     v = std::round(rig.depth.fy * distorted.y() + rig.depth.cy);
        const bool inside = u >= 0 && v >= 0 && u < rig.depth.width && v < rig.depth.height;
        pixel_.push_back(inside ? static_cast<int>(v) * rig.depth.width + static_cast<int>(u) : -1);
      }
  }
  [[nodiscard]] const Camera& camera() const { return camera_; }

  [[nodiscard]] View view_of(const Frame& frame) const {
    std::vector<float> depth = frame.depth;
    rig_.depth_correction.apply(rig_.depth.width, rig_.depth.height, depth);
    View view{.time = frame.timestamp, .depth = std::vector<float>(pixel_.size()), .points = {}};
    for (std::size_t i = 0; i < pixel_.size(); ++i) {
      if (pixel_[i] < 0) continue;
      const auto p = static_cast<std::size_t>(pixel_[i]);
      const float z = depth[p];
      const bool is_confident = frame.confidence.empty() || frame.confidence[p] >= rig_.sensor.min_confidence;
      if (is_confident && z >= rig_.sensor.min_depth && z <= rig_.sensor.max_depth) view.depth[i] = z;
    }
    for (int row = 0; row < kPointRows; ++row)
      for (int column = 0; column < kPointColumns; ++column) add_point(view, row, column);
    return view;
  }

 private:
  /// Adds the point at the center of a cell if its neighbors are on the same surface.
  void add_point(View& view, int row, int column) const {
    const int x = (2 * column + 1) * camera_.width / (2 * kPointColumns),
              y = (2 * row + 1) * camera_.height / (2 * kPointRows);
    if (x < 1 || y < 1 || x + 1 >= camera_.width || y + 1 >= camera_.height) return;
    const int at = y * camera_.width + x;
    const float z = view.depth[static_cast<std::size_t>(at)];
    if (!(z > 0)) return;
    for (const int next : {at - 1, at + 1, at - camera_.width, at + camera_.width})
      if (!(std::abs(view.depth[static_cast<std::size_t>(next)] - z) < kMaxDepthStep * z)) return;
    view.points.push_back(z * camera_.ray(x, y).cast<float>());
  }

  Rig rig_;
  Camera camera_;
  std::vector<int> pixel_;  // depth image pixel per view pixel; -1: none
};

/// Depth interpolated between four pixels; at a depth edge, the value nearest to `z`; 0: no depth.
float depth_at(const View& view, int width, float u, float v, float z) {
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const float* const row = view.depth.data() + static_cast<std::ptrdiff_t>(y) * width + x;
  const std::array four{row[0], row[1], row[width], row[width + 1]};
  const auto [nearest_of_four, farthest_of_four] = std::minmax_element(four.begin(), four.end());
  if (*nearest_of_four > 0 && *farthest_of_four - *nearest_of_four < kMaxDepthStep * *farthest_of_four) {
    const float a = u - static_cast<float>(x), b = v - static_cast<float>(y);
    return (1 - b) * ((1 - a) * four[0] + a * four[1]) + b * ((1 - a) * four[2] + a * four[3]);
  }
  float nearest = 0;
  for (const float d : four)
    if (d > 0 && (nearest == 0 || std::abs(d - z) < std::abs(nearest - z))) nearest = d;
  return nearest;
}

class Comparison {
 public:
  Comparison(const Camera& camera, const SensorModel& sensor) : camera_(camera), sensor_(sensor) {
    fx_ = static_cast<float>(camera.fx), fy_ = static_cast<float>(camera.fy);
    cx_ = static_cast<float>(camera.cx), cy_ = static_cast<float>(camera.cy);
  }
  /// Share of the points of `a` that agree with the depth of `b`.
  [[nodiscard]] float share(const View& a, const View& b, const Eigen::Isometry3f& b_from_a) const {
    int visible = 0, agree = 0;
    for (const Eigen::Vector3f& point : a.points) {
      const Eigen::Vector3f p = b_from_a * point;
      if (!(p.z() > kMinDepth)) continue;
      const float u = fx_ * p.x() / p.z() + cx_, v = fy_ * p.y() / p.z() + cy_;
      if (!(u >= 0 && v >= 0 && u < static_cast<float>(camera_.width - 1) &&
            v < static_cast<float>(camera_.height - 1)))
        continue;
      const float d = depth_at(b, camera_.width, u, v, p.z());
      if (!(d > 0)) continue;
      ++visible;
      agree += std::abs(d - p.z()) < allowance(p.z());
    }
    const float min_visible = kMinVisible * static_cast<float>(a.points.size());
    return static_cast<float>(agree) / std::max({static_cast<float>(visible), min_visible, 1.0f});
  }
  [[nodiscard]] float both(const View& a, const View& b, const Eigen::Isometry3f& a_from_b) const {
    return (share(b, a, a_from_b) + share(a, b, a_from_b.inverse())) / 2;
  }

 private:
  [[nodiscard]] float allowance(float z) const {
    return kSigmas * std::numbers::sqrt2_v<float> * sensor_.sigma(z) + kPoseError + kTurnError * z;
  }
  Camera camera_;
  SensorModel sensor_;
  float fx_, fy_, cx_, cy_;
};

using Shares = std::vector<float>;  // per pair; NaN: no poses at its times

/// Two views with camera motion between them, according to the images or the poses.
struct Pair {
  std::size_t a, b;  // views
  int stretch;       // index of the time stretch
  bool by_poses;     // the poses show motion
};

bool claims_motion(const Eigen::Isometry3d& a_from_b) {
  return Eigen::AngleAxisd(a_from_b.linear()).angle() / kMovedAngle + a_from_b.translation().norm() / kMovedDistance >
         1;
}

bool overlap(const Eigen::Isometry3d& a_from_b) {
  return Eigen::AngleAxisd(a_from_b.linear()).angle() < kMaxOverlapAngle &&
         a_from_b.translation().norm() < kMaxOverlapDistance;
}

class PoseEvidence {
 public:
  PoseEvidence(const Rig& rig, const std::vector<Frame>& frames, const Trajectory& poses)
      : poses_(poses), comparison_(Views(rig).camera(), rig.sensor) {
    const Views views(rig);
    for (const Frame& frame : frames)
      if (const auto pose = pose_at(poses_, frame.timestamp); pose && !frame.problem && !frame.depth.empty())
        views_.push_back(views.view_of(frame)), given_.push_back(*pose);
    choose_pairs();
  }
  [[nodiscard]] const std::vector<Pair>& pairs() const { return pairs_; }
  [[nodiscard]] Shares motionless() const {
    Shares all;
    for (const Pair& p : pairs_) all.push_back(motionless(p.a, p.b));
    return all;
  }
  [[nodiscard]] Shares shares(const PoseConvention& c) const {
    std::vector<std::optional<Eigen::Isometry3d>> at;
    Trajectory one(1);
    for (const View& view : views_) {
      auto pose = pose_at(poses_, view.time - c.clock);
      if (pose) {
        one[0].world_from_camera = *pose;
        pose = with_convention(one, c)[0].world_from_camera;
      }
      at.push_back(pose);
    }
    Shares all;
    for (const auto& [a, b, stretch, by_poses] : pairs_)
      all.push_back(at[a] && at[b] ? comparison_.both(views_[a], views_[b], (at[a]->inverse() * *at[b]).cast<float>())
                                   : NAN);
    return all;
  }

 private:
  [[nodiscard]] float motionless(std::size_t a, std::size_t b) const {
    return comparison_.both(views_[a], views_[b], Eigen::Isometry3f::Identity());
  }
  [[nodiscard]] double median_interval() const {
    std::vector<double> all;
    for (std::size_t i = 1; i < views_.size(); ++i) all.push_back(views_[i].time - views_[i - 1].time);
    if (all.empty()) return 0;
    std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2), all.end());
    return all[all.size() / 2];
  }
  void choose_pairs() {
    const double max_gap = kMinBurstGap * median_interval();
    int stretch = 0, views_in_stretch = 0;
    for (std::size_t a = 0, end = 0; a < views_.size(); ++a) {
      if (a == end) {
        for (end = a + 1; end < views_.size() && views_[end].time - views_[end - 1].time <= max_gap;) ++end;
        views_in_stretch = 0, ++stretch;
      }
      if (++views_in_stretch > kViewsPerStretch) ++stretch, views_in_stretch = 1;
      if (a % 2 == 0) add_pairs(a, end, stretch);
    }
  }
  /// Adds the first later views with sufficiently different images, the first with motion according to the poses, and
  /// the last with overlap according to the poses, where small errors have accumulated.
  void add_pairs(std::size_t a, std::size_t end, int stretch) {
    std::size_t differ = 0, last = a;
    bool has_moved = false;
    for (std::size_t b = a + 1; b < end; ++b) {
      const Eigen::Isometry3d step = given_[a].inverse() * given_[b];
      const bool claims = claims_motion(step);
      if (claims && overlap(step)) last = b;
      bool taken = claims && !has_moved;
      has_moved = has_moved || claims;
      const float share = differ < kMovedAgreement.size() ? motionless(a, b) : 1;
      while (differ < kMovedAgreement.size() && share < kMovedAgreement[differ]) ++differ, taken = true;
      if (taken) pairs_.push_back({a, b, stretch, claims});
    }
    const bool is_new = pairs_.empty() || pairs_.back().a != a || pairs_.back().b < last;
    if (last > a && is_new) pairs_.push_back({a, last, stretch, true});
  }

  Trajectory poses_;
  Comparison comparison_;
  std::vector<View> views_;               // of the frames with poses
  std::vector<Eigen::Isometry3d> given_;  // unmodified, per view
  std::vector<Pair> pairs_;
};

/// Mean difference of the shares of two conventions, also in standard deviations of the means over stretches.
struct Difference {
  double mean = 0, sigmas = 0;
  int pairs = 0;
  [[nodiscard]] bool is_clear() const { return mean > kMinClearDifference && sigmas > kMinClearSigmas; }
  [[nodiscard]] bool is_none() const { return !(mean > kMaxEqualDifference && sigmas > kMaxEqualSigmas); }
};

Difference difference(const std::vector<Pair>& pairs, const Shares& a, const Shares& b, bool only_by_poses = false) {
  std::vector<double> sums, counts;
  double sum = 0, count = 0;
  for (std::size_t i = 0, last = pairs.size(); i < pairs.size(); ++i) {
    if (std::isnan(a[i]) || std::isnan(b[i]) || (only_by_poses && !pairs[i].by_poses)) continue;
    if (last == pairs.size() || pairs[i].stretch != pairs[last].stretch) sums.push_back(0), counts.push_back(0);
    last = i;
    const double d = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    sums.back() += d, counts.back() += 1, sum += d, count += 1;
  }
  if (sums.size() < kMinStretches) return {};
  const double mean = sum / count, n = static_cast<double>(sums.size());
  double squares = 0;  // variance of a ratio of sums over clusters
  for (std::size_t i = 0; i < sums.size(); ++i) squares += std::pow(sums[i] - mean * counts[i], 2);
  const double deviation = std::sqrt(squares * n / (n - 1)) / count;
  return {mean, mean / std::max(deviation, 1e-3), static_cast<int>(count)};
}

/// Returns true if at least half of the pairs have poses.
bool have_poses(const Shares& shares) {
  const auto without = std::count_if(shares.begin(), shares.end(), [](float s) { return std::isnan(s); });
  return !shares.empty() && 2 * static_cast<std::size_t>(without) <= shares.size();
}

/// 0 if there are too few poses.
double mean_of(const Shares& shares) {
  double sum = 0, count = 0;
  for (const float s : shares)
    if (!std::isnan(s)) sum += static_cast<double>(s), count += 1;
  return have_poses(shares) ? sum / count : 0;
}

struct Candidate {
  PoseConvention convention;
  Shares shares;
  double mean = 0;
  /// Number of departures from the default convention; unnamed conventions count more, since they are less likely.
  [[nodiscard]] double departures() const {
    constexpr double kUnnamedPenalty = 0.2;
    const PoseConvention& c = convention;
    const bool is_turned = c.axes != Eigen::Matrix3d::Identity(), is_mirrored = c.axes.determinant() < 0;
    const auto has_name = [](const PoseConvention& part) { return to_string(part).find('=') == std::string::npos; };
    const bool axes_named = has_name({.axes = c.axes}), scale_named = has_name({.scale = c.scale});
    return c.quaternion_w_first + c.camera_from_world + (c.clock != 0) +
           (is_turned ? 1 + (axes_named ? 0 : kUnnamedPenalty + is_mirrored) : 0) +
           (c.scale != 1 ? 1 + (scale_named ? 0 : kUnnamedPenalty) : 0);
  }
  [[nodiscard]] bool is_about(const Candidate& other) const {
    const PoseConvention &c = convention, &o = other.convention;
    return c.quaternion_w_first == o.quaternion_w_first && c.camera_from_world == o.camera_from_world &&
           c.axes == o.axes && std::abs(c.clock - o.clock) < kClockStep &&
           std::abs(std::log(c.scale / o.scale)) < std::log(kMaxEqualScale);
  }
};

std::vector<Eigen::Matrix3d> signed_permutations() {
  std::vector<Eigen::Matrix3d> all;
  std::array order{0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
      for (int i = 0; i < 3; ++i) axes(order[static_cast<std::size_t>(i)], i) = (signs >> i & 1) != 0 ? -1 : 1;
      all.push_back(axes);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return all;
}

class Search {
 public:
  explicit Search(const PoseEvidence& evidence) : evidence_(evidence) {
    std::vector<PoseConvention> conventions;
    for (const bool w_first : {false, true})
      for (const bool inverse : {false, true})
        for (const auto& axes : signed_permutations())
          for (const double scale : kScales)
            conventions.push_back(
                {.quaternion_w_first = w_first, .camera_from_world = inverse, .axes = axes, .scale = scale});
    all_ = evaluated(conventions);
    sort();
    std::vector<PoseConvention> best;
    for (std::size_t i = 0; i < kRefinedCandidates; ++i) best.push_back(all_[i].convention);
    add_clock({}, kMaxClockOffsetAlone);
    for (const PoseConvention& c : best) {
      if (c != PoseConvention{}) add_clock(c, kMaxClockOffset);
      add_scale(c);
    }
    sort();
  }
  /// The simplest candidate that explains the depth as well as the best.
  [[nodiscard]] const Candidate& likely() const {
    const Candidate* found = &all_.front();
    for (const Candidate& c : all_)
      if (c.departures() < found->departures() &&
          difference(evidence_.pairs(), all_.front().shares, c.shares).is_none())
        found = &c;
    return *found;
  }
  /// Returns true if another candidate of the same simplicity explains the depth as well.
  [[nodiscard]] bool has_rival(const Candidate& likely) const {
    return std::any_of(all_.begin(), all_.end(), [&](const Candidate& c) {
      return std::floor(c.departures()) <= std::floor(likely.departures()) && !c.is_about(likely) &&
             difference(evidence_.pairs(), likely.shares, c.shares).is_none();
    });
  }

 private:
  [[nodiscard]] std::vector<Candidate> evaluated(const std::vector<PoseConvention>& conventions) const {
    std::vector<Candidate> all(conventions.size());
    tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) {
      all[i] = {conventions[i], evidence_.shares(conventions[i]), 0};
      all[i].mean = mean_of(all[i].shares);
    });
    return all;
  }
  void sort() {
    std::stable_sort(all_.begin(), all_.end(), [](const auto& a, const auto& b) { return a.mean > b.mean; });
  }
  [[nodiscard]] Candidate best_of(const std::vector<PoseConvention>& conventions) const {
    auto all = evaluated(conventions);
    return *std::max_element(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.mean < b.mean; });
  }
  void add_clock(const PoseConvention& of, double max_offset) {
    double middle = of.clock;
    Candidate best;
    for (const auto& [step, reach] : {std::pair{kClockStep, max_offset}, {kClockFine, kClockStep}}) {
      std::vector<PoseConvention> all;
      const int steps = static_cast<int>(std::lround(reach / step));
      for (int i = -steps; i <= steps; ++i) {
        all.push_back(of);
        all.back().clock = middle + i * step;
      }
      best = best_of(all);
      middle = best.convention.clock;
    }
    best.convention.clock = std::round(middle / kClockFine) * kClockFine;
    if (std::abs(middle) >= kMinClockOffset) all_.push_back(std::move(best));
  }
  void add_scale(const PoseConvention& of) {
    double middle = of.scale;
    Candidate best;
    for (const auto& [step, reach] : {std::pair{std::sqrt(2), kMaxScale}, {std::pow(2, 1.0 / 16), std::sqrt(2)}}) {
      std::vector<PoseConvention> all;
      const int steps = static_cast<int>(std::lround(std::log(reach) / std::log(step)));
      for (int i = -steps; i <= steps; ++i) {
        all.push_back(of);
        all.back().scale = middle * std::pow(step, i);
      }
      best = best_of(all);
      middle = best.convention.scale;
    }
    if (std::abs(std::log(middle / of.scale)) >= std::log(kMinScale)) all_.push_back(std::move(best));
  }

  const PoseEvidence& evidence_;
  std::vector<Candidate> all_;  // sorted, best first
};

}  // namespace

std::vector<Frame> sampled_frames(Source& source) {
  const int size = source.size().value_or(0);
  const bool is_short = size <= kMaxSingleBurst, can_seek = source.next_timestamp().has_value();
  const int step = is_short ? std::max(1, (size + kBursts * kFramesPerBurst - 1) / (kBursts * kFramesPerBurst)) : 1;
  const int max_frames = can_seek ? kBursts * kFramesPerBurst : kMaxUnseekableFrames;
  std::vector<Frame> frames;
  double last = -INFINITY;
  for (int at = 0, taken = 0; taken < max_frames; ++at) {
    if (const auto time = source.next_timestamp()) {
      const int burst = taken / kFramesPerBurst;
      const bool is_before = at < static_cast<int>(static_cast<std::int64_t>(size) * burst / kBursts);
      if (is_short ? at % step != 0 : is_before || (taken % kFramesPerBurst != 0 && *time < last + kMinFrameInterval)) {
        source.skip();
        continue;
      }
      last = *time;
    }
    auto frame = source.next();
    if (!frame) break;
    ++taken;
    frame->color.clear();
    frames.push_back(std::move(*frame));
  }
  return frames;
}

PoseCheck check_poses(const Rig& rig, const std::vector<Frame>& frames, const Trajectory& poses) {
  const PoseEvidence evidence(rig, frames, poses);
  const auto& pairs = evidence.pairs();
  const Shares given = evidence.shares({}), motionless = evidence.motionless();
  const Difference moved = difference(pairs, motionless, given);
  if (moved.pairs < kMinPairs) return {};
  PoseCheck check{.pairs = moved.pairs, .as_given = mean_of(given), .motionless = mean_of(motionless)};
  check.explained = check.as_given;
  if (check.as_given > 1 - kMinClearDifference) return check;  // a clear improvement is impossible
  const Search search(evidence);
  const Candidate& likely = search.likely();
  check.explained = likely.mean;
  check.likely = likely.convention;
  check.is_likely = difference(pairs, likely.shares, given).is_clear();
  check.is_only = check.is_likely && !search.has_rival(likely);
  // Poses with motion must explain more than a motionless camera.
  const Difference gained = difference(pairs, given, motionless, true);
  const bool gains_nothing =
      gained.pairs >= kMinPairs && check.as_given < kMinExplained && gained.mean < kMaxEqualDifference;
  check.contradicts = check.is_likely || moved.is_clear() || gains_nothing;
  return check;
}

std::string to_string(const PoseCheck& check, std::string_view option) {
  if (!check.contradicts) return {};
  const std::string finding = fmt::format(
      "{}: the poses contradict the depth images: {:.0f} % of the points agree between "
      "consecutive images",
      option, 100 * check.as_given);
  const std::string name = to_string(check.likely);
  if (!check.is_likely)
    return finding +
           fmt::format(
               ", {:.0f} % with a static camera; no known pose convention explains it: do the poses belong to "
               "this recording, with times of its clock?",
               100 * check.motionless);
  const bool is_scaled = check.likely.scale != 1;
  return finding + fmt::format(", {:.0f} % with the convention {}: {}{}", 100 * check.explained, name,
                               check.is_only ? "give --poses-convention " + name
                                             : "other conventions fit as well, so check how the poses were written",
                               is_scaled ? ", or check depth_scale of the camera" : "");
}

}  // namespace cairn
