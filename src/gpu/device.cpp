// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "gpu/device.hpp"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "base/atomic_file.hpp"
#include "gpu/vulkan.hpp"

namespace cairn::gpu {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

enum class Validation { off, basic, synchronization, on_device };

Validation validation_wanted() {
  const char* value = std::getenv("CAIRN_VALIDATION");
  const std::string_view wanted = value != nullptr ? value : "";
  if (wanted.empty() || wanted == "0") return Validation::off;
  if (wanted == "1") return Validation::basic;
  if (wanted == "sync") return Validation::synchronization;
  if (wanted == "gpu") return Validation::on_device;
  throw std::runtime_error("CAIRN_VALIDATION is '" + std::string(wanted) + "': choose 0, 1, sync or gpu");
}

VKAPI_ATTR VkBool32 VKAPI_CALL keep_message(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                            const VkDebugUtilsMessengerCallbackDataEXT* data, void* messages) {
  static_cast<std::vector<std::string>*>(messages)->emplace_back(data->pMessage);
  return VK_FALSE;
}

/// Cast to the callback type of this version of Vulkan-Hpp: the type of Vulkan's C header, or since 1.4 its own.
const auto kKeepMessage =
    reinterpret_cast<decltype(vk::DebugUtilsMessengerCreateInfoEXT::pfnUserCallback)>(keep_message);

std::optional<vk::raii::Instance> make_instance(const vk::raii::Context& context, Validation validation) {
  const vk::ApplicationInfo application{.pApplicationName = "cairn", .apiVersion = VK_API_VERSION_1_2};
  std::vector<const char*> layers, extensions;
  if (validation != Validation::off) {
    const auto available = context.enumerateInstanceLayerProperties();
    if (std::none_of(available.begin(), available.end(),
                     [](const auto& l) { return std::string_view(l.layerName) == kValidationLayer; }))
      throw std::runtime_error(
          "CAIRN_VALIDATION=1, but the Vulkan validation layer is missing: install vulkan-validationlayers");
    layers.push_back(kValidationLayer);
    extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
  }
  std::vector<vk::ValidationFeatureEnableEXT> features;
  if (validation == Validation::synchronization)
    features = {vk::ValidationFeatureEnableEXT::eSynchronizationValidation};
  if (validation == Validation::on_device)
    features = {vk::ValidationFeatureEnableEXT::eGpuAssisted,
                vk::ValidationFeatureEnableEXT::eGpuAssistedReserveBindingSlot};
  if (!features.empty()) extensions.push_back(VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME);
  const vk::ValidationFeaturesEXT enable{.enabledValidationFeatureCount = static_cast<std::uint32_t>(features.size()),
                                         .pEnabledValidationFeatures = features.data()};
  const vk::InstanceCreateInfo create{.pNext = features.empty() ? nullptr : &enable,
                                      .pApplicationInfo = &application,
                                      .enabledLayerCount = static_cast<std::uint32_t>(layers.size()),
                                      .ppEnabledLayerNames = layers.data(),
                                      .enabledExtensionCount = static_cast<std::uint32_t>(extensions.size()),
                                      .ppEnabledExtensionNames = extensions.data()};
  try {
    return vk::raii::Instance(context, create);
  } catch (const vk::IncompatibleDriverError&) {
    return std::nullopt;  // the loader is installed, but no driver
  }
}

const char* type_name(vk::PhysicalDeviceType type) {
  switch (type) {
    case vk::PhysicalDeviceType::eDiscreteGpu:
      return "discrete";
    case vk::PhysicalDeviceType::eIntegratedGpu:
      return "integrated";
    case vk::PhysicalDeviceType::eVirtualGpu:
      return "virtual";
    case vk::PhysicalDeviceType::eCpu:
      return "cpu";
    default:
      return "other";
  }
}

int preference(vk::PhysicalDeviceType type) {
  switch (type) {
    case vk::PhysicalDeviceType::eDiscreteGpu:
      return 0;
    case vk::PhysicalDeviceType::eIntegratedGpu:
      return 1;
    case vk::PhysicalDeviceType::eVirtualGpu:
      return 2;
    case vk::PhysicalDeviceType::eCpu:
      return 3;
    default:
      return 4;
  }
}

std::optional<std::uint32_t> compute_family(const vk::raii::PhysicalDevice& physical) {
  const auto families = physical.getQueueFamilyProperties();
  for (std::uint32_t i = 0; i < families.size(); ++i)
    if ((families[i].queueFlags & vk::QueueFlagBits::eCompute) && families[i].timestampValidBits > 0) return i;
  return std::nullopt;
}

/// True if pipelines can require the device's reported subgroup size.
bool has_subgroup_size_control(const vk::raii::PhysicalDevice& physical) {
  const auto extensions = physical.enumerateDeviceExtensionProperties();
  if (std::none_of(extensions.begin(), extensions.end(), [](const auto& e) {
        return std::string_view(e.extensionName) == VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME;
      }))
    return false;
  const auto properties = physical.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceSubgroupProperties,
                                                  vk::PhysicalDeviceSubgroupSizeControlProperties>();
  const auto& sizes = properties.get<vk::PhysicalDeviceSubgroupSizeControlProperties>();
  const std::uint32_t subgroup_size = properties.get<vk::PhysicalDeviceSubgroupProperties>().subgroupSize;
  return physical.getFeatures2<vk::PhysicalDeviceFeatures2, vk::PhysicalDeviceSubgroupSizeControlFeatures>()
             .get<vk::PhysicalDeviceSubgroupSizeControlFeatures>()
             .subgroupSizeControl &&
         (sizes.requiredSubgroupSizeStages & vk::ShaderStageFlagBits::eCompute) &&
         subgroup_size >= sizes.minSubgroupSize && subgroup_size <= sizes.maxSubgroupSize;
}

/// First missing feature, if any.
std::optional<std::string> missing_feature(const vk::raii::PhysicalDevice& physical) {
  if (physical.getProperties().apiVersion < VK_API_VERSION_1_2) return "Vulkan 1.2";
  const auto extensions = physical.enumerateDeviceExtensionProperties();
  if (std::none_of(extensions.begin(), extensions.end(), [](const auto& e) {
        return std::string_view(e.extensionName) == VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME;
      }))
    return VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME;
  const auto chain = physical.getFeatures2<vk::PhysicalDeviceFeatures2, vk::PhysicalDeviceVulkan12Features>();
  const auto& v12 = chain.get<vk::PhysicalDeviceVulkan12Features>();
  if (!chain.get<vk::PhysicalDeviceFeatures2>().features.shaderInt64) return "shaderInt64";
  if (!v12.shaderBufferInt64Atomics) return "shaderBufferInt64Atomics";
  if (!v12.scalarBlockLayout) return "scalarBlockLayout";
  if (!v12.bufferDeviceAddress) return "bufferDeviceAddress";
  const auto subgroup = physical.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceSubgroupProperties>()
                            .get<vk::PhysicalDeviceSubgroupProperties>();
  if (!(subgroup.supportedOperations & vk::SubgroupFeatureFlagBits::eArithmetic) ||
      !(subgroup.supportedStages & vk::ShaderStageFlagBits::eCompute))
    return "subgroup arithmetic in compute shaders";
  if (!compute_family(physical)) return "a compute queue with timestamps";
  return {};
}

/// Index of the first usable device of the best type; 0 if none is usable, so that the error names its missing feature.
int best_of(const vk::raii::PhysicalDevices& physicals) {
  int index = 0, best = 5;
  for (std::size_t i = 0; i < physicals.size(); ++i) {
    const int rank = preference(physicals[i].getProperties().deviceType);
    if (rank < best && !missing_feature(physicals[i])) {
      best = rank;
      index = static_cast<int>(i);
    }
  }
  return index;
}

DeviceInfo describe(int index, const vk::raii::PhysicalDevice& physical) {
  const auto properties = physical.getProperties();
  DeviceInfo info{.index = index,
                  .name = std::string(properties.deviceName.data()),
                  .type = type_name(properties.deviceType),
                  .driver = {},
                  .missing = missing_feature(physical)};
  if (info.missing != "Vulkan 1.2") {
    const auto driver = physical.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceDriverProperties>()
                            .get<vk::PhysicalDeviceDriverProperties>();
    info.driver = std::string(driver.driverName.data()) + " " + driver.driverInfo.data();
  }
  info.subgroup_size = physical.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceSubgroupProperties>()
                           .get<vk::PhysicalDeviceSubgroupProperties>()
                           .subgroupSize;
  for (const auto& heap : physical.getMemoryProperties().memoryHeaps)
    if (heap.flags & vk::MemoryHeapFlagBits::eDeviceLocal)
      info.memory = std::max<std::uint64_t>(info.memory, heap.size);
  return info;
}

[[noreturn]] void no_device() {
  throw std::runtime_error(
      "no Vulkan device found: install a driver, for example mesa-vulkan-drivers, which also runs on the CPU");
}

std::filesystem::path pipeline_cache_file(const vk::raii::PhysicalDevice& physical) {
  const char* cache = std::getenv("XDG_CACHE_HOME");
  const char* home = std::getenv("HOME");
  if (cache == nullptr && home == nullptr) return {};
  const auto folder =
      (cache != nullptr ? std::filesystem::path(cache) : std::filesystem::path(home) / ".cache") / "cairn";
  std::string id;
  for (const auto byte : physical.getProperties().pipelineCacheUUID) {
    constexpr char kHex[] = "0123456789abcdef";
    id += kHex[byte >> 4];
    id += kHex[byte & 15];
  }
  return folder / ("pipelines-" + id);
}

std::vector<char> read_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

vk::raii::Context open_loader() {
  try {
    return {};
  } catch (const std::runtime_error&) {
    no_device();
  }
}

std::vector<DeviceInfo> find_devices() {
  const vk::raii::Context context = open_loader();
  const auto instance = make_instance(context, Validation::off);
  std::vector<DeviceInfo> devices;
  if (!instance) return devices;
  for (const auto& physical : vk::raii::PhysicalDevices(*instance))
    devices.push_back(describe(static_cast<int>(devices.size()), physical));
  return devices;
}

void Device::State::open() {
  queue_family = *compute_family(*physical);
  memory_types = physical->getMemoryProperties();
  const auto limits = physical->getProperties().limits;
  timestamp_period_ns = limits.timestampPeriod;
  max_binding = limits.maxStorageBufferRange;
  max_texels = limits.maxTexelBufferElements;
  std::copy(limits.maxComputeWorkGroupCount.begin(), limits.maxComputeWorkGroupCount.end(), max_groups.begin());
  max_allocation = physical->getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceMaintenance3Properties>()
                       .get<vk::PhysicalDeviceMaintenance3Properties>()
                       .maxMemoryAllocationSize;
  subgroup_size_control = has_subgroup_size_control(*physical);

  const float priority = 1.0f;
  const vk::DeviceQueueCreateInfo queue_of_family{
      .queueFamilyIndex = queue_family, .queueCount = 1, .pQueuePriorities = &priority};
  std::vector<const char*> extensions{VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME};
  if (subgroup_size_control) extensions.push_back(VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME);
  vk::PhysicalDeviceSubgroupSizeControlFeatures subgroup_size{.subgroupSizeControl = true};
  const vk::PhysicalDeviceFeatures features{.shaderInt64 = true};
  const vk::PhysicalDeviceVulkan12Features v12{.pNext = subgroup_size_control ? &subgroup_size : nullptr,
                                               .shaderBufferInt64Atomics = true,
                                               .scalarBlockLayout = true,
                                               .timelineSemaphore = true,
                                               .bufferDeviceAddress = true};
  device.emplace(*physical, vk::DeviceCreateInfo{.pNext = &v12,
                                                 .queueCreateInfoCount = 1,
                                                 .pQueueCreateInfos = &queue_of_family,
                                                 .enabledExtensionCount = static_cast<std::uint32_t>(extensions.size()),
                                                 .ppEnabledExtensionNames = extensions.data(),
                                                 .pEnabledFeatures = &features});
  queue.emplace(*device, queue_family, 0);
  const vk::SemaphoreTypeCreateInfo numbered{.semaphoreType = vk::SemaphoreType::eTimeline};
  timeline.emplace(*device, vk::SemaphoreCreateInfo{.pNext = &numbered});
}

Device::Device(int index) : state_(std::make_unique<State>()) {
  State& s = *state_;
  const Validation validation = validation_wanted();
  s.instance = make_instance(s.context, validation);
  if (!s.instance) no_device();
  if (validation != Validation::off)
    s.messenger.emplace(*s.instance, vk::DebugUtilsMessengerCreateInfoEXT{
                                         .messageSeverity = vk::DebugUtilsMessageSeverityFlagBitsEXT::eWarning |
                                                            vk::DebugUtilsMessageSeverityFlagBitsEXT::eError,
                                         .messageType = vk::DebugUtilsMessageTypeFlagBitsEXT::eGeneral |
                                                        vk::DebugUtilsMessageTypeFlagBitsEXT::eValidation |
                                                        vk::DebugUtilsMessageTypeFlagBitsEXT::ePerformance,
                                         .pfnUserCallback = kKeepMessage,
                                         .pUserData = &s.messages});

  vk::raii::PhysicalDevices physicals(*s.instance);
  if (physicals.empty()) no_device();
  if (index < -1 || index >= static_cast<int>(physicals.size()))
    throw std::runtime_error("there is no Vulkan device " + std::to_string(index) + ": see `cairn devices`");
  if (index < 0) index = best_of(physicals);
  s.physical = std::move(physicals[static_cast<std::size_t>(index)]);
  s.info = describe(index, *s.physical);
  if (s.info.missing)
    throw std::runtime_error("Vulkan device " + std::to_string(index) + " (" + s.info.name + ") lacks " +
                             *s.info.missing + ": choose another device, see list_devices (`cairn devices`)");
  s.open();

  s.pipelines_file = pipeline_cache_file(*s.physical);
  const auto cached = read_file(s.pipelines_file);  // the driver checks the header and ignores foreign data
  s.pipelines.emplace(*s.device,
                      vk::PipelineCacheCreateInfo{.initialDataSize = cached.size(), .pInitialData = cached.data()});
}

Device::~Device() {
  state_->wait_idle();
  state_->completed = state_->submitted;
  if (!state_->pipelines || state_->pipelines_file.empty()) return;
  // Errors are ignored: a missing cache only slows down the next start.
  try {
    const auto data = state_->pipelines->getData();
    if (data == std::vector<std::uint8_t>{}) return;
    std::filesystem::create_directories(state_->pipelines_file.parent_path());
    write_whole(state_->pipelines_file, data, Durable::some_time);
  } catch (const std::exception&) {
  }
}

void Device::wait() { state_->wait_for(state_->submitted); }

const DeviceInfo& Device::info() const { return state_->info; }
const std::vector<std::string>& Device::validation_messages() const { return state_->messages; }
const std::map<std::string, KernelTime>& Device::kernel_times() const { return state_->times; }
const Traffic& Device::traffic() const { return state_->traffic; }
std::uint64_t Device::max_allocation() const { return state_->max_allocation; }
std::uint64_t Device::max_texels() const { return state_->max_texels; }
std::uint64_t Device::max_binding() const { return state_->max_binding; }
std::uint32_t Device::max_groups() const { return state_->max_groups[0]; }
std::uint64_t Device::memory_in_use() const { return state_->in_use; }
std::uint64_t Device::peak_memory() const { return state_->peak; }

}  // namespace cairn::gpu

std::vector<cairn::DeviceInfo> cairn::list_devices() { return gpu::find_devices(); }
