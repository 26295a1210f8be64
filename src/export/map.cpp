// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/map.hpp"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "base/atomic_file.hpp"
#include "base/file_name.hpp"
#include "cairn/mapping/mapper.hpp"
#include "export/cells.hpp"
#include "export/export.hpp"
#include "export/export_run.hpp"
#include "export/floor_plan.hpp"
#include "export/graph_picture.hpp"
#include "export/map_contents.hpp"
#include "export/views.hpp"
#include "geometry/axes.hpp"
#include "geometry/mesh_vertices.hpp"
#include "gravity/align_gravity.hpp"
#include "mapper/map_state.hpp"
#include "volume/vdb/map_vdb.hpp"
#include "volume/voxels.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kGridBatch = 8192;  // bricks: 32 MiB
constexpr int kPointsPercent = 30;        // of 100: cost of the points in an export of views

/// Velocity of a keyframe from neighboring frames that are close in time. `are_connected`: true if the poses of two
/// frames share a frame of reference.
template <class Frames, class Pose, class AreTogether>
Vector6d velocity_at(const Frames& frames, std::size_t i, const Pose& pose, const AreTogether& are_connected) {
  constexpr double kMaxGap = 0.2;  // seconds between frames used for a velocity
  const std::size_t a = i > 0 && are_connected(i - 1, i) ? i - 1 : i,
                    b = i + 1 < frames.size() && are_connected(i, i + 1) ? i + 1 : i;
  const double seconds = frames[b].timestamp - frames[a].timestamp;
  if (!(seconds > 0 && seconds < kMaxGap)) return Vector6d::Zero();
  return local_coordinates(pose(a).inverse() * pose(b)) / seconds;
}

std::vector<TextureKeyframe> texture_keyframes(const MapState&, const GivenPoses& given) {
  std::vector<TextureKeyframe> keyframes;
  for (std::size_t k = 0; k < given.keyframes().size(); ++k) {
    const auto [i, delay] = given.keyframes()[k];
    keyframes.push_back({.image = k,
                         .world_from_camera = given.poses()[i].world_from_camera,
                         .velocity = velocity_at(
                             given.poses(), i, [&](std::size_t j) { return given.poses()[j].world_from_camera; },
                             [](auto...) { return true; }),
                         .color_delay = delay});
  }
  return keyframes;
}

std::vector<TextureKeyframe> texture_keyframes(const MapState& s, const TrackedPoses&) {
  std::vector<TextureKeyframe> keyframes;
  const Atlas& atlas = s.back_end.atlas();
  const auto component_of = atlas.components();
  const std::size_t main = atlas.keyframes.empty() ? 0 : atlas.main_component();
  std::vector<std::size_t> segment(atlas.keyframes.size(), 0);  // tracked without interruption
  for (std::size_t k = 1; k < segment.size(); ++k) segment[k] = atlas.keyframes[k].follows ? segment[k - 1] : k;
  for (std::size_t i = 0; i < atlas.frames.size(); ++i) {
    const std::size_t k = atlas.frames[i].keyframe;
    if (component_of[k] != main || (i > 0 && atlas.frames[i - 1].keyframe == k)) continue;
    keyframes.push_back({.image = k,
                         .world_from_camera = atlas.world_from_camera[k],
                         .velocity = velocity_at(
                             atlas.frames, i, [&](std::size_t j) { return atlas.submap_from_camera(atlas.frames[j]); },
                             [&](std::size_t a, std::size_t b) {
                               return segment[atlas.frames[a].keyframe] == segment[atlas.frames[b].keyframe];
                             }),
                         .color_delay = atlas.keyframes[k].color_delay - s.tracker.clock_offset()});
  }
  return keyframes;
}

/// Keyframes of the main component for texturing.
std::vector<TextureKeyframe> texture_keyframes(const MapState& s) {
  return std::visit([&](const auto& poses) { return texture_keyframes(s, poses); }, s.poses);
}

/// Distance field rotated into the written world.
std::shared_ptr<const DistanceField> turned(const std::shared_ptr<const DistanceField>& field,
                                            const GravityAlignment& upright) {
  if (upright.world_from_tracked.matrix().isIdentity(0)) return field;
  return std::make_shared<const DistanceField>(field->voxel_size(), field->origin(), field->max_distance(),
                                               field->blocks(), upright.world_from_tracked.cast<float>());
}

