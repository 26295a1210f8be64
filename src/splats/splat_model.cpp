// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/splat_model.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "shaders/splats.h"

namespace cairn {
namespace {

/// Planes of a model in host memory.
class Planes {
 public:
  Planes(std::size_t count, std::size_t planes) : count_(count), values_(std::max<std::size_t>(1, count * planes)) {}
  template <class Vector>
  void put(std::size_t first, std::size_t i, const Vector& value) {
    for (int k = 0; k < value.size(); ++k) values_[(first + static_cast<std::size_t>(k)) * count_ + i] = value[k];
  }
  template <class Vector>
  [[nodiscard]] Vector get(std::size_t first, std::size_t i) const {
    Vector value;
    for (int k = 0; k < value.size(); ++k) value[k] = values_[(first + static_cast<std::size_t>(k)) * count_ + i];
    return value;
  }
  [[nodiscard]] std::vector<float>& values() { return values_; }

 private:
  std::size_t count_;
  std::vector<float> values_;
};

using Scalar = Eigen::Matrix<float, 1, 1>;

}  // namespace

std::size_t max_splats(const gpu::Device& device, int degree) {
  const std::size_t planes = std::max<std::size_t>(shader::kSplatPlanes, 3 * harmonics_per_splat(degree));
  return std::min(device.max_binding() / sizeof(float), device.max_texels()) / planes;
}

SplatModel upload(gpu::Device& device, const Splats& splats) {
  const std::size_t count = splats.size(), harmonics = harmonics_per_splat(splats.degree);
  if (count > max_splats(device, splats.degree))
    throw std::runtime_error(std::to_string(count) + " splats exceed the device's limit of " +
                             std::to_string(max_splats(device, splats.degree)) + " of degree " +
                             std::to_string(splats.degree));
  Planes core(count, shader::kSplatPlanes), bands(count, 3 * harmonics);
  for (std::size_t i = 0; i < count; ++i) {
    core.put(shader::kSplatPosition, i, splats.positions[i]);
    core.put(shader::kSplatScale, i, splats.log_scales[i]);
    core.put(shader::kSplatRotation, i, splats.rotations[i]);
    core.put(shader::kSplatOpacity, i, Scalar(splats.opacities[i]));
    core.put(shader::kSplatColor, i, splats.colors[i]);
    for (std::size_t k = 0; k < harmonics; ++k) bands.put(3 * k, i, splats.harmonics[i * harmonics + k]);
  }
  SplatModel model{.count = static_cast<std::uint32_t>(count),
                   .degree = static_cast<std::uint32_t>(splats.degree),
                   .core = gpu::Buffer(device, sizeof(float) * core.values().size()),
                   .harmonics = gpu::Buffer(device, sizeof(float) * bands.values().size())};
  gpu::Batch batch(device);
  batch.upload(model.core, core.values());
  batch.upload(model.harmonics, bands.values());
  batch.run();
  return model;
}

Splats download(gpu::Device& device, const SplatModel& model) {
  const std::size_t count = model.count;
  Splats splats;
  splats.degree = static_cast<int>(model.degree);
  const std::size_t harmonics = harmonics_per_splat(splats.degree);
  Planes core(count, shader::kSplatPlanes), bands(count, 3 * harmonics);
  gpu::Batch batch(device);
  batch.download(model.core, core.values());
  batch.download(model.harmonics, bands.values());
  batch.run();
  for (std::size_t i = 0; i < count; ++i) {
    splats.positions.push_back(core.get<Eigen::Vector3f>(shader::kSplatPosition, i));
    splats.log_scales.push_back(core.get<Eigen::Vector3f>(shader::kSplatScale, i));
    splats.rotations.push_back(core.get<Eigen::Vector4f>(shader::kSplatRotation, i));
    splats.opacities.push_back(core.get<Scalar>(shader::kSplatOpacity, i)[0]);
    splats.colors.push_back(core.get<Eigen::Vector3f>(shader::kSplatColor, i));
    for (std::size_t k = 0; k < harmonics; ++k) splats.harmonics.push_back(bands.get<Eigen::Vector3f>(3 * k, i));
  }
  return splats;
}

}  // namespace cairn
