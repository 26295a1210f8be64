// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>

#include "base/stopwatch.hpp"
#include "mesh/clean.hpp"
#include "mesh/formats.hpp"
#include "mesh/gltf.hpp"
#include "mesh/points.hpp"
#include "mesh/simplify.hpp"
#include "mesh/tiles.hpp"
#include "mesh/topology.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kOneNode = 65536;          // bricks of a map that is not cut into cells unless it is asked for
constexpr int kUsualCell = 64, kUsualTile = 32;  // bricks a side
constexpr float kLevelRatio = 0.25f;             // of the triangles, from one level of detail to the next
constexpr std::uint64_t kViewMemory = std::uint64_t{512} << 20;  // bytes of keyframes on the device
constexpr float kMostError = 2;  // voxels that a ratio may move the surface, doubled from level to level
constexpr float kFull = 0.75f;   // of a texture that charts cover, about
constexpr std::uint8_t kNeverFree = 255;

bool is_gltf(const fs::path& file) { return file.extension() == ".glb" || file.extension() == ".gltf"; }
bool is_tileset(const fs::path& file) { return file.extension() == ".json"; }

/// A cell's surface. Vertices that neighbouring cells share stay until both are in one mesh.
struct Part {
  Mesh mesh;
  std::vector<std::uint8_t> free_from;  // by vertex: the level from which on all of its triangles are in one mesh
  float error = 0;                      // metres
  std::shared_ptr<const VoxelColours> colours;  // of the surface before it was simplified, for textures
};

Brick cell_at(const Brick& cell, int level) {
  return cell.unaryExpr([level](int i) { return i >> level; });
}

void take(std::vector<std::uint8_t>& values, const std::vector<std::uint32_t>& kept) {
  std::vector<std::uint8_t> taken;
  taken.reserve(kept.size());
  for (const std::uint32_t v : kept) taken.push_back(values[v]);
  values = std::move(taken);
}

class Exporter {
 public:
  Exporter(const ExportInput& input, const fs::path& file, const ExportOptions& options, const ExportProgress& progress)
      : input_(input), file_(file), options_(options), progress_(progress) {
    const std::vector<Brick>& bricks = input.bricks;
    if (bricks.empty())
      throw std::runtime_error(file.string() + ": is not written, the map is empty: no frame was fused into it");
    const float brick = input.volume.brick_size();
    if (options.cell_size > 0)
      cell_bricks_ = std::max(4, static_cast<int>(std::lround(options.cell_size / brick)));
    else if (is_tileset(file) || bricks.size() > kOneNode)
      cell_bricks_ = is_tileset(file) ? kUsualTile : kUsualCell;
    if (cell_bricks_ > 0) {
      origin_ = cell_of(bricks[0], cell_bricks_);
      for (const Brick& b : bricks) origin_ = origin_.cwiseMin(cell_of(b, cell_bricks_));
      for (const Brick& b : bricks) cells_[key(cell_of(b, cell_bricks_) - origin_)].push_back(b);
      margin_ = 2 + static_cast<int>(std::max(3 * options.clean.min_piece, options.clean.fill_holes) / brick);
    } else {
      cells_[{0, 0, 0}] = bricks;
    }
    count_ = static_cast<int>(cells_.size()) * (3 + options.texture.enabled) + 1 +
             (options.texture.enabled ? static_cast<int>(input.keyframes.size()) : 0);
  }

  Exported run() {
    if (options_.texture.enabled) prepare_texture();
    if (is_tileset(file_))
      write_tiles();
    else if (options_.point_spacing > 0)
      write_points();
    else
      write_parts();
    return std::move(exported_);
  }

 private:
  using Key = std::array<int, 3>;
  static Key key(const Brick& b) { return {b.x(), b.y(), b.z()}; }
  static Brick brick(const Key& k) { return {k[0], k[1], k[2]}; }

  void step(const char* next) {
    if (progress_) progress_(std::min(++done_, count_), count_, next);
  }
  template <class Work>
  decltype(auto) timed(const char* stage, const Work& work) {
    return cairn::timed(exported_.stage_ms, stage, work);
  }