/// Poses of the written world, converted to the frame of fusion.
Trajectory tracked(Trajectory poses, const GravityAlignment& upright) {
  for (StampedPose& pose : poses)
    pose.world_from_camera = upright.world_from_tracked.conjugate() * pose.world_from_camera;
  return poses;
}

/// Progress of a stage between two percentages of the entire export.
ExportProgress sub_progress(const ExportProgress& total, int begin, int end) {
  if (!total) return {};
  return [&total, begin, end](int done, int count, const std::string& next) {
    total(begin * count + (end - begin) * done, 100 * count, next);
  };
}

/// True if the map is made chunk by chunk: after corrections of its poses, a map may be larger than the memory.
bool is_chunked(MapState& s) {
  s.back_end.finish_optimization();
  return !s.back_end.is_undeformed();
}

/// `only`: restricts to these submaps, sorted; null: all.
GlobalVolumeChunks chunks_of(MapState& s, const std::vector<std::size_t>* only = nullptr) {
  s.cached_volume.reset();
  s.back_end.end_submap(s.volume, s.fused_count, true);
  malloc_trim(0);  // both consisted of thousands of small allocations
  return s.back_end.global_volume_chunks(s.device, only);
}

/// Inlier loops of the main component, for drawing.
std::vector<plan::LoopLine> loop_lines(const MapState& s) {
  std::vector<plan::LoopLine> lines;
  const Atlas& atlas = s.back_end.atlas();
  if (atlas.keyframes.empty()) return lines;
  const auto component_of = atlas.components();
  const std::size_t main = atlas.main_component();
  std::vector<std::size_t> begins;  // first keyframe of each recording after the first
  for (const std::size_t frame : atlas.recordings)
    begins.push_back(frame < atlas.frames.size() ? atlas.frames[frame].keyframe : atlas.keyframes.size());
  const auto recording_of = [&](std::size_t k) { return std::upper_bound(begins.begin(), begins.end(), k); };
  const Eigen::Isometry3d turn(s.upright().world_from_tracked);
  const auto place_of = [&](std::size_t k) {
    return Eigen::Vector3d((turn * atlas.world_from_camera[k]).translation());
  };
  for (const Loop& loop : atlas.loops) {
    const std::size_t i = loop.edge.i, j = loop.edge.j;
    if (loop.feature_inliers > 0 && loop.inlier && component_of[j] == main)
      lines.push_back({place_of(i), place_of(j), recording_of(i) != recording_of(j)});
  }
  return lines;
}

/// Adds bricks in batches of kGridBatch.
void add_batches(GridsWriter& writer, GlobalVolumeChunks& chunks, std::vector<Brick> bricks, const LoadSubmap& load) {
  std::sort(bricks.begin(), bricks.end(), before_in_grid);
  for (std::size_t i = 0; i < bricks.size(); i += kGridBatch)
    writer.add(chunks.make(std::span(bricks).subspan(i, std::min(kGridBatch, bricks.size() - i)), load));
}

class MapperContents final : public MapContents {
 public:
  explicit MapperContents(std::shared_ptr<MapState> state) : state_(std::move(state)) {}

  Mesh mesh() override {
    Mesh mesh = state_->polygonizer.polygonize(state_->global_volume());
    mesh.sigmas = sigma().at_each(mesh.positions);
    return turned(std::move(mesh), state_->upright().world_from_tracked);
  }

  Voxels voxels() override {
    MapState& s = *state_;
    const BrickTree& tree = s.global_volume().on_host();
    return voxels_of(
        tree,
        {.voxel_size = s.options.fuse.voxel_size, .truncation = s.options.fuse.truncation, .upright = s.upright()});
  }

  std::shared_ptr<const DistanceField> distances(const EsdfOptions* options, const Trajectory& visited) override {
    MapState& s = *state_;
    const GravityAlignment upright = s.upright();
    return turned(distances_of(s.device, s.global_volume().on_host(), s.options.fuse,
                               options != nullptr ? *options : s.options.esdf, tracked(visited, upright)),
                  upright);
  }

  ExportReport export_mesh(const fs::path& file, const ExportOptions& options, const ExportProgress& progress) override;

