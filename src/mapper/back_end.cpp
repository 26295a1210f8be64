// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/back_end.hpp"

#include <algorithm>
#include <chrono>
#include <limits>

#include "loop_closing/components.hpp"
#include "mapper/frame_features.hpp"

namespace cairn {
namespace {

constexpr double kMaxLoopSigmas = 3;      // max. motion by a loop closure, in standard deviations of the tracker
constexpr double kChiSquared999 = 22.46;  // 99.9 % of the chi-squared distribution with 6 degrees of freedom
// Meters, radians: smaller drift needs no immediate optimization.
constexpr double kMinDriftTranslation = 0.005, kMinDriftRotation = 0.003;
constexpr double kManyKeyframesShare = 0.75;  // share of submap_keyframes
// Factor on the keyframe distance where earlier submaps saw the same surface.
constexpr double kSparseDistanceFactor = 2;
constexpr int kMinCoveringKeyframes = 6;  // keyframes of earlier submaps that saw the same surface: at least two visits
constexpr double kIdentityTolerance = 1e-4;  // m, rad
constexpr const char* kNoFeatures = "keyframes without features are not recognized";
constexpr double kMaxBreakSigma = 0.3;  // m, of a motion between two components
constexpr double kBreakCovarianceFactor = 9;

double milliseconds(std::chrono::steady_clock::time_point since) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - since).count();
}

}  // namespace

BackEnd::BackEnd(gpu::Device& device, const Rig& rig, const Options& options, const std::filesystem::path& files,
                 Access access, const std::vector<SourceMapFiles>& source_maps)
    : device_(device),
      rig_(rig),
      options_(options),
      access_(access),
      matcher_(device, rig.depth, options),
      structure_(rig),
      images_(rig, keyframe_files(files, source_maps), access),
      submaps_(submap_files(files, source_maps), options.map.host_memory, access),
      database_(!files.empty() && access == Access::write ? files : std::filesystem::temp_directory_path()),
      global_volume_(device, options.fuse) {
  atlas_.up = options.up;
  if (!files.empty() && access == Access::write) std::filesystem::create_directories(keyframe_files(files).folder());
}

bool BackEnd::add(const Frame& frame, const FramePyramid& live, const Eigen::Isometry3d& submap_from_camera,
                  const Matrix6d* information, const OtherSensors& sensors, Volume& volume, std::uint32_t fused_count) {
  const bool starts_component = std::exchange(starts_component_, false);
  const bool is_keyframe =
      starts_component || submap_begin_ == atlas_.keyframes.size() || is_new_view(submap_from_camera);
  if (is_keyframe) {
    bool has_drift = false;
    attempt_optimization([&] { has_drift = scheduler_.take_results(atlas_); });
    has_drift = take_search_result() || has_drift;
    // If the whole map was searched, the new submap is still empty.
    if (!starts_component && submap_begin_ < atlas_.keyframes.size() && is_full(submap_from_camera, volume))
      end_submap(volume, fused_count, true);
    start_features(live);
    atlas_.add({.frame = frame.index,
                .timestamp = frame.timestamp,
                .color_delay = frame.color_delay,
                .submap = submaps_.size(),
                .searched = options_.map.loops ? searched_ : 0,
                .follows = !starts_component,
                .odometry_from_camera = submap_from_camera,
                .submap_from_camera = submap_from_camera,
                .information = information != nullptr ? *information : Matrix6d::Zero(),
                .acceleration = frame.acceleration,
                .device_pose = frame.guess,
                .device_drift = sensors.drift,
                .structure = structure_.find(live.images().depth),
                .inertial = sensors.inertial ? sensors.inertial() : InertialKeyframe{}});
    if (sensors.mount) atlas_.inertial_mount = sensors.mount;
    if (sensors.is_inertial_contradicted && atlas_.inertial_mount) atlas_.forget_inertial();
    drift_.update(atlas_.keyframes);
    database_.add(submap_from_camera, features_);
    warnings_.attempt("keyframes without images have no loop closures",
                      [&] { images_.put(atlas_.keyframes.size() - 1, live.images(), features_); });
    if (starts_component && tracks_in_world_) add_anchor_edge(information);
    if (starts_component && sensors.before_break) add_inertial_edge(*sensors.before_break);
    if (has_drift) attempt_optimization([&] { scheduler_.start(atlas_); });
    start_search();
  }
  atlas_.add_frame(frame.timestamp, submap_from_camera, frame.acceleration);
  return is_keyframe;
}