  void prepare_texture() {
    if (input_.keyframes.empty())
      throw std::runtime_error(file_.string() +
                               ": is not written, the map has no keyframes, from which a texture is made: reconstruct "
                               "with --texture, or export without it");
    views_.emplace(input_.volume, input_.camera, input_.surface, input_.keyframes, input_.get_image, kViewMemory);
    exported_.keyframes = static_cast<int>(views_->size());
    const bool has_colour =
        timed("exposure", [&] { return views_->compensate_exposure([&] { step("comparing exposures"); }); });
    if (!has_colour)
      throw std::runtime_error(file_.string() +
                               ": is not written, the keyframes have no colour, from which a texture is made: export "
                               "without --texture");
    timed("registration", [&] { views_->register_colour(); });
    const shader::ColourCamera& c = views_->colour_camera();
    exported_.colour_camera = {c.rotation.x,    c.rotation.y,    c.rotation.z, c.translation.x,
                               c.translation.y, c.translation.z, c.focal_scale};
  }

  /// The bricks of a cell and of its neighbourhood, so that what is decided at its border is decided alike on both
  /// sides.
  [[nodiscard]] std::vector<Brick> around(const Key& cell) const {
    std::vector<Brick> bricks;
    const Brick low = (brick(cell) + origin_) * cell_bricks_ - Brick::Constant(margin_),
                high = (brick(cell) + origin_ + Brick::Ones()) * cell_bricks_ + Brick::Constant(margin_);
    const int reach = 1 + (margin_ - 1) / cell_bricks_;
    for (int x = -reach; x <= reach; ++x)
      for (int y = -reach; y <= reach; ++y)
        for (int z = -reach; z <= reach; ++z)
          if (const auto it = cells_.find(key(brick(cell) + Brick(x, y, z))); it != cells_.end())
            for (const Brick& b : it->second)
              if ((b.array() >= low.array()).all() && (b.array() < high.array()).all()) bricks.push_back(b);
    std::sort(bricks.begin(), bricks.end(), before);
    return bricks;
  }

  /// A cell's surface, clean, not yet simpler.
  Part part_of(const Key& cell) {
    Part part;
    Mesh& mesh = part.mesh;
    const bool is_whole = cell_bricks_ == 0;
    timed("mesh", [&] {
      const std::vector<Brick> bricks = is_whole ? cells_.begin()->second : around(cell);
      if (input_.load) {
        input_.load(bricks);
        if (views_) views_->forget();  // what they see of the map is another part now
      }
      mesh = input_.polygonizer.polygonize(input_.volume, bricks);
    });
    step("cleaning");
    const float size = static_cast<float>(cell_bricks_) * input_.volume.brick_size();
    const auto owner = [&](const std::array<std::uint32_t, 3>& t) -> Brick {
      const Eigen::Vector3f middle = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
      return (middle / size).array().floor().cast<int>().matrix() - origin_;
    };
    timed("clean", [&] {
      const auto own = [&](const auto& t) { return is_whole || key(owner(t)) == cell; };
      exported_.full_triangles +=
          static_cast<std::size_t>(std::count_if(mesh.triangles.begin(), mesh.triangles.end(), own));
      const Cleaned cleaned = clean(mesh, options_.clean);
      exported_.components_removed += cleaned.components_removed;  // at borders of cells counted in both
      exported_.holes_filled += cleaned.holes_filled;
      part.free_from.assign(mesh.positions.size(), 0);
      if (is_whole) return;
      for (const auto& t : mesh.triangles) {
        const Brick other = owner(t);
        std::uint8_t level = 0;
        while (level < 30 && cell_at(other, level) != cell_at(brick(cell), level)) ++level;
        if (level == 30) level = kNeverFree;
        for (const std::uint32_t v : t) part.free_from[v] = std::max(part.free_from[v], level);
      }
      std::erase_if(mesh.triangles, [&](const auto& t) { return !own(t); });
      take(part.free_from, drop_unused_vertices(mesh));
    });
    mesh.weights.clear();
    if (!has_colours(mesh)) mesh.colours.clear();
    if (options_.texture.enabled)
      part.colours = std::make_shared<VoxelColours>(mesh, input_.volume.options().voxel_size);
    return part;
  }

