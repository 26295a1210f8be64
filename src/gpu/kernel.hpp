// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <type_traits>

#include "gpu/batch.hpp"

namespace cairn::gpu {

/// Common part of all kernels: a compute pipeline with buffer bindings numbered from 0.
class KernelBase {
 public:
  KernelBase(Device& device, std::string name, std::span<const std::uint32_t> spirv, std::size_t push_bytes,
             std::span<const float> constants, std::uint32_t workgroup);
  ~KernelBase();
  KernelBase(KernelBase&&) noexcept;

 protected:
  void dispatch(Batch& batch, std::array<std::uint32_t, 3> threads, const void* push,
                std::span<const Buffer* const> buffers) const;
  void dispatch_indirect(Batch& batch, const Buffer& groups, std::uint64_t offset, const void* push,
                         std::span<const Buffer* const> buffers) const;

 private:
  template <class Record>
  void record(Batch& batch, const void* push, std::span<const Buffer* const> buffers,
              const Record& record_dispatch) const;
  struct State;
  std::unique_ptr<State> state_;
};

/// Kernel of one .comp file and its push struct. `constants`: specialization constants by ID, from 0; the shader's
/// defaults for the rest. `workgroup`: number of threads, for a shader with a local_size_x_id. Binding count, workgroup
/// size and push size are read from the SPIR-V and checked.
///
///   gpu::Kernel<TsdfIntegratePush> integrate_{device, "tsdf_integrate", tsdf_integrate_comp};
///   integrate_(batch, {512 * count, 1, 1}, push, {&depth, &voxels});
template <class Push>
class Kernel : private KernelBase {
  static_assert(std::is_trivially_copyable_v<Push> && sizeof(Push) <= 128);

 public:
  template <std::size_t N>
  Kernel(Device& device, const char* name, const std::uint32_t (&spirv)[N], std::span<const float> constants = {},
         std::uint32_t workgroup = 0)
      : KernelBase(device, name, std::span(spirv, N), sizeof(Push), constants, workgroup) {}

  /// `threads` are rounded up to complete workgroups; the shader must check its bounds. Records nothing for 0 threads.
  void operator()(Batch& batch, std::array<std::uint32_t, 3> threads, const Push& push,
                  std::span<const Buffer* const> buffers) const {
    dispatch(batch, threads, &push, buffers);
  }
  void operator()(Batch& batch, std::array<std::uint32_t, 3> threads, const Push& push,
                  std::initializer_list<const Buffer*> buffers) const {
    dispatch(batch, threads, &push, {buffers.begin(), buffers.size()});
  }
  /// Dispatches the number of workgroups given by the three words at `offset` bytes of `groups`, read on execution.
  void indirect(Batch& batch, const Buffer& groups, std::uint64_t offset, const Push& push,
                std::span<const Buffer* const> buffers) const {
    dispatch_indirect(batch, groups, offset, &push, buffers);
  }
  void indirect(Batch& batch, const Buffer& groups, std::uint64_t offset, const Push& push,
                std::initializer_list<const Buffer*> buffers) const {
    dispatch_indirect(batch, groups, offset, &push, {buffers.begin(), buffers.size()});
  }
};

/// Workgroup size for a shader with a variable size: on a CPU device the number of threads that it executes at once,
/// since each further round reads all parameters again, lane by lane.
[[nodiscard]] std::uint32_t preferred_workgroup_size(const Device& device, std::uint32_t on_a_gpu);

}  // namespace cairn::gpu
