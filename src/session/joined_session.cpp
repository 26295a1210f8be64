// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "session/joined_session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "gpu/device.hpp"
#include "map/join.hpp"
#include "map/match.hpp"
#include "map/submaps.hpp"
#include "session/matches.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr double kStays = 0.25;    // voxels, at kReach from the camera
constexpr double kReach = 2;       // meters
constexpr std::size_t kOfMap = 2;  // keyframes of another map to align a keyframe with, at most

/// Bricks of the active volume in the newest submap; excludes bricks left by an earlier submap.
BrickTree last_submap(const BrickTree& active, const SessionState& s) {
  std::unordered_map<Brick, std::uint32_t, BrickHash> last_seen;
  const Volume::Residency& r = s.residency;
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
void leave_out_changed(std::vector<Loop>& loops, std::size_t begin, const std::vector<std::size_t>& map_of) {
  constexpr double kMuch = 1.7;
  const auto maps = [&](const Loop& l) { return std::minmax(map_of[l.edge.i], map_of[l.edge.j]); };
  std::vector<double> all;
  std::map<std::pair<std::size_t, std::size_t>, std::vector<double>> of_maps;
  for (std::size_t l = begin; l < loops.size(); ++l)
    all.push_back(loops[l].rmse), of_maps[maps(loops[l])].push_back(loops[l].rmse);
  if (all.empty()) return;
  const double usual = median(all);
  std::map<std::pair<std::size_t, std::size_t>, double> limit;
  for (auto& [pair, rmse] : of_maps) limit[pair] = kMuch * std::max(usual, median(rmse));
  const auto first = loops.begin() + static_cast<std::ptrdiff_t>(begin);
  loops.erase(std::remove_if(first, loops.end(), [&](const Loop& l) { return l.rmse > limit.at(maps(l)); }),
              loops.end());
}

/// Scales the information of the loops from `begin` on by how well they agree with each other: the error of an
/// alignment depends on the camera and is unknown in advance (variance component of a group of observations: Förstner &
/// Wrobel 2016, sec. 4.2.4).
void sharpen(Atlas& atlas, std::size_t begin) {
  constexpr double kMedian = 5.348;  // of the chi-squared distribution with 6 degrees of freedom
  constexpr double kMost = 16;       // limit of the factor: with few loops the poses follow the loops, so all seem to
                                     // agree
  std::vector<double> squared;
  for (std::size_t l = begin; l < atlas.loops.size(); ++l) {
    const PoseGraph::Edge& edge = atlas.loops[l].edge;
    if (!atlas.loops[l].inlier) continue;
    const Vector6d off = local_coordinates(edge.i_from_j.inverse() * atlas.world_from_camera[edge.i].inverse() *
                                           atlas.world_from_camera[edge.j]);
    squared.push_back(off.dot(edge.information * off));
  }
  if (squared.empty()) return;
  const double surer = std::clamp(kMedian / std::max(median(squared), 1e-9), 1.0, kMost);
  for (std::size_t l = begin; l < atlas.loops.size(); ++l) atlas.loops[l].edge.information *= surer;
}

/// Maximum displacement of points within kReach of the camera, meters.
double travel(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
  const Vector6d v = local_coordinates(from.inverse() * to);
  return v.tail<3>().norm() + kReach * v.head<3>().norm();
}

}  // namespace

void JoinedSession::add(const fs::path& session, std::size_t recording) {
  ReadSession read = read_session(session);
  SessionState& s = read.session;
  BackEnd::Memory& theirs = s.back_end;
  if (!read.parts.empty())
    throw std::runtime_error(session.string() + ": is a map of several parts; give the maps that it is made of");
  const bool is_first = maps_.empty();
  if (!is_first)
    check_alike({maps_[0].files.folder, state_.rig, state_.fuse}, {session, s.rig, s.fuse}, "put together");
  BackEnd::Memory& m = state_.back_end;
  Atlas& atlas = m.atlas;
  const std::size_t keyframes = atlas.keyframes.size(), submaps = m.submaps.size();
  Map& map = maps_.emplace_back(Map{.files = {.folder = fs::absolute(read.files),
                                              .first_keyframe = keyframes,
                                              .keyframes = theirs.atlas.keyframes.size(),
                                              .first_submap = submaps,
                                              .submaps = theirs.submaps.size()},
                                    .recording = recording,
                                    .frames = theirs.atlas.frames.size(),
                                    .submaps = theirs.submaps.size(),
                                    .id = map_id(theirs.atlas)});
  m.submaps.insert(m.submaps.end(), theirs.submaps.begin(), theirs.submaps.end());
  if (theirs.submap_begin < theirs.atlas.keyframes.size()) {
    const BrickTree last = last_submap(read.active, s);
    m.submaps.push_back(last.size() > 0);
    if (last.size() > 0) write_bricks(submap_file(submap_files(writer_.files()), m.submaps.size() - 1), last);
    ++map.submaps;
  }
  for (std::size_t k = 0; k < map.files.keyframes; ++k) {
    atlas.keyframes.push_back(theirs.atlas.keyframes[k]);
    atlas.keyframes.back().submap += submaps;
    atlas.world_from_camera.push_back(theirs.atlas.world_from_camera[k]);
  }
  if (!theirs.atlas.steps.empty()) {
    atlas.steps.resize(keyframes);
    atlas.steps.insert(atlas.steps.end(), theirs.atlas.steps.begin(), theirs.atlas.steps.end());
  }
  for (Loop loop : theirs.atlas.loops) {
    loop.edge.i += keyframes, loop.edge.j += keyframes;
    atlas.loops.push_back(loop);
  }
  frames_.push_back(std::move(theirs.atlas.frames));
  holds_.push_back(std::move(read.hold));
  state_.fused_count += s.fused_count;
  if (!is_first) return;
  atlas.up = theirs.atlas.up;
  state_.rig = s.rig, state_.fuse = s.fuse;
  state_.min_depth = s.min_depth, state_.max_depth = s.max_depth;
  state_.tracker = std::move(s.tracker);
  state_.residency.origin = s.residency.origin;
}