void BackEnd::start_features(const FramePyramid& live) {
  await_features();
  features_ = ready({});
  warnings_.attempt(kNoFeatures, [&] {
    features_ = std::async(std::launch::async, [images = feature_images(live, rig_, device_)] {
                  return std::make_shared<const Features>(extract_features(images.color, images.depth, images.camera));
                }).share();
  });
}

void BackEnd::await_features() {
  if (features_.valid()) warnings_.attempt(kNoFeatures, [&] { (void)features_.get(); });
}

bool BackEnd::hold_out(double timestamp, const Eigen::Isometry3d& submap_from_camera) {
  if (starts_component_) return false;
  atlas_.add_frame(timestamp, submap_from_camera);
  return true;
}

/// True if the camera is at keyframe distance from the last keyframe and, in a submap with many keyframes, from all of
/// its keyframes. Tracking aligns to their surface, so revisiting adds no information, and a room scanned for hours
/// stays one submap. Where earlier submaps saw the same surface the required distance is larger: a few views suffice to
/// find and constrain loop closures.
bool BackEnd::is_new_view(const Eigen::Isometry3d& submap_from_camera) const {
  const auto is_far = [&](const Keyframe& k) {
    return exceeds_keyframe_distance(k.submap_from_camera, submap_from_camera);
  };
  const auto begin = atlas_.keyframes.begin() + static_cast<std::ptrdiff_t>(submap_begin_),
             end = atlas_.keyframes.end();
  const bool has_many = static_cast<double>(end - begin) >= kManyKeyframesShare * options_.map.submap_keyframes;
  const Keyframe& last = atlas_.keyframes.back();
  if (has_many ? !std::all_of(begin, end, is_far) : !is_far(last)) return false;
  return exceeds_keyframe_distance(last.submap_from_camera, submap_from_camera, kSparseDistanceFactor) ||
         !is_covered_by_earlier_submaps(submap_from_camera);
}

/// True if many keyframes of earlier submaps, at their poses in the graph, have nearly the same view as the camera.
bool BackEnd::is_covered_by_earlier_submaps(const Eigen::Isometry3d& submap_from_camera) const {
  const std::size_t last = atlas_.keyframes.size() - 1;
  const Eigen::Isometry3d camera = atlas_.correction(last) * submap_from_camera;
  std::vector<std::size_t> nearby;
  for (std::size_t k = 0; k < searched_; ++k)
    if (!exceeds_keyframe_distance(atlas_.world_from_camera[k], camera, kSparseDistanceFactor)) nearby.push_back(k);
  if (nearby.size() < kMinCoveringKeyframes) return false;
  const auto component_of = atlas_.components();
  return std::count_if(nearby.begin(), nearby.end(),
                       [&](std::size_t k) { return component_of[k] == component_of[last]; }) >= kMinCoveringKeyframes;
}

bool BackEnd::is_full(const Eigen::Isometry3d& submap_from_camera, const Volume& volume) const {
  const Eigen::Vector3d begin = atlas_.keyframes[submap_begin_].submap_from_camera.translation();
  return (submap_from_camera.translation() - begin).norm() > static_cast<double>(options_.map.submap_radius) ||
         volume.size() > static_cast<std::size_t>(options_.map.submap_bricks) ||
         atlas_.keyframes.size() - submap_begin_ >= static_cast<std::size_t>(options_.map.submap_keyframes);
}

void BackEnd::end_submap(Volume& volume, std::uint32_t fused_count, bool keep) {
  // The search for its last keyframe covers the submaps before this one.
  (void)take_search_result();
  if (submap_begin_ == atlas_.keyframes.size()) {  // no frame was fused since the last submap
    if (keep) return;
    volume.adopt({});
    begin_component();
    return;
  }
  BrickList voxels = volume.split(submap_since_, atlas_.submap_from_camera(atlas_.frames.back()).translation(),
                                  keep ? options_.surface.max_depth : 0.0f);
  submaps_.add(std::move(voxels));
  searched_ = submap_begin_;
  submap_begin_ = atlas_.keyframes.size();
  submap_since_ = fused_count + 1;
  if (!keep) begin_component();
}

/// The next frame starts a component with unknown pose relative to the map.
void BackEnd::begin_component() {
  searched_ = atlas_.keyframes.size();
  starts_component_ = true;
  for (std::size_t k = 0; k < database_.size(); ++k) database_[k].tracked_from_camera.reset();
}

bool BackEnd::is_possible(std::size_t from, std::size_t to, const Eigen::Isometry3d& i_from_j) const {
  const auto covariance = drift_.covariance(atlas_.keyframes, from, to);
  if (!covariance) return true;
  const Eigen::Isometry3d expected = atlas_.world_from_camera[from].inverse() * atlas_.world_from_camera[to];
  const Vector6d error = local_coordinates(expected.inverse() * i_from_j);
  return error.dot(covariance->ldlt().solve(error)) < kMaxLoopSigmas * kMaxLoopSigmas * kChiSquared999;
}