  /// Without any colour the mesh is all of the volume's grey.
  static bool has_colours(const Mesh& mesh) {
    return std::any_of(mesh.colours.begin(), mesh.colours.end(), [](const auto& c) {
      return c != std::array<std::uint8_t, 4>{179, 179, 179, 255};
    });
  }

  /// `freed`: what is in one mesh by now; `level` of detail.
  void simplify_part(Part& part, SimplifyOptions options, int freed, int level) {
    // Where a ratio would need more than this, more triangles stay.
    if (options.max_error <= 0 && options.ratio < 1)
      options.max_error = std::ldexp(kMostError * input_.volume.options().voxel_size, level);
    timed("simplify", [&] {
      std::vector<bool> locked(part.free_from.size(), false);
      for (std::size_t v = 0; v < locked.size(); ++v) locked[v] = part.free_from[v] > freed;
      const Simplified simplified = simplify(part.mesh, options, locked, !options_.texture.enabled);
      take(part.free_from, simplified.kept);
      part.error += simplified.error;
    });
    exported_.error = std::max(exported_.error, part.error);
  }

  /// With a texture, if one is asked for.
  Mesh textured(const Part& part, int level) {
    const Mesh& mesh = part.mesh;
    if (!options_.texture.enabled || mesh.triangles.empty()) return mesh;
    double area = 0;
    for (const auto& t : mesh.triangles)
      area +=
          0.5 *
          static_cast<double>(
              (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).norm());
    const auto max_size = static_cast<float>(options_.texture.max_size);
    float texel = options_.texture.texel > 0 ? options_.texture.texel : views_->texel_size(mesh);
    if (!(texel > 0)) texel = 0.25f * input_.volume.options().voxel_size;
    texel = std::max(std::ldexp(texel, level), static_cast<float>(std::sqrt(area / kFull)) / max_size);
    std::optional<TextureAtlas> atlas;
    timed("charts", [&] {
      for (int tries = 0; !atlas; ++tries, texel *= 1.15f) {
        if (tries == 40)
          throw std::runtime_error("the surface does not fit into a texture: give a larger --texture-size");
        atlas = pack(mesh, make_charts(mesh, texel, options_.texture.max_size), options_.texture.max_size);
      }
      texel /= 1.15f;
    });
    step("colouring");
    std::size_t points = 0;
    for (const shader::Texel& t : atlas->points) points += t.normal != 0;
    const std::size_t seen = timed("texture", [&] { return views_->blend(*atlas, part.colours.get()); });
    seen_ += seen;
    exported_.texels += points;
    exported_.textured_share =
        exported_.texels == 0 ? 0 : static_cast<double>(seen_) / static_cast<double>(exported_.texels);
    exported_.charts += atlas->charts;
    exported_.texel = std::max(exported_.texel, texel);
    ++exported_.textures;
    return std::move(atlas->mesh);
  }

  [[nodiscard]] GltfOptions gltf_options() const {
    return {.compression = options_.compression,
            .png = options_.texture.png,
            .jpeg_quality = options_.texture.jpeg_quality,
            .source = options_.source};
  }

  void count(const GltfWriter::Added& added) {
    exported_.parts += added.triangles > 0;
    exported_.triangles += added.triangles;
    exported_.vertices += added.vertices;
  }

  void write_points() {
    SurfacePoints points(options_.point_spacing);
    for (const auto& [cell, bricks] : cells_) {
      const Part part = part_of(cell);
      step("spreading points");
      timed("points", [&] { points.add(part.mesh); });
      step("meshing");
    }
    exported_.points = points.points().positions.size();
    refuse_empty(exported_.points);
    timed("write", [&] { write_ply(file_, points.points()); });
  }