void JoinedSession::add_loops(std::size_t first, std::size_t second, std::vector<Loop> loops) {
  for (Loop& loop : loops) {
    loop.edge.i += maps_[first].files.first_keyframe, loop.edge.j += maps_[second].files.first_keyframe;
    loops_.push_back(loop);
  }
}

/// Loops between keyframes of a map and of the map before it, from frames tracked in both.
std::vector<Loop> JoinedSession::overlaps(std::size_t map) const {
  std::vector<Loop> ties;
  if (map == 0 || maps_[map].recording != maps_[map - 1].recording) return ties;
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
    const Matrix6d covariance =
        calibrated(keyframes[from].information).inverse() + calibrated(keyframes[k].information).inverse();
    ties.push_back({.edge = {.i = from,
                             .j = k,
                             .i_from_j = retract(same->second->twist.cast<double>()),
                             .information = covariance.inverse(),
                             .is_loop_closure = true}});
  }
  return ties;
}

/// For each keyframe, the nearest keyframes of each other map with an overlapping view, by their current poses.
std::vector<KeyframePair> JoinedSession::pairs(const std::vector<std::size_t>& map_of) const {
  const Atlas& atlas = state_.back_end.atlas;
  const auto piece = atlas.components();
  std::vector<KeyframePair> pairs;
  for (std::size_t i = 0; i < atlas.keyframes.size(); ++i) {
    std::map<std::size_t, std::size_t> of_map;
    std::size_t count = 0;
    for (const std::size_t j : near_keyframes(atlas, piece, i)) {
      if (map_of[i] == map_of[j] || of_map[map_of[j]] == kOfMap) continue;
      pairs.push_back({i, j, atlas.world_from_camera[i].inverse() * atlas.world_from_camera[j], 0});
      ++of_map[map_of[j]];
      if (++count == kCovisible) break;
    }
  }
  return pairs;
}

JoinedSession::Report JoinedSession::join(std::size_t recordings, int device) {
  Atlas& atlas = state_.back_end.atlas;
  Report report{.loops = static_cast<int>(loops_.size())};
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const std::vector<Loop> ties = overlaps(m);
    if (ties.empty()) continue;
    atlas.join(ties[ties.size() / 2].edge);
    atlas.loops.insert(atlas.loops.end(), ties.begin(), ties.end());
    report.overlaps += static_cast<int>(ties.size());
  }
  const std::size_t before = atlas.loops.size();
  std::vector<PartFiles> parts;
  for (const Map& map : maps_) parts.push_back(map.files);
  const KeyframeStore images(state_.rig, keyframe_files({}, parts), Access::read);
  ViewsApart views = views_of(state_.rig, images);
  (void)join_pieces(atlas, loops_, views);
  const auto settle = [&] {
    PoseGraph graph = atlas.graph();
    report.graph = optimise(graph);
    atlas.take(graph, report.graph);
  };
  settle();
  std::vector<std::size_t> map_of;
  for (std::size_t m = 0; m < maps_.size(); ++m) map_of.insert(map_of.end(), maps_[m].files.keyframes, m);
  if (const std::vector<KeyframePair> near = pairs(map_of); !near.empty()) {
    gpu::Device aligning(device);
    SurfaceMatcher matcher(aligning, state_.rig, options_of(state_));
    const std::vector<Loop> aligned = align_pairs(near, images, matcher);
    atlas.loops.insert(atlas.loops.end(), aligned.begin(), aligned.end());
    report.pairs = static_cast<int>(near.size());
    leave_out_changed(atlas.loops, before, map_of);
    settle();
    sharpen(atlas, before);
    settle();
  }
  for (std::size_t l = before; l < atlas.loops.size(); ++l)
    (atlas.loops[l].corners > 0 ? report.believed : report.aligned) += atlas.loops[l].inlier;
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