  ExportViewsReport export_views(const fs::path& folder, const ViewsOptions& options,
                                 const ExportProgress& progress) override;

  ExportedPlan export_plan(const fs::path& file, const PlanOptions& options, const ExportProgress& progress) override;

  void look(const std::function<void(const MapChunks&)>& visit) override { look_at(*state_, nullptr, visit); }

  void write_grids(const fs::path& file, Axes axes) override;

  ViewsInput views() override;
  gpu::Device& device() override { return state_->device; }

  void write_graph(const fs::path& file) const override {
    if (extension_of(file) == ".svg")
      write_graph_picture(file, state_->back_end.atlas());
    else
      write_g2o(file, upright_graph());
  }

  GravityAlignment upright() const override { return state_->upright(); }
  void set_up_axis(Up up) override {
    state_->options.up = up;
    state_->back_end.set_up_axis(up);
  }
  int recordings() const override { return state_->recordings(); }
  Trajectory trajectory(int recording) const override { return state_->trajectory(recording); }
  Statistics statistics() const override { return state_->statistics(); }

 private:
  [[nodiscard]] const SurfaceSigma& sigma() const { return state_->back_end.atlas().surface_sigma; }
  [[nodiscard]] PoseGraph upright_graph() const;
  std::shared_ptr<MapState> state_;
};

PoseGraph MapperContents::upright_graph() const {
  PoseGraph graph = state_->back_end.atlas().graph();
  const Eigen::Isometry3d turn(state_->upright().world_from_tracked);
  for (Eigen::Isometry3d& pose : graph.world_from_node) pose = turn * pose;
  graph.file_rotation = PoseGraph::FileRotation::half_angle;
  return graph;
}

void MapperContents::write_grids(const fs::path& file, Axes axes) {
  MapState& s = *state_;
  std::shared_ptr<const DistanceField> field;
  if (s.options.esdf.live)
    s.warnings().attempt(file.string() + " has no grid `esdf`", [&] { field = distances(nullptr, {}); });
  s.back_end.finish_optimization();
  GridsWriter writer(file, {.voxel_size = s.options.fuse.voxel_size,
                            .truncation = s.options.fuse.truncation,
                            .upright = s.upright(),
                            .axes = resolved(axes, Axes::world),
                            .sigma = sigma()});
  if (!is_chunked(s) || s.cached_volume) {
    const BrickTree& tree = s.global_volume().on_host();
    writer.add(tree);
    return writer.write(tree, field.get());
  }
  GlobalVolumeChunks chunks = chunks_of(s);
  add_batches(writer, chunks, chunks.bricks(), s.back_end.load_submap());
  writer.write(s.back_end.global_free_space(), nullptr);
}

ExportReport MapperContents::export_mesh(const fs::path& file, const ExportOptions& options,
                                         const ExportProgress& progress) {
  MapState& s = *state_;
  check(options, file);
  const KeyframeStore& images = s.images();
  images.wait();
  const bool in_chunks = is_chunked(s);
  std::optional<GlobalVolumeChunks> chunks;
  std::optional<Volume> loaded;  // chunk loaded last
  if (in_chunks) {
    chunks.emplace(chunks_of(s));
    loaded.emplace(s.device, s.global_volume_options(), s.options.surface.max_depth);
  }
  ExportInput input{.bricks = in_chunks ? chunks->bricks() : s.volume.bricks(),
                    .volume = in_chunks ? *loaded : s.volume,
                    .load = {},
                    .polygonizer = s.polygonizer,
                    .rig = s.rig,
                    .surface = s.options.surface,
                    .keyframes = texture_keyframes(s),
                    .get_image = [&](std::size_t image) { return images.get(image); },
                    .paths = {},
                    .upright = s.upright(),
                    .sigma = sigma()};
  if (in_chunks)
    input.load = [&](std::span<const Brick> bricks) { loaded->adopt(chunks->make(bricks, s.back_end.load_submap())); };
  for (int i = 0; i < s.recordings(); ++i) input.paths.push_back(s.trajectory(i));
  return export_surface(input, file, options, progress);
}