BackEnd::Candidates BackEnd::find_candidates(const Features& features, std::size_t before) const {
  Candidates candidates;
  for (const auto& candidate : database_.query(features, kMaxLoopCandidates, 0, before)) {
    const auto pnp = solve_pnp(*images_.features(candidate.entry), features, rig_.depth);
    if (pnp && pnp->inliers >= kMinLoopInliers) candidates.emplace_back(candidate.entry, *pnp);
  }
  return candidates;
}

std::optional<Loop> BackEnd::verify(std::size_t to, const Candidates& candidates) {
  return verify(to, images_, candidates,
                [&](std::size_t from, const Eigen::Isometry3d& from_to) { return is_possible(from, to, from_to); });
}

std::optional<Loop> BackEnd::verify(std::size_t to, const KeyframeStore& images, const Candidates& candidates,
                                    const IsPossible& is_possible_pose) {
  ++counts_.database_queries;
  std::optional<Frame> frame;
  for (const auto& [from, pnp] : candidates) {
    if (!is_possible_pose(from, pnp.known_from_seen)) continue;
    ++counts_.tried;
    if (!frame) frame = images.get(to);
    const auto match = matcher_.match_symmetric(images_.get(from), *frame, pnp.known_from_seen);
    if (!match || !is_possible_pose(from, match->reference_from_query)) continue;
    return Loop{.edge = {.i = from,
                         .j = to,
                         .i_from_j = match->reference_from_query,
                         .information = match->information,
                         .is_loop_closure = true},
                .feature_inliers = pnp.inliers,
                .inlier_share = match->inlier_share,
                .rmse = match->rmse};
  }
  return std::nullopt;
}

/// Features are matched concurrently with tracking. The result is always taken at the next keyframe, so that offline
/// runs are repeatable.
void BackEnd::start_search() {
  if (!options_.map.loops || searched_ == 0) return;
  search_ = std::async(std::launch::async, [this, to = atlas_.keyframes.size() - 1, before = searched_] {
    return find_candidates(*images_.features(to), before);
  });
}

/// Returns true if the loop closure reveals drift, so that poses need optimization.
bool BackEnd::take_search_result() {
  if (!search_.valid()) return false;
  const std::size_t to = atlas_.keyframes.size() - 1;
  std::optional<Loop> loop;
  const bool is_searched =
      warnings_.attempt("loop closure detection is disabled", [&] { loop = verify(to, search_.get()); });
  options_.map.loops = options_.map.loops && is_searched;
  if (!loop) return false;
  atlas_.align_components(loop->edge);
  atlas_.loops.push_back(*loop);
  scheduler_.add_loop();
  const Eigen::Isometry3d expected = atlas_.world_from_camera[loop->edge.i].inverse() * atlas_.world_from_camera[to];
  const Vector6d error = local_coordinates(expected.inverse() * loop->edge.i_from_j);
  return error.head<3>().norm() > kMinDriftRotation || error.tail<3>().norm() > kMinDriftTranslation;
}

void BackEnd::attempt_optimization(const std::function<void()>& stage) {
  if (!optimizes_) return;
  optimizes_ = warnings_.attempt("keyframe poses stay unchanged, and loop closure detection is disabled", stage);
  options_.map.loops = options_.map.loops && optimizes_;
  counts_.graph_ms = 1000 * scheduler_.longest_seconds();
}

/// Joins a component to the preceding one by the motion of the inertial sensor between them. The edge is weak: the
/// keyframe's own measurement has the motion's noise.
void BackEnd::add_inertial_edge(const InertialOdometry::Prediction& before_break) {
  if (atlas_.keyframes.size() < 2 || before_break.position_sigma() > kMaxBreakSigma) return;
  const std::size_t to = atlas_.keyframes.size() - 1, from = to - 1;
  const PoseGraph::Edge edge{
      .i = from,
      .j = to,
      .i_from_j = atlas_.keyframes[from].submap_from_camera.inverse() * before_break.world_from_camera,
      .information = (kBreakCovarianceFactor * before_break.covariance).inverse(),
      .is_loop_closure = true};
  atlas_.align_components(edge);
  atlas_.loops.push_back({.edge = edge});
}

