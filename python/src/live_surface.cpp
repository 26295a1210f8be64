// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/live_surface.hpp"

#include <pybind11/stl.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "mapper.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

/// SurfaceChanges with a separate owner for each block.
struct Changes {
  std::vector<std::shared_ptr<SurfaceBlock>> blocks;
  std::vector<Eigen::Isometry3d> world_from_submap;
  std::optional<double> coverage;
};

/// Live surface, serialized with the calls to its mapper.
class GuardedSurface {
 public:
  explicit GuardedSurface(std::shared_ptr<GuardedMapper> mapper)
      : mapper_(std::move(mapper)),
        surface_(mapper_->guard->run([&] { return std::make_unique<LiveSurface>(mapper_->mapper); })) {}
  ~GuardedSurface() {
    mapper_->guard->run_in_destructor([&] { surface_.reset(); });
  }
  GuardedSurface(const GuardedSurface&) = delete;
  GuardedSurface& operator=(const GuardedSurface&) = delete;
  [[nodiscard]] Changes changes(int max_bricks, bool all) {
    return mapper_->guard->run([&] {
      SurfaceChanges changes = surface_->changes(max_bricks, all);
      Changes result{{}, std::move(changes.world_from_submap), changes.coverage};
      for (SurfaceBlock& block : changes.parts)
        result.blocks.push_back(std::make_shared<SurfaceBlock>(std::move(block)));
      return result;
    });
  }

 private:
  std::shared_ptr<GuardedMapper> mapper_;
  std::unique_ptr<LiveSurface> surface_;
};

/// View (N, columns) of a list of the block's mesh.
template <class T, class List>
py::array_t<T> rows_of(const py::object& self, const List& list, py::ssize_t columns) {
  return view(reinterpret_cast<const T*>(list.data()), {static_cast<py::ssize_t>(list.size()), columns}, self);
}

std::tuple<int, int, int> cell_of(const SurfaceBlock& block) {
  return {block.cell.x(), block.cell.y(), block.cell.z()};
}

void add_changes(py::module_& m) {
  py::class_<SurfaceBlock, std::shared_ptr<SurfaceBlock>>(
      m, "SurfaceBlock",
      R"(Mesh of one cube of a submap. It replaces the cube's previous mesh, and may be empty. Arrays are views of the block's
memory and keep it alive.)")
      .def_readonly("submap", &SurfaceBlock::submap, "Index of the submap.")
      .def_property_readonly("cell", &cell_of,
                             "Index (i, j, k) of the cube in the submap. A cube has 32 voxels per side.")
      .def_property_readonly(
          "vertices",
          [](const py::object& self) {
            return rows_of<float>(self, self.cast<const SurfaceBlock&>().mesh.positions, 3);
          },
          "(N, 3) float32, meters, in the submap's frame.")
      .def_property_readonly(
          "triangles",
          [](const py::object& self) {
            return rows_of<std::uint32_t>(self, self.cast<const SurfaceBlock&>().mesh.triangles, 3);
          },
          "(M, 3) uint32, indices of vertices; counter-clockwise seen from outside.")
      .def_property_readonly(
          "normals",
          [](const py::object& self) { return rows_of<float>(self, self.cast<const SurfaceBlock&>().mesh.normals, 3); },
          "(N, 3) float32, unit length, away from the solid, in the submap's frame.")
      .def_property_readonly(
          "colors",
          [](const py::object& self) {
            return rows_of<std::uint8_t>(self, self.cast<const SurfaceBlock&>().mesh.colors, 4);
          },
          "(N, 4) uint8: R, G, B (sRGB), and the confidence of the vertex: 255 after about eight observations at 1 m.")
      .def("__repr__", [](const SurfaceBlock& b) {
        return repr("SurfaceBlock",
                    {{"submap", b.submap}, {"cell", cell_of(b)}, {"triangles", b.mesh.triangles.size()}});
      });
  py::class_<Changes>(m, "SurfaceChanges", "Result of LiveSurface.changes.")
      .def_readonly("blocks", &Changes::blocks, "A list of SurfaceBlock.")
      .def_property_readonly(
          "world_from_submap", [](const Changes& c) { return to_numpy(c.world_from_submap); },
          "(N, 4, 4) float64, meters: current pose of each submap, by index. Loop closures change the poses.")
      .def_readonly("coverage", &Changes::coverage,
                    "Mean confidence of the vertices, 0 to 1, over the cubes changed by the last frame; or None.")
      .def("__repr__", [](const Changes& c) {
        return repr("SurfaceChanges", {{"blocks", c.blocks.size()}, {"submaps", c.world_from_submap.size()}});
      });
}

}  // namespace

void add_live_surface(py::module_& m) {
  add_changes(m);
  py::class_<GuardedSurface>(m, "LiveSurface", R"(LiveSurface(mapper)
--

Incremental surface of a growing map, for a viewer. The first call of changes returns the entire surface on the
device. Several may exist at once. Keeps the mapper alive.

    surface = cairn.LiveSurface(mapper)
    meshes = {}
    for frame in source:
        mapper.add(frame)
        changes = surface.changes()
        for block in changes.blocks:
            meshes[block.submap, block.cell] = block)")
      .def(py::init<std::shared_ptr<GuardedMapper>>(), py::arg("mapper").none(false), R"(__init__(self, mapper)
--

)")
      .def("changes", &GuardedSurface::changes, py::kw_only(), py::arg("max_bricks") = 1000, py::arg("all") = false,
           R"(changes(self, *, max_bricks=1000, all=False)
--

Blocks changed since the previous call, new blocks first, and the current poses of the submaps, as SurfaceChanges.

max_bricks: maximum number of cubes of 8 voxels per side to mesh. all: includes well-observed blocks, which are
otherwise updated less often. Submaps are placed as rigid bodies; Map.mesh deforms them. If the surface extraction
fails, updates stop and Mapper.warnings gives the reason.)");
}

}  // namespace cairn::python
