// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "multisession/session_merger.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "gpu/device.hpp"
#include "loop_closing/components.hpp"
#include "loop_closing/match.hpp"
#include "map/submaps.hpp"
#include "multisession/segment_loops.hpp"
#include "volume/vdb/brick_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr double kMinMotion = 0.25;         // voxels, at kMotionRange from the camera
constexpr double kMotionRange = 2;          // meters
constexpr std::size_t kMaxPairsPerMap = 2;  // keyframes of another map to align a keyframe with, at most

/// Bricks of the active volume in the newest submap; excludes bricks left by an earlier submap.
BrickTree last_submap(const BrickTree& active, const SessionState& s) {
  std::unordered_map<Brick, std::uint32_t, BrickHash> last_seen;
  const Volume::SavedState& r = s.residency;
  for (std::size_t i = 0; i < r.on_device.size(); ++i) last_seen[r.on_device[i]] = r.device_last_seen[i];
  for (std::size_t i = 0; i < r.on_host.size(); ++i) last_seen[r.on_host[i]] = r.host_last_seen[i];
  BrickTree submap;
  for (const Brick& brick : active.bricks())
    if (const auto seen = last_seen.find(brick); seen != last_seen.end() && seen->second >= s.back_end.submap_since)
      submap.put(brick, std::span<const std::uint64_t, 512>(active.find(brick), 512));
  for (const Brick& brick : active.free_bricks()) submap.mark_free(brick, active.free_voxels(brick));
  return submap;
}

/// Reorders the values; requires at least one.
double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Removes loops from index `begin` on whose surface RMSE is far above the median of all loops and of the loops between
/// the same two maps: the alignment followed a change of the scene, such as a moved door. `map_of`: map of each
/// keyframe.
void remove_changed_scene_loops(std::vector<Loop>& loops, std::size_t begin, const std::vector<std::size_t>& map_of) {
  constexpr double kMaxRmseRatio = 1.7;
  const auto maps = [&](const Loop& l) { return std::minmax(map_of[l.edge.i], map_of[l.edge.j]); };
  std::vector<double> all;
  std::map<std::pair<std::size_t, std::size_t>, std::vector<double>> of_maps;
  for (std::size_t l = begin; l < loops.size(); ++l)
    all.push_back(loops[l].rmse), of_maps[maps(loops[l])].push_back(loops[l].rmse);
  if (all.empty()) return;
  const double median_rmse = median(all);
  std::map<std::pair<std::size_t, std::size_t>, double> limit;
  for (auto& [pair, rmse] : of_maps) limit[pair] = kMaxRmseRatio * std::max(median_rmse, median(rmse));
  const auto first = loops.begin() + static_cast<std::ptrdiff_t>(begin);
  loops.erase(std::remove_if(first, loops.end(), [&](const Loop& l) { return l.rmse > limit.at(maps(l)); }),
              loops.end());
}

/// Scales the information of the loops from `begin` on by how well they agree with each other: the error of an
/// alignment depends on the camera and is unknown in advance (variance component of a group of observations: Förstner &
/// Wrobel 2016, sec. 4.2.4).
void scale_information(Atlas& atlas, std::size_t begin) {
  constexpr double kMedianChiSquared = 5.348;  // of the chi-squared distribution with 6 degrees of freedom
  constexpr double kMaxFactor = 16;  // limit of the factor: with few loops the poses follow the loops, so all seem to
                                     // agree
  std::vector<double> squared;
  for (std::size_t l = begin; l < atlas.loops.size(); ++l) {
    const PoseGraph::Edge& edge = atlas.loops[l].edge;
    if (!atlas.loops[l].inlier) continue;
    const Vector6d error = local_coordinates(edge.i_from_j.inverse() * atlas.world_from_camera[edge.i].inverse() *
                                             atlas.world_from_camera[edge.j]);
    squared.push_back(error.dot(edge.information * error));
  }
  if (squared.empty()) return;
  const double factor = std::clamp(kMedianChiSquared / std::max(median(squared), 1e-9), 1.0, kMaxFactor);
  for (std::size_t l = begin; l < atlas.loops.size(); ++l) atlas.loops[l].edge.information *= factor;
}

/// Maximum displacement of points within kMotionRange of the camera, meters.
double max_motion(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
  const Vector6d v = local_coordinates(from.inverse() * to);
  return v.tail<3>().norm() + kMotionRange * v.head<3>().norm();
}

}  // namespace

