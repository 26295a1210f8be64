// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Conversions between numpy and Eigen: poses, points, images; and views of C++ memory that keep its owner alive.
#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "cairn/mapping/pose.hpp"

namespace cairn::python {

namespace py = pybind11;
using Floats = py::array_t<float, py::array::c_style>;
using Doubles = py::array_t<double, py::array::c_style>;

/// Description of a value for messages: "uint16 of shape (480, 640)", or the type of a value other than an array.
[[nodiscard]] std::string description_of(const py::handle& value);

[[nodiscard]] Doubles to_numpy(const Eigen::Isometry3d& pose);
[[nodiscard]] Doubles to_numpy(const std::vector<Eigen::Isometry3d>& poses);  ///< (N, 4, 4)
[[nodiscard]] Doubles to_numpy(const Matrix6d& matrix);
[[nodiscard]] Doubles to_numpy(const Eigen::Vector3d& vector);
[[nodiscard]] py::object to_numpy(const std::optional<Eigen::Isometry3d>& pose);  ///< None for nullopt

/// Pose of 4x4 numbers. Throws ValueError, TypeError with `name`.
[[nodiscard]] Eigen::Isometry3d pose_of(const py::handle& value, const char* name);
[[nodiscard]] std::optional<Eigen::Isometry3d> optional_pose_of(const py::handle& value, const char* name);
[[nodiscard]] Eigen::Vector3d vector_of(const py::handle& value, const char* name);
[[nodiscard]] Matrix6d matrix6_of(const py::handle& value, const char* name);

/// Numbers of shape (..., 3) as float32; no copy if float32 already.
[[nodiscard]] Floats points_of(const py::handle& value, const char* name);
[[nodiscard]] inline std::span<const Eigen::Vector3f> vectors(const Floats& points) {
  return {reinterpret_cast<const Eigen::Vector3f*>(points.data()), static_cast<std::size_t>(points.size() / 3)};
}
/// Shape without the last dimension.
[[nodiscard]] std::vector<py::ssize_t> leading_shape(const py::array& array);

/// Integers of shape (N, 3), at least 0.
[[nodiscard]] std::vector<std::array<std::uint32_t, 3>> triangles_of(const py::handle& value, std::size_t vertices);

/// Array view of `owner`'s memory; keeps `owner` alive. Strides in C order.
template <class T>
py::array_t<T> view(const T* data, std::vector<py::ssize_t> shape, const py::handle& owner) {
  return py::array_t<T>(std::move(shape), data, owner);
}
inline void make_read_only(const py::array& array) { array.attr("flags").attr("writeable") = false; }

/// Moves a vector into an array.
template <class T, class Element>
py::array_t<T> moved(std::vector<Element>&& vector, std::vector<py::ssize_t> shape) {
  auto* owned = new std::vector<Element>(std::move(vector));
  const py::capsule owner(owned, [](void* p) { delete static_cast<std::vector<Element>*>(p); });
  return py::array_t<T>(std::move(shape), reinterpret_cast<const T*>(owned->data()), owner);
}

}  // namespace cairn::python