ViewsInput MapperContents::views() {
  const MapState& s = *state_;
  const KeyframeStore& images = s.images();
  images.wait();
  return {.rig = s.rig,
          .keyframes = texture_keyframes(s),
          .get_image = [&images](std::size_t image) { return images.get(image); },
          .world_from_map = Eigen::Isometry3d(s.upright().world_from_tracked)};
}

ExportViewsReport MapperContents::export_views(const fs::path& folder, const ViewsOptions& options,
                                               const ExportProgress& progress) {
  ExportViewsReport exported;
  check(options);
  write_folder(folder, [&](const fs::path& staging) {
    exported.points = export_mesh(staging / kViewPoints, {.point_spacing = options.point_spacing},
                                  sub_progress(progress, 0, kPointsPercent))
                          .points;
    const ViewsInput input = views();
    exported.keyframes = static_cast<int>(input.keyframes.size());
    exported.images = write_views(input, staging, options, sub_progress(progress, kPointsPercent, 100));
  });
  return exported;
}

ExportedPlan MapperContents::export_plan(const fs::path& file, const PlanOptions& options,
                                         const ExportProgress& progress) {
  check(options, file);
  std::vector<Trajectory> paths;
  paths.reserve(static_cast<std::size_t>(state_->recordings()));
  for (int i = 0; i < state_->recordings(); ++i) paths.push_back(state_->trajectory(i));
  ExportedPlan exported;
  look([&](const MapChunks& map) {
    exported = export_floor_plan({map, std::move(paths), loop_lines(*state_)}, file, options, progress);
  });
  return exported;
}

/// A map.vdb, or the part of it in a box: without keyframes, poses or a device in use.
class GridContents final : public MapContents {
 public:
  /// `box`: range of the voxels of a part, possibly without a surface.
  GridContents(fs::path file, ReadGrids grids, const std::optional<BrickBox>& box, int device)
      : file_(std::move(file)), box_(box), device_index_(device), grids_(std::move(grids)) {
    fuse_.voxel_size = grids_.info.voxel_size;
    fuse_.truncation = grids_.info.truncation;
  }

  Mesh mesh() override {
    Mesh mesh = Polygonizer(device()).polygonize(volume());
    mesh.sigmas = grids_.info.sigma.at_each(mesh.positions);
    return turned(std::move(mesh), grids_.info.upright.world_from_tracked);
  }

  Voxels voxels() override { return voxels_of(tree(), grids_.info); }

  std::shared_ptr<const DistanceField> distances(const EsdfOptions* options, const Trajectory& visited) override {
    Options checked;
    checked.fuse = fuse_;
    if (options != nullptr) checked.esdf = *options;
    check(checked);
    const GravityAlignment& upright = grids_.info.upright;
    auto field = turned(distances_of(device(), tree(), fuse_, checked.esdf, tracked(visited, upright), box_), upright);
    const auto& blocks = field->blocks();
    const bool has_surface = box_ || std::any_of(blocks.begin(), blocks.end(), [&](const auto& block) {
                               return std::any_of(block.samples->begin(), block.samples->end(),
                                                  [&](float d) { return d < field->max_distance(); });
                             });
    if (!has_surface) throw std::runtime_error(file_.string() + ": has no surface, so there are no distances");
    return field;
  }

  ExportReport export_mesh(const fs::path& file, const ExportOptions& options,
                           const ExportProgress& progress) override {
    check(options, file);
    Polygonizer polygonizer(device());
    return export_surface({.bricks = volume().bricks(),
                           .volume = volume(),
                           .polygonizer = polygonizer,
                           .upright = grids_.info.upright,
                           .sigma = grids_.info.sigma},
                          file, options, progress);
  }

  ExportViewsReport export_views(const fs::path&, const ViewsOptions&, const ExportProgress&) override {
    throw std::runtime_error(file_.string() + ": has no keyframes, so no images can be written");
  }

  ExportedPlan export_plan(const fs::path& file, const PlanOptions& options, const ExportProgress& progress) override {
    check(options, file);
    if (options.loops) throw not_written(file, file_.string() + " has no loops: give the output folder of the run");
    ExportedPlan exported;
    look([&](const MapChunks& map) { exported = export_floor_plan({map, {}, {}}, file, options, progress); });
    return exported;
  }