  void write_parts() {
    const auto levels = static_cast<std::size_t>(options_.levels);
    std::vector<GltfWriter> writers;
    std::vector<std::vector<Mesh>> parts(levels);  // of other formats
    for (std::size_t i = 0; i < levels; ++i) writers.emplace_back(gltf_options());
    for (const auto& [cell, bricks] : cells_) {
      Part part = part_of(cell);
      step("simplifying");
      for (std::size_t level = 0; level < levels; ++level) {
        // Cells of one file stay cells at every level.
        simplify_part(part, level == 0 ? options_.simplify : SimplifyOptions{.ratio = kLevelRatio}, 0,
                      static_cast<int>(level));
        Mesh mesh = textured(part, static_cast<int>(level));
        GltfWriter::Added added{mesh.triangles.size(), mesh.positions.size()};
        if (is_gltf(file_)) {
          const std::string name = cells_.size() == 1 ? "map" : fmt::format("cell {} {} {}", cell[0], cell[1], cell[2]);
          timed("write", [&] { added = writers[level].add(name, mesh); });
        } else {
          parts[level].push_back(std::move(mesh));
        }
        if (level == 0) count(added);
      }
      step("meshing");
    }
    refuse_empty(exported_.triangles);
    timed("write", [&] {
      for (std::size_t level = levels; level-- > 0;) {
        fs::path file = file_;
        if (level > 0) file.replace_extension(fmt::format("lod{}{}", level, file_.extension().string()));
        if (is_gltf(file)) {
          if (options_.cameras)
            for (std::size_t i = 0; i < input_.paths.size(); ++i)
              writers[level].add_cameras(input_.camera, input_.paths[i],
                                         i == 0 ? cameras() : std::vector<Eigen::Isometry3d>{});
          writers[level].write(file);
        } else if (file.extension() == ".obj") {
          write_obj(file, parts[level], {.png = options_.texture.png, .jpeg_quality = options_.texture.jpeg_quality});
        } else {
          write_ply(file, joined(parts[level]));
        }
      }
    });
  }

  [[nodiscard]] std::vector<Eigen::Isometry3d> cameras() const {
    std::vector<Eigen::Isometry3d> cameras;
    for (const TextureKeyframe& k : input_.keyframes) cameras.push_back(k.world_from_camera);
    return cameras;
  }

  void refuse_empty(std::size_t count) const {
    if (count == 0)
      throw std::runtime_error(file_.string() +
                               ": is not written, nothing of the surface is left: it is empty, or --min-piece or "
                               "--min-weight removed all of it");
  }

  void write_tiles() {
    int top = 0;
    for (const auto& [cell, bricks] : cells_)
      while (cell_at(brick(cell), top) != Brick::Zero()) ++top;
    const auto root = make_tile({0, 0, 0}, top);
    refuse_empty(root.has_value());
    timed("write", [&] { write_tileset(file_, root->first); });
  }

  /// Tiles from the leaves up; each is in memory until its parent is made.
  std::optional<std::pair<Tile, Part>> make_tile(const Key& cell, int level) {
    Tile tile;
    Part part;
    if (level == 0) {
      if (!cells_.contains(cell)) return std::nullopt;
      part = part_of(cell);
      step("simplifying");
      simplify_part(part, options_.simplify, 0, 0);
      step("meshing");
    } else {
      std::vector<Part> children;
      for (int c = 0; c < 8; ++c)
        if (auto child = make_tile(key(2 * brick(cell) + Brick(c & 1, c >> 1 & 1, c >> 2)), level - 1)) {
          tile.children.push_back(std::move(child->first));
          children.push_back(std::move(child->second));
        }
      if (children.empty()) return std::nullopt;
      part = together(children);
      simplify_part(part, {.ratio = kLevelRatio}, level, level);
      for (const Tile& child : tile.children) tile.box.extend(child.box);
    }
    if (part.mesh.triangles.empty()) return std::nullopt;
    for (const auto& p : part.mesh.positions) tile.box.extend(p);
    tile.error = part.error;
    tile.content = fmt::format("{}_{}_{}_{}.glb", level, cell[0], cell[1], cell[2]);
    const Mesh mesh = textured(part, level);
    ++exported_.tiles;
    timed("write", [&] {
      GltfWriter writer(gltf_options());
      const auto added = writer.add(tile.content.substr(0, tile.content.find('.')), mesh);
      if (level == 0) count(added);
      writer.write(file_.parent_path() / tile.content);
    });
    return std::pair{std::move(tile), std::move(part)};
  }