/// Motion of the world with the most keyframes within `stays` of their earlier poses. Candidates: none, the fit of all
/// keyframes, the fit of each map's keyframes.
Eigen::Isometry3d where_most_stays(const Atlas& atlas, const std::vector<SameKeyframe>& same, std::size_t maps,
                                   double stays) {
  const auto staying = [&](const Eigen::Isometry3d& move) {
    return std::count_if(same.begin(), same.end(), [&](const SameKeyframe& k) {
      return travel(k.was, move * atlas.world_from_camera[k.keyframe]) < stays;
    });
  };
  Eigen::Isometry3d best = Eigen::Isometry3d::Identity();
  auto most = staying(best);
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
    if (const auto count = staying(move); count > most) best = move, most = count;
  }
  return best;
}

}  // namespace

/// Divides the frames shared by two maps: the first half goes to the first map.
void JoinedSession::add_frames(std::size_t map) {
  Atlas& atlas = state_.back_end.atlas;
  // A recording without a map has no frames; later recordings keep their numbers.
  while (atlas.recordings.size() < maps_[map].recording) atlas.recordings.push_back(atlas.frames.size());
  const auto cut = [&](std::size_t first, std::size_t second) -> std::optional<double> {
    if (second >= maps_.size() || maps_[first].recording != maps_[second].recording || frames_[second].empty())
      return std::nullopt;
    const double begin = frames_[second][0].timestamp,
                 end = frames_[first].empty() ? begin : frames_[first].back().timestamp;
    return std::max(begin, 0.5 * (begin + end));
  };
  const auto begin = map > 0 ? cut(map - 1, map) : std::nullopt;
  const auto end = cut(map, map + 1);
  for (std::size_t i = 0; i < frames_[map].size(); ++i) {
    FusedFrame frame = frames_[map][i];
    if ((begin && frame.timestamp < *begin) || (end && frame.timestamp >= *end)) continue;
    frame.keyframe += static_cast<std::uint32_t>(maps_[map].files.first_keyframe);
    atlas.frames.push_back(frame);
  }
}

std::vector<std::optional<double>> JoinedSession::keep(const ReadSession& earlier) {
  const double stays = kStays * static_cast<double>(state_.fuse.voxel_size);
  const Atlas& before = earlier.session.back_end.atlas;
  Atlas& atlas = state_.back_end.atlas;
  std::vector<SameKeyframe> same;
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const PartFiles& now = maps_[m].files;
    const auto was = std::find_if(earlier.parts.begin(), earlier.parts.end(), [&](const PartFiles& p) {
      return fs::absolute(p.folder).lexically_normal() == now.folder.lexically_normal() && p.keyframes == now.keyframes;
    });
    if (was == earlier.parts.end()) continue;
    for (std::size_t k = 0; k < now.keyframes; ++k)
      same.push_back({m, now.first_keyframe + k, before.world_from_camera[was->first_keyframe + k]});
  }
  // The world's frame is arbitrary: keep most of the map in place.
  const Eigen::Isometry3d world = where_most_stays(atlas, same, maps_.size(), stays);
  if (!world.matrix().isIdentity(0))
    for (Eigen::Isometry3d& pose : atlas.world_from_camera) pose = world * pose;
  std::vector<std::optional<double>> moved(maps_.size());
  for (const auto& [map, keyframe, was] : same) {
    Eigen::Isometry3d& pose = atlas.world_from_camera[keyframe];
    const double by = travel(was, pose);
    moved[map] = std::max(moved[map].value_or(0), by);
    if (by >= stays) continue;
    pose = was;
    if (before.settled && before.settled->keyframe == keyframe) atlas.settled = before.settled;
  }
  return moved;
}

bool JoinedSession::is_joined(std::size_t map) const {
  const Atlas& atlas = state_.back_end.atlas;
  const auto component = atlas.components();
  const auto begin = component.begin() + static_cast<std::ptrdiff_t>(maps_[map].files.first_keyframe);
  return std::count(begin, begin + static_cast<std::ptrdiff_t>(maps_[map].files.keyframes), atlas.main_component()) > 0;
}

void JoinedSession::write(bool gather) {
  BackEnd::Memory& m = state_.back_end;
  if (!m.atlas.settled) m.atlas.settle_upright();
  const std::size_t keyframes = m.atlas.keyframes.size();
  m.tracked_from_camera.assign(keyframes, std::nullopt);
  m.searched = m.submap_begin = keyframes;
  m.submap_since = state_.fused_count + 1;
  m.breaks = true;
  state_.number = 1;
  std::vector<PartFiles> parts;
  for (const Map& map : maps_) parts.push_back(map.files);
  if (gather)
    writer_.copy_files(state_, submap_files({}, parts), keyframe_files({}, parts));
  else
    writer_.set_parts(std::move(parts));
  writer_.write(state_, {});
}

}  // namespace cairn
