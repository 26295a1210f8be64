// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/back_end.hpp"

#include <algorithm>
#include <chrono>
#include <limits>

#include "map/frame_features.hpp"
#include "map/join.hpp"

namespace cairn {
namespace {

constexpr double kTrust = 3;       // max. motion by a loop closure, in standard deviations of the tracker
constexpr double kChance = 22.46;  // 99.9 % of the chi-squared distribution with 6 degrees of freedom
constexpr double kSlipped = 0.005, kTurned = 0.003;  // m, rad: smaller slips need no immediate optimization
constexpr double kMany = 0.75;                       // share of submap_keyframes
constexpr double kSparser = 2;     // factor on the keyframe distance where earlier submaps saw the same surface
constexpr int kOthers = 6;         // keyframes of earlier submaps that saw the same surface: at least two visits
constexpr double kUnmoved = 1e-4;  // m, rad

double milliseconds(std::chrono::steady_clock::time_point since) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - since).count();
}

}  // namespace

BackEnd::BackEnd(gpu::Device& device, const Rig& rig, const Options& options, const std::filesystem::path& files,
                 Access access, const std::vector<PartFiles>& parts)
    : device_(device),
      rig_(rig),
      options_(options),
      access_(access),
      matcher_(device, rig.depth, options),
      structure_(rig),
      images_(rig, keyframe_files(files, parts), access),
      submaps_(submap_files(files, parts), options.map.host_memory, access),
      database_(!files.empty() && access == Access::write ? files : std::filesystem::temp_directory_path()),
      world_(device, options.fuse) {
  atlas_.up = options.up;
  if (!files.empty() && access == Access::write) std::filesystem::create_directories(keyframe_files(files).folder());
}

bool BackEnd::add(const Frame& frame, const Surface& live, const Eigen::Isometry3d& submap_from_camera,
                  const Matrix6d* information, Volume& volume, std::uint32_t fused_count) {
  const bool breaks = std::exchange(breaks_, false);
  const bool is_keyframe = breaks || submap_begin_ == atlas_.keyframes.size() || is_new_view(submap_from_camera);
  if (is_keyframe) {
    bool has_slipped = false;
    attempt_settling([&] { has_slipped = settling_.take(atlas_); });
    has_slipped = take_found() || has_slipped;
    // If the whole map was searched, the new submap is still empty.
    if (!breaks && submap_begin_ < atlas_.keyframes.size() && is_full(submap_from_camera, volume))
      end_submap(volume, fused_count, true);
    Features features;
    warnings_.attempt("keyframes without corners are not recognised",
                      [&] { features = features_of(live, rig_, device_); });
    atlas_.add({.frame = frame.index,
                .timestamp = frame.timestamp,
                .colour_delay = frame.colour_delay,
                .submap = submaps_.size(),
                .searched = options_.map.loops ? searched_ : 0,
                .follows = !breaks,
                .odometry_from_camera = submap_from_camera,
                .submap_from_camera = submap_from_camera,
                .information = information != nullptr ? *information : Matrix6d::Zero(),
                .acceleration = frame.acceleration,
                .structure = structure_.find(live.images().depth)});
    drift_.follow(atlas_.keyframes);
    database_.add(submap_from_camera, features);
    warnings_.attempt("keyframes without images close no loops",
                      [&] { images_.put(atlas_.keyframes.size() - 1, live.images(), std::move(features)); });
    if (breaks && in_world_) tie_to_world(information);
    if (has_slipped) attempt_settling([&] { settling_.begin(atlas_); });
    start_searching();
  }
  atlas_.add_frame(frame.timestamp, submap_from_camera, frame.acceleration);
  return is_keyframe;
}

bool BackEnd::hold_out(double timestamp, const Eigen::Isometry3d& submap_from_camera) {
  if (breaks_) return false;
  atlas_.add_frame(timestamp, submap_from_camera);
  return true;
}

/// True if the camera is at keyframe distance from the last keyframe and, in a submap with many keyframes, from all of
/// its keyframes. Tracking aligns to their surface, so revisiting adds no information, and a room scanned for hours
/// stays one submap. Where earlier submaps saw the same surface the required distance is larger: a few views suffice to
/// find and constrain loop closures.
bool BackEnd::is_new_view(const Eigen::Isometry3d& submap_from_camera) const {
  const auto left = [&](const Keyframe& k) { return is_apart(k.submap_from_camera, submap_from_camera); };
  const auto begin = atlas_.keyframes.begin() + static_cast<std::ptrdiff_t>(submap_begin_),
             end = atlas_.keyframes.end();
  const bool has_many = static_cast<double>(end - begin) >= kMany * options_.map.submap_keyframes;
  const Keyframe& last = atlas_.keyframes.back();
  if (has_many ? !std::all_of(begin, end, left) : !left(last)) return false;
  return is_apart(last.submap_from_camera, submap_from_camera, kSparser) || !was_seen_before(submap_from_camera);
}