  void look(const std::function<void(const MapChunks&)>& visit) override {
    Polygonizer polygonizer(device());
    visit({.bricks = volume().bricks(),
           .volume = volume(),
           .load = {},
           .polygonizer = polygonizer,
           .free = volume().on_host(),
           .upright = grids_.info.upright});
  }

  void write_grids(const fs::path& file, Axes axes) override {
    GridInfo info = grids_.info;
    info.axes = resolved(axes, Axes::world);
    cairn::write_grids(file, tree(), info, nullptr);
  }

  ViewsInput views() override {
    throw std::runtime_error(file_.string() +
                             ": has no keyframes, so there are no images: give the output folder of the run");
  }

  gpu::Device& device() override {
    if (!device_) device_.emplace(device_index_);
    return *device_;
  }

  void write_graph(const fs::path& file) const override {
    throw std::runtime_error(file.string() + ": cannot be written: " + file_.string() + " has no pose graph");
  }

  GravityAlignment upright() const override { return grids_.info.upright; }
  void set_up_axis(Up up) override {
    if (up == Up::automatic || up == Up::camera)
      throw std::runtime_error(fmt::format(
          "{}: Options::up {} needs the session of the map: give the axis that points up, x, y, z, -x, -y or -z",
          file_.string(), to_string(up)));
    grids_.info.upright = gravity_alignment_of(*estimate_gravity({}, up), {});
  }
  int recordings() const override { return 1; }
  Trajectory trajectory(int) const override { return {}; }
  Statistics statistics() const override { return {}; }

 private:
  Volume& volume() {
    if (!volume_) {
      volume_.emplace(device(), fuse_, SurfaceOptions{}.max_depth);
      volume_->adopt(std::move(grids_.tree));
    }
    return *volume_;
  }
  const BrickTree& tree() { return volume_ ? volume_->on_host() : grids_.tree; }

  fs::path file_;
  std::optional<BrickBox> box_;
  int device_index_;
  ReadGrids grids_;
  FuseOptions fuse_;
  std::optional<gpu::Device> device_;
  std::optional<Volume> volume_;
};

/// Bricks inside a box.
std::vector<Brick> within(const std::vector<Brick>& bricks, const BrickBox& box) {
  std::vector<Brick> found;
  std::copy_if(bricks.begin(), bricks.end(), std::back_inserter(found),
               [&](const Brick& b) { return box.contains(b); });
  return found;
}

}  // namespace

void look_at(MapState& s, const std::vector<std::size_t>* submaps, const std::function<void(const MapChunks&)>& visit) {
  if (submaps == nullptr && !is_chunked(s))
    return visit({.bricks = s.volume.bricks(),
                  .volume = s.volume,
                  .load = {},
                  .polygonizer = s.polygonizer,
                  .free = s.volume.on_host(),
                  .upright = s.upright()});
  GlobalVolumeChunks chunks = chunks_of(s, submaps);
  Volume loaded(s.device, s.global_volume_options(), s.options.surface.max_depth);
  const BrickTree free = s.back_end.global_free_space(submaps);
  visit({.bricks = chunks.bricks(),
         .volume = loaded,
         .load =
             [&](std::span<const Brick> bricks) {
               loaded.adopt(chunks.make(bricks, s.back_end.load_submap()));
               malloc_trim(0);  // limits memory growth from chunk to chunk
             },
         .polygonizer = s.polygonizer,
         .free = free,
         .upright = s.upright()});
}

Mesh surface_of_block(MapState& s, const Eigen::Vector3i& block, const std::vector<std::size_t>& submaps) {
  GlobalVolumeChunks chunks = s.back_end.global_volume_chunks(s.device, &submaps);
  Volume loaded(s.device, s.global_volume_options(), s.options.surface.max_depth);
  const std::vector<Brick> bricks = within(chunks.bricks(), Cells::box_of(block));
  if (bricks.empty()) return {};
  loaded.adopt(chunks.make(bricks, s.back_end.load_submap()));
  return turned(s.polygonizer.polygonize(loaded, bricks), s.upright().world_from_tracked);
}