void SessionMerger::add(const fs::path& session, std::size_t recording) {
  ReadSession read = read_session(session);
  SessionState& s = read.session;
  BackEnd::State& source = s.back_end;
  if (!read.source_maps.empty()) throw std::runtime_error(session.string() + ": is a merged map; give its source maps");
  const bool is_first = maps_.empty();
  if (!is_first) check_alike({maps_[0].files.folder, state_.rig, state_.fuse}, {session, s.rig, s.fuse}, "merged");
  BackEnd::State& m = state_.back_end;
  Atlas& atlas = m.atlas;
  const std::size_t keyframes = atlas.keyframes.size(), submaps = m.submaps.size();
  Map& map = maps_.emplace_back(Map{.files = {.folder = fs::absolute(read.files),
                                              .first_keyframe = keyframes,
                                              .keyframes = source.atlas.keyframes.size(),
                                              .first_submap = submaps,
                                              .submaps = source.submaps.size()},
                                    .recording = recording,
                                    .frames = source.atlas.frames.size(),
                                    .submaps = source.submaps.size(),
                                    .id = map_id(source.atlas)});
  m.submaps.insert(m.submaps.end(), source.submaps.begin(), source.submaps.end());
  if (source.submap_begin < source.atlas.keyframes.size()) {
    const BrickTree last = last_submap(read.active, s);
    m.submaps.push_back(last.size() > 0);
    if (last.size() > 0) write_bricks(submap_file(submap_files(writer_.files()), m.submaps.size() - 1), last);
    ++map.submaps;
  }
  for (std::size_t k = 0; k < map.files.keyframes; ++k) {
    atlas.keyframes.push_back(source.atlas.keyframes[k]);
    atlas.keyframes.back().submap += submaps;
    atlas.world_from_camera.push_back(source.atlas.world_from_camera[k]);
  }
  if (!source.atlas.steps.empty()) {
    atlas.steps.resize(keyframes);
    atlas.steps.insert(atlas.steps.end(), source.atlas.steps.begin(), source.atlas.steps.end());
  }
  for (Loop loop : source.atlas.loops) {
    loop.edge.i += keyframes, loop.edge.j += keyframes;
    atlas.loops.push_back(loop);
  }
  frames_.push_back(std::move(source.atlas.frames));
  holds_.push_back(std::move(read.hold));
  state_.fused_count += s.fused_count;
  if (!is_first) return;
  atlas.up = source.atlas.up;
  state_.rig = s.rig, state_.fuse = s.fuse;
  state_.min_depth = s.min_depth, state_.max_depth = s.max_depth;
  state_.tracker = std::move(s.tracker);
  state_.residency.origin = s.residency.origin;
}

void SessionMerger::add_loops(std::size_t first, std::size_t second, std::vector<Loop> loops) {
  for (Loop& loop : loops) {
    loop.edge.i += maps_[first].files.first_keyframe, loop.edge.j += maps_[second].files.first_keyframe;
    loops_.push_back(loop);
  }
}

/// Loops between keyframes of a map and of the map before it, from frames tracked in both.
std::vector<Loop> SessionMerger::overlaps(std::size_t map) const {
  std::vector<Loop> edges;
  if (map == 0 || maps_[map].recording != maps_[map - 1].recording) return edges;
  const std::size_t before = maps_[map - 1].files.first_keyframe, first = maps_[map].files.first_keyframe;
  const auto& keyframes = state_.back_end.atlas.keyframes;
  std::map<double, const FusedFrame*> earlier;
  for (std::size_t i = 0; i < frames_[map - 1].size(); ++i)
    earlier.emplace(frames_[map - 1][i].timestamp, &frames_[map - 1][i]);
  for (std::size_t k = first; k < first + maps_[map].files.keyframes; ++k) {
    const auto same = earlier.find(keyframes[k].timestamp);
    if (same == earlier.end()) continue;
    const std::size_t from = before + same->second->keyframe;
    // Each pose was aligned with its own map.
    const Matrix6d covariance = inflate_information(keyframes[from].information).inverse() +
                                inflate_information(keyframes[k].information).inverse();
    edges.push_back({.edge = {.i = from,
                              .j = k,
                              .i_from_j = retract(same->second->twist.cast<double>()),
                              .information = covariance.inverse(),
                              .is_loop_closure = true}});
  }
  return edges;
}