/// True if many keyframes of earlier submaps, at their poses in the graph, have nearly the same view as the camera.
bool BackEnd::was_seen_before(const Eigen::Isometry3d& submap_from_camera) const {
  const std::size_t last = atlas_.keyframes.size() - 1;
  const Eigen::Isometry3d camera = atlas_.correction(last) * submap_from_camera;
  std::vector<std::size_t> near;
  for (std::size_t k = 0; k < searched_; ++k)
    if (!is_apart(atlas_.world_from_camera[k], camera, kSparser)) near.push_back(k);
  if (near.size() < kOthers) return false;
  const auto component_of = atlas_.components();
  return std::count_if(near.begin(), near.end(),
                       [&](std::size_t k) { return component_of[k] == component_of[last]; }) >= kOthers;
}

bool BackEnd::is_full(const Eigen::Isometry3d& submap_from_camera, const Volume& volume) const {
  const Eigen::Vector3d begin = atlas_.keyframes[submap_begin_].submap_from_camera.translation();
  return (submap_from_camera.translation() - begin).norm() > static_cast<double>(options_.map.submap_radius) ||
         volume.size() > static_cast<std::size_t>(options_.map.submap_bricks) ||
         atlas_.keyframes.size() - submap_begin_ >= static_cast<std::size_t>(options_.map.submap_keyframes);
}

void BackEnd::end_submap(Volume& volume, std::uint32_t fused_count, bool keep) {
  // The search for its last keyframe covers the submaps before this one.
  (void)take_found();
  if (submap_begin_ == atlas_.keyframes.size()) {  // no frame was fused since the last submap
    if (keep) return;
    volume.adopt({});
    leave_frame();
    return;
  }
  BrickList voxels = volume.split(submap_since_, atlas_.submap_from_camera(atlas_.frames.back()).translation(),
                                  keep ? options_.surface.max_depth : 0.0f);
  submaps_.add(std::move(voxels));
  searched_ = submap_begin_;
  submap_begin_ = atlas_.keyframes.size();
  submap_since_ = fused_count + 1;
  if (!keep) leave_frame();
}

/// The next frame starts a component with unknown pose relative to the map.
void BackEnd::leave_frame() {
  searched_ = atlas_.keyframes.size();
  breaks_ = true;
  for (std::size_t k = 0; k < database_.size(); ++k) database_[k].tracked_from_camera.reset();
}

bool BackEnd::is_possible(std::size_t from, std::size_t to, const Eigen::Isometry3d& i_from_j) const {
  const auto covariance = drift_.covariance(atlas_.keyframes, from, to);
  if (!covariance) return true;
  const Eigen::Isometry3d expected = atlas_.world_from_camera[from].inverse() * atlas_.world_from_camera[to];
  const Vector6d error = local_coordinates(expected.inverse() * i_from_j);
  return error.dot(covariance->ldlt().solve(error)) < kTrust * kTrust * kChance;
}

BackEnd::Seen BackEnd::look_up(const Features& features, std::size_t before) const {
  Seen seen;
  for (const auto& candidate : database_.query(features, kCandidates, 0, before)) {
    const auto located = solve_pnp(*images_.features(candidate.entry), features, rig_.depth);
    if (located && located->inliers >= kLoopCorners) seen.emplace_back(candidate.entry, *located);
  }
  return seen;
}

std::optional<Loop> BackEnd::verify(std::size_t to, const Seen& seen) {
  return verify(to, images_, seen,
                [&](std::size_t from, const Eigen::Isometry3d& from_to) { return is_possible(from, to, from_to); });
}

std::optional<Loop> BackEnd::verify(std::size_t to, const KeyframeStore& images, const Seen& seen,
                                    const IsPossible& may_lie) {
  ++counts_.looked_up;
  std::optional<Frame> frame;
  for (const auto& [from, located] : seen) {
    if (!may_lie(from, located.known_from_seen)) continue;
    ++counts_.tried;
    if (!frame) frame = images.get(to);
    const auto match = matcher_.both_ways(images_.get(from), *frame, located.known_from_seen);
    if (!match || !may_lie(from, match->i_from_j)) continue;
    return Loop{.edge = {.i = from,
                         .j = to,
                         .i_from_j = match->i_from_j,
                         .information = match->information,
                         .is_loop_closure = true},
                .corners = located.inliers,
                .inlier_share = match->inlier_share,
                .rmse = match->rmse};
  }
  return std::nullopt;
}

