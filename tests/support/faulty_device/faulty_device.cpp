// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Vulkan layer between the program and the driver with failures and missing features for tests. Invisible to the
// program. Configured by the environment when an instance or a device is made:
//   CAIRN_FAULTS  words of: allocation=N  the N-th allocation of device memory fails, counted from 1
//                           submit=N      the N-th submission fails
//                           groups=N      the device takes N workgroups along x; more ends the program
//                           max_allocation=BYTES  the largest allocation
//                           subgroup=N    reports this subgroup size, whatever the real one, and allows no choice
//                           uncached      no memory is cached by the host
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <sstream>
#include <string>
#include <unordered_map>

namespace {

struct Faults {
  long allocation = 0, submit = 0;
  std::uint32_t groups = 0, subgroup = 0;
  std::uint64_t max_allocation = 0;
  bool uncached = false;
};

Faults asked() {
  Faults faults;
  const char* words = std::getenv("CAIRN_FAULTS");
  std::istringstream in(words != nullptr ? words : "");
  for (std::string word; in >> word;) {
    const std::string name = word.substr(0, word.find('='));
    const long value = word.size() > name.size() ? std::atol(word.c_str() + name.size() + 1) : 0;
    if (name == "allocation") faults.allocation = value;
    if (name == "submit") faults.submit = value;
    if (name == "groups") faults.groups = static_cast<std::uint32_t>(value);
    if (name == "subgroup") faults.subgroup = static_cast<std::uint32_t>(value);
    if (name == "max_allocation") faults.max_allocation = static_cast<std::uint64_t>(value);
    if (name == "uncached") faults.uncached = true;
  }
  return faults;
}

// All handles of one instance or device start with the loader's dispatch table, which identifies the owner.
void* key(void* handle) { return *static_cast<void**>(handle); }

struct Below {
  PFN_vkGetInstanceProcAddr instance = nullptr;
  PFN_vkGetDeviceProcAddr device = nullptr;
  VkInstance made = nullptr;
  // Queried while the instance is made: later the loader would return this layer's own functions.
  std::unordered_map<std::string, PFN_vkVoidFunction> functions;
};
std::mutex mutex;
std::unordered_map<void*, Below> below;
std::atomic<long> allocations, submissions;
Faults faults;

template <class F>
F next(void* handle, const char* name) {
  const std::lock_guard lock(mutex);
  return reinterpret_cast<F>(below.at(key(handle)).functions.at(name));
}

template <class CreateInfo>
CreateInfo* link_of(const void* chain, VkStructureType type) {
  for (auto* info = static_cast<const CreateInfo*>(chain); info != nullptr;
       info = static_cast<const CreateInfo*>(info->pNext))
    if (info->sType == type && info->function == VK_LAYER_LINK_INFO) return const_cast<CreateInfo*>(info);
  return nullptr;
}

template <class Struct>
Struct* in_chain(void* chain, VkStructureType type) {
  for (auto* s = static_cast<VkBaseOutStructure*>(chain); s != nullptr; s = s->pNext)
    if (s->sType == type) return reinterpret_cast<Struct*>(s);
  return nullptr;
}

VKAPI_ATTR VkResult VKAPI_CALL create_instance(const VkInstanceCreateInfo* info, const VkAllocationCallbacks* allocator,
                                               VkInstance* instance) {
  auto* link = link_of<VkLayerInstanceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
  if (link == nullptr) return VK_ERROR_INITIALIZATION_FAILED;
  const PFN_vkGetInstanceProcAddr get = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
  link->u.pLayerInfo = link->u.pLayerInfo->pNext;
  const auto create = reinterpret_cast<PFN_vkCreateInstance>(get(nullptr, "vkCreateInstance"));
  const VkResult result = create(info, allocator, instance);
  if (result != VK_SUCCESS) return result;
  const std::lock_guard lock(mutex);
  Below& b = below[key(*instance)] = {.instance = get, .made = *instance, .functions = {}};
  for (const char* name : {"vkGetPhysicalDeviceProperties", "vkGetPhysicalDeviceProperties2",
                           "vkGetPhysicalDeviceFeatures2", "vkGetPhysicalDeviceMemoryProperties", "vkCreateDevice"})
    b.functions[name] = get(*instance, name);
  faults = asked();
  return result;
}

VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                                             const VkAllocationCallbacks* allocator, VkDevice* device) {
  auto* link = link_of<VkLayerDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
  if (link == nullptr) return VK_ERROR_INITIALIZATION_FAILED;
  const PFN_vkGetDeviceProcAddr get = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
  link->u.pLayerInfo = link->u.pLayerInfo->pNext;
  const VkResult result = next<PFN_vkCreateDevice>(physical, "vkCreateDevice")(physical, info, allocator, device);
  if (result != VK_SUCCESS) return result;
  const std::lock_guard lock(mutex);
  Below& b = below[key(*device)] = {.device = get, .functions = {}};
  for (const char* name : {"vkAllocateMemory", "vkQueueSubmit", "vkCmdDispatch"})
    b.functions[name] = get(*device, name);
  faults = asked();
  allocations = submissions = 0;
  return result;
}

void lower(VkPhysicalDeviceProperties& properties) {
  if (faults.groups != 0) properties.limits.maxComputeWorkGroupCount[0] = faults.groups;
}

VKAPI_ATTR void VKAPI_CALL properties(VkPhysicalDevice physical, VkPhysicalDeviceProperties* output) {
  next<PFN_vkGetPhysicalDeviceProperties>(physical, "vkGetPhysicalDeviceProperties")(physical, output);
  lower(*output);
}