/// For each keyframe, the nearest keyframes of each other map with an overlapping view, by their current poses.
std::vector<KeyframePair> SessionMerger::pairs(const std::vector<std::size_t>& map_of) const {
  const Atlas& atlas = state_.back_end.atlas;
  const auto component = atlas.components();
  std::vector<KeyframePair> pairs;
  for (std::size_t i = 0; i < atlas.keyframes.size(); ++i) {
    std::map<std::size_t, std::size_t> of_map;
    std::size_t count = 0;
    for (const std::size_t j : covisible_keyframes(atlas, component, i)) {
      if (map_of[i] == map_of[j] || of_map[map_of[j]] == kMaxPairsPerMap) continue;
      pairs.push_back({i, j, atlas.world_from_camera[i].inverse() * atlas.world_from_camera[j], 0});
      ++of_map[map_of[j]];
      if (++count == kMaxCovisible) break;
    }
  }
  return pairs;
}

SessionMerger::Report SessionMerger::merge(std::size_t recordings, int device) {
  Atlas& atlas = state_.back_end.atlas;
  Report report{.loops = static_cast<int>(loops_.size())};
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const std::vector<Loop> edges = overlaps(m);
    if (edges.empty()) continue;
    atlas.align_components(edges[edges.size() / 2].edge);
    atlas.loops.insert(atlas.loops.end(), edges.begin(), edges.end());
    report.overlaps += static_cast<int>(edges.size());
  }
  const std::size_t before = atlas.loops.size();
  std::vector<SourceMapFiles> source_maps;
  for (const Map& map : maps_) source_maps.push_back(map.files);
  const KeyframeStore images(state_.rig, keyframe_files({}, source_maps), Access::read);
  FreeSpaceConflicts views = free_space_conflicts(state_.rig, images);
  (void)merge_components(atlas, loops_, views);
  const auto optimize_poses = [&] {
    PoseGraph graph = atlas.graph();
    report.graph = optimize(graph);
    atlas.update_poses(graph, report.graph);
  };
  optimize_poses();
  std::vector<std::size_t> map_of;
  for (std::size_t m = 0; m < maps_.size(); ++m) map_of.insert(map_of.end(), maps_[m].files.keyframes, m);
  if (const std::vector<KeyframePair> near = pairs(map_of); !near.empty()) {
    gpu::Device aligning(device);
    SurfaceMatcher matcher(aligning, state_.rig, options_of(state_));
    const std::vector<Loop> aligned = align_pairs(near, images, matcher);
    atlas.loops.insert(atlas.loops.end(), aligned.begin(), aligned.end());
    report.pairs = static_cast<int>(near.size());
    remove_changed_scene_loops(atlas.loops, before, map_of);
    optimize_poses();
    scale_information(atlas, before);
    optimize_poses();
  }
  for (std::size_t l = before; l < atlas.loops.size(); ++l)
    (atlas.loops[l].feature_inliers > 0 ? report.inliers : report.aligned) += atlas.loops[l].inlier;
  for (std::size_t m = 0; m < maps_.size(); ++m) add_frames(m);
  while (atlas.recordings.size() + 1 < recordings) atlas.recordings.push_back(atlas.frames.size());
  return report;
}

namespace {

/// Keyframe also present in an earlier session, with its pose there.
struct SameKeyframe {
  std::size_t map = 0, keyframe = 0;
  Eigen::Isometry3d was;
};

/// Motion of the world with the most keyframes within `tolerance` of their earlier poses. Candidates: none, the fit of
/// all keyframes, the fit of each map's keyframes.
Eigen::Isometry3d world_alignment(const Atlas& atlas, const std::vector<SameKeyframe>& same, std::size_t maps,
                                  double tolerance) {
  const auto count_kept = [&](const Eigen::Isometry3d& move) {
    return std::count_if(same.begin(), same.end(), [&](const SameKeyframe& k) {
      return max_motion(k.was, move * atlas.world_from_camera[k.keyframe]) < tolerance;
    });
  };
  Eigen::Isometry3d best = Eigen::Isometry3d::Identity();
  auto max_count = count_kept(best);
  for (std::size_t m = 0; m <= maps; ++m) {  // the last iteration uses all maps
    std::vector<Eigen::Vector3d> is, was;
    for (const SameKeyframe& k : same) {
      if (m < maps && k.map != m) continue;
      is.emplace_back(atlas.world_from_camera[k.keyframe].translation());
      was.emplace_back(k.was.translation());
    }
    if (is.size() < 3) continue;
    const auto columns = [](const std::vector<Eigen::Vector3d>& points) {
      return Eigen::Map<const Eigen::Matrix3Xd>(points.front().data(), 3, static_cast<Eigen::Index>(points.size()));
    };
    const Eigen::Isometry3d move(Eigen::umeyama(columns(is), columns(was), false));
    if (const auto count = count_kept(move); count > max_count) best = move, max_count = count;
  }
  return best;
}

}  // namespace

