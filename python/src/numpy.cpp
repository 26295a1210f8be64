// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "numpy.hpp"

#include <algorithm>
#include <optional>

namespace cairn::python {
namespace {

constexpr double kRotationTolerance = 1e-4;

/// Converts to an array, without a copy of an existing array.
py::array array_of(const py::handle& value, const char* name) {
  const py::array array = py::array::ensure(value);
  if (!array) {
    PyErr_Clear();
    throw py::type_error(std::string(name) + " is " + description_of(value) + "; an array of numbers is expected");
  }
  if (const char kind = array.dtype().kind(); kind != 'f' && kind != 'i' && kind != 'u')
    throw py::type_error(std::string(name) + " is " + description_of(array) + "; numbers are expected");
  return array;
}

Doubles numbers_of(const py::handle& value, const char* name, const std::vector<py::ssize_t>& shape,
                   const char* meaning) {
  const py::array array = array_of(value, name);
  if (!std::equal(shape.begin(), shape.end(), array.shape(), array.shape() + array.ndim()))
    throw py::value_error(std::string(name) + " is " + description_of(array) + "; " + meaning + " is expected");
  return py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(array);
}

}  // namespace

std::string description_of(const py::handle& value) {
  if (!py::isinstance<py::array>(value)) return "a " + std::string(py::str(py::type::of(value).attr("__name__")));
  const auto array = py::reinterpret_borrow<py::array>(value);
  return std::string(py::str(array.dtype())) + " of shape " + std::string(py::str(array.attr("shape")));
}

Doubles to_numpy(const Eigen::Isometry3d& pose) {
  Doubles array({4, 4});
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.mutable_data()) = pose.matrix();
  return array;
}

Doubles to_numpy(const std::vector<Eigen::Isometry3d>& poses) {
  Doubles array({static_cast<py::ssize_t>(poses.size()), py::ssize_t{4}, py::ssize_t{4}});
  double* to = array.mutable_data();
  for (const Eigen::Isometry3d& pose : poses) {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = pose.matrix();
    to = std::copy_n(matrix.data(), 16, to);
  }
  return array;
}

Doubles to_numpy(const Matrix6d& matrix) {
  Doubles array({6, 6});
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(array.mutable_data()) = matrix;
  return array;
}

Doubles to_numpy(const Eigen::Vector3d& vector) { return Doubles(3, vector.data()); }

py::object to_numpy(const std::optional<Eigen::Isometry3d>& pose) {
  return pose ? py::object(to_numpy(*pose)) : py::none();
}

Eigen::Isometry3d pose_of(const py::handle& value, const char* name) {
  const Doubles array = numbers_of(value, name, {4, 4}, "a pose of shape (4, 4)");
  Eigen::Isometry3d pose;
  pose.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.data());
  const Eigen::Matrix3d rotation = pose.linear();
  if (!pose.matrix().allFinite() || !(rotation * rotation.transpose()).isIdentity(kRotationTolerance) ||
      rotation.determinant() < 0 || pose.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    throw py::value_error(std::string(name) +
                          " is not a rigid transform: a rotation, a translation and the row 0 0 0 1 are expected");
  pose.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
  return pose;
}

std::optional<Eigen::Isometry3d> optional_pose_of(const py::handle& value, const char* name) {
  if (value.is_none()) return std::nullopt;
  return pose_of(value, name);
}

Eigen::Vector3d vector_of(const py::handle& value, const char* name) {
  const Doubles array = numbers_of(value, name, {3}, "a vector of three numbers");
  return Eigen::Vector3d(array.data());
}

Matrix6d matrix6_of(const py::handle& value, const char* name) {
  const Doubles array = numbers_of(value, name, {6, 6}, "a matrix of shape (6, 6)");
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(array.data());
}

Floats points_of(const py::handle& value, const char* name) {
  const py::array array = array_of(value, name);
  if (array.ndim() < 1 || array.shape(array.ndim() - 1) != 3)
    throw py::value_error(std::string(name) + " is " + description_of(array) + "; (N, 3) is expected, in meters");
  return py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(array);
}

std::vector<py::ssize_t> leading_shape(const py::array& array) {
  return {array.shape(), array.shape() + array.ndim() - 1};
}

std::vector<std::array<std::uint32_t, 3>> triangles_of(const py::handle& value, std::size_t vertices) {
  const py::array array = array_of(value, "triangles");
  if (array.dtype().kind() == 'f')
    throw py::type_error("triangles is " + description_of(array) + "; integers of shape (M, 3) are expected");
  if (array.ndim() != 2 || array.shape(1) != 3)
    throw py::value_error("triangles is " + description_of(array) + "; integers of shape (M, 3) are expected");
  const auto numbers = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(array);
  std::vector<std::array<std::uint32_t, 3>> triangles(static_cast<std::size_t>(array.shape(0)));
  for (std::size_t i = 0; i < 3 * triangles.size(); ++i) {
    const std::int64_t vertex = numbers.data()[i];
    if (vertex < 0 || vertex >= static_cast<std::int64_t>(vertices))
      throw py::value_error("triangles refer to vertex " + std::to_string(vertex) + "; the mesh has " +
                            std::to_string(vertices) + " vertices");
    triangles[i / 3][i % 3] = static_cast<std::uint32_t>(vertex);
  }
  return triangles;
}

}  // namespace cairn::python
