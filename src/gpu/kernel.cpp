// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "gpu/kernel.hpp"

#include <spirv_cross/spirv_cross_c.h>

#include <algorithm>
#include <bit>
#include <stdexcept>

#include "gpu/vulkan.hpp"

namespace cairn::gpu {
namespace {

constexpr std::uint32_t kWorkgroupConstant = 15;  // local_size_x_id of shaders with a variable workgroup size

/// Type of a buffer binding in a shader: storage buffer, read-only texels (shaders/fetch.h), or uniform buffer.
struct Binding {
  vk::DescriptorType type = vk::DescriptorType::eStorageBuffer;
  vk::Format texel = vk::Format::eUndefined;
};

struct Layout {
  std::vector<Binding> bindings;
  std::size_t push_bytes = 0;
  std::array<std::uint32_t, 3> workgroup{};
  bool uses_subgroups = false;
};

/// See shaders/fetch.h.
vk::Format texel_of(spvc_basetype sampled) {
  switch (sampled) {
    case SPVC_BASETYPE_FP32:
      return vk::Format::eR32Sfloat;
    case SPVC_BASETYPE_INT32:
      return vk::Format::eR32Sint;
    default:
      return vk::Format::eR32G32Uint;
  }
}

/// Interface of a shader, read from its SPIR-V.
Layout reflect(const std::string& name, std::span<const std::uint32_t> spirv) {
  spvc_context context = nullptr;
  const auto check = [&](spvc_result result) {
    if (result != SPVC_SUCCESS)
      throw std::logic_error("shader " + name + ": " + spvc_context_get_last_error_string(context));
  };
  check(spvc_context_create(&context));
  const std::unique_ptr<spvc_context_s, void (*)(spvc_context)> owner(context, spvc_context_destroy);
  spvc_parsed_ir ir = nullptr;
  spvc_compiler compiler = nullptr;
  spvc_resources resources = nullptr;
  check(spvc_context_parse_spirv(context, spirv.data(), spirv.size(), &ir));
  check(spvc_context_create_compiler(context, SPVC_BACKEND_NONE, ir, SPVC_CAPTURE_MODE_TAKE_OWNERSHIP, &compiler));
  check(spvc_compiler_create_shader_resources(compiler, &resources));

  Layout layout;
  const spvc_reflected_resource* list = nullptr;
  std::size_t count = 0;
  const auto place = [&](const spvc_reflected_resource& resource) -> Binding& {
    const std::uint32_t at = spvc_compiler_get_decoration(compiler, resource.id, SpvDecorationBinding);
    layout.bindings.resize(std::max<std::size_t>(layout.bindings.size(), at + 1));
    return layout.bindings[at];
  };
  check(spvc_resources_get_resource_list_for_type(resources, SPVC_RESOURCE_TYPE_STORAGE_BUFFER, &list, &count));
  for (std::size_t i = 0; i < count; ++i) (void)place(list[i]);
  check(spvc_resources_get_resource_list_for_type(resources, SPVC_RESOURCE_TYPE_UNIFORM_BUFFER, &list, &count));
  for (std::size_t i = 0; i < count; ++i) place(list[i]).type = vk::DescriptorType::eUniformBuffer;
  check(spvc_resources_get_resource_list_for_type(resources, SPVC_RESOURCE_TYPE_SEPARATE_IMAGE, &list, &count));
  for (std::size_t i = 0; i < count; ++i) {
    const spvc_type image = spvc_compiler_get_type_handle(compiler, list[i].type_id);
    if (spvc_type_get_image_dimension(image) != SpvDimBuffer)
      throw std::logic_error("shader " + name + " has an image that is not a buffer");
    place(list[i]) = {.type = vk::DescriptorType::eUniformTexelBuffer,
                      .texel = texel_of(spvc_type_get_basetype(
                          spvc_compiler_get_type_handle(compiler, spvc_type_get_image_sampled_type(image))))};
  }
  check(spvc_resources_get_resource_list_for_type(resources, SPVC_RESOURCE_TYPE_PUSH_CONSTANT, &list, &count));
  if (count > 0)
    check(spvc_compiler_get_declared_struct_size(
        compiler, spvc_compiler_get_type_handle(compiler, list[0].base_type_id), &layout.push_bytes));
  for (unsigned i = 0; i < 3; ++i)
    layout.workgroup[i] = spvc_compiler_get_execution_mode_argument_by_index(compiler, SpvExecutionModeLocalSize, i);
  const SpvCapability* capabilities = nullptr;
  check(spvc_compiler_get_declared_capabilities(compiler, &capabilities, &count));
  layout.uses_subgroups =
      std::find(capabilities, capabilities + count, SpvCapabilityGroupNonUniformArithmetic) != capabilities + count;
  return layout;
}

}  // namespace

struct KernelBase::State {
  explicit State(Device::State& d) : device(d) {}
  ~State() { device.wait_idle(); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  Device::State& device;
  std::string name;
  Layout layout;
  vk::raii::DescriptorSetLayout set_layout = nullptr;
  vk::raii::PipelineLayout pipeline_layout = nullptr;
  vk::raii::Pipeline pipeline = nullptr;
};

KernelBase::KernelBase(Device& device, std::string name, std::span<const std::uint32_t> spirv, std::size_t push_bytes,
                       std::span<const float> constants, std::uint32_t workgroup)
    : state_(std::make_unique<State>(device.state())) {
  State& s = *state_;
  auto& d = device.state();
  s.layout = reflect(name, spirv);
  s.name = std::move(name);
  if (s.layout.push_bytes != push_bytes)
    throw std::logic_error("shader " + s.name + " has " + std::to_string(s.layout.push_bytes) +
                           " bytes of push constants, but its C++ struct has " + std::to_string(push_bytes));

  std::vector<vk::DescriptorSetLayoutBinding> bindings;
  for (std::uint32_t i = 0; i < s.layout.bindings.size(); ++i)
    bindings.push_back({.binding = i,
                        .descriptorType = s.layout.bindings[i].type,
                        .descriptorCount = 1,
                        .stageFlags = vk::ShaderStageFlagBits::eCompute});
  s.set_layout = vk::raii::DescriptorSetLayout(
      *d.device, vk::DescriptorSetLayoutCreateInfo{.flags = vk::DescriptorSetLayoutCreateFlagBits::ePushDescriptorKHR,
                                                   .bindingCount = static_cast<std::uint32_t>(bindings.size()),
                                                   .pBindings = bindings.data()});
  const vk::PushConstantRange push{.stageFlags = vk::ShaderStageFlagBits::eCompute,
                                   .size = static_cast<std::uint32_t>(push_bytes)};
  s.pipeline_layout = vk::raii::PipelineLayout(*d.device, vk::PipelineLayoutCreateInfo{.setLayoutCount = 1,
                                                                                       .pSetLayouts = &*s.set_layout,
                                                                                       .pushConstantRangeCount = 1,
                                                                                       .pPushConstantRanges = &push});
  const vk::raii::ShaderModule module(*d.device, {.codeSize = spirv.size_bytes(), .pCode = spirv.data()});
  std::vector<vk::SpecializationMapEntry> entries;
  std::vector<std::uint32_t> words;
  const auto specialize = [&](std::uint32_t id, std::uint32_t word) {
    entries.push_back(
        {.constantID = id, .offset = static_cast<std::uint32_t>(words.size() * sizeof(word)), .size = sizeof(word)});
    words.push_back(word);
  };
  for (std::uint32_t id = 0; id < constants.size(); ++id) specialize(id, std::bit_cast<std::uint32_t>(constants[id]));
  if (workgroup > 0) {
    specialize(kWorkgroupConstant, workgroup);
    s.layout.workgroup[0] = workgroup;
  }
  const vk::SpecializationInfo specialization{.mapEntryCount = static_cast<std::uint32_t>(entries.size()),
                                              .pMapEntries = entries.data(),
                                              .dataSize = words.size() * sizeof(words[0]),
                                              .pData = words.data()};
  vk::PipelineShaderStageCreateInfo stage{.stage = vk::ShaderStageFlagBits::eCompute,
                                          .module = *module,
                                          .pName = "main",
                                          .pSpecializationInfo = &specialization};
  // Otherwise a device with several subgroup sizes could change the order of sums.
  const vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo size{.requiredSubgroupSize = d.info.subgroup_size};
  if (s.layout.uses_subgroups && d.subgroup_size_control) stage.pNext = &size;
  s.pipeline = vk::raii::Pipeline(*d.device, *d.pipelines,
                                  vk::ComputePipelineCreateInfo{.stage = stage, .layout = *s.pipeline_layout});
}
KernelBase::~KernelBase() = default;
KernelBase::KernelBase(KernelBase&&) noexcept = default;

template <class Record>
void KernelBase::record(Batch& batch, const void* push, std::span<const Buffer* const> buffers,
                        const Record& record_dispatch) const {
  const State& s = *state_;
  if (buffers.size() != s.layout.bindings.size())
    throw std::logic_error("shader " + s.name + " has " + std::to_string(s.layout.bindings.size()) + " bindings, got " +
                           std::to_string(buffers.size()) + " buffers");

  Batch::State& b = batch.state();
  std::vector<vk::DescriptorBufferInfo> infos;
  std::vector<vk::WriteDescriptorSet> writes;
  infos.reserve(buffers.size());
  for (const Buffer* buffer : buffers) {
    if (!*buffer) throw std::logic_error("shader " + s.name + ": a buffer has no memory");
    const Binding& binding = s.layout.bindings[writes.size()];
    writes.push_back({.dstBinding = static_cast<std::uint32_t>(writes.size()),
                      .descriptorCount = 1,
                      .descriptorType = binding.type});
    if (binding.type == vk::DescriptorType::eUniformTexelBuffer) {
      writes.back().pTexelBufferView = &*buffer->state().texels(binding.texel);
      continue;
    }
    if (buffer->size() > b.device.max_binding)
      throw std::runtime_error("shader " + s.name + ": a buffer of " + std::to_string(buffer->size() >> 20) +
                               " MiB exceeds the device's limit for bindings (" +
                               std::to_string(b.device.max_binding >> 20) +
                               " MiB): the map has too many bricks, choose a larger FuseOptions::voxel_size");
    infos.push_back({.buffer = *buffer->state().allocation.buffer, .offset = 0, .range = VK_WHOLE_SIZE});
    writes.back().pBufferInfo = &infos.back();
  }
  auto& commands = b.record();
  const bool timed = b.timed.size() < Batch::State::kMaxTimed;
  const auto query = static_cast<std::uint32_t>(2 * b.timed.size());
  if (timed) commands.writeTimestamp(vk::PipelineStageFlagBits::eComputeShader, *b.queries, query);
  commands.bindPipeline(vk::PipelineBindPoint::eCompute, *s.pipeline);
  commands.pushDescriptorSetKHR(vk::PipelineBindPoint::eCompute, *s.pipeline_layout, 0, writes);
  // The dispatcher's typed overload needs a T; the push struct is known here as bytes only.
  commands.getDispatcher()->vkCmdPushConstants(
      static_cast<VkCommandBuffer>(*commands), static_cast<VkPipelineLayout>(*s.pipeline_layout),
      VK_SHADER_STAGE_COMPUTE_BIT, 0, static_cast<std::uint32_t>(s.layout.push_bytes), push);
  record_dispatch(commands);
  if (timed) {
    commands.writeTimestamp(vk::PipelineStageFlagBits::eComputeShader, *b.queries, query + 1);
    b.timed.push_back(&s.name);
  }
}

void KernelBase::dispatch(Batch& batch, std::array<std::uint32_t, 3> threads, const void* push,
                          std::span<const Buffer* const> buffers) const {
  if (threads[0] == 0 || threads[1] == 0 || threads[2] == 0) return;
  const auto& max_groups = batch.state().device.max_groups;
  std::array<std::uint32_t, 3> groups{};
  for (std::size_t i = 0; i < 3; ++i)
    groups[i] = threads[i] / state_->layout.workgroup[i] + (threads[i] % state_->layout.workgroup[i] != 0 ? 1 : 0);
  if (groups[0] > max_groups[0] && groups[1] == 1) {  // see group_index in shaders/types.h
    groups[1] = (groups[0] + max_groups[0] - 1) / max_groups[0];
    groups[0] = (groups[0] + groups[1] - 1) / groups[1];
  }
  for (std::size_t i = 0; i < 3; ++i)
    if (groups[i] > max_groups[i])
      throw std::logic_error("shader " + state_->name + ": " + std::to_string(groups[i]) +
                             " workgroups along one axis, but the device allows at most " +
                             std::to_string(max_groups[i]));
  record(batch, push, buffers,
         [&](const vk::raii::CommandBuffer& commands) { commands.dispatch(groups[0], groups[1], groups[2]); });
}

void KernelBase::dispatch_indirect(Batch& batch, const Buffer& groups, std::uint64_t offset, const void* push,
                                   std::span<const Buffer* const> buffers) const {
  record(batch, push, buffers, [&](const vk::raii::CommandBuffer& commands) {
    commands.dispatchIndirect(*groups.state().allocation.buffer, offset);
  });
}

std::uint32_t preferred_workgroup_size(const Device& device, std::uint32_t on_a_gpu) {
  return device.info().type == "cpu" ? std::clamp(device.info().subgroup_size, 8u, on_a_gpu) : on_a_gpu;
}

}  // namespace cairn::gpu