  /// Parts that share vertices at their borders become one.
  static Part together(std::vector<Part>& parts) {
    std::vector<Mesh> meshes;
    Part all;
    for (Part& part : parts) {
      meshes.push_back(std::move(part.mesh));
      all.free_from.insert(all.free_from.end(), part.free_from.begin(), part.free_from.end());
      all.error = std::max(all.error, part.error);
    }
    all.mesh = joined(meshes);
    const std::vector<std::uint32_t> name = weld(all.mesh);
    for (std::size_t v = 0; v < name.size(); ++v)
      all.free_from[name[v]] = std::max(all.free_from[name[v]], all.free_from[v]);
    for (auto& t : all.mesh.triangles)
      for (std::uint32_t& v : t) v = name[v];
    take(all.free_from, drop_unused_vertices(all.mesh));
    return all;
  }

  const ExportInput& input_;
  fs::path file_;
  const ExportOptions& options_;
  const ExportProgress& progress_;
  int cell_bricks_ = 0, margin_ = 0;  // 0: all is one cell
  Brick origin_ = Brick::Zero();      // cells are counted from here, so that there is one around all of them
  std::map<Key, std::vector<Brick>> cells_;
  std::optional<TextureViews> views_;
  Exported exported_;
  std::size_t seen_ = 0;  // texels
  int done_ = 0, count_ = 0;
};

}  // namespace

void check(const ExportOptions& o, const fs::path& file) {
  const auto extension = file.extension();
  if (extension != ".glb" && extension != ".gltf" && extension != ".ply" && extension != ".obj" && extension != ".json")
    throw std::runtime_error(
        fmt::format("{}: '{}' is no format that is written; use .glb, .gltf, .ply, .obj, or "
                    "tileset.json for 3D Tiles",
                    file.string(), extension.string()));
  const auto range = [](const char* name, double value, double low, double high) {
    if (!(value >= low && value <= high))
      throw std::runtime_error(fmt::format("--{} is {}: it must be between {} and {}", name, value, low, high));
  };
  range("simplify", static_cast<double>(o.simplify.ratio), 0.0001, 1);
  range("max-error", static_cast<double>(o.simplify.max_error), 0, 1);
  range("min-piece", static_cast<double>(o.clean.min_piece), 0, 10);
  range("min-weight", static_cast<double>(o.clean.min_weight), 0, 255);
  range("fill-holes", static_cast<double>(o.clean.fill_holes), 0, 2);
  range("texel", static_cast<double>(o.texture.texel), 0, 1);
  range("texture-size", o.texture.max_size, 64, 16384);
  range("jpeg-quality", o.texture.jpeg_quality, 1, 100);
  range("cell-size", static_cast<double>(o.cell_size), 0, 1000);
  range("points", static_cast<double>(o.point_spacing), 0, 10);
  range("lods", o.levels, 1, 8);
  const auto refuse = [&](const char* what, const char* why) {
    throw std::runtime_error(fmt::format("{}: {} {}", file.string(), what, why));
  };
  if (o.texture.enabled && extension == ".ply")
    refuse("--texture", "needs .glb, .gltf, .obj or tileset.json: PLY has none");
  if (o.point_spacing > 0 && extension != ".ply") refuse("--points", "needs .ply");
  if (o.compression != Compression::none && extension != ".glb" && extension != ".gltf" && extension != ".json")
    refuse("--compress", "needs .glb, .gltf or tileset.json");
  if (o.cameras && !is_gltf(file)) refuse("--cameras", "needs .glb or .gltf");
  if (o.levels > 1 && (is_tileset(file) || o.point_spacing > 0))
    refuse("--lods", "needs a single mesh file: tiles have levels anyway");
}

Exported export_surface(const ExportInput& input, const fs::path& file, const ExportOptions& options,
                        const ExportProgress& progress) {
  check(options, file);
  return Exporter(input, file, options, progress).run();
}

Exported export_map(const fs::path& map, const fs::path& file, const ExportOptions& options,
                    const ExportProgress& progress, int device) {
  check(options, file);
  ReadGrids read = read_grids(map);
  gpu::Device on(device);
  FuseOptions fuse;
  fuse.voxel_size = read.info.voxel_size;
  fuse.truncation = read.info.truncation;
  Volume volume(on, fuse, SurfaceOptions{}.max_depth);
  volume.adopt(std::move(read.tree));
  Polygonizer polygonizer(on);
  return export_surface({.bricks = volume.bricks(), .volume = volume, .polygonizer = polygonizer}, file, options,
                        progress);
}

}  // namespace cairn