VKAPI_ATTR void VKAPI_CALL properties2(VkPhysicalDevice physical, VkPhysicalDeviceProperties2* output) {
  next<PFN_vkGetPhysicalDeviceProperties2>(physical, "vkGetPhysicalDeviceProperties2")(physical, output);
  lower(output->properties);
  if (auto* m = in_chain<VkPhysicalDeviceMaintenance3Properties>(
          output->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_3_PROPERTIES);
      m != nullptr && faults.max_allocation != 0)
    m->maxMemoryAllocationSize = faults.max_allocation;
  if (auto* s = in_chain<VkPhysicalDeviceSubgroupProperties>(output->pNext,
                                                             VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES);
      s != nullptr && faults.subgroup != 0)
    s->subgroupSize = faults.subgroup;
}

VKAPI_ATTR void VKAPI_CALL features2(VkPhysicalDevice physical, VkPhysicalDeviceFeatures2* output) {
  next<PFN_vkGetPhysicalDeviceFeatures2>(physical, "vkGetPhysicalDeviceFeatures2")(physical, output);
  if (auto* s = in_chain<VkPhysicalDeviceSubgroupSizeControlFeatures>(
          output->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES);
      s != nullptr && faults.subgroup != 0)
    s->subgroupSizeControl = VK_FALSE;
}

VKAPI_ATTR void VKAPI_CALL memory_properties(VkPhysicalDevice physical, VkPhysicalDeviceMemoryProperties* output) {
  next<PFN_vkGetPhysicalDeviceMemoryProperties>(physical, "vkGetPhysicalDeviceMemoryProperties")(physical, output);
  for (std::uint32_t i = 0; faults.uncached && i < output->memoryTypeCount; ++i)
    output->memoryTypes[i].propertyFlags &= ~static_cast<VkMemoryPropertyFlags>(VK_MEMORY_PROPERTY_HOST_CACHED_BIT);
}

VKAPI_ATTR VkResult VKAPI_CALL allocate_memory(VkDevice device, const VkMemoryAllocateInfo* info,
                                               const VkAllocationCallbacks* allocator, VkDeviceMemory* memory) {
  if (++allocations == faults.allocation) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  if (faults.max_allocation != 0 && info->allocationSize > faults.max_allocation) {
    std::fprintf(stderr, "faulty device: %llu bytes in one allocation\n",
                 static_cast<unsigned long long>(info->allocationSize));
    std::abort();
  }
  return next<PFN_vkAllocateMemory>(device, "vkAllocateMemory")(device, info, allocator, memory);
}

VKAPI_ATTR VkResult VKAPI_CALL queue_submit(VkQueue queue, std::uint32_t count, const VkSubmitInfo* submits,
                                            VkFence fence) {
  if (++submissions == faults.submit) return VK_ERROR_OUT_OF_HOST_MEMORY;
  return next<PFN_vkQueueSubmit>(queue, "vkQueueSubmit")(queue, count, submits, fence);
}

VKAPI_ATTR void VKAPI_CALL dispatch(VkCommandBuffer commands, std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  if (faults.groups != 0 && x > faults.groups) {
    std::fprintf(stderr, "faulty device: %u workgroups along x\n", x);
    std::abort();
  }
  next<PFN_vkCmdDispatch>(commands, "vkCmdDispatch")(commands, x, y, z);
}

PFN_vkVoidFunction ours(const char* name) {
  const std::unordered_map<std::string, PFN_vkVoidFunction> functions{
      {"vkCreateInstance", reinterpret_cast<PFN_vkVoidFunction>(create_instance)},
      {"vkCreateDevice", reinterpret_cast<PFN_vkVoidFunction>(create_device)},
      {"vkGetPhysicalDeviceProperties", reinterpret_cast<PFN_vkVoidFunction>(properties)},
      {"vkGetPhysicalDeviceProperties2", reinterpret_cast<PFN_vkVoidFunction>(properties2)},
      {"vkGetPhysicalDeviceFeatures2", reinterpret_cast<PFN_vkVoidFunction>(features2)},
      {"vkGetPhysicalDeviceMemoryProperties", reinterpret_cast<PFN_vkVoidFunction>(memory_properties)},
      {"vkAllocateMemory", reinterpret_cast<PFN_vkVoidFunction>(allocate_memory)},
      {"vkQueueSubmit", reinterpret_cast<PFN_vkVoidFunction>(queue_submit)},
      {"vkCmdDispatch", reinterpret_cast<PFN_vkVoidFunction>(dispatch)}};
  const auto found = functions.find(name);
  return found == functions.end() ? nullptr : found->second;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL get_device(VkDevice device, const char* name) {
  if (const auto own = ours(name)) return own;
  const std::lock_guard lock(mutex);
  return below.at(key(device)).device(device, name);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL get_instance(VkInstance instance, const char* name) {
  if (std::strcmp(name, "vkGetDeviceProcAddr") == 0) return reinterpret_cast<PFN_vkVoidFunction>(get_device);
  if (const auto own = ours(name)) return own;
  if (instance == nullptr) return nullptr;
  const std::lock_guard lock(mutex);
  return below.at(key(instance)).instance(instance, name);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface* negotiate) {
  negotiate->loaderLayerInterfaceVersion = 2;
  negotiate->pfnGetInstanceProcAddr = get_instance;
  negotiate->pfnGetDeviceProcAddr = get_device;
  negotiate->pfnGetPhysicalDeviceProcAddr = nullptr;
  return VK_SUCCESS;
}