/// Features are matched concurrently with tracking. The result is always taken at the next keyframe, so that offline
/// runs are repeatable.
void BackEnd::start_searching() {
  if (!options_.map.loops || searched_ == 0) return;
  searching_ = std::async(std::launch::async, [this, to = atlas_.keyframes.size() - 1, before = searched_] {
    return look_up(*images_.features(to), before);
  });
}

/// Returns true if tracking had slipped, so that poses need optimization.
bool BackEnd::take_found() {
  if (!searching_.valid()) return false;
  const std::size_t to = atlas_.keyframes.size() - 1;
  std::optional<Loop> loop;
  const bool is_searched =
      warnings_.attempt("loops are no longer looked for", [&] { loop = verify(to, searching_.get()); });
  options_.map.loops = options_.map.loops && is_searched;
  if (!loop) return false;
  atlas_.join(loop->edge);
  atlas_.loops.push_back(*loop);
  settling_.add_loop();
  const Eigen::Isometry3d expected = atlas_.world_from_camera[loop->edge.i].inverse() * atlas_.world_from_camera[to];
  const Vector6d slip = local_coordinates(expected.inverse() * loop->edge.i_from_j);
  return slip.head<3>().norm() > kTurned || slip.tail<3>().norm() > kSlipped;
}

void BackEnd::attempt_settling(const std::function<void()>& stage) {
  if (!optimises_) return;
  optimises_ = warnings_.attempt("keyframes stay where they are, and loops are no longer looked for", stage);
  options_.map.loops = options_.map.loops && optimises_;
  counts_.graph_ms = 1000 * settling_.longest_seconds();
}

void BackEnd::settle() {
  attempt_settling([&] { settling_.take_closing(atlas_); });
  (void)take_found();
  attempt_settling([&] { settling_.finish(atlas_); });
  attempt_settling([&] {
    if (!contradict_each_other(atlas_)) return;
    Atlas anew = atlas_;  // an error on the way must leave the map unchanged
    ViewsApart views = views_of(rig_, images_);
    join_anew(anew, views);
    atlas_ = std::move(anew);
  });
}

void BackEnd::ask_up(Up up) {
  atlas_.up = up;
  atlas_.settled.reset();
}

bool BackEnd::is_plain() const {
  const auto component_of = atlas_.components();
  const std::size_t main = atlas_.main_component();
  for (std::size_t k = 0; k < atlas_.keyframes.size(); ++k)
    if (component_of[k] == main &&
        (atlas_.keyframes[k].submap != submaps_.size() || !atlas_.correction(k).matrix().isIdentity(kUnmoved)))
      return false;
  return true;
}

std::optional<std::string> BackEnd::store() {
  auto problem = images_.store();
  return problem ? problem : submaps_.store();
}

BackEnd::Memory BackEnd::memory() const {
  Memory memory{.atlas = atlas_,
                .searched = searched_,
                .submap_begin = submap_begin_,
                .submap_since = submap_since_,
                .in_world = in_world_,
                .breaks = breaks_,
                .searching = searching_.valid(),
                .settling = settling_.memory()};
  for (std::size_t i = 0; i < submaps_.size(); ++i) memory.submaps.push_back(submaps_.has_voxels(i));
  for (std::size_t k = 0; k < database_.size(); ++k)
    memory.tracked_from_camera.push_back(database_[k].tracked_from_camera);
  return memory;
}

void BackEnd::restore(const Memory& memory) {
  atlas_ = memory.atlas;
  for (const bool has_file : memory.submaps) submaps_.add_stored(has_file);
  for (const auto& tracked_from_camera : memory.tracked_from_camera) database_.add(tracked_from_camera);
  if (access_ == Access::write || memory.searching) index_keyframes();  // a read-only map needs no place recognition
  drift_.follow(atlas_.keyframes);
  searched_ = memory.searched;
  submap_begin_ = memory.submap_begin;
  submap_since_ = memory.submap_since;
  in_world_ = memory.in_world;
  breaks_ = memory.breaks;
  if (memory.searching) start_searching();
  settling_.restore(memory.settling, atlas_);
}

void BackEnd::index_keyframes() {
  while (database_.indexed() < database_.size()) database_.index(*images_.features(database_.indexed()));
}

std::vector<Loop> BackEnd::match(const BackEnd& other) {
  index_keyframes();
  std::vector<Loop> loops;
  for (std::size_t to = 0; to < other.atlas_.keyframes.size(); ++to) {
    const Seen seen = look_up(*other.images_.features(to), database_.size());
    // The relative pose of the two maps is unknown in advance.
    if (auto loop = verify(to, other.images_, seen, [](auto&&...) { return true; })) loops.push_back(*loop);
  }
  return loops;
}