/// Divides the frames shared by two maps: the first half goes to the first map.
void SessionMerger::add_frames(std::size_t map) {
  Atlas& atlas = state_.back_end.atlas;
  // A recording without a map has no frames; later recordings keep their numbers.
  while (atlas.recordings.size() < maps_[map].recording) atlas.recordings.push_back(atlas.frames.size());
  const auto split_time = [&](std::size_t first, std::size_t second) -> std::optional<double> {
    if (second >= maps_.size() || maps_[first].recording != maps_[second].recording || frames_[second].empty())
      return std::nullopt;
    const double begin = frames_[second][0].timestamp,
                 end = frames_[first].empty() ? begin : frames_[first].back().timestamp;
    return std::max(begin, 0.5 * (begin + end));
  };
  const auto begin = map > 0 ? split_time(map - 1, map) : std::nullopt;
  const auto end = split_time(map, map + 1);
  for (std::size_t i = 0; i < frames_[map].size(); ++i) {
    FusedFrame frame = frames_[map][i];
    if ((begin && frame.timestamp < *begin) || (end && frame.timestamp >= *end)) continue;
    frame.keyframe += static_cast<std::uint32_t>(maps_[map].files.first_keyframe);
    atlas.frames.push_back(frame);
  }
}

std::vector<std::optional<double>> SessionMerger::restore_poses(const ReadSession& earlier) {
  const double tolerance = kMinMotion * static_cast<double>(state_.fuse.voxel_size);
  const Atlas& before = earlier.session.back_end.atlas;
  Atlas& atlas = state_.back_end.atlas;
  std::vector<SameKeyframe> same;
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const SourceMapFiles& now = maps_[m].files;
    const auto was = std::find_if(earlier.source_maps.begin(), earlier.source_maps.end(), [&](const SourceMapFiles& p) {
      return fs::absolute(p.folder).lexically_normal() == now.folder.lexically_normal() && p.keyframes == now.keyframes;
    });
    if (was == earlier.source_maps.end()) continue;
    for (std::size_t k = 0; k < now.keyframes; ++k)
      same.push_back({m, now.first_keyframe + k, before.world_from_camera[was->first_keyframe + k]});
  }
  // The world's frame is arbitrary: keep most of the map in place.
  const Eigen::Isometry3d world = world_alignment(atlas, same, maps_.size(), tolerance);
  if (!world.matrix().isIdentity(0))
    for (Eigen::Isometry3d& pose : atlas.world_from_camera) pose = world * pose;
  std::vector<std::optional<double>> moved(maps_.size());
  for (const auto& [map, keyframe, was] : same) {
    Eigen::Isometry3d& pose = atlas.world_from_camera[keyframe];
    const double by = max_motion(was, pose);
    moved[map] = std::max(moved[map].value_or(0), by);
    if (by >= tolerance) continue;
    pose = was;
    if (before.frozen_gravity && before.frozen_gravity->keyframe == keyframe)
      atlas.frozen_gravity = before.frozen_gravity;
  }
  return moved;
}

bool SessionMerger::is_merged(std::size_t map) const {
  const Atlas& atlas = state_.back_end.atlas;
  const auto component = atlas.components();
  const auto begin = component.begin() + static_cast<std::ptrdiff_t>(maps_[map].files.first_keyframe);
  return std::count(begin, begin + static_cast<std::ptrdiff_t>(maps_[map].files.keyframes), atlas.main_component()) > 0;
}

void SessionMerger::write(bool gather) {
  BackEnd::State& m = state_.back_end;
  if (!m.atlas.frozen_gravity) m.atlas.freeze_gravity();
  const std::size_t keyframes = m.atlas.keyframes.size();
  m.tracked_from_camera.assign(keyframes, std::nullopt);
  m.searched = m.submap_begin = keyframes;
  m.submap_since = state_.fused_count + 1;
  m.starts_component = true;
  state_.number = 1;
  std::vector<SourceMapFiles> source_maps;
  for (const Map& map : maps_) source_maps.push_back(map.files);
  if (gather)
    writer_.copy_files(state_, submap_files({}, source_maps), keyframe_files({}, source_maps));
  else
    writer_.set_source_maps(std::move(source_maps));
  writer_.write(state_, {});
}

}  // namespace cairn
