// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/optimizer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "spirv/splat_adam.comp.h"

namespace cairn {
namespace {

constexpr double kBeta1 = 0.9, kBeta2 = 0.999;  // of shaders/splat_adam.comp

gpu::Buffer zeros(gpu::Device& device, std::uint64_t bytes) {
  gpu::Buffer buffer(device, bytes);
  gpu::Batch batch(device);
  batch.fill(buffer, 0);
  batch.run();
  return buffer;
}

}  // namespace

SplatOptimizer::SplatOptimizer(gpu::Device& device, SplatModel model)
    : device_(device), adam_(device, "splat_adam", splat_adam_comp), model_(std::move(model)) {
  core_ = {.mean = zeros(device, model_.core.size()), .square = zeros(device, model_.core.size())};
  harmonics_ = {.mean = zeros(device, model_.harmonics.size()), .square = zeros(device, model_.harmonics.size())};
}

void SplatOptimizer::step(const SplatRasterizer& rasterizer, const SplatRates& rates) {
  ++steps_;
  gpu::Batch batch(device_);
  shader::SplatAdamPush push{.count = model_.count,
                             .visible = rasterizer.visible(),
                             .position = rates.position,
                             .scale = rates.scale,
                             .rotation = rates.rotation,
                             .opacity = rates.opacity,
                             .color = rates.color,
                             .correction1 = static_cast<float>(1 - std::pow(kBeta1, steps_)),
                             .correction2 = static_cast<float>(1 - std::pow(kBeta2, steps_))};
  adam_(batch, {push.visible, shader::kSplatPlanes, 1}, push,
        {&rasterizer.order(), &rasterizer.gradients(), &model_.core, &core_.mean, &core_.square});
  push.position = push.scale = push.rotation = push.opacity = push.color = rates.harmonics;
  const auto planes = static_cast<std::uint32_t>(3 * harmonics_per_splat(static_cast<int>(model_.degree)));
  adam_(
      batch, {push.visible, planes, 1}, push,
      {&rasterizer.order(), &rasterizer.harmonic_gradients(), &model_.harmonics, &harmonics_.mean, &harmonics_.square});
  batch.submit();
}

void SplatOptimizer::gather(gpu::Buffer& planes, std::size_t plane_count, const std::vector<std::uint32_t>& source,
                            std::uint32_t old_count) {
  std::vector<float> old_values(plane_count * old_count), values(std::max<std::size_t>(1, plane_count * source.size()));
  gpu::Batch batch(device_);
  batch.download(planes, old_values);
  batch.run();
  for (std::size_t plane = 0; plane < plane_count; ++plane)
    for (std::size_t i = 0; i < source.size(); ++i)
      values[plane * source.size() + i] = old_values[plane * old_count + source[i]];
  planes = gpu::Buffer(device_, sizeof(float) * values.size());
  batch.upload(planes, values);
  batch.run();
}

void SplatOptimizer::replace(const Splats& splats, const std::vector<std::uint32_t>& source) {
  const std::uint32_t old_count = model_.count;
  model_ = upload(device_, splats);
  for (gpu::Buffer* moment : {&core_.mean, &core_.square}) gather(*moment, shader::kSplatPlanes, source, old_count);
  for (gpu::Buffer* moment : {&harmonics_.mean, &harmonics_.square})
    gather(*moment, 3 * harmonics_per_splat(splats.degree), source, old_count);
}

}  // namespace cairn