/// Corrects drift, above all of roll and pitch, by the inertial measurements. Smaller corrections would only resample
/// the submaps.
void BackEnd::optimize_inertially() {
  auto inertial = atlas_.inertial_graph(atlas_.keyframes.size());
  if (!inertial || inertial_keyframes_ == atlas_.keyframes.size()) return;
  inertial_keyframes_ = atlas_.keyframes.size();
  PoseGraph graph = atlas_.graph();
  const OptimizeReport report = optimize(graph, &*inertial);
  const auto is_small = [](const Eigen::Isometry3d& before, const Eigen::Isometry3d& after) {
    const Vector6d change = local_coordinates(before.inverse() * after);
    return change.head<3>().norm() < kMinDriftRotation && change.tail<3>().norm() < kMinDriftTranslation;
  };
  if (std::equal(graph.world_from_node.begin(), graph.world_from_node.end(), atlas_.world_from_camera.begin(),
                 is_small))
    graph.world_from_node = atlas_.world_from_camera;
  atlas_.update_poses(graph, report, inertial);
}

void BackEnd::finish_optimization() {
  await_features();
  attempt_optimization([&] { scheduler_.take_closing(atlas_); });
  (void)take_search_result();
  attempt_optimization([&] { scheduler_.finish(atlas_); });
  attempt_optimization([&] { optimize_inertially(); });
  attempt_optimization([&] {
    if (!has_inconsistent_loops(atlas_)) return;
    Atlas remerged = atlas_;  // an error on the way must leave the map unchanged
    FreeSpaceConflicts views = free_space_conflicts(rig_, images_);
    remerge_components(remerged, views);
    atlas_ = std::move(remerged);
  });
}

void BackEnd::set_up_axis(Up up) {
  atlas_.up = up;
  atlas_.frozen_gravity.reset();
}

bool BackEnd::is_undeformed() const {
  const auto component_of = atlas_.components();
  const std::size_t main = atlas_.main_component();
  for (std::size_t k = 0; k < atlas_.keyframes.size(); ++k)
    if (component_of[k] == main && (atlas_.keyframes[k].submap != submaps_.size() ||
                                    !atlas_.correction(k).matrix().isIdentity(kIdentityTolerance)))
      return false;
  return true;
}

std::optional<std::string> BackEnd::store() {
  auto problem = images_.store();
  return problem ? problem : submaps_.store();
}

BackEnd::State BackEnd::save() const {
  State state{.atlas = atlas_,
              .searched = searched_,
              .submap_begin = submap_begin_,
              .submap_since = submap_since_,
              .inertial_keyframes = inertial_keyframes_,
              .tracks_in_world = tracks_in_world_,
              .starts_component = starts_component_,
              .searching = search_.valid(),
              .scheduler = scheduler_.save()};
  for (std::size_t i = 0; i < submaps_.size(); ++i) state.submaps.push_back(submaps_.has_voxels(i));
  for (std::size_t k = 0; k < database_.size(); ++k)
    state.tracked_from_camera.push_back(database_[k].tracked_from_camera);
  return state;
}

void BackEnd::restore(const State& state) {
  atlas_ = state.atlas;
  for (const bool has_file : state.submaps) submaps_.add_stored(has_file);
  for (const auto& tracked_from_camera : state.tracked_from_camera) database_.add(tracked_from_camera);
  if (access_ == Access::write || state.searching) index_keyframes();  // a read-only map needs no place recognition
  drift_.update(atlas_.keyframes);
  searched_ = state.searched;
  submap_begin_ = state.submap_begin;
  submap_since_ = state.submap_since;
  inertial_keyframes_ = state.inertial_keyframes;
  tracks_in_world_ = state.tracks_in_world;
  starts_component_ = state.starts_component;
  if (state.searching) start_search();
  scheduler_.restore(state.scheduler, atlas_);
}

void BackEnd::index_keyframes() {
  while (database_.indexed() < database_.size()) database_.index(*images_.features(database_.indexed()));
}

std::vector<Loop> BackEnd::match(const BackEnd& other) {
  index_keyframes();
  std::vector<Loop> loops;
  for (std::size_t to = 0; to < other.atlas_.keyframes.size(); ++to) {
    const Candidates candidates = find_candidates(*other.images_.features(to), database_.size());
    // The relative pose of the two maps is unknown in advance.
    if (auto loop = verify(to, other.images_, candidates, [](auto&&...) { return true; })) loops.push_back(*loop);
  }
  return loops;
}

void BackEnd::begin_recording() {
  finish_optimization();
  index_keyframes();  // not done yet for a read-only map
  const auto component_of = atlas_.components();
  const std::size_t main = atlas_.main_component();
  submap_begin_ = atlas_.keyframes.size();
  begin_component();
  for (std::size_t k = 0; k < atlas_.keyframes.size(); ++k)
    if (component_of[k] == main) database_[k].tracked_from_camera = atlas_.world_from_camera[k];
  atlas_.recordings.push_back(atlas_.frames.size());
  tracks_in_world_ = true;
}

