// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <functional>
#include <initializer_list>
#include <optional>
#include <span>
#include <vector>

#include "gpu/kernel.hpp"
#include "volume/volume.hpp"

namespace cairn {

/// A kernel with access to voxels, see shaders/pool.h; its last binding is the pool. Created on first use, separately
/// for texels and addresses.
template <class Push>
class VoxelKernel {
 public:
  /// `sensor_constants`: its first specialization constants, at most four. `workgroup`: see gpu::Kernel.
  template <std::size_t N>
  VoxelKernel(gpu::Device& device, const char* name, const std::uint32_t (&spirv)[N],
              std::array<float, 4> sensor_constants = {}, std::uint32_t workgroup = 0)
      : make_([=, &device, &spirv](bool in_texels) {
          const auto& c = sensor_constants;
          return gpu::Kernel<Push>(device, name, spirv, std::array{c[0], c[1], c[2], c[3], in_texels ? 1.0f : 0.0f},
                                   workgroup);
        }) {}

  void operator()(gpu::Batch& batch, std::array<std::uint32_t, 3> threads, const Push& push, const Volume& volume,
                  std::initializer_list<const gpu::Buffer*> buffers) const {
    kernel_for(volume)(batch, threads, push, with_pool(volume, buffers));
  }
  /// See gpu::Kernel::indirect.
  void indirect(gpu::Batch& batch, const gpu::Buffer& groups, std::uint64_t offset, const Push& push,
                const Volume& volume, std::initializer_list<const gpu::Buffer*> buffers) const {
    kernel_for(volume).indirect(batch, groups, offset, push, with_pool(volume, buffers));
  }

 private:
  [[nodiscard]] const gpu::Kernel<Push>& kernel_for(const Volume& volume) const {
    auto& kernel = volume.is_read_as_texels() ? as_texels_ : by_address_;
    if (!kernel) kernel.emplace(make_(volume.is_read_as_texels()));
    return *kernel;
  }
  [[nodiscard]] static std::vector<const gpu::Buffer*> with_pool(const Volume& volume,
                                                                 std::initializer_list<const gpu::Buffer*> buffers) {
    std::vector<const gpu::Buffer*> all(buffers);
    all.push_back(volume.is_read_as_texels() ? &volume.voxels() : &volume.slots());  // any buffer if not read
    return all;
  }

  std::function<gpu::Kernel<Push>(bool in_texels)> make_;
  mutable std::optional<gpu::Kernel<Push>> as_texels_, by_address_;
};

}  // namespace cairn
