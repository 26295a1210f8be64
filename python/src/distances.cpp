// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "distances.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <limits>

#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"
#include "trajectory.hpp"

namespace cairn::python {
namespace {

constexpr py::ssize_t kMaxVoxels = py::ssize_t{1} << 31;  // of a dense array

/// Box of voxels as an array.
struct Dense {
  py::array_t<float> values;
  Eigen::Affine3d world_from_voxel = Eigen::Affine3d::Identity();
  float voxel_size = 0;
};

/// Voxels of a lattice, in blocks of `side` voxels a side.
struct Lattice {
  Eigen::Affine3d world_from_voxel;
  float voxel_size;
  int side;
  std::size_t blocks;
  std::function<Eigen::Vector3i(std::size_t)> block;
  std::function<const float*(std::size_t)> samples;  // x, y, z
};

Eigen::AlignedBox3i bounds_of(const Lattice& lattice) {
  Eigen::AlignedBox3i box;
  for (std::size_t i = 0; i < lattice.blocks; ++i) {
    const Eigen::Vector3i first = lattice.side * lattice.block(i);
    box.extend(first).extend((first.array() + lattice.side - 1).matrix());
  }
  return box;
}

/// Voxel range of a box in the world.
Eigen::AlignedBox3i box_of(const Lattice& lattice, const py::object& low, const py::object& high) {
  if (low.is_none() != high.is_none())
    throw py::value_error("low and high are expected, both corners of the box, or neither");
  if (low.is_none()) return bounds_of(lattice);
  const Eigen::AlignedBox3d world(vector_of(low, "low"), vector_of(high, "high"));
  if (!world.min().allFinite() || !world.max().allFinite() || world.isEmpty())
    throw py::value_error("low must be less than high in all three axes");
  const Eigen::Affine3d voxel_from_world = lattice.world_from_voxel.inverse();
  Eigen::AlignedBox3d box;
  for (int corner = 0; corner < 8; ++corner)
    box.extend(voxel_from_world * world.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
  constexpr double kMaxCoordinate = 1e9;  // within the range of int
  if (box.min().cwiseAbs().maxCoeff() > kMaxCoordinate || box.max().cwiseAbs().maxCoeff() > kMaxCoordinate)
    throw py::value_error("the box is too far from the map");
  return {box.min().array().floor().cast<int>().matrix(), box.max().array().ceil().cast<int>().matrix()};
}

Dense dense(const Lattice& lattice, const py::object& low, const py::object& high, float unknown) {
  const Eigen::AlignedBox3i box = box_of(lattice, low, high);
  const Eigen::Vector3i size =
      box.isEmpty() ? Eigen::Vector3i::Zero() : Eigen::Vector3i(box.sizes() + Eigen::Vector3i::Ones());
  if (static_cast<double>(size.x()) * size.y() * size.z() > static_cast<double>(kMaxVoxels))
    throw py::value_error("the box has more than 2^31 voxels: choose a smaller box by low and high");
  Dense grid{py::array_t<float>({size.x(), size.y(), size.z()}), lattice.world_from_voxel, lattice.voxel_size};
  if (box.isEmpty()) return grid;
  grid.world_from_voxel.translate(box.min().cast<double>());
  float* values = grid.values.mutable_data();
  const py::gil_scoped_release release;
  std::fill_n(
      values,
      static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(size.z()),
      unknown);
  const int side = lattice.side;
  for (std::size_t i = 0; i < lattice.blocks; ++i) {
    const Eigen::Vector3i first = side * lattice.block(i);
    const Eigen::Vector3i
        begin = first.cwiseMax(box.min()),
        end = (first.array() + side).matrix().cwiseMin(Eigen::Vector3i(box.max() + Eigen::Vector3i::Ones()));
    if ((begin.array() >= end.array()).any()) continue;
    const float* samples = lattice.samples(i);
    for (int x = begin.x(); x < end.x(); ++x)
      for (int y = begin.y(); y < end.y(); ++y) {
        const float* row = samples + ((x - first.x()) * side + (y - first.y())) * side - first.z();
        const Eigen::Vector3i at = Eigen::Vector3i(x, y, 0) - box.min();
        float* to = values + (static_cast<std::ptrdiff_t>(at.x()) * size.y() + at.y()) * size.z() + at.z();
        std::copy(row + begin.z(), row + end.z(), to + begin.z());
      }
  }
  return grid;
}

Eigen::Affine3d scaled(const Eigen::Quaternionf& rotation, const Eigen::Vector3f& origin, float voxel_size) {
  return Eigen::Affine3d(rotation.cast<double>()) * Eigen::Translation3d(origin.cast<double>()) *
         Eigen::Scaling(static_cast<double>(voxel_size));
}

Lattice lattice_of(const DistanceField& field) {
  return {scaled(field.world_from_field(), field.origin(), field.voxel_size()),
          field.voxel_size(),
          16,
          field.blocks().size(),
          [&field](std::size_t i) { return field.blocks()[i].index; },
          [&field](std::size_t i) { return field.blocks()[i].samples->data(); }};
}

Lattice lattice_of(const Voxels& voxels) {
  return {scaled(voxels.world_from_voxels, Eigen::Vector3f::Zero(), voxels.voxel_size),
          voxels.voxel_size,
          8,
          voxels.blocks.size(),
          [&voxels](std::size_t i) { return voxels.blocks[i]; },
          [&voxels](std::size_t i) { return voxels.distances.data() + 512 * i; }};
}

Doubles matrix(const Eigen::Affine3d& affine) {
  Doubles array({4, 4});
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.mutable_data()) = affine.matrix();
  return array;
}

/// Block indices and samples, in an array each.
py::tuple blocks_of(const DistanceField& field) {
  const auto& blocks = field.blocks();
  const auto n = static_cast<py::ssize_t>(blocks.size());
  py::array_t<std::int32_t> places({n, py::ssize_t{3}});
  py::array_t<float> samples({n, py::ssize_t{16}, py::ssize_t{16}, py::ssize_t{16}});
  std::int32_t* place = places.mutable_data();
  float* sample = samples.mutable_data();
  {
    const py::gil_scoped_release release;
    for (const auto& [block, values] : blocks) {
      place = std::copy_n(block.data(), 3, place);
      sample = std::copy_n(values->data(), values->size(), sample);
    }
  }
  return py::make_tuple(places, samples);
}

void add_field(py::module_& m) {
  py::class_<Dense>(m, "DenseGrid", "Box of voxels as one array.")
      .def_readonly("values", &Dense::values, "(X, Y, Z) float32, meters; NaN: unobserved.")
      .def_property_readonly(
          "world_from_voxel", [](const Dense& d) { return matrix(d.world_from_voxel); },
          "(4, 4) float64: from an index (i, j, k, 1) to the voxel's position, meters.")
      .def_readonly("voxel_size", &Dense::voxel_size, "Meters.")
      .def("__repr__",
           [](const Dense& d) { return "DenseGrid of " + std::string(py::str(d.values.attr("shape"))) + " voxels"; });

  py::class_<Field>(
      m, "DistanceField",
      R"(Signed distances to the nearest surface, meters: positive in front, negative behind. Immutable, so thread-safe.)")
      .def(
          "query", [](const Field& f, const py::object& points) { return query(*f.field, points); }, py::arg("points"),
          R"(query(self, points)
--

Distances at points: (distances, gradients, known). Uses all cores.

points: (..., 3), meters; (N, 3) float32 is read without a copy. distances: (...) float32, meters, limited to
max_distance; NaN in unobserved space. gradients: (..., 3) float32, unit length, direction of increasing distance;
zero beyond max_distance and in unobserved space. known: (...) bool, True in observed space.)")
      .def_property_readonly(
          "voxel_size", [](const Field& f) { return f.field->voxel_size(); }, "Meters.")
      .def_property_readonly(
          "max_distance", [](const Field& f) { return f.field->max_distance(); }, "Meters.")
      .def_property_readonly(
          "bounds",
          [](const Field& f) -> py::object {
            const auto box = [&] {
              const py::gil_scoped_release release;
              return f.field->bounds();
            }();
            if (box.isEmpty()) return py::none();
            Floats corners({2, 3});
            std::copy_n(box.min().data(), 3, corners.mutable_data());
            std::copy_n(box.max().data(), 3, corners.mutable_data() + 3);
            return corners;
          },
          "(2, 3) float32, meters: lower and upper corner of observed space; None if it is empty.")
      .def_property_readonly(
          "world_from_voxel", [](const Field& f) { return matrix(lattice_of(*f.field).world_from_voxel); },
          "(4, 4) float64: from a voxel index (i, j, k, 1) to its position, meters.")
      .def(
          "blocks", [](const Field& f) { return blocks_of(*f.field); }, R"(blocks(self)
--

All samples: (places, samples). places: (N, 3) int32, block indices; block (i, j, k) starts at voxel 16 (i, j, k).
samples: (N, 16, 16, 16) float32, meters, by x, y, z; NaN: unobserved.)")
      .def(
          "dense",
          [](const Field& f, const py::object& low, const py::object& high) {
            return dense(lattice_of(*f.field), low, high, std::numeric_limits<float>::quiet_NaN());
          },
          py::arg("low") = py::none(), py::arg("high") = py::none(), R"(dense(self, low=None, high=None)
--

Voxels of a box as one array, a DenseGrid. low, high: (3,), corners in the world, meters; default: the entire field.)")
      .def_static(
          "read",
          [](const std::filesystem::path& vdb) {
            const py::gil_scoped_release release;
            return Field{std::make_shared<const DistanceField>(DistanceField::read(vdb))};
          },
          py::arg("file"), R"(read(file)
--

Reads the grid 'esdf' of a .vdb file.)")
      .def(
          "write",
          [](const Field& f, const std::filesystem::path& vdb) {
            const py::gil_scoped_release release;
            write_distances(vdb, *f.field);
          },
          py::arg("file"), R"(write(self, file)
--

Writes the grid 'esdf' to a .vdb file, atomically. Values in meters; active in observed space.)")
      .def("__repr__", [](const Field& f) {
        return repr("DistanceField",
                    {{"voxel_size", f.field->voxel_size()}, {"max_distance", f.field->max_distance()}});
      });
}

void add_voxels(py::module_& m) {
  const auto block_view = [](const py::object& self, const auto& list, std::vector<py::ssize_t> shape) {
    using T = std::remove_cvref_t<decltype(*list)>;
    shape.insert(shape.begin(), static_cast<py::ssize_t>(self.cast<const Voxels&>().blocks.size()));
    return view<T>(list, std::move(shape), self);
  };
  py::class_<Voxels>(
      m, "Voxels",
      R"(Truncated signed distances of a map, in blocks of 8x8x8 voxels: a copy. Arrays are views of its memory.)")
      .def_readonly("voxel_size", &Voxels::voxel_size, "Meters.")
      .def_readonly("truncation", &Voxels::truncation, "Meters, on each side of the surface.")
      .def_property_readonly(
          "world_from_voxel", [](const Voxels& v) { return matrix(lattice_of(v).world_from_voxel); },
          "(4, 4) float64: from a voxel index (i, j, k, 1) to its position, meters.")
      .def_property_readonly(
          "places",
          [block_view](const py::object& self) {
            return block_view(self, reinterpret_cast<const std::int32_t*>(self.cast<const Voxels&>().blocks.data()),
                              {3});
          },
          "(N, 3) int32, block indices; block (i, j, k) starts at voxel 8 (i, j, k).")
      .def_property_readonly(
          "distances",
          [block_view](const py::object& self) {
            return block_view(self, self.cast<const Voxels&>().distances.data(), {8, 8, 8});
          },
          "(N, 8, 8, 8) float32, meters, by x, y, z; 0 at weight 0.")
      .def_property_readonly(
          "weights",
          [block_view](const py::object& self) {
            return block_view(self, self.cast<const Voxels&>().weights.data(), {8, 8, 8});
          },
          "(N, 8, 8, 8) float32, observations at 1 m; 0: unobserved.")
      .def_property_readonly(
          "colors",
          [block_view](const py::object& self) {
            return block_view(self, reinterpret_cast<const std::uint8_t*>(self.cast<const Voxels&>().colors.data()),
                              {8, 8, 8, 4});
          },
          "(N, 8, 8, 8, 4) uint8: R, G, B (sRGB), and the weight of the color; 0: no color.")
      .def(
          "dense",
          [](const Voxels& voxels, const py::object& low, const py::object& high) {
            constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
            Voxels known = voxels;
            for (std::size_t i = 0; i < known.distances.size(); ++i)
              if (!(known.weights[i] > 0)) known.distances[i] = kUnknown;
            return dense(lattice_of(known), low, high, kUnknown);
          },
          py::arg("low") = py::none(), py::arg("high") = py::none(), R"(dense(self, low=None, high=None)
--

Distances of a box as one array, a DenseGrid; NaN: unobserved. low, high: (3,), corners in the world, meters; default:
the entire map.)")
      .def("__repr__", [](const Voxels& v) {
        return "Voxels of " + std::to_string(v.voxel_size) + " m in " + std::to_string(v.blocks.size()) + " blocks";
      });
}

}  // namespace

py::tuple query(const DistanceField& field, const py::object& points) {
  const Floats at = points_of(points, "points");
  std::vector<py::ssize_t> shape = leading_shape(at);
  const auto count = static_cast<std::size_t>(at.size() / 3);
  py::array_t<float> distances(shape);
  py::array_t<bool> known(shape);
  shape.push_back(3);
  py::array_t<float> gradients(shape);
  const std::span<float> distances_to(distances.mutable_data(), count);
  const std::span<Eigen::Vector3f> gradients_to(reinterpret_cast<Eigen::Vector3f*>(gradients.mutable_data()), count);
  const std::span<bool> known_to(known.mutable_data(), count);
  {
    const py::gil_scoped_release release;
    field.query(vectors(at), distances_to, gradients_to, known_to);
  }
  return py::make_tuple(distances, gradients, known);
}

py::object distances(Guard& guard, const py::object& points, const std::optional<EsdfOptions>& options,
                     const py::object& visited,
                     const std::function<std::shared_ptr<const DistanceField>(const std::optional<EsdfOptions>&,
                                                                              const Trajectory&)>& make) {
  const Trajectory poses = visited.is_none() ? Trajectory{} : visited.cast<const StampedPoses&>().poses;
  const bool is_default = !options && poses.empty();
  const auto result = guard.run([&] {
    if (is_default && guard.distances && guard.distances_version == guard.version) return guard.distances;
    auto field = make(options, poses);
    if (is_default) guard.distances = field, guard.distances_version = guard.version;
    return field;
  });
  check_signals();
  if (points.is_none()) return py::cast(Field{result});
  return query(*result, points);
}

void add_distances(py::module_& m) {
  add_field(m);
  add_voxels(m);
}

}  // namespace cairn::python