/// Adds an anchor edge for the first keyframe of a recording that was relocalized in the map, with the tracked relative
/// pose.
void BackEnd::add_anchor_edge(const Matrix6d* information) {
  tracks_in_world_ = false;
  if (information == nullptr) return;  // starts a component of its own
  const auto component_of = atlas_.components();
  const std::size_t main = atlas_.main_component(), to = atlas_.keyframes.size() - 1;
  std::size_t from = main;
  double min_distance = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < to; ++k) {
    if (component_of[k] != main) continue;
    const Vector6d motion = local_coordinates(atlas_.world_from_camera[k].inverse() * atlas_.world_from_camera[to]);
    if (motion.norm() < min_distance) min_distance = motion.norm(), from = k;
  }
  atlas_.loops.push_back({.edge = {.i = from,
                                   .j = to,
                                   .i_from_j = atlas_.world_from_camera[from].inverse() * atlas_.world_from_camera[to],
                                   .information = inflate_information(*information),
                                   .is_loop_closure = true}});
}

void BackEnd::rebase(std::uint32_t since, const Trajectory& poses, const DepthCorrection& correction) {
  const auto component_of = atlas_.components();
  const std::size_t main = atlas_.main_component();
  std::size_t next = 0;
  FusedFrames frames;
  for (std::size_t i = 0; i < atlas_.frames.size(); ++i) {
    FusedFrame frame = atlas_.frames[i];
    if (component_of[frame.keyframe] == main)
      frame.twist =
          local_coordinates(atlas_.world_from_camera[frame.keyframe].inverse() * poses[next++].world_from_camera)
              .cast<float>();
    frames.push_back(frame);
  }
  atlas_.frames = std::move(frames);
  if (!correction.empty())
    for (std::size_t k = 0; k < atlas_.keyframes.size(); ++k) images_.correct(k, correction);
  std::vector<bool> used(submaps_.size() + 1, false);
  for (std::size_t k = 0; k < atlas_.keyframes.size(); ++k) {
    if (component_of[k] == main) {
      database_[k].tracked_from_camera = atlas_.keyframes[k].submap_from_camera = atlas_.world_from_camera[k];
      atlas_.keyframes[k].submap = submaps_.size();
    }
    used[atlas_.keyframes[k].submap] = true;
  }
  for (std::size_t i = 0; i < submaps_.size(); ++i)
    if (!used[i]) submaps_.drop(i);
  submap_since_ = since;
}

std::vector<PlacedSubmap> BackEnd::placed_submaps(const std::vector<std::size_t>* only) const {
  const auto component_of = atlas_.components();
  const std::size_t main = atlas_.main_component();
  std::vector<bool> is_main(submaps_.size() + 1, false);
  for (std::size_t k = 0; k < component_of.size(); ++k)
    if (component_of[k] == main) is_main[atlas_.keyframes[k].submap] = true;
  std::vector<PlacedSubmap> placed;
  for (std::size_t i = 0; i < submaps_.size(); ++i)
    if (is_main[i] && (only == nullptr || std::binary_search(only->begin(), only->end(), i)))
      placed.push_back({i, submaps_.bricks(i), Deformation(atlas_, i)});
  return placed;
}

GlobalVolume& BackEnd::global_volume() {
  const auto start = std::chrono::steady_clock::now();
  (void)global_volume_.update(placed_submaps(), load_submap(), load_free());
  counts_.world_ms = std::max(counts_.world_ms, milliseconds(start));
  return global_volume_;
}

LoadSubmap BackEnd::load_submap() {
  return [this](std::size_t i, const BrickBox& box) {
    auto voxels = std::make_shared<const BrickTree>();
    warnings_.attempt("its content is missing in the map", [&] { voxels = submaps_.voxels(i, box); });
    return voxels;
  };
}

GlobalVolumeChunks BackEnd::global_volume_chunks(gpu::Device& device, const std::vector<std::size_t>* only) {
  submaps_.release_memory();
  return {device, options_.fuse, placed_submaps(only)};
}

LoadFree BackEnd::load_free() {
  return [this](std::size_t i) {
    auto free = std::make_shared<const BrickTree>();
    warnings_.attempt("its content is missing in the map", [&] { free = submaps_.free_space(i); });
    return free;
  };
}

BrickTree BackEnd::global_free_space(const std::vector<std::size_t>* only) {
  return free_space(options_.fuse, placed_submaps(only), load_free());
}

}  // namespace cairn