std::pair<int, bool> BackEnd::append(const BackEnd& other) {
  (void)take_found();
  std::vector<Loop> loops = match(other);
  atlas_.surface_sigma = {};  // unknown for two merged maps
  const std::size_t keyframes = atlas_.keyframes.size(), frames = atlas_.frames.size(), submaps = submaps_.size();
  for (std::size_t i = 0; i < other.submaps_.size(); ++i) submaps_.add(other.submaps_.copy(i));
  for (std::size_t k = 0; k < other.atlas_.keyframes.size(); ++k) {
    Keyframe keyframe = other.atlas_.keyframes[k];
    keyframe.submap += submaps;
    atlas_.keyframes.push_back(keyframe);
    atlas_.world_from_camera.push_back(other.atlas_.world_from_camera[k]);
    database_.add(std::nullopt, *other.images_.features(k));
    images_.copy(keyframes + k, other.images_, k);
  }
  if (!other.atlas_.steps.empty()) {
    atlas_.steps.resize(keyframes);
    atlas_.steps.insert(atlas_.steps.end(), other.atlas_.steps.begin(), other.atlas_.steps.end());
  }
  drift_.follow(atlas_.keyframes);
  for (Loop loop : other.atlas_.loops) {
    loop.edge.i += keyframes, loop.edge.j += keyframes;
    atlas_.loops.push_back(loop);
  }
  for (std::size_t i = 0; i < other.atlas_.frames.size(); ++i) {
    FusedFrame frame = other.atlas_.frames[i];
    frame.keyframe += static_cast<std::uint32_t>(keyframes);
    atlas_.frames.push_back(frame);
  }
  atlas_.recordings.push_back(frames);
  for (const std::size_t first : other.atlas_.recordings) atlas_.recordings.push_back(frames + first);
  submap_begin_ = atlas_.keyframes.size();
  leave_frame();

  for (Loop& loop : loops) loop.edge.j += keyframes;
  ViewsApart views = views_of(rig_, images_);
  if (join_pieces(atlas_, loops, views) == 0) return {static_cast<int>(loops.size()), false};
  settling_.add_loop();
  settle();
  return {static_cast<int>(loops.size()), true};
}

void BackEnd::begin_in_world() {
  settle();
  const auto component_of = atlas_.components();
  const std::size_t main = atlas_.main_component();
  submap_begin_ = atlas_.keyframes.size();
  leave_frame();
  for (std::size_t k = 0; k < atlas_.keyframes.size(); ++k)
    if (component_of[k] == main) database_[k].tracked_from_camera = atlas_.world_from_camera[k];
  atlas_.recordings.push_back(atlas_.frames.size());
  in_world_ = true;
}

/// Adds an anchor edge for the first keyframe of a recording that was relocalized in the map, with the tracked relative
/// pose.
void BackEnd::tie_to_world(const Matrix6d* information) {
  in_world_ = false;
  if (information == nullptr) return;  // starts a component of its own
  const auto component_of = atlas_.components();
  const std::size_t main = atlas_.main_component(), to = atlas_.keyframes.size() - 1;
  std::size_t from = main;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < to; ++k) {
    if (component_of[k] != main) continue;
    const Vector6d motion = local_coordinates(atlas_.world_from_camera[k].inverse() * atlas_.world_from_camera[to]);
    if (motion.norm() < least) least = motion.norm(), from = k;
  }
  atlas_.loops.push_back({.edge = {.i = from,
                                   .j = to,
                                   .i_from_j = atlas_.world_from_camera[from].inverse() * atlas_.world_from_camera[to],
                                   .information = calibrated(*information),
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

World& BackEnd::world() {
  const auto start = std::chrono::steady_clock::now();
  (void)world_.update(placed_submaps(), load_submap(), load_free());
  counts_.world_ms = std::max(counts_.world_ms, milliseconds(start));
  return world_;
}

LoadSubmap BackEnd::load_submap() {
  return [this](std::size_t i, const BrickBox& box) {
    auto voxels = std::make_shared<const BrickTree>();
    warnings_.attempt("what it holds is missing in the map", [&] { voxels = submaps_.voxels(i, box); });
    return voxels;
  };
}

WorldParts BackEnd::world_parts(gpu::Device& device, const std::vector<std::size_t>* only) {
  submaps_.leave_memory();
  return {device, options_.fuse, placed_submaps(only)};
}

LoadFree BackEnd::load_free() {
  return [this](std::size_t i) {
    auto free = std::make_shared<const BrickTree>();
    warnings_.attempt("what it holds is missing in the map", [&] { free = submaps_.free(i); });
    return free;
  };
}

BrickTree BackEnd::world_free(const std::vector<std::size_t>* only) {
  return free_space(options_.fuse, placed_submaps(only), load_free());
}

}  // namespace cairn