ExportReport export_block(MapState& s, const MapBlock& block, const fs::path& folder, const ExportOptions& options,
                          const ExportProgress& progress) {
  const fs::path file = folder / "tileset.json";
  GlobalVolumeChunks chunks = s.back_end.global_volume_chunks(s.device, &block.submaps);
  Volume loaded(s.device, s.global_volume_options(), s.options.surface.max_depth);
  const BrickBox own = Cells::box_of(block.block);
  const Brick margin = Brick::Constant(Cells::margin(options.clean, loaded.brick_size()));
  const BrickBox around(own.min() - margin, own.max() + margin);
  std::vector<Brick> bricks = within(chunks.bricks(), around);
  const std::vector<Brick> inside = within(bricks, own);
  if (inside.empty()) throw not_written(file, "the map does not reach this cell");

  BrickTree free;
  const BrickTree all_free = s.back_end.global_free_space(&block.submaps);
  for (const Brick& brick : within(all_free.free_bricks(), own)) free.mark_free(brick, all_free.free_voxels(brick));
  GridsWriter writer(folder / "map.vdb", {.voxel_size = s.options.fuse.voxel_size,
                                          .truncation = s.options.fuse.truncation,
                                          .upright = s.upright(),
                                          .axes = Axes::world,
                                          .sigma = {}});
  add_batches(writer, chunks, inside, s.back_end.load_submap());
  writer.write(free, nullptr);

  std::vector<TextureKeyframe> keyframes = texture_keyframes(s);
  std::erase_if(keyframes, [&](const TextureKeyframe& k) {
    return !std::binary_search(block.keyframes.begin(), block.keyframes.end(), k.image);
  });
  ExportOptions with_views = options;
  with_views.texture.enabled = options.texture.enabled && !keyframes.empty();
  const SurfaceSigma unknown;
  return export_surface(
      {.bricks = std::move(bricks),
       .volume = loaded,
       .load = [&](std::span<const Brick> wanted) { loaded.adopt(chunks.make(wanted, s.back_end.load_submap())); },
       .polygonizer = s.polygonizer,
       .rig = s.rig,
       .surface = s.options.surface,
       .keyframes = std::move(keyframes),
       .get_image = [&](std::size_t image) { return s.back_end.images().get(image); },
       .paths = {},
       .upright = s.upright(),
       .sigma = unknown,
       .block = block.block},
      file, with_views, progress);
}

Map map_of(std::shared_ptr<MapState> state) {
  return MapAccess::map_of(std::make_shared<MapperContents>(std::move(state)));
}

Map map_of_grids(const fs::path& vdb, int device) {
  return MapAccess::map_of(std::make_shared<GridContents>(vdb, read_grids(vdb), std::nullopt, device));
}

Map map_of_box(const fs::path& vdb, ReadGrids grids, const BrickBox& box, int device) {
  return MapAccess::map_of(std::make_shared<GridContents>(vdb, std::move(grids), box, device));
}

Map Mapper::map() { return map_of(state_); }

Map::Map(std::shared_ptr<MapContents> contents) : contents_(std::move(contents)) {}
Mesh Map::mesh() { return contents_->mesh(); }
Voxels Map::voxels() { return contents_->voxels(); }
std::shared_ptr<const DistanceField> Map::distances(const EsdfOptions& options, const Trajectory& visited) {
  return contents_->distances(&options, visited);
}
std::shared_ptr<const DistanceField> Map::distances() { return contents_->distances(nullptr, {}); }
ExportReport Map::export_mesh(const fs::path& file, const ExportOptions& options, const ExportProgress& progress) {
  return contents_->export_mesh(file, options, progress);
}
ExportViewsReport Map::export_views(const fs::path& folder, const ViewsOptions& options,
                                    const ExportProgress& progress) {
  return contents_->export_views(folder, options, progress);
}
ExportedPlan Map::export_plan(const fs::path& file, const PlanOptions& options, const ExportProgress& progress) {
  return contents_->export_plan(file, options, progress);
}
void Map::write_grids(const fs::path& file, Axes axes) { contents_->write_grids(file, axes); }
void Map::write_graph(const fs::path& file) const { contents_->write_graph(file); }
GravityAlignment Map::upright() const { return contents_->upright(); }
void Map::set_up_axis(Up up) { contents_->set_up_axis(up); }
int Map::recordings() const { return contents_->recordings(); }
Trajectory Map::trajectory(int recording) const { return contents_->trajectory(recording); }
Statistics Map::statistics() const { return contents_->statistics(); }

}  // namespace cairn
